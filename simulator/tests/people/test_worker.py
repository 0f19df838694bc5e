from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from laws import examples, seeds
from tolerances import FOOT_ON_GROUND_M

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.people.carried import LOADS
from standoff_sim.people.outfit import choose_outfit
from standoff_sim.people.worker import JOINTS, Worker, make_worker
from standoff_sim.scene.scene import CARRIED, NOTHING, Batch

UPRIGHT: Mapping[str, float] = {}


def worker(seed: int) -> Worker:
    return make_worker(np.random.default_rng(seed))


def carried_by(person: Worker, joints: Mapping[str, float]) -> list[Batch]:
    return [batch for batch in person.parts(joints) if batch.entity_id == CARRIED]


def vertices(batch: Batch) -> FloatArray:
    points = np.einsum("nij,vj->nvi", batch.poses[:, :3, :3], batch.mesh.vertices_m) + batch.poses[:, None, :3, 3]
    cloud: FloatArray = points.reshape(-1, 3).astype(np.float64)
    return cloud


def cloud(batches: tuple[Batch, ...]) -> FloatArray:
    return np.concatenate([vertices(batch) for batch in batches])


def triangles(batches: tuple[Batch, ...]) -> int:
    return sum(len(batch.mesh.triangles) * len(batch.poses) for batch in batches)


def joint_values() -> st.SearchStrategy[dict[str, float]]:
    """Draw joints from all of their ranges, the ends as often as the middle: what goes wrong goes wrong there."""
    bounds = {name: (-50.0, 50.0) if name == "stride_m" else JOINTS[name] for name in JOINTS}
    return st.fixed_dictionaries(
        {name: st.one_of(st.sampled_from([low, high]), st.floats(low, high)) for name, (low, high) in bounds.items()}
    )


@examples(150)
@given(seed=st.integers(0, 40), joints=joint_values())
@example(seed=16, joints={"bend_deg": 95.0, "crouch": 1.0, "arms": 0.1, "turn_deg": -60.0})
def test_the_lowest_foot_is_on_the_ground_whatever_the_joints(seed: int, joints: dict[str, float]) -> None:
    person = worker(seed)
    lowest_m = cloud(person.person(joints))[:, 2].min()
    assert abs(lowest_m) < FOOT_ON_GROUND_M


@examples(40)
@given(seed=st.integers(0, 60), joints=joint_values())
def test_nothing_that_is_carried_is_below_the_ground(seed: int, joints: dict[str, float]) -> None:
    assert all(vertices(batch)[:, 2].min() > -0.06 for batch in carried_by(worker(seed), {**joints, "arms": 1.0}))


@examples(40)
@given(seed=st.integers(0, 40), joints=joint_values())
def test_no_joint_value_tears_a_body_apart(seed: int, joints: dict[str, float]) -> None:
    person = worker(seed)
    points_m = cloud(person.person(joints))
    assert np.isfinite(points_m).all()
    assert np.abs(points_m[:, :2]).max() < 0.75 * person.body.stature_m
    assert points_m[:, 2].max() < 1.05 * person.height_m


@pytest.mark.parametrize("seed", seeds(12))
def test_height_is_the_top_of_the_hat_and_close_to_the_stature(seed: int) -> None:
    person = worker(seed)
    assert cloud(person.parts(UPRIGHT))[:, 2].max() == pytest.approx(person.height_m, abs=1e-6)
    assert 1.55 <= person.body.stature_m <= 1.95
    assert -0.02 < person.height_m - person.body.stature_m < 0.09


@pytest.mark.parametrize("seed", seeds(12))
def test_bending_and_crouching_make_small(seed: int) -> None:
    person = worker(seed)
    bent_m = cloud(person.person({"bend_deg": 90.0}))[:, 2].max()
    crouched_m = cloud(person.person({"crouch": 1.0}))[:, 2].max()
    assert 0.45 * person.height_m < bent_m < 0.75 * person.height_m
    assert 0.45 * person.height_m < crouched_m < 0.75 * person.height_m


@pytest.mark.parametrize("seed", seeds(12))
def test_a_standing_person_is_as_wide_and_deep_as_people_are(seed: int) -> None:
    person = worker(seed)
    points_m = cloud(person.person(UPRIGHT))
    shoulders_m = points_m[np.abs(points_m[:, 2] - 0.78 * person.body.stature_m) < 0.05]
    width_m = np.ptp(shoulders_m[:, 1])
    assert 0.24 * person.body.stature_m < width_m < 0.36 * person.body.stature_m
    shins_m = points_m[np.abs(points_m[:, 2] - 0.2 * person.body.stature_m) < 0.03]
    assert np.ptp(shins_m[:, 1]) < 0.34 * person.body.stature_m


