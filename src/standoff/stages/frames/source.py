"""One door to all sources: ask for one, iterate once, get frames.

A reader knows one kind of source (`video.py`, `folder.py`); `FileSource` adds what all kinds share: when it is opened,
where to stop, the stream's name and the time of capture. A live stream is a third reader.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import timedelta
from functools import cached_property, partial
from itertools import chain
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import unquote

from standoff.core import protocols
from standoff.core.camera import CameraPrior
from standoff.core.errors import SourceError
from standoff.core.types import Frame, ImageArray, ToldBy
from standoff.stages.frames.folder import FolderReader
from standoff.stages.frames.pictures import ArrayPicture
from standoff.stages.frames.reader import TIME_ROUNDING_S, Reader, Selection, Shot
from standoff.stages.frames.telemetry_choice import TelemetryChoice, choose_telemetry
from standoff.stages.frames.video import VideoReader

_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/")
"""A scheme has two letters or more; a drive has one. A path has lost the second slash."""

_FILE_ADDRESS = re.compile(r"file:/*(?:/localhost)?/(?P<path>.*)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class _Opened:
    """What is there once a source is open.

    Attributes:
        reader: Closed with the source.
        telemetry: Where the drone's readings come from.
        shots: Of the part that is wanted; the first is read already.
    """

    reader: Reader
    telemetry: TelemetryChoice
    shots: Iterator[Shot]


class FileSource(protocols.Source):
    """A film or a folder of pictures, which is opened by the first question about it; iterate over it once.

    What is wrong with it is said then, and again by the next question: a file that comes later can still be opened.

    Args:
        read: Opens it, and says where its telemetry comes from; raises SourceError where it cannot be read.
        selection: The part that is wanted.
        stream_id: Name of the stream.

    Attributes:
        stream_id: Name of the stream.
    """

    def __init__(
        self, read: Callable[[], tuple[Reader, TelemetryChoice]], selection: Selection, stream_id: str
    ) -> None:
        self.stream_id = stream_id
        self._read = read
        self._selection = selection
        self._is_closed = False

    @cached_property
    def _opened(self) -> _Opened:
        if self._is_closed:
            raise ValueError(f"the source {self.stream_id} was closed before it was opened")
        reader, telemetry = self._read()
        try:
            return _Opened(reader, telemetry, _wanted_shots(reader, self._selection))
        except SourceError:
            reader.close()
            raise

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of every frame, upright.

        Raises:
            SourceError: As `open_source`; so do all questions.
        """
        return self._opened.reader.size_px

    @property
    def frame_count(self) -> int | None:
        """How many frames it should yield: exact for an image folder and at a constant frame rate, else an estimate."""
        reader = self._opened.reader
        return self._selection.expected_of(reader.total_frames, reader.rate_fps)

    def __iter__(self) -> Iterator[Frame]:
        return self.frames()

    def frames(self) -> Iterator[Frame]:
        """Yield frames; once.

        Raises:
            FrameSizeChanged: A picture has another size than the first.
            SourceTruncated: The source ended before its own header says it should; all its frames came first.
            SourceError: It cannot be opened, a picture cannot be read, or has no usable time.
        """
        # The call opens it, so that what is wrong is said here and whoever times frames times no opening.
        return self._frames_of(self._opened)

    def _frames_of(self, opened: _Opened) -> Iterator[Frame]:
        started_at = opened.reader.started_at
        for shot in opened.shots:
            if self._is_closed:
                return
            captured_at = None if started_at is None else started_at + timedelta(seconds=shot.time_s)
            telemetry = opened.telemetry.at(shot)
            told_by: ToldBy | None = None if captured_at is None else "file"
            yield Frame(self.stream_id, shot.index, shot.time_s, shot.picture, captured_at, told_by, telemetry)

    @property
    def camera_prior(self) -> CameraPrior:
        """What the source itself knows of its camera: its log's focal length, EXIF data, the drone's model, nothing."""
        return self._opened.telemetry.camera_prior(self._opened.reader)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What does not fit together, was not used or was lost, a clause each; some are known only at the end."""
        return (*self._opened.reader.warnings, *self._opened.telemetry.warnings)

    def describe(self) -> dict[str, Any]:
        """Return what it is and which part was wanted, for the record; counts grow while it is read."""
        reader, prior = self._opened.reader, self.camera_prior
        return {
            **reader.describe(),
            **self._selection._asdict(),
            "warnings": list(self.warnings),
            "frames_expected": self.frame_count,
            "utc": {"first": reader.started_at, "told_by": None if reader.started_at is None else "file"},
            "telemetry": self._opened.telemetry.describe(),
            "camera": {
                "origin": prior.origin,
                "focal_px": round(float(prior.camera.matrix[0, 0]), 1),
                "focal_sigma": round(prior.focal_sigma, 4),
            },
        }

    def close(self) -> None:
        """Let go of the file; frames already yielded stay valid. What was never opened is not opened any more."""
        self._is_closed = True
        if "_opened" in vars(self):
            self._opened.reader.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def local_path(source: str | PathLike[str]) -> Path:
    """Return the path of a source that may be written as a `file:` address.

    >>> local_path("file:///films/site%201.mp4").as_posix(), local_path("films/site.mp4").as_posix()
    ('/films/site 1.mp4', 'films/site.mp4')
    """
    address = _FILE_ADDRESS.fullmatch(str(source))
    if address is None:
        return Path(source)
    path = unquote(address["path"])
    return Path(path if re.match(r"[A-Za-z]:[/\\]", path) else f"/{path}")


def _wanted_shots(reader: Reader, wanted: Selection) -> Iterator[Shot]:
    """Return the shots of a part, of which the first is read now.

    Raises:
        SourceError: The part holds no picture.
    """
    shots = reader.shots(wanted)
    first = next(shots, None)
    stop_s = math.inf if wanted.stop_s is None else wanted.stop_s - TIME_ROUNDING_S
    if first is None or first.time_s >= stop_s:
        found = "none" if first is None else f"the first one at {first.time_s:.3f} s"
        raise SourceError(
            expected=f"pictures from {wanted.start_s} s on",
            found=found if wanted.stop_s is None else f"{found}, to stop before {wanted.stop_s} s",
            fix=f"choose a start and a stop inside the source ({_length(reader)})",
        )
    return _until(stop_s, chain([first], shots))


def _length(reader: Reader) -> str:
    total, rate = reader.total_frames, reader.rate_fps
    return f"it lasts about {total / rate:.1f} s" if total and rate else "its length is not declared"


def _until(stop_s: float, shots: Iterator[Shot]) -> Iterator[Shot]:
    for shot in shots:
        if shot.time_s >= stop_s:
            return
        yield shot


def open_source(
    path: str | PathLike[str],
    *,
    stream_id: str | None = None,
    start_s: float = 0.0,
    stop_s: float | None = None,
    every: int = 1,
    fps: float | None = None,
    telemetry: str | PathLike[str] | None = None,
) -> FileSource:
    """Return a video file or a folder of images as a source, which is opened by the first question about it.

    Frames carry the index that they have in the whole source, wherever it is started, and the time since
    its first picture, from the presentation timestamps.

    Args:
        path: A video file (a single picture counts as one) or a folder that holds images only, or its `file:` address.
        stream_id: Name of the stream; the file's or folder's name by default.
        start_s: Begin with the first picture at or after this time.
        stop_s: End before the first picture at or after this time.
        every: Yield each `every`-th picture, the first one included.
        fps: Pictures a second: needed for a folder, which has no clock. For a video it replaces its
            timestamps by index / fps: only for files whose timestamps are missing or wrong.
        telemetry: A drone's log (SubRip); "none": no telemetry, not even that of the pictures. By default the log
            beside a film (`film.srt`, or `telemetry.srt` in its folder), and the EXIF data of pictures.

    Raises:
        SourceError: At once: a part, a rate or an address that no file has. When it is opened: it cannot be read, or
            is empty in the part that is wanted, or the log that is asked for cannot be used.
        SourceTruncated: When it is opened: its end, and with it the table of its pictures, is missing.
    """
    path = local_path(path)
    selection = Selection(start_s, stop_s, every)
    selection.check()
    if fps is not None and not (math.isfinite(fps) and fps > 0):
        raise SourceError(expected="more than 0 pictures a second", found=str(fps), fix="give fps as a positive number")
    if _ADDRESS.match(str(path)):
        raise SourceError(
            expected="a video file or a folder of images",
            found=f"the address of a stream, {path}",
            fix="record the stream to a file first; streams are not read yet",
        )
    return FileSource(partial(_read, path, fps, telemetry), selection, path.stem if stream_id is None else stream_id)


def _read(path: Path, fps: float | None, telemetry: str | PathLike[str] | None) -> tuple[Reader, TelemetryChoice]:
    """Open a file or a folder, and find its telemetry.

    Raises:
        SourceError: As `open_source`.
    """
    if not path.exists():
        raise SourceError(
            expected="a video file or a folder of images", found=f"nothing at {path}", fix="check the path"
        )
    reader: Reader = FolderReader(path, fps) if path.is_dir() else VideoReader(path, fps)
    try:
        return reader, choose_telemetry(reader, path, telemetry)
    except SourceError:
        reader.close()
        raise


def frame_from_array(image: ImageArray, *, index: int = 0, time_s: float = 0.0, stream_id: str = "array") -> Frame:
    """Wrap an (H, W, 3) uint8 BGR picture, which is copied, as a frame.

    Raises:
        ValueError: The array has another shape or type.

    >>> import numpy as np
    >>> frame_from_array(np.zeros((4, 6, 3), np.uint8), time_s=0.5).size_px
    (6, 4)
    """
    return Frame(stream_id, index, time_s, ArrayPicture(image))
