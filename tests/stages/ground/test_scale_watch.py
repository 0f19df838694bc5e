from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_ground import GrayPicture
from hypothesis import given, settings
from hypothesis import strategies as st
from walking_crowd import body_points, box_of, random_crowd

from standoff.core import homography, protocols
from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import view_from_homography
from standoff.core.protocols import AnyGround, AnyMotion
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, NoCameraMotion, NoGroundMap
from standoff.stages.ground import ScaleWatch, load_survey

_CROWD = random_crowd(11, clean=True, people=10)
_BOXES = _CROWD.pictures[0][1]
_PICTURE = GrayPicture(np.zeros((720, 1280), dtype=np.uint8))
_CAMERA = _CROWD.view.camera


class Mapped(protocols.Ground):
    """A ground stage whose metres are wrong by a factor."""

    def __init__(self, factor: float) -> None:
        image_to_ground = np.diag([factor, factor, 1.0]) @ homography.invert(_CROWD.view.plane_to_pinhole())
        self.map = GroundMap(image_to_ground, np.zeros((9, 9)), (1280, 720), "test", 1.0, camera=_CAMERA)

    def describe(self) -> dict[str, object]:
        return {"method": "test", "warnings": ["its own"]}

    def update(self, frame: Frame, detections: Detections, motion: AnyMotion) -> AnyGround:
        return self.map


def workers(boxes: FloatArray, score: float = 0.9) -> Detections:
    return Detections(boxes, np.full(len(boxes), score), np.zeros(len(boxes), dtype=np.int64))


def watched(factor: float, seen: Detections, frames: int = 4, step_s: float = 0.5) -> tuple[ScaleWatch, AnyGround]:
    watch, result = ScaleWatch(Mapped(factor)), NoGroundMap("not asked")
    last: AnyGround = result
    for k in range(frames):
        last = watch.update(Frame("drawn", k, step_s * k, _PICTURE), seen, NoCameraMotion("none"))
    return watch, last


def test_metres_that_are_metres_pass_untouched() -> None:
    watch, result = watched(1.0, workers(_BOXES))
    assert result is watch.inner.update(Frame("drawn", 0, 0.0, _PICTURE), workers(_BOXES), NoCameraMotion(""))
    assert watch.describe()["warnings"] == ["its own"]
    assert watch.describe()["scale_watch"]["sizes_seen"]["people"] > 8


@settings(max_examples=6, deadline=None)
@given(st.sampled_from([3.281, 0.3048, 1.9, 0.55]), st.floats(0.97, 1.03))
def test_a_factor_of_some_units_is_a_warning_by_name(factor: float, off: float) -> None:
    watch, result = watched(factor * off, workers(_BOXES))
    assert isinstance(result, GroundMap)
    _, told = watch.describe()["warnings"]
    assert told.startswith("seen through the ground map, people look")
    unit = {3.281: "feet for metres", 0.3048: "metres for feet"}.get(factor, "check the lengths")
    assert unit in told
    assert ("large" in told) == (factor > 1)


@pytest.mark.parametrize(
    ("factor", "unit"), [(100.0, "centimetres"), (1000.0, "millimetres"), (39.37, "inches"), (0.01, "metres for cent")]
)
def test_a_factor_that_cannot_be_is_no_map_and_named(factor: float, unit: str) -> None:
    watch, result = watched(factor, workers(_BOXES))
    assert isinstance(result, NoGroundMap)
    assert unit in result.reason
    assert unit in watch.describe()["warnings"][1]


def test_the_reason_keeps_its_words_so_that_it_can_be_counted() -> None:
    watch = ScaleWatch(Mapped(30.0))
    reasons = set()
    for k in range(20):
        boxes = workers(_BOXES[: 5 + k % 4])
        result = watch.update(Frame("drawn", k, 0.5 * k, _PICTURE), boxes, NoCameraMotion("none"))
        reasons |= {result.reason} if isinstance(result, NoGroundMap) else set()
    assert len(reasons) == 1


