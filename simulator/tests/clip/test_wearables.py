from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from flat_ground import FlatGround
from tolerances import GEOMETRY_REL

from standoff.clips import DEVICES_SCHEMA
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff_sim.behaviour import idle, walking_past
from standoff_sim.camera.flight import Still
from standoff_sim.camera.telemetry import Origin
from standoff_sim.clip.truth import Row
from standoff_sim.clip.wearables import (
    DRIFT_M,
    JITTER_S,
    NEAR_FACTOR,
    NOISE_M,
    OUTAGE_EVERY_NEAR_S,
    OUTAGE_EVERY_S,
    SHORTEST_OUTAGE_S,
    report_positions,
)
from standoff_sim.movement.motion import Place, sample
from standoff_sim.people.worker import make_worker
from standoff_sim.scene.light import random_light
from standoff_sim.scene.scene import Actor, Batch, Scene, place
from standoff_sim.solids.mesh import box, translation

_LASTING_S = 500.0
_ORIGIN = Origin.draw(np.random.default_rng(9))
_CABIN = place(box((6.0, 2.4, 2.8), None), translation(3.0, 3.0, 0.0))
_SHED = place(box((6.0, 2.4, 2.0), None), translation(3.0, 3.0, 0.0))


def _scene(*props: Batch, people: int = 8) -> Scene:
    rng = np.random.default_rng(0)
    worker = make_worker(rng)
    actors = [Actor(k + 1, worker, idle(rng, worker, Place(0.0, 0.0), 1.0)) for k in range(people - 1)]
    actors.append(Actor(people, worker, walking_past(rng, worker, [(0.0, 0.0), (9.0, 0.0)], 10.0)))
    camera = Camera(640, 360, np.array([[500.0, 0, 319.5], [0, 500.0, 179.5], [0, 0, 1.0]]), np.zeros(5))
    flight = Still.over(camera, np.zeros(2), altitude_m=20.0, pitch_deg=50.0, heading_deg=0.0)
    return Scene("test", 1, FlatGround(), props, tuple(actors), (), None, random_light(rng, "noon"), flight)


def _reports(scene: Scene, seed: int, lasting_s: float = _LASTING_S) -> list[Row]:
    return report_positions(scene, lasting_s, _ORIGIN, np.random.default_rng(seed))


def _errors(scene: Scene, rows: list[Row]) -> dict[int, FloatArray]:
    """Return (N, 2) errors of each entity's reports, in the order of time."""
    motions = {actor.entity_id: actor.motion for actor in scene.actors}
    errors: dict[int, list[FloatArray]] = {entity_id: [] for entity_id in motions}
    for row in rows:
        true_m = sample(motions[row["entity_id"]], row["time_s"]).xy_m
        errors[row["entity_id"]].append(np.array([row["x_m"], row["y_m"]]) - true_m)
    return {entity_id: np.array(own) for entity_id, own in errors.items()}


@pytest.fixture(scope="module")
def open_air() -> list[tuple[Scene, list[Row]]]:
    scene = _scene()
    return [(scene, _reports(scene, seed)) for seed in range(3)]


def test_everybody_reports_in_the_order_of_time(open_air: list[tuple[Scene, list[Row]]]) -> None:
    scene, rows = open_air[0]
    assert {row["entity_id"] for row in rows} == {actor.entity_id for actor in scene.actors}
    assert len({(row["device_id"], row["entity_id"]) for row in rows}) == len(scene.actors)
    times_s = [row["time_s"] for row in rows]
    assert times_s == sorted(times_s) and times_s[0] >= 0.0 and times_s[-1] < _LASTING_S
    assert pa.Table.from_pylist(rows, schema=DEVICES_SCHEMA).column_names == list(rows[0])


def test_degrees_are_those_of_the_metres(open_air: list[tuple[Scene, list[Row]]]) -> None:
    for row in open_air[0][1][::500]:
        degrees = _ORIGIN.degrees(np.array([row["x_m"], row["y_m"]]))
        assert (row["latitude_deg"], row["longitude_deg"]) == pytest.approx(degrees, rel=GEOMETRY_REL)


@pytest.mark.live
def test_each_device_drifts_slowly_by_half_a_metre_to_three(open_air: list[tuple[Scene, list[Row]]]) -> None:
    rms_m = []
    for scene, rows in open_air:
        for error_m in _errors(scene, rows).values():
            rms_m.append(float(np.sqrt((error_m**2).mean())))
            # what is not slow is the noise: the drift moves 2 m by less than 0.25 m in a second
            quick_m = np.abs(np.diff(error_m, axis=0)).mean()
            assert quick_m < 2.0 * NOISE_M[1] + 0.1 * DRIFT_M[1]
    low_m, high_m = np.hypot(DRIFT_M[0], NOISE_M[0]), np.hypot(DRIFT_M[1], NOISE_M[1])
    assert 0.6 * low_m < min(rms_m) and max(rms_m) < 1.5 * high_m  # 500 s are a few periods of the slowest drift
    assert np.mean(np.log(rms_m)) == pytest.approx(np.mean(np.log(DRIFT_M)), abs=4 * 0.52 / len(rms_m) ** 0.5 + 0.05)


def test_reports_come_a_second_apart_but_for_outages(open_air: list[tuple[Scene, list[Row]]]) -> None:
    gaps_s, outages, watched_s = [], 0, 0.0
    for scene, rows in open_air:
        for actor in scene.actors:
            times_s = [row["time_s"] for row in rows if row["entity_id"] == actor.entity_id]
            gaps_s += np.diff(times_s).tolist()
            watched_s += _LASTING_S
    outages = sum(gap_s > SHORTEST_OUTAGE_S - 2 * JITTER_S for gap_s in gaps_s)
    steady_s = np.array([gap_s for gap_s in gaps_s if gap_s < SHORTEST_OUTAGE_S - 2 * JITTER_S])
    assert np.abs(steady_s - 1.0).max() <= 2 * JITTER_S
    assert steady_s.std() > 0.05
    expected = watched_s / OUTAGE_EVERY_S
    assert outages == pytest.approx(expected, abs=5 * expected**0.5)


@pytest.mark.live
def test_near_a_structure_reports_are_worse_and_fewer_and_a_low_shed_is_none() -> None:
    tall, low = _scene(_CABIN), _scene(_SHED)
    by_cabin, by_shed = _reports(tall, 1), _reports(low, 1)
    assert len(by_cabin) < len(by_shed)
    lost = 1.0 - len(by_cabin) / len(by_shed)
    assert lost > 0.3 * 6.0 / OUTAGE_EVERY_NEAR_S
    worse, better = (
        np.mean([np.sqrt((own[:200] ** 2).mean()) for own in list(_errors(scene, rows).values())[:-1]])
        for scene, rows in ((tall, by_cabin), (low, by_shed))
    )
    assert worse > 0.6 * NEAR_FACTOR * better


def test_two_thirds_of_the_errors_are_within_the_stated_accuracy(open_air: list[tuple[Scene, list[Row]]]) -> None:
    within = []
    for scene, rows in open_air:
        errors = {entity_id: iter(own) for entity_id, own in _errors(scene, rows).items()}
        within += [np.linalg.norm(next(errors[row["entity_id"]])) < row["accuracy_m"] for row in rows]
    assert np.mean(within) == pytest.approx(
        0.68, abs=0.08
    )  # slow drifts: 36 devices, some ten independent moments each


def test_the_same_seed_reports_the_same() -> None:
    scene = _scene()
    first, again, other = (_reports(scene, seed, 40.0) for seed in (1, 1, 2))
    assert again == first and other != first
