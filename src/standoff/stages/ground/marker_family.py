"""The families of printed markers, and what each of their markers looks like.

A marker is upright as the AprilTag project publishes it. OpenCV has the AprilTag families upside down, and its
corners run the other way around; both are put right here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Literal, get_args

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.errors import GroundError
from standoff.core.homography import BoolArray

MarkerFamily = Literal["apriltag36h11", "apriltag25h9", "aruco6x6_50"]
"""Smaller codes (4 x 4, 5 x 5) are left out: dark things on sites read like them, and are explained by them."""

MARKER_FAMILIES: tuple[MarkerFamily, ...] = get_args(MarkerFamily)

_DICTIONARIES: Mapping[MarkerFamily, int] = MappingProxyType({
    "apriltag36h11": cv2.aruco.DICT_APRILTAG_36h11,
    "apriltag25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "aruco6x6_50": cv2.aruco.DICT_6X6_50,
})  # fmt: skip
_UPSIDE_DOWN = ("apriltag36h11", "apriltag25h9")


def marker_dictionary(family: MarkerFamily) -> Any:  # noqa: ANN401
    """Return OpenCV's dictionary of a family.

    Raises:
        GroundError: There is no such family.
    """
    if family not in _DICTIONARIES:
        raise GroundError(
            expected=f"a marker family, one of {', '.join(MARKER_FAMILIES)}",
            found=repr(family),
            fix="choose one of them",
        )
    return cv2.aruco.getPredefinedDictionary(_DICTIONARIES[family])


def marker_count(family: MarkerFamily) -> int:
    """Return how many markers a family has; their ids are 0 to one less.

    >>> marker_count("apriltag36h11")
    587
    """
    return len(marker_dictionary(family).bytesList)


@lru_cache(maxsize=64)
def marker_pattern(family: MarkerFamily, marker_id: int) -> BoolArray:
    """Return the modules of a marker, its black border included, without the white around it.

    Args:
        family: Of which family.
        marker_id: Which of its markers.

    Returns:
        (n, n), True where a module is white; row 0 is the upper one of the upright marker.

    Raises:
        GroundError: The family has no such marker.

    >>> marker_pattern("apriltag36h11", 0).astype(int).tolist()[1]
    [0, 1, 1, 0, 1, 0, 1, 0]
    """
    count = marker_count(family)
    if not 0 <= marker_id < count:
        raise GroundError(
            expected=f"an id from 0 to {count - 1} for {family}",
            found=str(marker_id),
            fix="choose another id or family",
        )
    dictionary = marker_dictionary(family)
    drawn = cv2.aruco.generateImageMarker(dictionary, marker_id, dictionary.markerSize + 2, borderBits=1)
    white: BoolArray = np.ascontiguousarray(_upright(drawn, family) > 127)
    white.setflags(write=False)
    return white


def _upright(drawn: npt.NDArray[np.uint8], family: MarkerFamily) -> npt.NDArray[np.uint8]:
    return np.rot90(drawn, 2) if family in _UPSIDE_DOWN else drawn


def corner_order(family: MarkerFamily) -> list[int]:
    """Return which of OpenCV's corners are ours: lower left, lower right, upper right, upper left when upright."""
    return [1, 0, 3, 2] if family in _UPSIDE_DOWN else [3, 2, 1, 0]
