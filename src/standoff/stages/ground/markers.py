"""Find printed markers (AprilTag, ArUco) in a picture, also where they are less than twenty pixels wide.

OpenCV proposes quadrilaterals and the likeliest id of each, with as many wrong bits as the family can bear, because
at three pixels a module bits are often wrong. Whether it is that marker is decided afterwards and much more strictly:
its whole drawing is laid over the picture, and has to explain it. That also gives corners to a tenth of a pixel.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.rows import Columns, Rows
from standoff.core.types import ImageArray, IntArray
from standoff.stages.ground.marker_alignment import Alignment, align
from standoff.stages.ground.marker_family import MarkerFamily, corner_order, marker_dictionary, marker_pattern

_LEAST_SIDE_PX = 10.0
_LEAST_LIKENESS = 0.8
"""Drawing and picture must be so alike; markers reach 0.85 at dusk, 0.94 otherwise, and nothing else comes near."""

_SIGMA_FACTOR = 2.0
"""What the drawing leaves unexplained is not independent from pixel to pixel, least of all after H.264, which also
moves whole blocks by fractions of a pixel (the floor). Both measured on drawn films."""
_SIGMA_FLOOR_PX = 0.1
_ENLARGED_PX = 700_000
"""Pictures with fewer pixels are searched at twice their size: it finds smaller markers, and takes no long time."""

_LARGE_SIDE_PX = 35.0
_SHARPER = 1.0
_BLUR_PX = 1.2


@dataclass(frozen=True, slots=True, eq=False)
class Markers(Rows):
    """Markers that were found in one picture, in the order of their ids.

    Attributes:
        ids: (N,) within their family.
        corners_px: (N, 4, 2) as seen in the picture, outer corners of the black square: lower left, lower right,
            upper right, upper left of the upright marker, counter-clockwise seen from above.
        sigma_px: (N, 4) standard error of a corner's coordinates.
    """

    ids: IntArray
    corners_px: FloatArray
    sigma_px: FloatArray

    _COLUMNS: ClassVar[Columns] = {
        "ids": (np.int64, ()),
        "corners_px": (np.float64, (4, 2)),
        "sigma_px": (np.float64, (4,)),
    }


def find_markers(
    gray: ImageArray, family: MarkerFamily, *, wanted: Collection[int] | None = None, expected_px: float | None = None
) -> Markers:
    """Find the markers of a family.

    Args:
        gray: (H, W) uint8, as seen: lens distortion need not be removed.
        family: Of which family.
        wanted: Ids that there can be; None for any.
        expected_px: About how long a side is, which saves time where it is long; None if nobody knows.

    Returns:
        Each marker once, the likeliest where an id was read twice.

    Raises:
        GroundError: There is no such family.
    """
    best: dict[int, Alignment] = {}
    for marker_id, corners_px in _proposals(gray, family, expected_px):
        if wanted is not None and marker_id not in wanted:
            continue
        found = align(gray, corners_px, marker_pattern(family, marker_id))
        if found.correlation >= max(_LEAST_LIKENESS, best[marker_id].correlation if marker_id in best else 0.0):
            best[marker_id] = found
    if not best:
        return Markers.empty()
    chosen = sorted(best)
    sigma_px = np.hypot(_SIGMA_FACTOR * np.stack([best[one].sigma_px for one in chosen]), _SIGMA_FLOOR_PX)
    return Markers(np.array(chosen), np.stack([best[one].corners_px for one in chosen]), sigma_px)


def _proposals(gray: ImageArray, family: MarkerFamily, expected_px: float | None) -> list[tuple[int, FloatArray]]:
    """Return ids and (4, 2) corners of what may be a marker."""
    if min(gray.shape) < 2 * _LEAST_SIDE_PX:
        return []
    large = expected_px is not None and expected_px > _LARGE_SIDE_PX
    enlarged = 2 if gray.size < _ENLARGED_PX and not large else 1
    if enlarged > 1:
        gray = cv2.resize(gray, None, fx=enlarged, fy=enlarged, interpolation=cv2.INTER_CUBIC)
    blurred = cv2.GaussianBlur(gray, (0, 0), _BLUR_PX * enlarged)
    sharp = cv2.addWeighted(gray, 1.0 + _SHARPER, blurred, -_SHARPER, 0.0)
    least_share = 4.0 * _LEAST_SIDE_PX * enlarged / max(gray.shape)
    quads, ids, _ = _detector(family, least_share).detectMarkers(sharp)
    order = corner_order(family)
    return [
        (int(marker_id), (quad.reshape(4, 2)[order].astype(np.float64) + 0.5) / enlarged - 0.5)
        for quad, marker_id in zip(quads, [] if ids is None else ids.ravel(), strict=True)
    ]


@lru_cache(maxsize=32)
def _detector(family: MarkerFamily, least_perimeter_share: float) -> Any:  # noqa: ANN401
    settings = cv2.aruco.DetectorParameters()
    settings.minMarkerPerimeterRate = least_perimeter_share
    settings.perspectiveRemovePixelPerCell = 8
    # Only the middle of a module tells its colour where modules are three pixels wide.
    settings.perspectiveRemoveIgnoredMarginPerCell = 0.25
    settings.errorCorrectionRate = 1.01
    settings.minDistanceToBorder = 1
    # By default the sheet's own edge counts as the same candidate, and may be the one that is kept.
    settings.minMarkerDistanceRate = 0.05
    return cv2.aruco.ArucoDetector(marker_dictionary(family), settings)
