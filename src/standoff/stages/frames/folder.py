"""A folder of images as a source: natural order, a stated frame rate, nothing else in it."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import av

from standoff.core.errors import SourceError
from standoff.files.fingerprint import fingerprint
from standoff.files.orientation import UPRIGHT, Orientation
from standoff.files.picture_header import PictureHeader, UnreadablePicture, read_whole_header
from standoff.stages.frames.album import read_album
from standoff.stages.frames.photograph import read_photograph
from standoff.stages.frames.pictures import AvPicture, Scaler
from standoff.stages.frames.reader import Selection, Shot, check_size, size_changed

_IMAGE_SUFFIXES = frozenset({".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp"})
_LEFT_BY_FILE_MANAGERS = frozenset({"thumbs.db", "desktop.ini"})
_NAMED = 3
_REPLACE = "replace it, or take it out of the folder"


def _natural_key(path: Path) -> tuple[list[tuple[int, str]], str]:
    parts = re.findall(r"\d+|\D+", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part.casefold()) for part in parts], path.name


def _list_images(folder: Path) -> list[Path]:
    present = [
        path
        for path in folder.iterdir()
        if not path.name.startswith(".") and path.name.casefold() not in _LEFT_BY_FILE_MANAGERS
    ]
    images = [path for path in present if path.suffix.casefold() in _IMAGE_SUFFIXES and path.is_file()]
    strangers = sorted(set(present) - set(images))
    if strangers:
        raise SourceError(
            expected=f"only images ({', '.join(sorted(_IMAGE_SUFFIXES))}) in {folder.name}",
            found=_some([path.name for path in strangers]),
            fix="move what is not part of the sequence elsewhere",
        )
    if not images:
        raise SourceError(expected=f"images in {folder.name}", found="none", fix="check the path")
    return sorted(images, key=_natural_key)


def _some(texts: Sequence[str]) -> str:
    """Name the first few, and count the others."""
    more = f" and {len(texts) - _NAMED} more" if len(texts) > _NAMED else ""
    return ", ".join(texts[:_NAMED]) + more


def _decode(path: Path, orientation: Orientation, scaler: Scaler) -> AvPicture:
    """Decode one image by its content, whatever its name promises."""
    try:
        # From memory: a file name with % in it would be taken for a pattern.
        with av.open(io.BytesIO(path.read_bytes())) as container:
            frame = next(container.decode(video=0), None)
        if frame is None:
            raise ValueError("it holds no picture")
    except (av.FFmpegError, IndexError, OSError, ValueError) as error:
        raise SourceError(
            expected="an image that can be decoded",
            found=f"{path.name}: {error}",
            fix=_REPLACE,
        ) from error
    return AvPicture(frame, orientation, scaler)


def _checked_headers(paths: Sequence[Path]) -> list[PictureHeader]:
    """Return what all images say of themselves.

    Raises:
        SourceError: Some are no whole images.
        FrameSizeChanged: Some have another size than the first.
    """
    headers: list[PictureHeader] = []
    unreadable: list[str] = []
    for path in paths:
        try:
            headers.append(read_whole_header(path))
        except (UnreadablePicture, FileNotFoundError) as error:
            unreadable.append(f"{path.name}: {error}")
    if unreadable:
        raise SourceError(expected="images that can be decoded", found=_some(unreadable), fix=_REPLACE)
    size_px = headers[0].size_px
    strange = [
        "{}x{} at {}".format(*header.size_px, path.name)
        for path, header in zip(paths, headers, strict=True)
        if header.size_px != size_px
    ]
    if strange:
        raise size_changed(size_px, _some(strange))
    return headers


class FolderReader:
    """Read the images of a folder in natural order (2 before 10), upright as their EXIF data say.

    All eight orientations of EXIF data are followed, those that mirror as well; what a header says of the shape of
    pixels is not, as no viewer does. Hidden files are overlooked.

    Args:
        folder: It holds images only.
        fps: Images a second.

    Raises:
        SourceError: No frame rate is given, something else lies in the folder, it is empty, or its first
            image cannot be read.
    """

    started_at: datetime | None = None
    orientation = UPRIGHT

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
        self.size_px = _checked_headers(self._paths[:1])[0].size_px
        self.total_frames: int | None = len(self._paths)
        self.rate_fps = fps
        self._fingerprint = fingerprint(self._paths)
        album = read_album(self._paths)
        self.drone = album.drone
        self.camera_prior = album.camera_prior(self.size_px)
        self.warnings = album.warnings

    def shots(self, wanted: Selection) -> Iterator[Shot]:
        """Yield the images that are wanted; the others are not even opened.

        The headers of all of them are read first: what is wrong with the last one is said before any work is done.

        Raises:
            SourceError: Images that cannot be read, or have another size than the first.
        """
        chosen = self._paths[: wanted.end_index(len(self._paths), self.rate_fps)]
        numbered = list(enumerate(chosen))[wanted.first_index(self.rate_fps) :: wanted.every]
        headers = _checked_headers([self._paths[0], *(path for _, path in numbered)])[1:]
        return self._decoded(numbered, headers)

    def _decoded(self, numbered: Sequence[tuple[int, Path]], headers: Sequence[PictureHeader]) -> Iterator[Shot]:
        for (index, path), header in zip(numbered, headers, strict=True):
            picture = _decode(path, header.orientation, self._scaler)
            check_size(picture, self.size_px, path.name)
            time_s = index / self.rate_fps
            yield Shot(index, time_s, picture, path.name, read_photograph(path, time_s).telemetry)

    def describe(self) -> dict[str, Any]:
        """Return what it is, for the record."""
        return {
            "name": self._folder.name,
            "kind": "image folder",
            "size_px": list(self.size_px),
            "fps": self.rate_fps,
            "duration_s": len(self._paths) / self.rate_fps,
            "fingerprint": self._fingerprint,
            "frames_declared": len(self._paths),
            "clock": "given frame rate",
        }

    def close(self) -> None:
        """Do nothing: no file stays open."""
