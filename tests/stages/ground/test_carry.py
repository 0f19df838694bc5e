from __future__ import annotations

import numpy as np
import pytest
from drawn_solid import lens, looking_at, motion_between
from tolerances import CARRIED_PX, MAP_SIGMA_REL

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import CameraMotion
from standoff.stages.ground.carry import carry

CAMERA = lens(k1=-0.05)
GROUND = np.column_stack([np.random.default_rng(3).uniform(-4.0, 4.0, (30, 2)), np.zeros(30)])


def _flight(seed: int) -> tuple[View, View]:
    rng = np.random.default_rng(seed)
    then = looking_at(
        CAMERA, (0.0, 0.0), away_m=12.0, heading_deg=float(rng.uniform(0, 360)), pitch_deg=float(rng.uniform(35, 80))
    )
    now = then.changed(rng.normal(size=8) * np.array([0.05] * 3 + [0.6] * 3 + [0.0, 0.0]))
    return then, now


@pytest.mark.parametrize("seed", range(10))
def test_the_exact_motion_of_the_plane_gives_the_exact_view(seed: int) -> None:
    then, now = _flight(seed)
    carried = carry(then, motion_between(then, now, 0.0), then)
    assert carried is not None
    np.testing.assert_allclose(carried.view.project(GROUND), now.project(GROUND), atol=CARRIED_PX)
    np.testing.assert_allclose(carried.view.position_m, now.position_m, atol=CARRIED_PX)


@pytest.mark.parametrize("seed", range(4))
def test_errors_of_the_keyframe_come_along_as_the_derivatives_say(seed: int) -> None:
    then, now = _flight(seed)
    motion = motion_between(then, now, 0.0)
    carried = carry(then, motion, then)
    assert carried is not None
    for k, size in enumerate([1e-4] * 3 + [1e-3] * 3 + [1e-4]):
        ends = []
        for sign in (1.0, -1.0):
            step = np.zeros(8)
            step[k] = sign * size
            moved = carry(then.changed(step), motion, now)
            assert moved is not None
            ends.append(moved.view.change_from(carried.view))
        slope = (ends[0] - ends[1]) / (2.0 * size)
        np.testing.assert_allclose(carried.by_key[:8, k], slope, atol=2e-2 * max(float(np.abs(slope).max()), 1.0))


def _disturbed(motion: CameraMotion, rng: np.random.Generator) -> CameraMotion:
    values, vectors = np.linalg.eigh(motion.covariance)
    error: FloatArray = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=9))
    return CameraMotion(motion.keyframe_to_image + error.reshape(3, 3), motion.covariance, 0.0, motion.camera)


def test_the_covariance_that_a_motion_adds_is_that_of_random_errors_of_it() -> None:
    then, now = _flight(2)
    motion = motion_between(then, now, 0.0, sigma_px=0.05)
    carried = carry(then, motion, now)
    assert carried is not None
    rng = np.random.default_rng(0)
    changes = []
    for _ in range(300):
        moved = carry(then, _disturbed(motion, rng), now)
        assert moved is not None
        changes.append(moved.view.change_from(carried.view)[:6])
    found = np.std(changes, axis=0)
    expected = np.sqrt(np.diag(carried.added)[:6])
    np.testing.assert_allclose(found, expected, rtol=3.0 * MAP_SIGMA_REL)


def test_a_motion_that_no_camera_makes_carries_nothing() -> None:
    then, now = _flight(1)
    motion = motion_between(then, now, 0.0)
    sheared = CameraMotion(
        np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) @ motion.keyframe_to_image,
        motion.covariance,
        0.0,
        motion.camera,
    )
    assert carry(then, sheared, then) is None


def test_a_camera_that_sees_hardly_any_ground_carries_nothing() -> None:
    level = View.aimed(CAMERA, np.array([0.0, 0.0, 2.0]), heading_deg=0.0, pitch_deg=-30.0)
    assert carry(level, CameraMotion(np.eye(3), np.zeros((9, 9)), 0.0, CAMERA), level) is None
