"""What one process lets others see: its latest word, and the newest picture. Nobody waits for anybody.

Files in memory (`/dev/shm`), each with one writer and any number of readers. A writer that is killed in the middle of a
word leaves one that no reader takes for whole: they go on with the word before, and see that it grows old.
"""

from __future__ import annotations

import json
import mmap
import os
import struct
import time
import zlib
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple, Self

import av
import numpy as np

from standoff.core.types import ImageArray

_HEAD: Final = struct.Struct("<II")
_TRIES: Final = 50
_PAUSE_S: Final = 2e-4
_RECORD_BYTES: Final = 1 << 18
"""A few hundred devices, each with all reasons why nobody watches over it, are a good half of it."""
_PICTURES: Final = 3
"""One that is read, one that is newest, one that is written."""
_COUNT: Final = struct.Struct("<Q")
_FORMATS: Final = ("yuv420p", "yuvj420p")


class SharedRecord:
    """A few words of one process, as JSON, that others read.

    Args:
        path: Of the file; made where it is not there.
        size: Bytes that it can hold.
    """

    def __init__(self, path: Path, size: int = _RECORD_BYTES) -> None:
        self._size = size
        self._map = _mapped(path, size)
        self._known: dict[str, Any] | None = None

    def write(self, words: dict[str, Any]) -> None:
        """Say something; what was said before is gone.

        Raises:
            ValueError: It is too long.
        """
        body = json.dumps(words, separators=(",", ":")).encode()
        if len(body) + _HEAD.size > self._size:
            raise ValueError(f"{len(body)} bytes do not fit into a record of {self._size}")
        self._map[_HEAD.size : _HEAD.size + len(body)] = body
        self._map[: _HEAD.size] = _HEAD.pack(zlib.crc32(body), len(body))

    def read(self) -> dict[str, Any] | None:
        """Return the latest words that are whole; None where nothing was said yet."""
        for _ in range(_TRIES):
            check, length = _HEAD.unpack(self._map[: _HEAD.size])
            if length == 0:
                return self._known
            body = self._map[_HEAD.size : _HEAD.size + min(length, self._size)]
            if zlib.crc32(body) == check:
                self._known = json.loads(body)
                return self._known
            time.sleep(_PAUSE_S)
        return self._known

    def close(self) -> None:
        """Let go of it."""
        self._map.close()


class SlotPicture(NamedTuple):
    """A picture out of a slot.

    Attributes:
        number: Counts the pictures that were put in, by whoever puts them in now.
        about: What was said with it.
        frame: An `av.VideoFrame` of its own memory.
    """

    number: int
    about: dict[str, Any]
    frame: av.VideoFrame


class PictureSlot:
    """The newest picture of a stream, and nothing older: who looks late sees what is now.

    Args:
        folder: In memory.
        name: Of the stream.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._path = folder / f"{name}.pictures"
        self._record = SharedRecord(folder / f"{name}.picture", 4096)
        self._map: mmap.mmap | None = None
        self._number = self._place_bytes = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def put(self, frame: av.VideoFrame, about: dict[str, Any]) -> None:
        """Put the newest picture in; for its one writer.

        Args:
            frame: Decoded; of an odd width or height the last column or row is left out.
            about: What is said with it; numbers and text.

        Raises:
            OSError: There is no room in memory.
        """
        pixels = _planes(frame)
        room = _room(pixels.nbytes)
        if self._map is None or len(self._map) < _PICTURES * room:
            self._map = _mapped(self._path, _PICTURES * room)
        if room != self._place_bytes:
            self._take_back(self._map)
            self._place_bytes = room
        self._number += 1
        begin = (self._number % _PICTURES) * room
        # Marked before and after: whoever read it meanwhile sees that it has changed.
        self._map[begin : begin + _COUNT.size] = _COUNT.pack(self._number)
        body = begin + _COUNT.size
        self._map[body : body + pixels.nbytes] = np.ascontiguousarray(pixels).tobytes()
        height_px, width_px = pixels.shape[0] * 2 // 3, pixels.shape[1]
        is_full = frame.format.name == "yuvj420p"
        self._record.write(
            {"number": self._number, "size_px": [width_px, height_px], "is_full": is_full, "room": room, "about": about}
        )

    def _take_back(self, places: mmap.mmap) -> None:
        """Make all pictures unreadable before one of another size is put across them."""
        head = self._record.read()
        if head is None:
            return
        for begin in range(0, _PICTURES * int(head["room"]), int(head["room"])):
            if begin + _COUNT.size <= len(places):
                places[begin : begin + _COUNT.size] = _COUNT.pack(0)

    def newest(self) -> SlotPicture | None:
        """Return the newest picture, copied; None where there is none, or it is just changing again and again."""
        for _ in range(_TRIES):
            head = self._record.read()
            if head is None:
                return None
            taken = self._take(head)
            if taken is not None:
                return taken
            time.sleep(_PAUSE_S)
        return None

    def about(self) -> tuple[int, dict[str, Any]] | None:
        """Return the number of the newest picture and what was said with it, without its pixels."""
        head = self._record.read()
        return None if head is None else (int(head["number"]), head["about"])

    def _take(self, head: dict[str, Any]) -> SlotPicture | None:
        number, room, (width_px, height_px) = head["number"], head["room"], head["size_px"]
        if self._map is None or len(self._map) < _PICTURES * room:
            if not self._path.exists() or self._path.stat().st_size < _PICTURES * room:
                return None
            self._map = _mapped(self._path, _PICTURES * room)
        begin = (number % _PICTURES) * room
        body = begin + _COUNT.size
        shape = (height_px * 3 // 2, width_px)
        pixels = np.frombuffer(self._map, np.uint8, shape[0] * shape[1], body).reshape(shape)
        name = _FORMATS[bool(head["is_full"])]
        frame = av.VideoFrame.from_ndarray(pixels, format=name)
        del pixels
        if _COUNT.unpack(self._map[begin : begin + _COUNT.size])[0] != number:
            return None
        return SlotPicture(number, head["about"], frame)

    def close(self) -> None:
        """Let go of it."""
        self._record.close()
        if self._map is not None:
            self._map.close()
            self._map = None


def _planes(frame: av.VideoFrame) -> ImageArray:
    """Return (H * 3/2, W) uint8: luma above both chromas."""
    even = (frame.width // 2 * 2, frame.height // 2 * 2)
    if frame.format.name not in _FORMATS or even != (frame.width, frame.height):
        frame = frame.reformat(width=even[0], height=even[1], format="yuv420p")
    planes: ImageArray = frame.to_ndarray()
    return planes


def _room(size: int) -> int:
    """Return the bytes of one picture's place, on the border of a page of memory."""
    return (size + _COUNT.size + mmap.PAGESIZE - 1) // mmap.PAGESIZE * mmap.PAGESIZE


def _mapped(path: Path, size: int) -> mmap.mmap:
    """Map a file, made as large as it must be: a place in memory that is not there would kill whoever writes to it."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        if os.fstat(descriptor).st_size < size:
            os.posix_fallocate(descriptor, 0, size)
        return mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)
