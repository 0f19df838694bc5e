"""Carry a view of the ground along with the motion of the picture, and its errors with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core import homography
from standoff.core.compiled import compiled, solved
from standoff.core.homography import FloatArray
from standoff.core.pose import POSE, View
from standoff.core.types import CameraMotion
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
    position_m, rotation, rms_px = _follow(places, moved_px, guess.position_m, guess.site_to_camera, *lens)
    if not rms_px < _MAX_MISFIT_PX:
        return None
    variance, by_state, by_entries = _derivatives(
        seen_px, places, moved_px, motion.keyframe_to_image, position_m, rotation, *then
    )
    if lens_known:
        by_state[:, 7] = 0.0
    by_key, added = np.eye(STATE), np.zeros((STATE, STATE))
    by_key[POSE, :8] = -by_state
    # The misfit is smooth over the picture: its eight degrees of freedom count, not the number of points.
    misfit = rms_px**2 * (len(seen_px) / 4.0) * variance
    added[POSE, POSE] = by_entries @ motion.covariance @ by_entries.T + misfit
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
        w = _row(keyframe_to_image, 2, grid_px[n])
        if away_m < _FAR_HEIGHTS * abs(position_m[2]) and w > 0.0:
            for axis in range(2):
                seen_px[found, axis], places[found, axis] = grid_px[n, axis], xy_m[n, axis]
                moved_px[found, axis] = _row(keyframe_to_image, axis, grid_px[n]) / w
            found += 1
    return seen_px[:found], places[:found], moved_px[:found]


@compiled
def _row(matrix: FloatArray, row: int, point: FloatArray) -> float:
    """Return what one row of a homography makes of a point (2,)."""
    value: float = matrix[row, 0] * point[0] + matrix[row, 1] * point[1] + matrix[row, 2]
    return value


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
    pull = np.empty((6, 1))
    for _ in range(_ROUNDS):
        points_px, by_view, _ = projected(places, position_m, rotation, matrix, distortion)
        pull[:] = 0.0
        for n in range(len(places)):
            for axis in range(2):
                for k in range(6):
                    pull[k, 0] += by_view[n, axis, k] * (moved_px[n, axis] - points_px[n, axis])
        change = solved(_by_pose_squared(by_view), pull)
        largest = 0.0
        for k in range(6):
            largest = max(largest, abs(change[k, 0]))
        rotation = turned_by(change[:3, 0], rotation)
        for axis in range(3):
            position_m[axis] += change[3 + axis, 0]
        if largest < _STILL:
            break
    points_px, _, _ = projected(places, position_m, rotation, matrix, distortion)
    squares = 0.0
    for n in range(len(places)):
        squares += (moved_px[n, 0] - points_px[n, 0]) ** 2 + (moved_px[n, 1] - points_px[n, 1]) ** 2
    return position_m, rotation, np.sqrt(squares / (2 * len(places)))


@compiled
def _by_pose_squared(by_view: FloatArray) -> FloatArray:
    """Return (6, 6) the derivative by the pose, squared and summed over all points."""
    squared = np.zeros((6, 6))
    for n in range(len(by_view)):
        for axis in range(2):
            for i in range(6):
                for k in range(6):
                    squared[i, k] += by_view[n, axis, i] * by_view[n, axis, k]
    return squared


@compiled
def _derivatives(
    seen_px: FloatArray,
    places: FloatArray,
    moved_px: FloatArray,
    keyframe_to_image: FloatArray,
    position_m: FloatArray,
    rotation: FloatArray,
    then_position_m: FloatArray,
    then_rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what moves the pose that follows the points.

    Returns:
        (6, 6) its covariance for points of unit variance; (6, 8) what a change of the keyframe's view, by which the
        places of the points move, asks of it; (6, 9) its derivative by the motion's entries.
    """
    _, by_view, by_point = projected(places, position_m, rotation, matrix, distortion)
    _, then_by_view, then_by_point = projected(places, then_position_m, then_rotation, matrix, distortion)
    by_state, by_entries, unit = np.zeros((6, 8)), np.zeros((6, 9)), np.eye(6)
    for n in range(len(places)):
        a, b, c, d = then_by_point[n, 0, 0], then_by_point[n, 0, 1], then_by_point[n, 1, 0], then_by_point[n, 1, 1]
        w = _row(keyframe_to_image, 2, seen_px[n])
        for axis in range(2):
            # By the pixel in the keyframe: a change of the view there moves the place that it shows.
            first = (by_point[n, axis, 0] * d - by_point[n, axis, 1] * c) / (a * d - b * c)
            second = (by_point[n, axis, 1] * a - by_point[n, axis, 0] * b) / (a * d - b * c)
            for i in range(6):
                share = by_view[n, axis, i]
                for k in range(8):
                    moves = -first * then_by_view[n, 0, k] - second * then_by_view[n, 1, k]
                    by_state[i, k] += share * (moves + (by_view[n, axis, k] if k >= 6 else 0.0))
                for k in range(3):
                    over_w = (seen_px[n, k] if k < 2 else 1.0) / w
                    by_entries[i, 3 * axis + k] += share * over_w
                    by_entries[i, 6 + k] -= share * moved_px[n, axis] * over_w
    squared = _by_pose_squared(by_view)
    return solved(squared, unit), solved(squared, by_state), solved(squared, by_entries)
