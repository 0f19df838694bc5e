"""Carry a view of the ground along with the motion of the picture, and its errors with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core import homography
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import CameraMotion
from standoff.core.compiled import compiled
from standoff.stages.ground.projection import on_ground, projected, turned_by
from standoff.stages.ground.solid import STATE

_COLUMNS, _ROWS = 7, 5
_MIN_POINTS = 8
_FAR_HEIGHTS = 8.0
"""Ground further away than so many times the camera's height is too near the horizon to carry anything."""

_ROUNDS, _STILL = 5, 1e-7
_MAX_MISFIT_PX = 4.0

_GRID = np.array([(column, row) for row in range(_ROWS) for column in range(_COLUMNS)], dtype=np.float64)


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
    camera, lens_known = key.camera, motion.camera is not None
    # Motion of undistorted points is motion in the pictures of a camera without distortion.
    distortion, fold_r2 = (np.zeros(5), np.inf) if lens_known else (camera.distortion, camera.first_fold_r2())
    then = key.position_m, key.site_to_camera, camera.matrix, distortion
    grid_px = (_GRID + 0.5) * np.array([camera.width_px / _COLUMNS, camera.height_px / _ROWS])
    seen_px, places, moved_px = _ground_moved(grid_px, motion.keyframe_to_image, *then, fold_r2)
    if len(seen_px) < _MIN_POINTS:
        return None
    lens = camera.matrix, distortion
    try:
        position_m, rotation, rms_px = _follow(places, moved_px, guess.position_m, guess.site_to_camera, *lens)
        if not rms_px < _MAX_MISFIT_PX:
            return None
        by_key, added = _errors(
            seen_px, places, moved_px, motion.keyframe_to_image, motion.covariance, position_m, rotation, rms_px,
            lens_known, *then,
        )
    except np.linalg.LinAlgError:
        return None
    return Carried(View(camera, position_m, rotation), by_key, added)


@compiled
def _ground_moved(
    grid_px: FloatArray,
    keyframe_to_image: FloatArray,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
    first_fold_r2: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return those of the points (G, 2) of the keyframe that show ground, near enough and still ahead after the motion.

    Returns:
        (N, 2) themselves; (N, 3) the places that they show; (N, 2) where these are in the picture now.
    """
    xy_m = on_ground(grid_px, position_m, rotation, matrix, distortion, first_fold_r2)
    seen_px, places, moved_px = np.empty_like(grid_px), np.zeros((len(grid_px), 3)), np.empty_like(grid_px)
    found = 0
    for n in range(len(grid_px)):
        away_m = np.sqrt((xy_m[n, 0] - position_m[0]) ** 2 + (xy_m[n, 1] - position_m[1]) ** 2)
        x, y, w = keyframe_to_image @ np.array([grid_px[n, 0], grid_px[n, 1], 1.0])
        if away_m < _FAR_HEIGHTS * abs(position_m[2]) and w > 0.0:
            seen_px[found], places[found, :2] = grid_px[n], xy_m[n]
            moved_px[found, 0], moved_px[found, 1] = x / w, y / w
            found += 1
    return seen_px[:found], places[:found], moved_px[:found]


@compiled
def _follow(
    places: FloatArray,
    moved_px: FloatArray,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
) -> tuple[FloatArray, FloatArray, float]:
    """Return the position (3,) and rotation (3, 3) from which places are seen nearest to where they moved.

    And how far off they are, root mean square; NaN where they are behind the camera.
    """
    position_m, rotation = position_m.copy(), rotation.copy()
    for _ in range(_ROUNDS):
        points_px, by_view, _ = projected(places, position_m, rotation, matrix, distortion)
        misfit = (moved_px - points_px).reshape(-1)
        by_pose = np.ascontiguousarray(by_view.reshape(-1, 8)[:, :6])
        if not np.isfinite(misfit).all():
            return position_m, rotation, np.nan
        change = np.linalg.solve(by_pose.T @ by_pose, by_pose.T @ misfit)
        position_m, rotation = position_m + change[3:6], turned_by(change[:3], rotation)
        if np.abs(change).max() < _STILL:
            break
    misfit = moved_px - projected(places, position_m, rotation, matrix, distortion)[0]
    return position_m, rotation, np.sqrt((misfit**2).mean())


@compiled
def _errors(
    seen_px: FloatArray,
    places: FloatArray,
    moved_px: FloatArray,
    keyframe_to_image: FloatArray,
    motion_covariance: FloatArray,
    position_m: FloatArray,
    rotation: FloatArray,
    rms_px: float,
    lens_known: bool,
    then_position_m: FloatArray,
    then_rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return (9, 9) `Carried.by_key` and (9, 9) `Carried.added`.

    The points of the ground move with the keyframe's state, and the view now follows them. The pose takes its share of
    the motion's error, and of what no pose explains of the motion.
    """
    count = len(places)
    _, by_view, by_point = projected(places, position_m, rotation, matrix, distortion)
    _, then_by_view, then_by_point = projected(places, then_position_m, then_rotation, matrix, distortion)
    by_pose = np.ascontiguousarray(by_view.reshape(-1, 8)[:, :6])
    image_by_key, by_entries = np.empty((count, 2, 8)), np.zeros((count, 2, 9))
    for n in range(count):
        ground_by_key = -np.linalg.solve(np.ascontiguousarray(then_by_point[n, :, :2]), then_by_view[n])
        image_by_key[n] = np.ascontiguousarray(by_point[n, :, :2]) @ ground_by_key
        image_by_key[n, :, 6:] += by_view[n, :, 6:]
        over_w = np.array([seen_px[n, 0], seen_px[n, 1], 1.0])
        over_w /= (keyframe_to_image[2] * over_w).sum()
        by_entries[n, 0, :3] = by_entries[n, 1, 3:6] = over_w
        by_entries[n, 0, 6:], by_entries[n, 1, 6:] = -moved_px[n, 0] * over_w, -moved_px[n, 1] * over_w
    if lens_known:
        image_by_key[:, :, 7] = 0.0
    variance = np.linalg.inv(by_pose.T @ by_pose)
    solve = variance @ by_pose.T
    to_pose = solve @ by_entries.reshape(-1, 9)
    by_key, added = np.eye(STATE), np.zeros((STATE, STATE))
    by_key[:6, :8] = -solve @ image_by_key.reshape(-1, 8)
    # The misfit is smooth over the picture: its eight degrees of freedom count, not the number of points.
    added[:6, :6] = to_pose @ motion_covariance @ to_pose.T + rms_px**2 * (count / 4.0) * variance
    return by_key, added