@settings(max_examples=5, deadline=None)
@given(st.integers(1, 7), st.integers(1, 12))
def test_few_sizes_or_a_single_person_never_take_the_map_away(boxes: int, frames: int) -> None:
    few = workers(_BOXES[:boxes])
    _, result = watched(7.0, few, frames=1)
    assert isinstance(result, GroundMap)
    _, result = watched(100.0, workers(_BOXES[:1]), frames=frames)
    assert isinstance(result, GroundMap)


def test_what_no_clutter_could_be_takes_the_map_away_at_the_first_look() -> None:
    assert isinstance(watched(100.0, workers(_BOXES[:4]), frames=1)[1], NoGroundMap)


def _machines(factor: float) -> FloatArray:
    """Return boxes of two excavators that look so many times too large through the exact map."""
    size = np.array([200.0, 150.0]) * 20.0 / _CROWD.view.position_m[2] * factor
    middle = np.array([[500.0, 400.0], [800.0, 400.0]])
    return np.hstack([middle - size / 2.0, middle + size / 2.0])


def _both(machines: FloatArray) -> Detections:
    boxes = np.concatenate([_BOXES[:3], machines])
    return Detections(boxes, np.full(len(boxes), 0.9), np.array([0, 0, 0, *[1] * len(machines)]))


@pytest.mark.parametrize("factor", [3.281, 2.0, 0.5, 0.3048])
def test_small_machines_do_not_hide_what_people_say(factor: float) -> None:
    """A site's excavators may be two thirds as large as is usual."""
    watch, result = watched(factor, _both(_machines(0.65)))
    assert isinstance(result, GroundMap)
    assert any("seen through the ground map, people" in told for told in watch.describe()["warnings"])
    silent, _ = watched(1.0, _both(_machines(0.65)))
    assert silent.describe()["warnings"] == ["its own"]


def test_people_and_machines_together_take_the_map_away_at_the_first_look() -> None:
    assert isinstance(watched(5.0, _both(_machines(1.0)), frames=1)[1], NoGroundMap)
    assert isinstance(watched(5.0, workers(_BOXES[:3]), frames=1)[1], GroundMap)


@pytest.mark.parametrize("factor", [1.0, 3.281])
def test_mirrored_metres_are_as_long(factor: float) -> None:
    mapped = Mapped(factor)
    mapped.map = replace(mapped.map, image_to_ground=np.diag([1.0, -1.0, 1.0]) @ mapped.map.image_to_ground)
    watch = ScaleWatch(mapped)
    for k in range(4):
        watch.update(Frame("drawn", k, 0.5 * k, _PICTURE), workers(_BOXES), NoCameraMotion("none"))
    assert ("feet" in " ".join(watch.describe()["warnings"])) == (factor > 1.0)


def test_a_map_that_no_camera_has_is_said() -> None:
    mapped = Mapped(1.0)
    mapped.map = replace(mapped.map, image_to_ground=np.diag([1.0, 0.0, 1.0]))
    watch = ScaleWatch(mapped)
    watch.update(Frame("drawn", 0, 0.0, _PICTURE), workers(_BOXES), NoCameraMotion("none"))
    assert any("no camera above level ground" in told for told in watch.describe()["warnings"])


def test_it_looks_at_most_twice_a_second() -> None:
    watch, _ = watched(1.0, workers(_BOXES), frames=31, step_s=0.1)
    one, _ = watched(1.0, workers(_BOXES), frames=1)
    seen = watch.describe()["scale_watch"]["sizes_seen"]["people"]
    assert seen <= 7 * one.describe()["scale_watch"]["sizes_seen"]["people"]


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 40))
def test_a_crowd_of_false_workers_does_not_take_a_good_map_away(seed: int, false: int) -> None:
    rng = np.random.default_rng(seed)
    middle = rng.uniform([100.0, 100.0], [1180.0, 620.0], (false, 2))
    half = np.exp(rng.uniform(np.log(2.0), np.log(40.0), (false, 2)))
    clutter = np.hstack([middle - half, middle + half])
    _, result = watched(1.0, workers(np.concatenate([_BOXES, clutter])))
    assert isinstance(result, GroundMap)


