"""From a camera's view of the site to the ground map, with its errors."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray, invert
from standoff.core.pose import CHANGES, View
from standoff.core.types import GroundMap

_STEP = np.array([1e-5] * 3 + [1e-4] * 3 + [1e-5] * 2)


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
    """
    entries = _entries(view)
    by_view = np.zeros((10, CHANGES))
    for k in range(CHANGES):
        step = np.zeros(CHANGES)
        step[k] = _STEP[k]
        by_view[:9, k] = (_entries(view.changed(step)) - _entries(view.changed(-step))) / (2.0 * _STEP[k])
    by_view[9, 7] = 1.0
    total = by_view @ covariance @ by_view.T
    matrix = entries.reshape(3, 3)
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
    )


def _entries(view: View) -> FloatArray:
    """Return the nine entries of the signed map from undistorted pixels to the ground, at unit norm."""
    matrix = invert(view.plane_to_pinhole())
    entries: FloatArray = (matrix / np.linalg.norm(matrix)).ravel()
    return entries
