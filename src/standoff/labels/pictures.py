"""Picture files: find them, read their size, load their pixels.

Pictures are taken as stored: a rotation that only EXIF asks for is never applied, neither to the size nor to the
pixels, because boxes belong to one of the two and label files do not say which.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from PIL import Image, UnidentifiedImageError

from standoff.core.errors import DataError
from standoff.core.types import ImageArray
from standoff.files.lfs import POINTER, is_pointer, refuse_pointer
from standoff.labels.source import BadPicture
from standoff.labels.types import UNREADABLE, LabelledPicture

SUFFIXES: Final = frozenset({".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp"})
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
    found = (path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES)
    return sorted(path for path in found if not any(part.startswith(".") for part in path.relative_to(folder).parts))


def first_file(candidates: Sequence[Path]) -> Path:
    """Return the first of some paths that is a file; the very first if none is."""
    for candidate in candidates:
        # a name out of a damaged label file may be too long to be looked for
        with suppress(OSError):
            if candidate.is_file():
                return candidate
    return candidates[0]


def read_size_px(path: Path) -> tuple[int, int]:
    """Return a picture's (width, height) from its header alone.

    Raises:
        BadPicture: There is no such file, or its header cannot be read.
    """
    try:
        with Image.open(path) as picture:
            return picture.size
    except FileNotFoundError as error:
        raise BadPicture(path, "no such file", "picture missing") from error
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        reason = POINTER if is_pointer(path) else f"not a picture ({_reason(error)})"
        raise BadPicture(path, reason, UNREADABLE) from error


def load_picture(picture: LabelledPicture, reduction: int = 1) -> ImageArray:
    """Decode a picture as stored.

    Args:
        picture: Which.
        reduction: 1, 2, 4 or 8: what its sides are divided by, rounded; with JPEG the decoding is quicker for it.

    Returns:
        (H, W, 3) uint8, blue first.

    Raises:
        DataError: It cannot be decoded, is cut short, or has another size than its header said.
    """
    try:
        coded = picture.path.read_bytes()
        if not coded.endswith(_WHOLE_ENDINGS):
            with Image.open(BytesIO(coded)) as strict:
                strict.load()
        image = cv2.imdecode(np.frombuffer(coded, np.uint8), _READ_AS[reduction] | cv2.IMREAD_IGNORE_ORIENTATION)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, cv2.error) as error:
        refuse_pointer(picture.path, f"a picture in {picture.path}", DataError)
        raise _undecodable(picture.path, _reason(error)) from error
    if image is None:
        raise _undecodable(picture.path, "OpenCV cannot decode it")
    width_px, height_px = (side * reduction for side in image.shape[1::-1])
    if abs(width_px - picture.size_px[0]) >= reduction or abs(height_px - picture.size_px[1]) >= reduction:
        expected = f"{picture.size_px[0]}x{picture.size_px[1]} pixels, as the header says, in {picture.path}"
        raise DataError(expected=expected, found=f"{width_px}x{height_px}", fix="save the picture again")
    return np.asarray(image)


def _undecodable(path: Path, reason: str) -> DataError:
    return DataError(expected=f"a picture in {path}", found=reason, fix="restore the file or remove it from the data")


def _reason(error: Exception) -> str:
    """Return what went wrong without the path, which Pillow repeats."""
    if isinstance(error, UnidentifiedImageError):
        return "no known format"
    return str(getattr(error, "strerror", None) or error) or type(error).__name__
