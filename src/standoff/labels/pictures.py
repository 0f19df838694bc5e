"""Picture files: find them, tell how they lie for their labels, load their pixels."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from PIL import Image, UnidentifiedImageError

from standoff.core.errors import DataError
from standoff.core.types import ImageArray
from standoff.files.below import files_below
from standoff.files.lfs import POINTER, is_pointer, refuse_pointer
from standoff.files.orientation import UPRIGHT, Orientation
from standoff.files.picture_header import PictureHeader, UnreadablePicture, read_header
from standoff.labels.source import BadPicture
from standoff.labels.types import UNREADABLE, LabelledPicture, Problem

SUFFIXES: Final = frozenset({".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp"})
TURNED: Final = "turned by EXIF data"
"""Kind of problem of a picture that does not lie in its file as viewers show it."""
_WHOLE_ENDINGS: Final = (b"\xff\xd9", b"IEND\xaeB`\x82")
"""Last bytes of whole JPEG and PNG files. OpenCV decodes half a file without a word and paints the rest grey."""
_READ_AS: Final = {
    1: cv2.IMREAD_COLOR,
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}


def find_pictures(folder: Path) -> list[Path]:
    """Return all pictures in a folder and below it, sorted; hidden ones are left out."""
    return list(files_below(folder, SUFFIXES))


@dataclass(frozen=True, slots=True)
class Canvas:
    """A picture as its labels take it.

    Attributes:
        size_px: (width, height).
        orientation: What makes it of the stored picture.
        notes: Where that is not as stored.
    """

    size_px: tuple[int, int]
    orientation: Orientation = UPRIGHT
    notes: tuple[Problem, ...] = ()


def canvas_of(path: Path, stated_px: tuple[float, float] | None, *, marked: bool) -> Canvas:
    """Return how a picture lies for its labels, from its header alone.

    Where EXIF data turn it, its labels are for the stored picture or for the upright one: the size that they state
    tells, or nothing does.

    Args:
        path: Of the picture.
        stated_px: (width, height) that its labels state; None: they do not.
        marked: Whether there are labels at all; a picture without any is upright.

    Raises:
        BadPicture: It cannot be read, has another size than stated, or is turned nobody knows how.
    """
    header = _read_header(path)
    stored_px, upright_px = header.stored_px, header.size_px
    if stated_px is not None and stated_px not in (stored_px, upright_px):
        swapped = ", width and height swapped" if stated_px == stored_px[::-1] else ""
        found = "{}x{} pixels where its labels say {:g}x{:g}".format(*stored_px, *stated_px)
        raise BadPicture(path, found + swapped, "size differs from labels")
    if header.orientation.is_upright:
        return Canvas(stored_px)
    if header.file_format == "TIFF":
        raise BadPicture(path, "a TIFF file that its orientation turns", TURNED)
    for_stored, for_upright = (stated_px == size_px for size_px in (stored_px, upright_px))
    if marked and for_stored and not for_upright:
        return Canvas(stored_px, UPRIGHT, (_note(path, "turned by its EXIF data, its labels are not: read as stored"),))
    if marked and (for_stored or not for_upright):
        found = "turned by its EXIF data, and its labels may be for the stored or the upright one: save it upright"
        raise BadPicture(path, found, TURNED)
    return Canvas(upright_px, header.orientation, (_note(path, "turned as its EXIF data say"),))


def _note(path: Path, found: str) -> Problem:
    return Problem(path, found, TURNED, skipped_picture=False)


def _read_header(path: Path) -> PictureHeader:
    try:
        return read_header(path)
    except FileNotFoundError as error:
        raise BadPicture(path, "no such file", "picture missing") from error
    except UnreadablePicture as error:
        raise BadPicture(path, POINTER if is_pointer(path) else f"not a picture ({error})", UNREADABLE) from error


def load_picture(picture: LabelledPicture, reduction: int = 1) -> ImageArray:
    """Decode a picture, turned as its labels are.

    Args:
        picture: Which.
        reduction: 1, 2, 4 or 8: what its sides are divided by, rounded; with JPEG the decoding is quicker for it.

    Returns:
        (H, W, 3) uint8, blue first.

    Raises:
        DataError: It cannot be decoded, is cut short, or has another size than its header said.
    """
    image = _decoded(picture.path, picture.orientation, _READ_AS[reduction])
    width_px, height_px = (side * reduction for side in image.shape[1::-1])
    if abs(width_px - picture.size_px[0]) >= reduction or abs(height_px - picture.size_px[1]) >= reduction:
        expected = f"{picture.size_px[0]}x{picture.size_px[1]} pixels, as the header says, in {picture.path}"
        raise DataError(expected=expected, found=f"{width_px}x{height_px}", fix="save the picture again")
    return image


def load_upright(path: Path) -> ImageArray:
    """Decode a picture without labels, turned as its EXIF data say.

    Returns:
        (H, W, 3) uint8, blue first.

    Raises:
        DataError: It cannot be decoded, or is cut short.
    """
    try:
        canvas = canvas_of(path, None, marked=False)
    except BadPicture as error:
        raise _undecodable(path, error.problem.found) from error
    return _decoded(path, canvas.orientation, cv2.IMREAD_COLOR)


def _decoded(path: Path, orientation: Orientation, read_as: int) -> ImageArray:
    try:
        coded = path.read_bytes()
        if not coded.endswith(_WHOLE_ENDINGS):
            with Image.open(BytesIO(coded)) as strict:
                strict.load()
        image = cv2.imdecode(np.frombuffer(coded, np.uint8), read_as | cv2.IMREAD_IGNORE_ORIENTATION)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, cv2.error) as error:
        refuse_pointer(path, f"a picture in {path}", DataError)
        raise _undecodable(path, _reason(error)) from error
    if image is None:
        raise _undecodable(path, "OpenCV cannot decode it")
    return orientation.upright(np.asarray(image))


def _undecodable(path: Path, reason: str) -> DataError:
    return DataError(expected=f"a picture in {path}", found=reason, fix="restore the file or remove it from the data")


def _reason(error: Exception) -> str:
    """Return what went wrong without the path, which Pillow repeats."""
    if isinstance(error, UnidentifiedImageError):
        return "no known format"
    return str(getattr(error, "strerror", None) or error) or type(error).__name__
