"""From a camera's view of the site to the ground map, with its errors."""

from __future__ import annotations

import numpy as np

from standoff.core.compiled import compiled
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
    )


@compiled
def _entries_with_jacobian(forth: FloatArray, rotation: FloatArray, camera: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the signed map from undistorted pixels to the ground, at unit norm, and its derivative by the view.

    Args:
        forth: (3, 3) from the ground to undistorted pixels.
        rotation: (3, 3) of the view.
        camera: (3, 3) its camera matrix.

    Returns:
        (3, 3), and (10, 8) of its entries and of the lens's k1.
    """
    back = np.linalg.inv(forth)
    to_camera = np.linalg.inv(camera) @ forth
    by_forth = np.zeros((CHANGES, 3, 3))
    for k in range(3):
        # A turn of a radian about axis k takes a point of the camera's frame to axis x point.
        turn = np.zeros((3, 3))
        turn[(k + 1) % 3, (k + 2) % 3], turn[(k + 2) % 3, (k + 1) % 3] = -1.0, 1.0
        by_forth[k] = camera @ turn @ to_camera
        by_forth[3 + k, :, 2] = -(camera @ rotation)[:, k]
    for axis in range(2):
        by_forth[6, axis] = camera[axis, axis] * to_camera[axis]
    norm = np.sqrt((back**2).sum())
    entries = back / norm
    by_view = np.zeros((10, CHANGES))
    for k in range(CHANGES):
        # The inverse moves by -back d(forth) back; of that only what is across the entries' own direction keeps the
        # norm.
        slope = -(back @ by_forth[k] @ back) / norm
        by_view[:9, k] = (slope - (slope * entries).sum() * entries).reshape(-1)
    by_view[9, 7] = 1.0
    return entries, by_view


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
    points_m = np.zeros((len(at_px), 3))
    points_m[:, :2] = on_ground(at_px, position_m, rotation, matrix, distortion, first_fold_r2)
    if not np.isfinite(points_m).all():
        return np.inf
    _, by_view, by_point = projected(points_m, position_m, rotation, matrix, distortion)
    worst = 0.0
    for start in (0, 2):
        apart_m = points_m[start + 1, :2] - points_m[start, :2]
        longer = np.zeros(CHANGES)
        for at, sign in ((start, 1.0), (start + 1, -1.0)):
            # A pixel stays where it is, so its place on the ground moves.
            moves = np.linalg.solve(np.ascontiguousarray(by_point[at, :, :2]), by_view[at])
            longer += sign * (apart_m[0] * moves[0] + apart_m[1] * moves[1]) / (apart_m**2).sum()
        worst = max(worst, (longer * (covariance @ longer)).sum())
    return np.sqrt(worst)


def middle_scale_m_per_px(view: View) -> float:
    """Return metres per undistorted pixel a little below the middle of the picture; NaN if no ground is seen there."""
    point_px = view.camera.undistort(np.array([[view.camera.width_px * 0.5, view.camera.height_px * 0.6]]))
    jacobian = point_jacobian(invert(view.plane_to_pinhole()), point_px)[0]
    return float(np.sqrt(abs(np.linalg.det(jacobian))))
