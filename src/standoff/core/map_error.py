"""How the error of a ground map, and of a point in the picture, moves the place on the ground: first order."""

from __future__ import annotations

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap

_STEP_PX = 0.5
_STEPS_PX = np.array([1.0, -1.0])[:, None, None, None] * np.diag([_STEP_PX, _STEP_PX])[:, None]
"""(2, 2, 1, 2) ahead and behind, along x and y."""


def factor(covariance: FloatArray) -> FloatArray:
    """Return L with L L^T = covariance, for a covariance that may lack full rank.

    Entries of very different size are first brought to the same one, so that none drowns in the
    rounding of another.

    Args:
        covariance: (P, P), positive semi-definite.

    Returns:
        (P, P).

    >>> root = factor(np.array([[4.0, 2.0], [2.0, 1.0]]))
    >>> np.round(root @ root.T, 9)
    array([[4., 2.],
           [2., 1.]])
    """
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    spread[spread == 0.0] = 1.0
    values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
    root: FloatArray = spread[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def undistortion_jacobian(camera: Camera, undistorted_px: FloatArray) -> FloatArray:
    """Return d undistorted / d picture point by central differences of the lens model, inverted.

    Args:
        camera: The lens.
        undistorted_px: (N, 2); not finite where there is no such point.

    Returns:
        (N, 2, 2); NaN where the point is not finite.
    """
    # All at once: a lens costs by the call.
    ahead, behind = camera.distort((undistorted_px + _STEPS_PX).reshape(-1, 2)).reshape(2, 2, -1, 2)
    forth = ((ahead - behind) / (2.0 * _STEP_PX)).transpose(1, 2, 0)
    back: FloatArray = np.full_like(forth, np.nan)
    usable = np.isfinite(undistorted_px).all(axis=1)
    back[usable] = np.linalg.inv(forth[usable])
    return back


def map_jacobian(ground: GroundMap, undistorted_px: FloatArray) -> FloatArray:
    """Return how ground points move with the map: by its nine entries, then by the lens's k1.

    Args:
        ground: The map.
        undistorted_px: (N, 2) the points without lens distortion, whose places in the picture stay.

    Returns:
        (N, 2, 10); NaN where the point is.
    """
    by_entries = homography.parameter_jacobian(ground.image_to_ground, undistorted_px)
    if ground.camera is None:
        return np.concatenate([by_entries, np.zeros((len(undistorted_px), 2, 1))], axis=2)
    focal = np.array([ground.camera.matrix[0, 0], ground.camera.matrix[1, 1]])
    normalised = (undistorted_px - ground.camera.matrix[:2, 2]) / focal
    # More k1 moves the picture of a direction outwards, so a fixed place in the picture is of one further in.
    seen_by_k1 = ground.camera.distorted_by_k1(normalised) * focal
    by_point = homography.point_jacobian(ground.image_to_ground, undistorted_px)
    by_k1 = -by_point @ undistortion_jacobian(ground.camera, undistorted_px) @ seen_by_k1[:, :, None]
    return np.concatenate([by_entries, by_k1], axis=2)


def picture_jacobian(ground: GroundMap, undistorted_px: FloatArray) -> FloatArray:
    """Return d place / d picture point, lens and perspective included.

    Args:
        ground: The map.
        undistorted_px: (N, 2) the points without lens distortion.

    Returns:
        (N, 2, 2) metres a pixel; NaN where the point is.
    """
    jacobian = homography.point_jacobian(ground.image_to_ground, undistorted_px)
    return jacobian if ground.camera is None else jacobian @ undistortion_jacobian(ground.camera, undistorted_px)
