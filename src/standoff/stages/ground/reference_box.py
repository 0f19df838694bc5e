"""Where in the picture the reference object is: a box given for one frame, or the detector's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from standoff.core.classes import Role, class_ids
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, NoGroundMap

NOT_SEEN = "no detection of the reference"
NOT_YET = "the reference's box is given for a later frame"

_LATE_S = 0.5
"""A box given for a time that the source starts after by more than this is a mistake."""

_TIME_SLACK_S = 1e-3


class GivenPlace:
    """What the operator said of where the reference is in one frame.

    Args:
        box_xyxy_px: (4,) left, top, right, bottom; None: the detector finds it.
        box_time_s: Presentation timestamp of that frame; None: the first frame.
        first_corner_px: (2,) about where corner 0 of the shape is in that frame, or, without a box, where it is when
            the detector first sees the reference; None: no hint.

    Raises:
        GroundError: The box, its time or the hint make no sense.
    """

    def __init__(
        self,
        box_xyxy_px: Sequence[float] | FloatArray | None = None,
        box_time_s: float | None = None,
        first_corner_px: Sequence[float] | FloatArray | None = None,
    ) -> None:
        self.box_xyxy_px = None if box_xyxy_px is None else _checked_box(box_xyxy_px)
        self.time_s = box_time_s
        self.first_corner_px = None if first_corner_px is None else _checked_corner(first_corner_px, self.box_xyxy_px)

    def describe(self) -> dict[str, Any]:
        """Return what a record of the run should say."""
        return {
            "box_xyxy_px": None if self.box_xyxy_px is None else self.box_xyxy_px.tolist(),
            "box_time_s": self.time_s,
            "first_corner_px": None if self.first_corner_px is None else self.first_corner_px.tolist(),
        }

    def check_size(self, size_px: tuple[int, int]) -> None:
        """Make sure that the box lies in pictures of a size (width, height).

        Raises:
            GroundError: It does not.
        """
        width, height = size_px
        if self.box_xyxy_px is not None:
            left, top, right, bottom = self.box_xyxy_px
            if left >= width or top >= height or right <= 0 or bottom <= 0:
                raise box_error(f"a box in the picture of {width}x{height}", f"{self.box_xyxy_px.tolist()}")

    def box_at(self, time_s: float) -> FloatArray | NoGroundMap:
        """Return the given box for the first frame that it can be used for.

        Raises:
            GroundError: The frame that it was given for has passed without being read.
        """
        assert self.box_xyxy_px is not None, "there is a box"
        if self.time_s is None:
            return self.box_xyxy_px
        if time_s < self.time_s - _TIME_SLACK_S:
            return NoGroundMap(NOT_YET)
        if time_s > self.time_s + _LATE_S:
            raise box_error(
                f"a frame at {self.time_s:g} s, for which the reference's box is given",
                f"the first frame after it at {time_s:g} s",
            )
        return self.box_xyxy_px


def detected_box(
    detections: Detections,
    min_score: float,
    near_box_px: FloatArray | None = None,
    taken: Sequence[FloatArray] = (),
) -> FloatArray | None:
    """Return the surest detection of a reference.

    Args:
        detections: Of a frame.
        min_score: Those less sure do not count.
        near_box_px: (4,) an earlier box; only those near it count. None: all do.
        taken: (4,) each: boxes of other references, whose detections do not count.
    """
    seen = np.isin(detections.class_id, class_ids(Role.REFERENCE)) & (detections.score >= min_score)
    if near_box_px is not None:
        centre, diagonal = _centre_and_diagonal(near_box_px)
        centres = (detections.xyxy_px[:, :2] + detections.xyxy_px[:, 2:]) / 2.0
        seen &= np.linalg.norm(centres - centre, axis=1) <= diagonal
    for other in taken:
        middle = (other[:2] + other[2:]) / 2.0
        seen &= ~((detections.xyxy_px[:, :2] <= middle) & (middle <= detections.xyxy_px[:, 2:])).all(axis=1)
    if not seen.any():
        return None
    box: FloatArray = detections.xyxy_px[int(np.where(seen, detections.score, -1.0).argmax())]
    return box


def _centre_and_diagonal(box_xyxy_px: FloatArray) -> tuple[FloatArray, float]:
    return (box_xyxy_px[:2] + box_xyxy_px[2:]) / 2.0, float(np.linalg.norm(box_xyxy_px[2:] - box_xyxy_px[:2]))


def _checked_box(box_xyxy_px: Sequence[float] | FloatArray) -> FloatArray:
    expected = "a reference box of left, top, right, bottom in px"
    box = np.array(box_xyxy_px, dtype=np.float64)
    if box.shape != (4,) or not np.isfinite(box).all():
        raise box_error(expected, f"{box.tolist()}")
    if box[2] <= box[0] or box[3] <= box[1]:
        raise box_error(expected, f"{box.tolist()}, whose right or bottom does not exceed its left or top")
    return box


def _checked_corner(first_corner_px: Sequence[float] | FloatArray, box: FloatArray | None) -> FloatArray:
    corner = np.array(first_corner_px, dtype=np.float64)
    if corner.shape != (2,) or not np.isfinite(corner).all():
        raise box_error("first_corner_px x, y", f"{corner.tolist()}")
    if box is not None:
        slack = 0.2 * (box[2:] - box[:2])
        if not ((corner >= box[:2] - slack) & (corner <= box[2:] + slack)).all():
            raise box_error(f"first_corner_px x, y in the reference's box {box.tolist()}", f"{corner.tolist()}")
    return corner


def box_error(expected: str, found: str) -> GroundError:
    """Return the error for a box that makes no sense."""
    return GroundError(expected=expected, found=found, fix="read the box off one frame and give that frame's time")
