"""How likely somebody whose place is not certain is in a zone."""

from __future__ import annotations

import numpy as np
from scipy.special import owens_t

from standoff.core.homography import FloatArray

_LEAST_SIGMA_M = 1e-3
"""Nobody's place is known better; without it a place without error could not be divided by."""

_FLAT_SIGMAS = 1e-9


def probability_inside(outline_m: FloatArray, xy_m: FloatArray, covariance_m2: FloatArray) -> FloatArray:
    """Integrate the normal distributions of some places over an area.

    Exact: each side of the area and the place make a triangle; seen in units of the standard error, the share of the
    distribution in it is an angle less two of Owen's T, and the shares add up with the signs of the triangles.

    Args:
        outline_m: (E, 2, 2) begin and end of every side, outer rings counter-clockwise and holes clockwise.
        xy_m: (N, 2) places.
        covariance_m2: (N, 2, 2) of them.

    Returns:
        (N,) from 0 to 1; NaN where place or covariance is.

    Source:
        Owen, Tables for computing bivariate normal probabilities, Ann. Math. Statist. 27 (1956), section on polygons.

    >>> half_plane = np.array([[[0, -90], [90, -90]], [[90, -90], [90, 90]], [[90, 90], [0, 90]], [[0, 90], [0, -90]]])
    >>> probability_inside(half_plane, np.array([[0.0, 0.0], [1.0, 0.0]]), np.tile(np.eye(2), (2, 1, 1))).round(4)
    array([0.5   , 0.8413])
    """
    known = np.isfinite(xy_m).all(axis=1) & np.isfinite(covariance_m2).all(axis=(1, 2))
    inside = np.full(len(xy_m), np.nan)
    if known.any():
        seen = _in_sigmas(outline_m, xy_m[known], covariance_m2[known])
        inside[known] = np.clip(_shares(seen[:, :, 0], seen[:, :, 1]).sum(axis=1), 0.0, 1.0)
    return inside


def _in_sigmas(outline_m: FloatArray, xy_m: FloatArray, covariance_m2: FloatArray) -> FloatArray:
    """Return (N, E, 2, 2) the outline around each place, stretched so that the place's distribution is round."""
    # Where the place is told by hundreds of metres in one direction only, rounding may take the other below nothing.
    wide = np.sqrt(np.maximum(covariance_m2[:, 0, 0], _LEAST_SIGMA_M**2))[:, None, None]
    tilt = covariance_m2[:, 0, 1][:, None, None] / wide
    narrow = np.sqrt(np.maximum(covariance_m2[:, 1, 1][:, None, None] - tilt**2, _LEAST_SIGMA_M**2))
    around = outline_m - xy_m[:, None, None]
    x = around[..., 0] / wide
    y = (around[..., 1] - tilt * x) / narrow
    return np.stack([x, y], axis=-1)


def _shares(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return (N, E) the share of a round distribution in the triangle of its middle and a side, signed."""
    along = end - start
    length = np.linalg.norm(along, axis=-1)
    unit = along / np.where(length > 0, length, 1.0)[..., None]
    height = start[..., 0] * unit[..., 1] - start[..., 1] * unit[..., 0]
    # A triangle of hardly any height has hardly anything in it.
    flat = np.abs(height) < _FLAT_SIGMAS
    off = np.where(flat, 1.0, np.abs(height))
    first, second = ((end_of * unit).sum(axis=-1) / off for end_of in (start, end))
    angles = (np.arctan(second) - np.arctan(first)) / (2.0 * np.pi)
    shares: FloatArray = np.sign(height) * (angles - owens_t(off, second) + owens_t(off, first))
    return np.where(flat, 0.0, shares)
