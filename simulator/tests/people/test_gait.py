from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import seeds
from tolerances import GEOMETRY_REL

from standoff.core.homography import FloatArray
from standoff_sim.people.anthropometry import Body
from standoff_sim.people.clothing import sole
from standoff_sim.people.gait import amplitude, arm_swing_deg, footing, step_length_m
from standoff_sim.people.skeleton import Stance, hanging_wrists, reach, stand
from standoff_sim.people.worker import Worker, make_worker
from standoff_sim.scene.scene import Batch

ALLOWED_SLIP = 0.1
"""Of the step, as the site's interface promises."""
MIRROR = np.array([1.0, -1.0, 1.0])


def stance(phase: float, speed_mps: float, bend_deg: float = 0.0, crouch: float = 0.0) -> Stance:
    return Stance(phase, 0.72, speed_mps, bend_deg, crouch, 0.0)


def joints_of(body: Body, pose: Stance) -> dict[str, FloatArray]:
    """Return where every part is hung up, (1 or 2, 3)."""
    trunk = stand(body, pose, sole(body.scale))
    frames = {**trunk.frames, **reach(body, trunk, hanging_wrists(body, pose, trunk))}
    return {name: frame.reshape(-1, 4, 4)[:, :3, 3] for name, frame in frames.items()}


def mirrored(places_m: dict[str, FloatArray]) -> dict[str, FloatArray]:
    return {name: place_m[::-1] * MIRROR for name, place_m in places_m.items()}


def boots(person: Worker, joints: dict[str, float]) -> Batch:
    return min(person.person(joints), key=lambda batch: float(batch.poses[:, 2, 3].max()))


@given(phase=st.floats(0.0, 1.0), speed_mps=st.floats(0.0, 2.0), crouch=st.floats(0.0, 1.0))
def test_half_a_cycle_later_the_body_is_its_mirror_image(phase: float, speed_mps: float, crouch: float) -> None:
    body = Body(1.78)
    now, later = (joints_of(body, stance(phase + half, speed_mps, 10.0, crouch)) for half in (0.0, 0.5))
    for name, place_m in mirrored(now).items():
        np.testing.assert_allclose(later[name], place_m, atol=1e-7, err_msg=name)


@given(phase=st.floats(-3.0, 3.0), speed_mps=st.floats(0.0, 2.0))
def test_a_cycle_later_the_body_is_the_same(phase: float, speed_mps: float) -> None:
    body = Body(1.66)
    now, later = joints_of(body, stance(phase, speed_mps)), joints_of(body, stance(phase + 1.0, speed_mps))
    for name, place_m in now.items():
        np.testing.assert_allclose(later[name], place_m, atol=1e-7, err_msg=name)


@pytest.mark.parametrize("seed", seeds(4))
@pytest.mark.parametrize("speed_mps", [0.6, 1.8])
def test_what_touches_the_ground_does_not_slide(seed: int, speed_mps: float) -> None:
    person = make_worker(np.random.default_rng(seed))
    walked_m = np.linspace(0.0, 2.0 * person.step_m, 161)
    slid_m = np.zeros(2)
    before = None
    for distance_m in walked_m:
        batch = boots(person, {"stride_m": float(distance_m), "speed_mps": speed_mps})
        points_m = np.einsum("nij,vj->nvi", batch.poses[:, :3, :3], batch.mesh.vertices_m) + batch.poses[:, None, :3, 3]
        points_m = points_m + np.array([distance_m, 0.0, 0.0])
        if before is not None:
            touching = (points_m[..., 2] < 0.004) & (before[..., 2] < 0.004)
            moved_m = np.linalg.norm((points_m - before)[..., :2], axis=-1)
            slid_m += np.where(touching, moved_m, 0.0).max(axis=1)
        before = points_m
    assert (slid_m < ALLOWED_SLIP * person.step_m).all()


