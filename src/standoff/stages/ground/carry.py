"""Carry a view of the ground along with the motion of the picture, and its errors with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import LENS, POSE, View
from standoff.core.types import CameraMotion
from standoff.stages.ground.projection import project_with_jacobians
from standoff.stages.ground.solid import STATE

_COLUMNS, _ROWS = 7, 5
_MIN_POINTS = 8
_FAR_HEIGHTS = 8.0
"""Ground further away than so many times the camera's height is too near the horizon to carry anything."""

_ROUNDS = 5
_MAX_MISFIT_PX = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """A view after a motion.

    Attributes:
        view: The camera now.
        by_key: (9, 9) how a small change of the state at the keyframe changes the state now.
        added: (9, 9) covariance that the motion's own error adds.
    """

    view: View
    by_key: FloatArray
    added: FloatArray


def since(earlier: CameraMotion, later: CameraMotion) -> CameraMotion:
    """Return the motion from one frame to a later one, both known since the same keyframe.

    The errors of both count in full, though they have causes in common: it is rather too large.
    """
    back = homography.invert(earlier.keyframe_to_image)
    step = later.keyframe_to_image @ back
    by_later, by_earlier = np.kron(np.eye(3), back.T), -np.kron(step, back.T)
    covariance = by_later @ later.covariance @ by_later.T + by_earlier @ earlier.covariance @ by_earlier.T
    norm = np.linalg.norm(step)
    return CameraMotion(step / norm, covariance / norm**2, earlier.keyframe_s, later.camera, later.repeated)


def carry(key: View, motion: CameraMotion, guess: View) -> Carried | None:
    """Find where the camera is after the picture of the ground has moved.

    Args:
        key: The camera at the keyframe.
        motion: Of the picture since.
        guess: About where the camera is now; the lens is the keyframe's.

    Returns:
        The view and its derivatives, or None where no camera could have moved the picture so.
    """
    # Motion of undistorted points is motion in the pictures of a camera without distortion.
    camera = key.camera if motion.camera is None else _straight(key.camera)
    then = View(camera, key.position_m, key.site_to_camera)
    now = View(camera, guess.position_m, guess.site_to_camera)
    seen_px, places = _ground_grid(then)
    moved_px, valid = homography.apply(motion.keyframe_to_image, seen_px)
    seen_px, places, moved_px = seen_px[valid], places[valid], moved_px[valid]
    if len(seen_px) < _MIN_POINTS:
        return None
    for _ in range(_ROUNDS):
        points_px, by_view, _ = project_with_jacobians(now, places)
        misfit = (moved_px - points_px).ravel()
        if not np.isfinite(misfit).all():
            return None
        change = np.zeros(8)
        change[POSE] = np.linalg.lstsq(by_view[:, :, POSE].reshape(-1, 6), misfit, rcond=None)[0]
        now = now.changed(change)
        if np.abs(change).max() < 1e-7:
            break
    points_px, by_view, by_point = project_with_jacobians(now, places)
    misfit = (moved_px - points_px).ravel()
    rms_px = float(np.sqrt((misfit**2).mean()))
    if not rms_px < _MAX_MISFIT_PX:
        return None
    solve = np.asarray(np.linalg.pinv(by_view[:, :, POSE].reshape(-1, 6)), dtype=np.float64)
    return Carried(
        view=View(key.camera, now.position_m, now.site_to_camera),
        by_key=_by_key(then, places, by_view, by_point, solve, lens_known=motion.camera is not None),
        added=_added(motion, seen_px, solve, rms_px),
    )


def _by_key(
    then: View, places: FloatArray, by_view: FloatArray, by_point: FloatArray, solve: FloatArray, *, lens_known: bool
) -> FloatArray:
    """Return (9, 9): the points of the ground move with the keyframe's state, and the view now follows them."""
    _, then_by_view, then_by_point = project_with_jacobians(then, places)
    ground_by_key = -np.linalg.solve(then_by_point[:, :, :2], then_by_view)
    image_by_key = by_point[:, :, :2] @ ground_by_key
    image_by_key[:, :, LENS] += by_view[:, :, LENS]
    if lens_known:
        image_by_key[:, :, 7] = 0.0
    by_key = np.eye(STATE)
    by_key[POSE, :8] = -solve @ image_by_key.reshape(-1, 8)
    return by_key


def _added(motion: CameraMotion, seen_px: FloatArray, solve: FloatArray, rms_px: float) -> FloatArray:
    """Return (9, 9) the pose's share of the motion's error, and of what no pose explains of the motion."""
    by_entries = homography.parameter_jacobian(motion.keyframe_to_image, seen_px).reshape(-1, 9)
    to_pose = solve @ by_entries
    added = np.zeros((STATE, STATE))
    added[POSE, POSE] = to_pose @ motion.covariance @ to_pose.T
    # The misfit is smooth over the picture: its eight degrees of freedom count, not the number of points.
    added[POSE, POSE] += rms_px**2 * (len(seen_px) / 4.0) * (solve @ solve.T)
    return added


def _straight(camera: Camera) -> Camera:
    return Camera(camera.width_px, camera.height_px, camera.matrix, np.zeros(5))


def _ground_grid(view: View) -> tuple[FloatArray, FloatArray]:
    """Return (N, 2) pixels spread over the ground in the picture, and (N, 3) the places that they show."""
    width, height = view.camera.width_px, view.camera.height_px
    x, y = np.meshgrid((np.arange(_COLUMNS) + 0.5) / _COLUMNS * width, (np.arange(_ROWS) + 0.5) / _ROWS * height)
    points_px = np.column_stack([x.ravel(), y.ravel()])
    xy_m = view.to_plane(points_px)
    near = np.linalg.norm(xy_m - view.position_m[:2], axis=1) < _FAR_HEIGHTS * abs(view.position_m[2])
    return points_px[near], np.column_stack([xy_m[near], np.zeros(near.sum())])
