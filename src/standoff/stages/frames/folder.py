"""A folder of images as a source: natural order, a stated frame rate, nothing else in it."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import av

from standoff.core.errors import SourceError
from standoff.files.lfs import refuse_pointer
from standoff.stages.frames.album import read_album
from standoff.stages.frames.fingerprint import fingerprint
from standoff.stages.frames.photograph import read_photograph
from standoff.stages.frames.pictures import AvPicture, Scaler
from standoff.stages.frames.reader import TIME_ROUNDING_S, Shot, check_size

_IMAGE_SUFFIXES = frozenset({".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp"})
_LEFT_BY_FILE_MANAGERS = frozenset({"thumbs.db", "desktop.ini"})
_STRANGERS_NAMED = 3
_JPEG_START, _JPEG_SCAN, _JPEG_END = b"\xff\xd8", b"\xff\xda", b"\xff\xd9"


def _natural_key(path: Path) -> tuple[list[tuple[int, str]], str]:
    parts = re.findall(r"\d+|\D+", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part.casefold()) for part in parts], path.name


def _is_whole_jpeg(content: bytes) -> bool:
    """Tell whether the picture's end marker follows its data; decoders fill up what is missing without a word."""
    position = len(_JPEG_START)
    while content[position : position + 1] == b"\xff" and content[position : position + 2] != _JPEG_SCAN:
        position += 2 + int.from_bytes(content[position + 2 : position + 4], "big")
    return content.find(_JPEG_END, position) >= 0


def _list_images(folder: Path) -> list[Path]:
    present = [
        path
        for path in folder.iterdir()
        if not path.name.startswith(".") and path.name.casefold() not in _LEFT_BY_FILE_MANAGERS
    ]
    images = [path for path in present if path.suffix.casefold() in _IMAGE_SUFFIXES and path.is_file()]
    strangers = sorted(set(present) - set(images))
    if strangers:
        names = ", ".join(path.name for path in strangers[:_STRANGERS_NAMED])
        more = f" and {len(strangers) - _STRANGERS_NAMED} more" if len(strangers) > _STRANGERS_NAMED else ""
        raise SourceError(
            expected=f"only images ({', '.join(sorted(_IMAGE_SUFFIXES))}) in {folder.name}",
            found=f"{names}{more}",
            fix="move what is not part of the sequence elsewhere",
        )
    if not images:
        raise SourceError(expected=f"images in {folder.name}", found="none", fix="check the path")
    return sorted(images, key=_natural_key)


def _decode(path: Path, scaler: Scaler) -> AvPicture:
    """Decode one image by its content, whatever its name promises."""
    try:
        content = path.read_bytes()
        if content.startswith(_JPEG_START) and not _is_whole_jpeg(content):
            raise ValueError("its end is missing")
        # From memory: a file name with % in it would be taken for a pattern.
        with av.open(io.BytesIO(content)) as container:
            frame = next(container.decode(video=0), None)
        if frame is None:
            raise ValueError("it holds no picture")
    except (av.FFmpegError, IndexError, OSError, ValueError) as error:
        refuse_pointer(path, f"an image in {path.name}", SourceError)
        raise SourceError(
            expected="an image that can be decoded",
            found=f"{path.name}: {error}",
            fix="replace it, or take it out of the folder",
        ) from error
    return AvPicture(frame, round(frame.rotation), scaler)


class FolderReader:
    """Read the images of a folder in natural order (2 before 10), turned upright as their EXIF data say.

    Mirroring in EXIF data, which no camera writes, is not undone. Hidden files are overlooked.

    Args:
        folder: It holds images only.
        fps: Images a second.

    Raises:
        SourceError: No frame rate is given, something else lies in the folder, it is empty, or its first
            image cannot be decoded.
    """

    started_at: datetime | None = None
    rotation_deg = 0

    def __init__(self, folder: Path, fps: float | None) -> None:
        if fps is None:
            raise SourceError(
                expected="a frame rate, for a folder has no clock",
                found=f"none for {folder.name}",
                fix="give the images a second (--fps)",
            )
        self._folder = folder
        self._scaler = Scaler()
        self._paths = _list_images(folder)
        first = _decode(self._paths[0], self._scaler)
        self.size_px = (first.width_px, first.height_px)
        self.total_frames: int | None = len(self._paths)
        self.rate_fps = fps
        album = read_album(self._paths)
        self.drone = album.drone
        self.camera_prior = album.camera_prior(self.size_px)
        self.warnings = album.warnings

    def shots(self, start_s: float, every: int) -> Iterator[Shot]:
        """Yield every `every`-th image from `start_s` on; the others are not even opened."""
        first = max(0, math.ceil((start_s - TIME_ROUNDING_S) * self.rate_fps))
        for index in range(first, len(self._paths), every):
            path = self._paths[index]
            picture = _decode(path, self._scaler)
            check_size(picture, self.size_px, path.name)
            time_s = index / self.rate_fps
            yield Shot(index, time_s, picture, path.name, read_photograph(path, time_s).telemetry)

    @property
    def description(self) -> dict[str, Any]:
        """What it is, for the record."""
        return {
            "name": self._folder.name,
            "kind": "image folder",
            "size_px": list(self.size_px),
            "fps": self.rate_fps,
            "duration_s": len(self._paths) / self.rate_fps,
            "fingerprint": fingerprint(self._paths),
            "frames_declared": len(self._paths),
            "clock": "given frame rate",
        }

    def close(self) -> None:
        """Do nothing: no file stays open."""