@pytest.mark.parametrize("seed", seeds(4))
def test_a_cycle_takes_the_walker_two_steps_ahead(seed: int) -> None:
    person = make_worker(np.random.default_rng(seed))
    for part, again in zip(
        person.person({"stride_m": 0.4, "speed_mps": 1.2}),
        person.person({"stride_m": 0.4 + 2.0 * person.step_m, "speed_mps": 1.2}),
        strict=True,
    ):
        np.testing.assert_allclose(part.poses, again.poses, atol=1e-5)


def test_standing_people_keep_their_feet_where_they_are_whatever_they_have_walked() -> None:
    person = make_worker(np.random.default_rng(3))
    one, other = boots(person, {"stride_m": 0.0}), boots(person, {"stride_m": 0.37})
    np.testing.assert_allclose(one.poses, other.poses, atol=1e-6)


@given(phase=st.floats(0.0, 1.0), share=st.floats(0.0, 1.0), step_m=st.floats(0.4, 0.9))
def test_a_foot_is_never_below_the_ground_and_never_high_above(phase: float, share: float, step_m: float) -> None:
    boot = sole(1.0)
    foot = footing(phase, step_m, share, boot)
    lowest_m = foot.z_m - boot.resting(foot.pitch_deg)[1]
    assert -GEOMETRY_REL < lowest_m < 0.05


def test_a_rolling_sole_rests_flat_without_having_moved() -> None:
    rolled_m, height_m = sole(1.0).resting(0.0)
    assert rolled_m == pytest.approx(0.0, abs=GEOMETRY_REL)
    assert height_m == pytest.approx(-sole(1.0).points_m[:, 1].min())


def test_arms_swing_against_the_legs() -> None:
    for phase in np.linspace(0.0, 1.0, 9):
        leg_m = footing(float(phase), 0.7, 1.0, sole(1.0)).x_m
        ahead, opposite = arm_swing_deg(float(phase), 1.3)[0], arm_swing_deg(float(phase) + 0.5, 1.3)[0]
        if abs(leg_m) > 0.15:
            assert (ahead - opposite) * leg_m < 0


def test_step_length_is_that_of_people() -> None:
    for speed_mps in (0.9, 1.4):
        step_m = step_length_m(speed_mps, 1.75)
        assert 80.0 < 60.0 * speed_mps / step_m < 120.0
    # Daily life of 8429 people in Japan: 0.656 m at 1.30 m/s (Geriatr Gerontol Int 20, 2020, p. 664).
    assert step_length_m(1.30, 1.64) == pytest.approx(0.656, rel=0.1)
    assert step_length_m(1.2, 1.95) > step_length_m(1.2, 1.55)


def test_amplitude_rises_from_standing_to_walking() -> None:
    shares = [amplitude(speed) for speed in np.linspace(0.0, 1.0, 21)]
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    assert (np.diff(shares) >= 0).all()


@pytest.mark.parametrize("stature_m", [1.55, 1.75, 1.95])
def test_segments_have_the_lengths_of_drillis_and_contini(stature_m: float) -> None:
    places_m = joints_of(Body(stature_m), stance(0.1, 1.2))
    lengths = {
        ("thigh", "shin"): 0.245, ("shin", "boot"): 0.246, ("upper_arm", "forearm"): 0.186, ("forearm", "hand"): 0.146,
    }  # fmt: skip
    for (upper, lower), ratio in lengths.items():
        length_m = np.linalg.norm(places_m[lower] - places_m[upper], axis=1)
        np.testing.assert_allclose(length_m, ratio * stature_m, rtol=1e-6, err_msg=upper)


def test_a_standing_body_has_published_joint_heights() -> None:
    places_m = joints_of(Body(1.75), stance(0.0, 0.0))
    heights = {"thigh": 0.530, "shin": 0.285, "boot": 0.039, "upper_arm": 0.818}
    for name, ratio in heights.items():
        np.testing.assert_allclose(places_m[name][:, 2] - 0.022, ratio * 1.75, atol=0.02, err_msg=name)