def test_bending_goes_forward_and_turning_to_the_left() -> None:
    person = worker(5)
    head = int(np.argmax([vertices(batch)[:, 2].mean() for batch in person.person(UPRIGHT)]))
    bent_m = vertices(person.person({"bend_deg": 80.0})[head]).mean(axis=0)
    turned_m = vertices(person.person({"bend_deg": 80.0, "turn_deg": 50.0})[head]).mean(axis=0)
    assert bent_m[0] > 0.3
    assert turned_m[1] > bent_m[1] + 0.10


def test_things_are_carried_only_with_raised_arms() -> None:
    bearers = [person for person in map(worker, range(40)) if person.load.mesh is not None]
    assert len(bearers) > 20
    for person in bearers:
        assert not carried_by(person, {"arms": 0.5})
        assert len(carried_by(person, {"arms": 0.51})) == 1
        assert len(person.parts({"arms": 1.0})) == len(person.parts(UPRIGHT)) + 1


def test_hands_hold_what_is_carried() -> None:
    for seed in range(60):
        person = worker(seed)
        if person.load.mesh is None or person.load.name == "sack":
            continue
        parts = person.parts({"arms": 1.0})
        thing_m = vertices(parts[-1])
        hands_m = next(vertices(b) for b in parts if len(b.poses) == 2 and _is_hand(b))
        low, high = thing_m.min(axis=0) - 0.16, thing_m.max(axis=0) + 0.16
        assert ((hands_m > low) & (hands_m < high)).all(axis=1).any(), person.load.name


def _is_hand(batch: Batch) -> bool:
    length_m = np.ptp(batch.mesh.vertices_m[:, 2])
    return bool(0.16 < length_m < 0.2)


def test_an_act_moves_the_hands_and_comes_back() -> None:
    people = [person for person in map(worker, range(30)) if person.load.name in ("bare hands", "shovel", "rake")]
    assert len(people) > 5
    for person in people:
        still, moved, again = (cloud(person.person({"arms": 1.0, "act": act})) for act in (0.0, 0.25, 1.0))
        assert np.abs(moved - still).max() > 0.05
        np.testing.assert_allclose(again, still, atol=1e-5)


def test_the_same_generator_state_gives_the_same_worker() -> None:
    joints = {"stride_m": 3.2, "speed_mps": 1.1, "arms": 0.8, "bend_deg": 20.0}
    for seed in range(5):
        pairs = zip(worker(seed).parts(joints), worker(seed).parts(joints), strict=True)
        for one, other in pairs:
            assert one.mesh is other.mesh
            np.testing.assert_array_equal(one.poses, other.poses)
            np.testing.assert_array_equal(one.tint, other.tint)
            np.testing.assert_array_equal(one.dust, other.dust)


def test_a_given_outfit_changes_the_clothes_alone() -> None:
    clothes = choose_outfit(np.random.default_rng(99))
    usual, dressed = worker(4), make_worker(np.random.default_rng(4), outfit=clothes)
    assert dressed.outfit is clothes
    assert (dressed.body, dressed.habits, dressed.load) == (usual.body, usual.habits, usual.load)


def test_a_crowd_shares_few_meshes() -> None:
    meshes = {id(batch.mesh) for seed in range(200) for batch in worker(seed).parts({"arms": 1.0})}
    assert len(meshes) < 110


def test_triangles_stay_within_budget() -> None:
    counts = [triangles(worker(seed).parts({"arms": 1.0})) for seed in range(100)]
    assert min(counts) > 1500
    assert np.median(counts) < 3000
    assert max(counts) < 3700


def test_every_worker_is_a_model_of_the_class_worker() -> None:
    person = worker(0)
    assert person.class_id == CLASS_BY_NAME["worker"].id
    assert person.tool_tip_m(UPRIGHT) is None
    assert set(person.joints) == {"stride_m", "speed_mps", "bend_deg", "crouch", "arms", "turn_deg", "act"}
    x, y = person.footprint_m.T
    assert person.footprint_m.shape == (8, 2)
    assert (np.ptp(x), np.ptp(y)) == pytest.approx((0.5, 0.45))
    assert float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) > 0
    assert all(batch.entity_id in (NOTHING, CARRIED) for batch in person.parts({"arms": 1.0}))


def test_shares_of_loads_add_up() -> None:
    assert sum(load.share for load in LOADS) == pytest.approx(1.0)
    assert len({load.name for load in LOADS}) == len(LOADS)


def test_people_differ() -> None:
    people = [worker(seed) for seed in range(30)]
    assert all(
        one.outfit != other.outfit and one.body != other.body for one, other in itertools.combinations(people, 2)
    )
    assert np.std([person.body.stature_m for person in people]) > 0.04
    assert {person.habits.kneeling for person in people} == {True, False}
