"""Lines, dashes, fills and labels on a picture, all sized in proportion to it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray
from standoff.drawing.fixed_point import FAR_PX, SHIFT
from standoff.drawing.palette import Bgr, bgr
from standoff.drawing.text import TextSprites, write_light

_MOST_DASHES = 600

Rectangle = tuple[int, int, int, int]


class Painter:
    """Draw on one picture.

    Labels are placed where no earlier label is, so draw the important ones first.

    Args:
        canvas: (H, W, 3) uint8 BGR, drawn on in place.
        text: Where text comes from.
        size: Factor on the usual sizes of text and lines.
    """

    def __init__(self, canvas: ImageArray, text: TextSprites, size: float = 1.0) -> None:
        self._canvas, self._text = canvas, text
        height = size * canvas.shape[0]
        self.stroke_px: int = max(1, round(height / 340))
        self.font_px: int = max(11, round(height / 54))
        self._taken: list[Rectangle] = []

    def shows(self, xyxy_px: Sequence[float]) -> bool:
        """Return whether a part of a box lies on the canvas."""
        height, width = self._canvas.shape[:2]
        x1, y1, x2, y2 = xyxy_px
        return x1 < width and y1 < height and x2 > 0 and y2 > 0

    def line(self, points_px: FloatArray, colour: Bgr, *, dashed: bool = False) -> None:
        """Draw a curve through (N, 2) points without sharp corners, or any polyline in dashes."""
        if dashed:
            self._strokes(_dashes(points_px, self.stroke_px), (colour, self.stroke_px))
        elif np.isfinite(points_px).all():
            # Whoever draws no curve does not wait for the compiler to be loaded.
            from standoff.drawing.strokes import strip

            cv2.fillPoly(self._canvas, [strip(points_px, self.stroke_px)], colour, cv2.LINE_AA, SHIFT)

    def cased_line(self, points_px: FloatArray, colour: Bgr, *, dashed: bool = False) -> None:
        """Draw a polyline with a dark edge, to be seen on any ground."""
        strokes = _dashes(points_px, self.stroke_px) if dashed else points_px[None]
        self._strokes(strokes, (bgr("dark"), self.stroke_px + 2), (colour, self.stroke_px))

    def _strokes(self, strokes_px: FloatArray, *pens: tuple[Bgr, int]) -> None:
        """Draw polylines (K, P, 2) with one pen after another, each a colour and a width."""
        if not strokes_px.size or not np.isfinite(strokes_px).all():
            return
        strokes = list(_fixed_point(strokes_px))
        for colour, width_px in pens:
            cv2.polylines(self._canvas, strokes, False, colour, width_px, cv2.LINE_AA, SHIFT)

    def box(self, xyxy_px: Sequence[float], colour: Bgr, *, dashed: bool = False) -> None:
        """Draw a rectangle."""
        x1, y1, x2, y2 = (min(max(edge_px, -FAR_PX), FAR_PX) for edge_px in xyxy_px)
        if dashed:
            self.line(np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2], [x1, y1]]), colour, dashed=True)
            return
        corners = (round(x1), round(y1)), (round(x2), round(y2))
        cv2.rectangle(self._canvas, *corners, bgr("dark"), self.stroke_px + 2)
        cv2.rectangle(self._canvas, *corners, colour, self.stroke_px)

    def dot(self, point_px: Sequence[float], colour: Bgr, *, hollow: bool = False) -> None:
        """Draw a small disc with a dark edge."""
        x, y = point_px
        if not (math.isfinite(x) and math.isfinite(y)):
            return
        centre = tuple(round(min(max(one_px, -FAR_PX), FAR_PX) * (1 << SHIFT)) for one_px in (x, y))
        radius = (2 + self.stroke_px) << SHIFT
        cv2.circle(self._canvas, centre, radius + (1 << SHIFT), bgr("dark"), -1, cv2.LINE_AA, SHIFT)
        thickness = self.stroke_px if hollow else -1
        cv2.circle(self._canvas, centre, radius, colour, thickness, cv2.LINE_AA, SHIFT)

    def fill(self, outline_px: FloatArray, colour: Bgr, opacity: float, holes_px: Sequence[FloatArray] = ()) -> None:
        """Tint the inside of an outline, without what is inside the outlines of holes."""
        if len(outline_px) < 3:
            return
        height, width = self._canvas.shape[:2]
        outlines = [_fixed_point(one) for one in (outline_px, *holes_px)]
        left, top, wide, high = cv2.boundingRect(outlines[0] >> SHIFT)
        x0, y0 = max(left, 0), max(top, 0)
        x1, y1 = min(left + wide, width), min(top + high, height)
        if x0 >= x1 or y0 >= y1:
            return
        area = self._canvas[y0:y1, x0:x1]
        tinted = area.copy()
        corner = np.array([x0, y0], dtype=np.int32) * (1 << SHIFT)
        cv2.fillPoly(tinted, [outline - corner for outline in outlines], colour, cv2.LINE_8, SHIFT)
        cv2.addWeighted(tinted, opacity, area, 1.0 - opacity, 0.0, dst=area)

    def label_size_px(self, text: str, *, bold: bool = False) -> tuple[int, int]:
        """Return the (width, height) of a label."""
        height, width = self._text.sprite(text, self.font_px, bold=bold).shape[:2]
        return width + 2 * self._pad_x, height + 2

    @property
    def _pad_x(self) -> int:
        return max(5, self.font_px // 2)

    def label(
        self,
        text: str,
        corners_px: Sequence[tuple[float, float]],
        *,
        accent: Bgr | None = None,
        bold: bool = False,
        optional: bool = False,
    ) -> None:
        """Put text on a dark translucent ground at the first place where it covers no earlier label.

        Args:
            text: One line.
            corners_px: Top left corners to try, best first; each is moved into the canvas.
            accent: Colour of a bar at the left edge.
            bold: Heavier type.
            optional: Leave the label out when there is no free place, instead of covering another.
        """
        size = self.label_size_px(text, bold=bold)
        place = self._free_place(corners_px, size)
        if place is None and optional:
            return
        x0, y0, x1, y1 = place = place or self._inside(corners_px[0], size)
        self._taken.append(place)
        area = self._canvas[y0:y1, x0:x1]
        cv2.convertScaleAbs(area, dst=area, alpha=0.28, beta=14)
        if accent is not None:
            self._canvas[y0:y1, x0 : x0 + max(3, self.font_px // 4)] = accent
        write_light(self._canvas, self._text.sprite(text, self.font_px, bold=bold), x0 + self._pad_x, y0 + 1)

    def title(self, text: str, corner_px: tuple[int, int]) -> None:
        """Write bold text, straight onto the picture."""
        write_light(self._canvas, self._text.sprite(text, self.font_px, bold=True), *corner_px)

    def reserve(self, rectangle: Rectangle) -> None:
        """Keep labels away from left, top, right, bottom."""
        self._taken.append(rectangle)

    def _inside(self, corner_px: tuple[float, float], size_px: tuple[int, int]) -> Rectangle:
        height, width = self._canvas.shape[:2]
        x0 = int(min(max(corner_px[0], 0), max(width - size_px[0], 0)))
        y0 = int(min(max(corner_px[1], 0), max(height - size_px[1], 0)))
        return x0, y0, min(x0 + size_px[0], width), min(y0 + size_px[1], height)

    def _free_place(self, corners_px: Sequence[tuple[float, float]], size_px: tuple[int, int]) -> Rectangle | None:
        """Return the first place of a label that covers no earlier one; None where all do."""
        for corner_px in corners_px:
            x0, y0, x1, y1 = place = self._inside(corner_px, size_px)
            for left, top, right, bottom in self._taken:
                if x0 < right and left < x1 and y0 < bottom and top < y1:
                    break
            else:
                return place
        return None


def _dashes(points_px: FloatArray, stroke_px: int) -> FloatArray:
    """Cut a polyline into dashes, (K, 2, 2); one that is too long to be seen as a whole is left as it is."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points_px, axis=0), axis=1))])
    count = along[-1] / (8.0 * stroke_px)
    if not 1.0 <= count <= _MOST_DASHES:
        return points_px[None]
    period = along[-1] / np.ceil(count)
    starts = period * np.arange(np.ceil(count))
    ends = starts + 0.55 * period
    at = np.column_stack([starts, ends]).ravel()
    return np.column_stack([np.interp(at, along, points_px[:, k]) for k in (0, 1)]).reshape(-1, 2, 2)


def _fixed_point(points_px: FloatArray) -> npt.NDArray[np.int32]:
    bounded = np.maximum(np.minimum(points_px, FAR_PX), -FAR_PX)
    fixed: npt.NDArray[np.int32] = np.rint(bounded * (1 << SHIFT)).astype(np.int32)
    return fixed
