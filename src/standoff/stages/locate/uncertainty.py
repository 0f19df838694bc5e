"""From the error of a box and of the ground map to the error of a position, first order."""

from __future__ import annotations

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap

_STEP_PX = 0.5


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
    columns = [
        (camera.distort(undistorted_px + step) - camera.distort(undistorted_px - step)) / (2.0 * _STEP_PX)
        for step in np.diag([_STEP_PX, _STEP_PX])
    ]
    forth = np.stack(columns, axis=-1)
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


def own_covariance(ground: GroundMap, undistorted_px: FloatArray, covariance_px2: FloatArray) -> FloatArray:
    """Carry the error of each picture point to the ground, lens and perspective included.

    Args:
        ground: The map.
        undistorted_px: (N, 2) the points without lens distortion.
        covariance_px2: (N, 2, 2) of the points, as seen in the picture.

    Returns:
        (N, 2, 2) metres squared, without the map's share; NaN where the point is.
    """
    jacobian = homography.point_jacobian(ground.image_to_ground, undistorted_px)
    if ground.camera is not None:
        jacobian = jacobian @ undistortion_jacobian(ground.camera, undistorted_px)
    covariance: FloatArray = jacobian @ covariance_px2 @ jacobian.transpose(0, 2, 1)
    return covariance


def horizon_margin(
    ground: GroundMap, root: FloatArray, undistorted_px: FloatArray, covariance_px2: FloatArray
) -> FloatArray:
    """Return by how many of its standard errors each point lies on the camera's side of the horizon.

    The error is that of the projective denominator, from the picture point and from the map.

    Args:
        ground: The map.
        root: (10, 10) factor of its covariance.
        undistorted_px: (N, 2).
        covariance_px2: (N, 2, 2); the lens's part in it is left out.

    Returns:
        (N,); negative beyond the horizon, infinite where nothing is uncertain, NaN where the point is.
    """
    last_row = ground.image_to_ground[2]
    homogeneous = np.column_stack([undistorted_px, np.ones(len(undistorted_px))])
    denominator = homogeneous @ last_row
    variance = covariance_px2 @ last_row[:2] @ last_row[:2] + ((homogeneous @ root[6:9]) ** 2).sum(axis=1)
    exact = variance == 0.0
    margin: FloatArray = denominator / np.sqrt(np.where(exact, 1.0, variance))
    margin[exact & (denominator > 0)] = np.inf
    return margin


def relief_covariance(ground: GroundMap, undistorted_px: FloatArray, height_sigma_m: float) -> FloatArray:
    """Return what ground that lies higher or lower than the map's plane does to a place: it moves along the view.

    The angle of the view is taken from the map alone, which is exact in the middle of the picture; towards its edges
    the standard error is off by up to a sixth.

    Args:
        ground: The map.
        undistorted_px: (N, 2) the points without lens distortion.
        height_sigma_m: Standard deviation of the ground's height.

    Returns:
        (N, 2, 2) metres squared; NaN where the point is.
    """
    covariance: FloatArray = np.full((len(undistorted_px), 2, 2), np.nan)
    jacobian = homography.point_jacobian(ground.image_to_ground, undistorted_px)
    usable = np.isfinite(jacobian).all(axis=(1, 2))
    # A pixel covers most ground along the view, and least across it, by the sine of the angle at which it is seen.
    directions, extents, _ = np.linalg.svd(jacobian[usable])
    sine = extents[:, 1] / extents[:, 0]
    along = directions[:, :, 0] * (height_sigma_m * np.sqrt(1.0 - sine**2) / sine)[:, None]
    covariance[usable] = along[:, :, None] * along[:, None, :]
    return covariance
