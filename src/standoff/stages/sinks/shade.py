"""Ground that is not watched, as pictures show it: a little darker, under thin diagonals."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray
from standoff.core.watched_ground import BEHIND_MACHINE, COLUMNS, ROWS, WATCHED, CellArray

Opacity = npt.NDArray[np.uint8]

_FINER = 8
_STEEPNESS = 3.0
_DARKER, _LIGHTER = 24, 18
_LINES_IN_HEIGHT = 42
_LINE_IN_HEIGHT = 340


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
    """Darken and hatch parts of pictures of one size.

    Args:
        size_px: Their (width, height).
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        self.size_px = size_px
        self._lines = diagonals(size_px)
        self._darker = self._lighter = np.zeros((0, 0, 3), dtype=np.uint8)

    def set(self, opacity: Opacity) -> None:
        """Take where to draw from now on, (H, W) of 255."""
        darker = cv2.convertScaleAbs(opacity, alpha=_DARKER / 255.0)
        lighter = cv2.convertScaleAbs(cv2.bitwise_and(opacity, self._lines), alpha=(_DARKER + _LIGHTER) / 255.0)
        self._darker, self._lighter = (np.asarray(cv2.merge([one] * 3)) for one in (darker, lighter))

    def draw(self, canvas: ImageArray) -> None:
        """Draw over a picture, in place."""
        # Dark ground shows the lines, bright ground the shade; both operations saturate, and cost a tenth of a blend.
        cv2.subtract(canvas, self._darker, dst=canvas)
        cv2.add(canvas, self._lighter, dst=canvas)


class PictureShade:
    """Hatch the ground in the camera's pictures on which a worker would not be found.

    What is behind a machine is left alone: the picture shows the machine there.
    """

    def __init__(self) -> None:
        self._shade = Shade((0, 0))
        self._drawn: tuple[bytes, bytes] | None = None

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
            self._shade, self._drawn = Shade((width, height)), None
        if self._drawn != (marked.tobytes(), part.tobytes()):
            self._drawn = marked.tobytes(), part.tobytes()
            regions = smooth_regions(marked)
            x0, y0, x1, y1 = np.rint(part * np.tile(regions.shape[::-1], 2)).astype(int)
            shown = np.ascontiguousarray(regions[y0 : max(y1, y0 + 1), x0 : max(x1, x0 + 1)])
            self._shade.set(np.asarray(cv2.resize(shown, (width, height)), dtype=np.uint8))
        self._shade.draw(canvas)
