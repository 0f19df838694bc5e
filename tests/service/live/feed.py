"""A camera: encodes pictures at its own pace, and writes down when each was taken."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from fractions import Fraction
from typing import Protocol

import av

from standoff.core.types import ImageArray


class Write(Protocol):
    """Takes each coded picture."""

    def __call__(self, data: bytes, *, is_key: bool) -> None: ...


Draw = Callable[[float], ImageArray]


class Camera:
    """Films what is drawn, in a thread of its own.

    Args:
        draw: Returns the picture of a moment, seconds since it began.
        write: Takes each coded picture.
        fps: Pictures a second.
        size_px: (width, height).
        gop: Pictures from one key frame to the next.
        bit_rate: Of the film.
        slices: Parts of each picture.
    """

    def __init__(
        self,
        draw: Draw,
        write: Write,
        fps: int = 25,
        size_px: tuple[int, int] = (1280, 720),
        gop: int = 25,
        bit_rate: int = 6_000_000,
        slices: int = 2,
    ) -> None:
        self._draw, self._write, self._fps = draw, write, fps
        codec = av.CodecContext.create("libx264", "w")
        codec.width, codec.height = size_px
        codec.pix_fmt, codec.time_base, codec.gop_size = "yuv420p", Fraction(1, fps), gop
        codec.bit_rate = bit_rate
        codec.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "x264-params": f"repeat-headers=1:slices={slices}",
        }
        self._codec = codec
        self.begun_s = time.monotonic()
        self._is_ended = threading.Event()
        self._thread = threading.Thread(target=self._film, daemon=True)

    def __enter__(self) -> Camera:
        self.begun_s = time.monotonic()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_ended.set()
        self._thread.join(5.0)

    def now_s(self) -> float:
        """Return the time of what is filmed now."""
        return time.monotonic() - self.begun_s

    def _film(self) -> None:
        number = 0
        while not self._is_ended.is_set():
            frame = av.VideoFrame.from_ndarray(self._draw(self.now_s()), format="bgr24")
            frame.pts = number
            for packet in self._codec.encode(frame):
                self._write(bytes(packet), is_key=packet.is_keyframe)
            number += 1
            pause_s = self.begun_s + number / self._fps - time.monotonic()
            if pause_s < -1.0:  # The machine was busy: go on from now.
                number = round((time.monotonic() - self.begun_s) * self._fps)
            time.sleep(max(0.0, pause_s))
