"""From a camera's view of the site to the ground map, with its errors."""

from __future__ import annotations

import numpy as np

from standoff.core.compiled import compiled, solved
from standoff.core.homography import FloatArray, invert, point_jacobian
from standoff.core.pose import CHANGES, View
from standoff.core.types import GroundMap
from standoff.stages.ground.projection import eye_of, on_ground, projected


def map_from_view(
    view: View,
    covariance: FloatArray,
    *,
    method: str,
    scale_m_per_px: float,
    anchors_px: FloatArray,
    age_s: float = 0.0,
    size_sigma: float = 0.0,
    middle_m: FloatArray | None = None,
    site_frame: int = 0,
    frame_stated: bool = False,
) -> GroundMap:
    """Return the map of the ground, z = 0.

    Args:
        view: The camera.
        covariance: (8, 8) of a change of the view.
        method: For the record.
        scale_m_per_px: Eq. 6's.
        anchors_px: (A, 2) for drawing.
        age_s: Since the view was last observed.
        size_sigma: Standard error of all lengths at once, as a share of them: of the tape measure.
        middle_m: (2,) the place that such an error leaves where it is; None: the origin.
        site_frame: Which of the stream's site frames the metres are of.
        frame_stated: Whether somebody stated where that lies.
    """
    matrix, by_view = _entries_with_jacobian(view.plane_to_pinhole(), view.site_to_camera, view.camera.matrix)
    total = by_view @ covariance @ by_view.T
    if size_sigma > 0:
        middle = np.zeros(2) if middle_m is None else middle_m
        stretch = np.zeros((3, 3))
        stretch[:2] = matrix[:2] - middle[:, None] * matrix[2]
        direction = np.append(stretch.ravel(), 0.0) * size_sigma
        total += np.outer(direction, direction)
    return GroundMap(
        image_to_ground=matrix,
        covariance=(total + total.T) / 2.0,
        image_size_px=(view.camera.width_px, view.camera.height_px),
        method=method,
        scale_m_per_px=scale_m_per_px,
        anchors_px=anchors_px,
        camera=view.camera,
        age_s=age_s,
        site_frame=site_frame,
        frame_stated=frame_stated,
    )


@compiled
def _entries_with_jacobian(
    forth: FloatArray, rotation: FloatArray, camera: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the signed map from undistorted pixels to the ground, at unit norm, and its derivative by the view.

    Args:
        forth: (3, 3) from the ground to undistorted pixels.
        rotation: (3, 3) of the view.
        camera: (3, 3) its camera matrix.

    Returns:
        (3, 3), and (10, 8) of its entries and of the lens's k1.
    """
    back, to_camera = solved(forth, np.eye(3)), solved(camera, forth)
    norm = np.sqrt((back**2).sum())
    entries, by_view = back / norm, np.zeros((10, CHANGES))
    by_forth, slope = np.zeros((3, 3)), np.empty((3, 3))
    for change in range(CHANGES - 1):
        _forth_by(change, to_camera, rotation, camera, by_forth)
        # The inverse moves by -back d(forth) back; of that only what is across the entries' own direction keeps the
        # norm.
        along = 0.0
        for i in range(3):
            for j in range(3):
                slope[i, j] = 0.0
                for k in range(3):
                    for m in range(3):
                        slope[i, j] -= back[i, k] * by_forth[k, m] * back[m, j] / norm
                along += slope[i, j] * entries[i, j]
        for entry in range(9):
            by_view[entry, change] = slope[entry // 3, entry % 3] - along * entries[entry // 3, entry % 3]
    by_view[9, 7] = 1.0
    return entries, by_view


@compiled
def _forth_by(
    change: int, to_camera: FloatArray, rotation: FloatArray, camera: FloatArray, by_forth: FloatArray
) -> None:
    """Fill in (3, 3) the derivative of the map to pixels by one parameter of a change of the view, all but k1."""
    by_forth[:] = 0.0
    for row in range(3):
        for column in range(3):
            if change < 3:
                # A turn of a radian about an axis takes a point of the camera's frame to axis x point.
                after, before = (change + 1) % 3, (change + 2) % 3
                by_forth[row, column] = camera[row, before] * to_camera[after, column]
                by_forth[row, column] -= camera[row, after] * to_camera[before, column]
            elif change < 6:
                by_forth[row, 2] -= camera[row, column] * rotation[column, change - 3]
            elif row < 2:
                by_forth[row, column] = camera[row, row] * to_camera[row, column]


_AT = np.array([[0.45, 0.6], [0.55, 0.6], [0.5, 0.52], [0.5, 0.68]])
"""Ends of a stretch of ground to the side and of one away from the camera, as shares of the picture."""


def length_sigma(view: View, covariance: FloatArray) -> float:
    """Return the relative standard error of lengths in the middle of the picture, in the worse direction.

    Args:
        view: The camera.
        covariance: (8, 8) of a change of the view.

    Returns:
        Infinite where no ground is seen there.
    """
    at_px = _AT * [view.camera.width_px, view.camera.height_px]
    return _length_sigma(at_px, np.ascontiguousarray(covariance), *eye_of(view))


@compiled
def _length_sigma(
    at_px: FloatArray,
    covariance: FloatArray,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
    first_fold_r2: float,
) -> float:
    xy_m = on_ground(at_px, position_m, rotation, matrix, distortion, first_fold_r2)
    points_m = np.zeros((len(at_px), 3))
    for n in range(len(at_px)):
        points_m[n, 0], points_m[n, 1] = xy_m[n, 0], xy_m[n, 1]
        if not (np.isfinite(xy_m[n, 0]) and np.isfinite(xy_m[n, 1])):
            return np.inf
    _, by_view, by_point = projected(points_m, position_m, rotation, matrix, distortion)
    worst, longer = 0.0, np.empty(CHANGES)
    for start in (0, 2):
        x, y = points_m[start + 1, 0] - points_m[start, 0], points_m[start + 1, 1] - points_m[start, 1]
        longer[:] = 0.0
        for at, sign in ((start, 1.0), (start + 1, -1.0)):
            # A pixel stays where it is, so its place on the ground moves.
            a, b, c, d = by_point[at, 0, 0], by_point[at, 0, 1], by_point[at, 1, 0], by_point[at, 1, 1]
            share = sign / ((a * d - b * c) * (x * x + y * y))
            for k in range(CHANGES):
                first, second = by_view[at, 0, k], by_view[at, 1, k]
                longer[k] += share * (x * (d * first - b * second) + y * (a * second - c * first))
        variance = 0.0
        for i in range(CHANGES):
            for k in range(CHANGES):
                variance += longer[i] * covariance[i, k] * longer[k]
        worst = max(worst, variance)
    sigma: float = np.sqrt(worst)
    return sigma


def middle_scale_m_per_px(view: View) -> float:
    """Return metres per undistorted pixel a little below the middle of the picture; NaN if no ground is seen there."""
    point_px = view.camera.undistort(np.array([[view.camera.width_px * 0.5, view.camera.height_px * 0.6]]))
    jacobian = point_jacobian(invert(view.plane_to_pinhole()), point_px)[0]
    return float(np.sqrt(abs(np.linalg.det(jacobian))))
