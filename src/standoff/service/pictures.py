"""Single pictures of a film, by their time."""

from __future__ import annotations

import threading
from collections import OrderedDict
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import cv2

from standoff.core.camera import CameraPrior
from standoff.core.errors import SourceError
from standoff.core.types import Frame, ImageArray
from standoff.stages.frames import SourceParams, open_source

_KEPT: Final = 6
_EARLIER_S: Final = (0.0, 0.5, 2.0)
_JPEG_QUALITY: Final = 88


class FilmPictures:
    """The pictures of a film; the last few are kept for as long as somebody may look at them again.

    Args:
        path: Video file, or folder of pictures.
        params: How it is read.

    Raises:
        StandoffError: It cannot be read.

    Attributes:
        path: Of the film.
        size_px: (width, height) of its pictures.
        camera_prior: What it tells of its camera.
        about: What the source says of itself.
        first_s: When its first picture is.
        last_s: About when its last one is: what the header says.
    """

    def __init__(self, path: Path, params: SourceParams) -> None:
        self.path = path
        self._params = params
        with open_source(path, **asdict(params)) as source:
            self.size_px = source.size_px
            self.camera_prior: CameraPrior = source.camera_prior
            self.about: dict[str, Any] = source.describe()
            first = next(iter(source.frames()))
            count = source.frame_count
        self.first_s = first.time_s
        rate = self.about.get("fps") or params.fps
        self.last_s = first.time_s + (count - 1) / rate if count and rate else first.time_s
        self._lock = threading.Lock()
        self._frames: OrderedDict[float, Frame] = OrderedDict([(first.time_s, first)])
        self._asked: dict[float, float] = {first.time_s: first.time_s}

    def frame(self, time_s: float) -> Frame:
        """Return the first picture at or after a time, or the last one.

        Raises:
            SourceError: It cannot be read.
        """
        time_s = round(min(max(time_s, self.first_s), self.last_s), 3)
        with self._lock:
            known = self._asked.get(time_s)
            if known is not None and known in self._frames:
                self._frames.move_to_end(known)
                return self._frames[known]
            frame = self._read(time_s)
            self._asked[time_s] = frame.time_s
            self._frames[frame.time_s] = frame
            while len(self._frames) > _KEPT:
                gone, _ = self._frames.popitem(last=False)
                self._asked = {asked: kept for asked, kept in self._asked.items() if kept != gone}
            return frame

    def _read(self, time_s: float) -> Frame:
        # Where the header promises more than there is, the last picture is looked for a little earlier.
        for earlier_s in (*_EARLIER_S, time_s - self.first_s):
            wanted = {"start_s": max(time_s - earlier_s, 0.0), "stop_s": None, "every": 1}
            with suppress(SourceError), open_source(self.path, **asdict(self._params) | wanted) as source:
                frame = next(iter(source.frames()))
                # Converted while the film is open, and once.
                frame.picture.bgr()
                return frame
        raise SourceError(
            expected=f"a picture in {self.path}", found="none any more", fix="look whether the film is still there"
        )

    def jpeg(self, time_s: float) -> tuple[bytes, Frame]:
        """Return a picture for people, and which it is.

        Raises:
            SourceError: It cannot be read.
        """
        frame = self.frame(time_s)
        return jpeg_of(frame.image, _JPEG_QUALITY), frame


def jpeg_of(image: ImageArray, quality: int) -> bytes:
    """Return (H, W, 3) uint8 BGR as the bytes of a JPEG."""
    coded, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert coded
    return data.tobytes()