def test_machines_of_the_usual_size_speak_for_a_map_that_small_clutter_speaks_against() -> None:
    small = _BOXES.copy()
    small[:, :2] = small[:, 2:] - 0.2 * (small[:, 2:] - small[:, :2])
    assert isinstance(watched(1.0, workers(small))[1], NoGroundMap)
    size = np.array([160.0, 110.0]) * 20.0 / _CROWD.view.position_m[2]
    middle = np.array([[500.0, 400.0], [800.0, 400.0]])
    machines = np.hstack([middle - size / 2.0, middle + size / 2.0])
    both = Detections(
        np.concatenate([small, machines]), np.full(len(small) + 2, 0.9), np.array([0] * len(small) + [1, 1])
    )
    assert isinstance(watched(1.0, both)[1], GroundMap)


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("good", None),
        ("cm", "centimetres for metres"),
        ("mm", "millimetres for metres"),
    ],
)
def test_a_survey_in_another_unit_is_named(shared_data: Path, name: str, told: str | None) -> None:
    watch = ScaleWatch(load_survey(shared_data / "public_reports" / "survey" / f"{name}.yaml"))
    sight = load_survey(shared_data / "public_reports" / "survey" / "good.yaml").update(
        Frame("drawn", 0, 0.0, _PICTURE), workers(_BOXES[:0]), NoCameraMotion("")
    )
    assert isinstance(sight, GroundMap)
    view = view_from_homography(sight.image_to_ground, CameraPrior.unknown(1280, 720).camera)
    places_m = view.to_plane(np.array([[x, y] for x in (350.0, 600.0, 850.0) for y in (380.0, 500.0)]))
    boxes = [box_of(view, body_points(1.75, 1.35) + np.append(xy_m, 0.0)) for xy_m in places_m]
    seen = workers(np.array([box for box in boxes if box is not None]))
    result: AnyGround = NoGroundMap("not asked")
    for k in range(4):
        result = watch.update(Frame("drawn", k, 0.5 * k, _PICTURE), seen, NoCameraMotion(""))
    if told is None:
        assert isinstance(result, GroundMap)
        assert watch.describe()["warnings"] == []
    else:
        assert isinstance(result, NoGroundMap)
        assert told in result.reason
        assert told in watch.describe()["warnings"][-1]


def test_what_a_detector_is_not_sure_of_says_nothing() -> None:
    watch, result = watched(100.0, workers(_BOXES, 0.5))
    assert isinstance(result, GroundMap)
    assert watch.describe()["scale_watch"]["sizes_seen"] == {}


def test_no_map_stays_no_map_with_its_own_reason() -> None:
    class Unmapped(protocols.Ground):
        def update(self, frame: Frame, detections: Detections, motion: AnyMotion) -> AnyGround:
            return NoGroundMap("its own")

    watch = ScaleWatch(Unmapped())
    motion = CameraMotion(np.eye(3), np.zeros((9, 9)), 0.0)
    result = watch.update(Frame("drawn", 0, 0.0, _PICTURE), workers(_BOXES), motion)
    assert isinstance(result, NoGroundMap)
    assert result.reason == "its own"
    watch.prepare((1, 1))


def test_a_mirrored_map_is_not_judged_by_sizes() -> None:
    mirrored = Mapped(1.0)
    matrix = np.diag([-1.0, 1.0, 1.0]) @ mirrored.map.image_to_ground
    mirrored.map = replace(mirrored.map, image_to_ground=matrix)
    watch = ScaleWatch(mirrored)
    assert watch.update(Frame("drawn", 0, 0.0, _PICTURE), workers(_BOXES), NoCameraMotion("")) is mirrored.map
