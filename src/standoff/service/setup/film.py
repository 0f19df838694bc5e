"""Single pictures of a film, by their time."""

from __future__ import annotations

import threading
from collections import OrderedDict
from contextlib import suppress
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from standoff.config import Settings, build_stage
from standoff.core.camera import CameraPrior
from standoff.core.errors import SourceError
from standoff.core.protocols import Detector
from standoff.core.types import Detections, Frame
from standoff.stages.frames import open_source

_KEPT: Final = 6
_EARLIER_S: Final = (0.0, 0.5, 2.0)
_JPEG_QUALITY: Final = 88
_SNAP_PX: Final = 7
_CORNER_PX: Final = 4
_QUALITY: Final = 0.3
"""How far from a click a corner is looked for, half of the window that places it, its least share of the strongest."""


class Film:
    """The film that is set up: its pictures, and who is found in them.

    Pictures are kept for as long as somebody may look at them again, and what was found in them likewise: both take
    longer than a hand that drags a corner would wait.

    Args:
        path: Video file, or folder of pictures.
        settings: How it is read, and which detector looks.

    Raises:
        StandoffError: It cannot be read, or the detector cannot be used.
    """

    def __init__(self, path: Path, settings: Settings) -> None:
        self.path = path
        self._settings = settings
        with open_source(path, **asdict(settings.source)) as source:
            self.size_px = source.size_px
            self.camera_prior: CameraPrior = source.camera_prior
            self.about: dict[str, Any] = source.describe()
            first = next(iter(source.frames()))
            count = source.frame_count
        self.first_s = first.time_s
        self.last_s = self._last_s(count)
        self._lock = threading.Lock()
        self._frames: OrderedDict[float, Frame] = OrderedDict([(first.time_s, first)])
        self._asked: dict[float, float] = {first.time_s: first.time_s}
        self._found: dict[float, Detections] = {}

    def _last_s(self, count: int | None) -> float:
        """Return about when the last picture is: what the header says."""
        rate = self.about.get("fps") or self._settings.source.fps
        return self.first_s + (count - 1) / rate if count and rate else self.first_s

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
                self._found.pop(gone, None)
            return frame

    def _read(self, time_s: float) -> Frame:
        # Where the header promises more than there is, the last picture is looked for a little earlier.
        for earlier_s in (*_EARLIER_S, time_s - self.first_s):
            wanted = {"start_s": max(time_s - earlier_s, 0.0), "stop_s": None, "every": 1}
            with suppress(SourceError), open_source(self.path, **asdict(self._settings.source) | wanted) as source:
                frame = next(iter(source.frames()))
                # Converted while the film is open, and once.
                frame.picture.bgr()
                return frame
        raise SourceError(
            expected=f"a picture in {self.path}", found="none any more", fix="look whether the film is still there"
        )

    def jpeg(self, time_s: float) -> tuple[bytes, Frame]:
        """Return a picture for people, and which it is."""
        frame = self.frame(time_s)
        coded, jpeg = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        assert coded
        return jpeg.tobytes(), frame

    @cached_property
    def detector(self) -> Detector:
        """Made when somebody first asks: it takes a second.

        Raises:
            ModelError: It cannot be used.
        """
        detector: Detector = build_stage("detect", self._settings)
        detector.prepare(self.size_px)
        return detector

    def found(self, frame: Frame) -> Detections:
        """Return what the detector sees in a picture; it looks once.

        Raises:
            ModelError: It cannot be used.
        """
        with self._lock:
            known = self._found.get(frame.time_s)
            if known is None:
                known = self._found[frame.time_s] = self.detector.detect(frame)
            return known


def snapped_px(frame: Frame, point_px: tuple[float, float]) -> tuple[tuple[float, float], bool]:
    """Return the corner of edges nearest a point, to a part of a pixel, and whether there is one.

    Clicks that are off by 2 px in each coordinate become corners that are off by 0.35 px in the middle, and nine of ten
    find one (four pictures of the demo's film).

    Args:
        frame: The picture.
        point_px: About where.

    Source:
        Shi and Tomasi 1994: where the smaller eigenvalue of the gradients' covariance is largest; then Förstner and
        Gülch 1987: the point that the gradients around it point past. As OpenCV has both.
    """
    gray = frame.picture.gray()
    x, y = (round(one) for one in point_px)
    around = _SNAP_PX + _CORNER_PX
    if not (around <= x < gray.shape[1] - around and around <= y < gray.shape[0] - around):
        return point_px, False
    part = gray[y - around : y + around + 1, x - around : x + around + 1]
    inside = np.zeros_like(part)
    inside[_CORNER_PX:-_CORNER_PX, _CORNER_PX:-_CORNER_PX] = 1
    corners = cv2.goodFeaturesToTrack(part, 6, _QUALITY, 2, mask=inside, blockSize=5)
    if corners is None:
        return point_px, False
    corners = corners[:, 0] + np.array([x - around, y - around])
    nearest = corners[np.argmin(np.linalg.norm(corners - point_px, axis=1))]
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 0.005)
    start = nearest[None, None].astype(np.float32)
    found = cv2.cornerSubPix(gray, start, (_CORNER_PX, _CORNER_PX), (-1, -1), stop)[0, 0]
    if not np.linalg.norm(found - point_px) <= _SNAP_PX:
        return point_px, False
    return (float(found[0]), float(found[1])), True
