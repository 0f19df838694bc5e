"""From the error of a box and of the ground map to the error of a position, first order."""

from __future__ import annotations

import numpy as np

from standoff.core import homography
from standoff.core.homography import FloatArray
from standoff.core.map_error import picture_jacobian
from standoff.core.types import GroundMap


def own_covariance(ground: GroundMap, undistorted_px: FloatArray, covariance_px2: FloatArray) -> FloatArray:
    """Carry the error of each picture point to the ground, lens and perspective included.

    Args:
        ground: The map.
        undistorted_px: (N, 2) the points without lens distortion.
        covariance_px2: (N, 2, 2) of the points, as seen in the picture.

    Returns:
        (N, 2, 2) metres squared, without the map's share; NaN where the point is.
    """
    jacobian = picture_jacobian(ground, undistorted_px)
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


def relief_covariance(ground: GroundMap, undistorted_px: FloatArray, usual_sigma_m: float) -> FloatArray:
    """Return what ground that lies higher or lower than the map's plane does to a place: it moves along the view.

    The angle of the view is taken from the map alone, which is exact in the middle of the picture; towards its edges
    the standard error is off by up to a sixth.

    Args:
        ground: The map.
        undistorted_px: (N, 2) the points without lens distortion.
        usual_sigma_m: Standard deviation of the ground's height, where nobody surveyed heights.

    Returns:
        (N, 2, 2) metres squared; NaN where the point is.
    """
    covariance: FloatArray = np.full((len(undistorted_px), 2, 2), np.nan)
    jacobian = homography.point_jacobian(ground.image_to_ground, undistorted_px)
    usable = np.isfinite(jacobian).all(axis=(1, 2))
    height_sigma_m = np.full(len(undistorted_px), usual_sigma_m)
    if ground.relief is not None:
        height_sigma_m = ground.relief.sigma_at(homography.apply(ground.image_to_ground, undistorted_px)[0])
    # A pixel covers most ground along the view, and least across it, by the sine of the angle at which it is seen.
    directions, extents, _ = np.linalg.svd(jacobian[usable])
    sine = extents[:, 1] / extents[:, 0]
    along = directions[:, :, 0] * (height_sigma_m[usable] * np.sqrt(1.0 - sine**2) / sine)[:, None]
    covariance[usable] = along[:, :, None] * along[:, None, :]
    return covariance
