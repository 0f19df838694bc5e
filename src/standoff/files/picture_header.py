"""What a picture file says before its pixels are decoded: its size, how it lies, and whether all of it is there."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from PIL import ExifTags, Image, UnidentifiedImageError

from standoff.files.lfs import FETCH, POINTER, is_pointer
from standoff.files.orientation import Orientation

_JPEG_START, _JPEG_SCAN, _JPEG_END = b"\xff\xd8", b"\xff\xda", b"\xff\xd9"
_PNG_HEAD_BYTES: Final = 8
_TIFF_OFFSETS: Final = ((273, 279), (324, 325))
"""Tags of where the strips or tiles begin and of their lengths."""


_DAMAGED: Final = (
    OSError,
    ValueError,
    SyntaxError,
    KeyError,
    IndexError,
    TypeError,
    OverflowError,
    struct.error,
    Image.DecompressionBombError,
)
"""What Pillow raises of files that are not as they should be."""


class UnreadablePicture(ValueError):
    """A file is no picture, or not all of one; says why in a clause without the file's name."""


@dataclass(frozen=True, slots=True)
class PictureHeader:
    """What a picture's header says.

    Attributes:
        stored_px: (width, height) as its pixels lie in the file.
        orientation: What makes it upright, by its EXIF data.
        file_format: As Pillow names it: "JPEG", "PNG", ...
    """

    stored_px: tuple[int, int]
    orientation: Orientation
    file_format: str

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) once upright."""
        return self.orientation.size_px(self.stored_px)


def read_header(path: Path) -> PictureHeader:
    """Read a picture's header.

    Raises:
        UnreadablePicture: It is no picture.
        FileNotFoundError: There is no such file.
    """
    with _opened(path) as (picture, file):
        return _header(picture, file)


def read_whole_header(path: Path) -> PictureHeader:
    """Read a picture's header, and check that the file does not end before the picture does.

    Of JPEG, PNG, WebP, BMP and TIFF files; decoders fill up what is missing without a word.

    Raises:
        UnreadablePicture: It is no picture, or not a whole one.
        FileNotFoundError: There is no such file.
    """
    with _opened(path) as (picture, file):
        header = _header(picture, file)
        if not _IS_WHOLE.get(header.file_format, _any)(picture, file):
            raise UnreadablePicture("its end is missing")
        return header


@contextmanager
def _opened(path: Path) -> Generator[tuple[Image.Image, BinaryIO], None, None]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of damaged EXIF data, without which the picture is as good
            with path.open("rb") as file, Image.open(file) as picture:
                yield picture, file
    except (FileNotFoundError, UnreadablePicture):
        raise
    except UnidentifiedImageError as error:
        if is_pointer(path):
            raise UnreadablePicture(f"it is {POINTER}: {FETCH}") from error
        raise UnreadablePicture("it is of no known format" if path.stat().st_size else "it is empty") from error
    except _DAMAGED as error:
        raise UnreadablePicture(str(getattr(error, "strerror", None) or error) or type(error).__name__) from error


def _header(picture: Image.Image, file: BinaryIO) -> PictureHeader:
    if picture.format == "TIFF":  # whose size Pillow turns itself, in some versions
        tags: Mapping[int, int] = picture.tag_v2  # type: ignore[attr-defined]
        stored_px = int(tags[ExifTags.Base.ImageWidth]), int(tags[ExifTags.Base.ImageLength])
        return PictureHeader(stored_px, Orientation.of_exif(tags.get(ExifTags.Base.Orientation)), "TIFF")
    return PictureHeader(picture.size, Orientation.of_exif(_exif_orientation(picture, file)), str(picture.format or ""))


def _exif_orientation(picture: Image.Image, file: BinaryIO) -> object:
    """Return EXIF's number; None where there is none, or where the data are damaged, as for every viewer."""
    try:
        if picture.format != "PNG" or "exif" in picture.info:
            return picture.getexif().get(ExifTags.Base.Orientation)
        exif = Image.Exif()  # for which Pillow would decode all pixels of a PNG
        exif.load(dict(_png_chunks(file)).get(b"eXIf", b""))
        return exif.get(ExifTags.Base.Orientation)
    except _DAMAGED:
        return None


def _jpeg_is_whole(picture: Image.Image, file: BinaryIO) -> bool:
    """Tell whether the end marker follows the picture's data; a thumbnail in its header has one of its own."""
    file.seek(-len(_JPEG_END), 2)
    if file.read() == _JPEG_END:
        return True
    file.seek(0)
    content = file.read()
    position = len(_JPEG_START)
    while content[position : position + 1] == b"\xff" and content[position : position + 2] != _JPEG_SCAN:
        position += 2 + int.from_bytes(content[position + 2 : position + 4], "big")
    return content.find(_JPEG_END, position) >= 0


def _png_is_whole(picture: Image.Image, file: BinaryIO) -> bool:
    return any(kind == b"IEND" for kind, _ in _png_chunks(file))


def _png_chunks(file: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """Yield the kind of each chunk that is all there, and what it holds if it is EXIF data."""
    size = file.seek(0, 2)
    position = _PNG_HEAD_BYTES
    while position + 12 <= size:
        file.seek(position)
        length, kind = struct.unpack(">I4s", file.read(8))
        position += 12 + length
        if position <= size:
            yield kind, file.read(length) if kind == b"eXIf" else b""


def _webp_is_whole(picture: Image.Image, file: BinaryIO) -> bool:
    file.seek(4)
    return 8 + int.from_bytes(file.read(4), "little") <= file.seek(0, 2)


def _bmp_is_whole(picture: Image.Image, file: BinaryIO) -> bool:
    codec, extents, offset, args = picture.tile[0]  # type: ignore[attr-defined]
    if codec != "raw" or not isinstance(args, tuple):  # compressed: its length is not known before
        return True
    return int(offset) + int(args[1]) * int(extents[3]) <= file.seek(0, 2)


def _tiff_is_whole(picture: Image.Image, file: BinaryIO) -> bool:
    size, tags = file.seek(0, 2), picture.tag_v2  # type: ignore[attr-defined]
    return all(
        offset + length <= size
        for offsets, lengths in _TIFF_OFFSETS
        for offset, length in zip(_as_tuple(tags.get(offsets)), _as_tuple(tags.get(lengths)), strict=False)
    )


def _as_tuple(value: tuple[int, ...] | int | None) -> tuple[int, ...]:
    return value if isinstance(value, tuple) else () if value is None else (value,)


def _any(picture: Image.Image, file: BinaryIO) -> bool:
    return True


_IS_WHOLE: Final[Mapping[str, Callable[[Image.Image, BinaryIO], bool]]] = {
    "JPEG": _jpeg_is_whole,
    "MPO": _jpeg_is_whole,
    "PNG": _png_is_whole,
    "WEBP": _webp_is_whole,
    "BMP": _bmp_is_whole,
    "TIFF": _tiff_is_whole,
}
