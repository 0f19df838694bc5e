"""Ground that is not watched, as pictures show it: a little darker, under thin diagonals."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import GroundMap, ImageArray
from standoff.core.watched_ground import BEHIND_MACHINE, COLUMNS, ROWS, WATCHED, CellArray
from standoff.drawing.ground_window import GroundWindow, rectify

Opacity = npt.NDArray[np.uint8]

_FINER = 8
_STEEPNESS = 3.0
_DARKER, _LIGHTER = 24, 18
_LINES_IN_HEIGHT = 42
_LINE_IN_HEIGHT = 340
_COARSER = 4
_NOTHING: ImageArray = np.zeros((0, 0, 3), dtype=np.uint8)


def diagonals(size_px: tuple[int, int]) -> Opacity:
    """Return (H, W) 255 on the diagonals that mean "not watched" in a picture of this (width, height), 0 elsewhere."""
    width, height = size_px
    spacing, thickness = max(8, round(height / _LINES_IN_HEIGHT)), max(1, round(height / _LINE_IN_HEIGHT))
    along = np.arange(width + height) % spacing < thickness
    rows = np.lib.stride_tricks.sliding_window_view(along, width)[:height]
    return rows.astype(np.uint8) * np.uint8(255)


def smooth_regions(marked: BoolArray) -> Opacity:
    """Return cells (ROWS, COLUMNS) as regions with round corners, eight times finer: 255 inside, 0 outside.

    The middle of each cell keeps what the cell says.
    """
    size_px = (_FINER * COLUMNS, _FINER * ROWS)
    finer = cv2.resize(marked.astype(np.float32), size_px, interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.clip(255.0 * (_STEEPNESS * (finer - 0.5) + 0.5), 0, 255), dtype=np.uint8)


class Shade:
    """Darken and hatch parts of pictures of one size; what it drew is kept while the parts stay the same.

    Args:
        size_px: Their (width, height).
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        self.size_px = size_px
        self._lines = diagonals(size_px)
        self._parts: tuple[bytes, ...] = ()
        self._there = slice(0), slice(0)
        self._darker = self._lighter = _NOTHING

    def draw(self, canvas: ImageArray, parts: tuple[bytes, ...], opacity: Callable[[], Opacity]) -> None:
        """Draw over a picture, in place.

        Args:
            canvas: (H, W, 3) uint8 BGR.
            parts: All that the opacity depends on.
            opacity: Gives (H, W) where to draw, of 255.
        """
        if parts != self._parts:
            self._parts, there = parts, opacity()
            left, top, wide, high = cv2.boundingRect(there)
            self._there = slice(top, top + high), slice(left, left + wide)
            there, lines = there[self._there], self._lines[self._there]
            if not there.size:
                # A part of a picture may show none of what is marked in the whole.
                self._darker = self._lighter = _NOTHING
                return
            darker = cv2.convertScaleAbs(there, alpha=_DARKER / 255.0)
            lighter = cv2.convertScaleAbs(cv2.bitwise_and(there, lines), alpha=(_DARKER + _LIGHTER) / 255.0)
            self._darker, self._lighter = (np.asarray(cv2.merge([one] * 3)) for one in (darker, lighter))
        if not self._darker.size:
            return
        # Dark ground shows the lines, bright ground the shade; both operations saturate, and cost a tenth of a blend.
        marked = canvas[self._there]
        cv2.subtract(marked, self._darker, dst=marked)
        cv2.add(marked, self._lighter, dst=marked)


class PictureShade:
    """Hatch the ground in the camera's pictures on which a worker would not be found.

    What is behind a machine is left alone: the picture shows the machine there.
    """

    def __init__(self) -> None:
        self._shade = Shade((0, 0))

    def draw(self, canvas: ImageArray, cells: CellArray, part: FloatArray) -> None:
        """Draw over a picture, in place.

        Args:
            canvas: (H, W, 3) uint8 BGR.
            cells: As in `WatchedGround`; (0, 0): nobody judged.
            part: (4,) left, top, right and bottom of what the canvas shows, as shares of the whole picture.
        """
        marked = (cells > WATCHED) & (cells != BEHIND_MACHINE)
        if not marked.any():
            return
        height, width = canvas.shape[:2]
        if self._shade.size_px != (width, height):
            self._shade = Shade((width, height))

        def opacity() -> Opacity:
            regions = smooth_regions(marked)
            x0, y0, x1, y1 = np.rint(part * np.tile(regions.shape[::-1], 2)).astype(int)
            shown = np.ascontiguousarray(regions[y0 : max(y1, y0 + 1), x0 : max(x1, x0 + 1)])
            return np.asarray(cv2.resize(shown, (width, height)), dtype=np.uint8)

        self._shade.draw(canvas, (marked.tobytes(), part.tobytes()), opacity)


class GroundShade:
    """Hatch the same ground, and what is behind machines, from above: as the ground outside of the picture looks.

    Args:
        size_px: (width, height) of the panel.
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        self._shade = Shade(size_px)

    def draw(self, panel: ImageArray, cells: CellArray, ground: GroundMap, window: GroundWindow) -> None:
        """Draw over the rectified picture, in place.

        Args:
            panel: (H, W, 3) uint8 BGR.
            cells: As in `WatchedGround`; (0, 0): nobody judged.
            ground: The frame's map.
            window: What the panel shows.
        """
        marked = cells > WATCHED
        if not marked.any():
            return

        def opacity() -> Opacity:
            coarse = window.coarser(_COARSER)
            there = np.zeros(coarse.size_px[::-1], dtype=np.uint8)
            rectify(smooth_regions(marked), ground, coarse, there)
            finer = cv2.resize(there, None, fx=_COARSER, fy=_COARSER)
            return np.ascontiguousarray(finer[: panel.shape[0], : panel.shape[1]], dtype=np.uint8)

        lens = () if ground.camera is None else (ground.camera.matrix, ground.camera.distortion)
        numbers = marked, ground.image_to_ground, window.ground_to_window, *lens
        self._shade.draw(panel, tuple(one.tobytes() for one in numbers), opacity)
