"""Find the inner corners of a printed checkerboard, to a fraction of a pixel.

OpenCV's classic finder goes first, its sector-based one (findChessboardCornersSB) where that fails, and
both are refined by cornerSubPix in a window that follows the size of the squares. Measured on 13 photographs
of a 9 x 6 board as the reprojection RMS of a calibration: sector-based alone 0.256 px, classic with the usual
fixed half-window of 11 px 0.41, of 5 px 0.195, with three tenths of the smallest square 0.181. Beyond four
tenths the window reaches the next corner and the result collapses (0.94).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from standoff.core.errors import GroundError, SourceError
from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray
from standoff.files.lfs import refuse_pointer

PICTURE_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
_SMALLEST_SQUARE_M, _LARGEST_SQUARE_M = 0.001, 5.0
"""From boards for microscopes to boards painted on the ground."""
_WINDOW_OF_SQUARE = 0.3
_SUBPIXEL_STOP = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-4)


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """One photograph of the board.

    Attributes:
        name: File name.
        image_size_px: (width, height).
        corners_px: (rows, columns, 2) inner corners as seen in the picture, neighbours next to each other;
            which end comes first is the finder's choice. (0, 0, 2) where no board was found.
    """

    name: str
    image_size_px: tuple[int, int]
    corners_px: FloatArray

    @property
    def found(self) -> bool:
        """Whether the whole board was found."""
        return self.corners_px.size > 0


def check_square(square_m: float) -> None:
    """Refuse a square that no board has: a side in another unit.

    Raises:
        GroundError: It is; says which unit is likely.
    """
    if not (square_m > 0 and np.isfinite(square_m)):
        raise GroundError(expected="a square with a positive side", found=f"{square_m} m", fix="measure one square")
    if not _SMALLEST_SQUARE_M <= square_m <= _LARGEST_SQUARE_M:
        raise GroundError(
            expected=f"squares of {1000 * _SMALLEST_SQUARE_M:g} to {1000 * _LARGEST_SQUARE_M:g} mm",
            found=f"{1000 * square_m:g} mm, likely in {'metres' if square_m < _SMALLEST_SQUARE_M else 'micrometres'}",
            fix="give the side of one square in millimetres",
        )


def find_corners(gray: ImageArray, pattern: tuple[int, int]) -> FloatArray:
    """Find the inner corners of a whole board.

    Args:
        gray: (H, W) uint8.
        pattern: (columns, rows) of inner corners, each at least 3.

    Returns:
        (rows, columns, 2) pixels; (0, 0, 2) where no whole board is seen.
    """
    columns, rows = pattern
    found, corners = cv2.findChessboardCorners(gray, pattern)
    if not found:
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        found, corners = cv2.findChessboardCornersSB(gray, pattern, flags=flags)
    if not found:
        return np.zeros((0, 0, 2))
    grid = corners.reshape(rows, columns, 2)
    smallest_px = min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1))
    half_window_px = max(2, int(_WINDOW_OF_SQUARE * smallest_px))
    refined = cv2.cornerSubPix(gray, corners, (half_window_px, half_window_px), (-1, -1), _SUBPIXEL_STOP)
    corners_px: FloatArray = refined.reshape(rows, columns, 2).astype(np.float64)
    return corners_px


def read_boards(pictures: Path | str | Iterable[Path], pattern: tuple[int, int]) -> tuple[BoardView, ...]:
    """Look for the board in photographs.

    Args:
        pictures: A folder, whose pictures are taken in the order of their names and whose other files are
            left alone; or picture files. They are taken as the sensor has them, however EXIF data say to turn them.
        pattern: (columns, rows) of inner corners.

    Returns:
        One view a picture, also where no board was found.

    Raises:
        SourceError: There is no picture, a picture cannot be read, or the pattern is impossible.
    """
    if min(pattern) < 3:
        found = f"{pattern[0]}x{pattern[1]}"
        fix = "count the corners where four squares meet, not the squares"
        raise SourceError(expected="a pattern of at least 3x3 inner corners", found=found, fix=fix)
    paths = _pictures_in(Path(pictures)) if isinstance(pictures, (Path, str)) else tuple(map(Path, pictures))
    if not paths:
        raise SourceError(expected="photographs of the board", found="none", fix="give picture files")
    return tuple(_read_view(path, pattern) for path in paths)


def _pictures_in(folder: Path) -> tuple[Path, ...]:
    if not folder.is_dir():
        found = f"{folder}, which is {'a file' if folder.exists() else 'not there'}"
        raise SourceError(expected="a folder of photographs of the board", found=found, fix="check the path")
    paths = tuple(sorted(path for path in folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES))
    if not paths:
        fix = f"put the photographs there ({', '.join(PICTURE_SUFFIXES)})"
        raise SourceError(expected="photographs of the board", found=f"none in {folder}", fix=fix)
    return paths


def _read_view(path: Path, pattern: tuple[int, int]) -> BoardView:
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise SourceError(expected="a picture", found=f"{path}: {error.strerror}", fix="check the path") from None
    # As the sensor has it: one that was held upright for some pictures has one lens, and its axis one place.
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    gray = cv2.imdecode(data, flags) if data.size else None
    if gray is None:
        refuse_pointer(path, f"a picture in {path}", SourceError)
        fix = "replace the file or take it out of the folder"
        raise SourceError(expected="a picture", found=f"{path}, which cannot be decoded", fix=fix)
    height_px, width_px = gray.shape
    return BoardView(path.name, (width_px, height_px), find_corners(gray, pattern))
