"""The film that is set up: who is found in its pictures, and where corners are."""

from __future__ import annotations

import threading
from collections import OrderedDict
from functools import cached_property
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from standoff.config import Settings, build_stage
from standoff.core.protocols import Detector
from standoff.core.types import Detections, Frame
from standoff.service.pictures import FilmPictures

_LOOKS_KEPT: Final = 6
_SNAP_PX: Final = 7
_CORNER_PX: Final = 4
_QUALITY: Final = 0.3
"""How far from a click a corner is looked for, half of the window that places it, its least share of the strongest."""


class Film(FilmPictures):
    """The film that is set up: its pictures, and who is found in them.

    What was found is kept likewise: looking takes longer than a hand that drags a corner would wait.

    Args:
        path: Video file, or folder of pictures.
        settings: How it is read, and which detector looks.

    Raises:
        StandoffError: It cannot be read, or the detector cannot be used.
    """

    def __init__(self, path: Path, settings: Settings) -> None:
        super().__init__(path, settings.source)
        self._settings = settings
        self._looking = threading.Lock()
        self._found: OrderedDict[float, Detections] = OrderedDict()

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
        with self._looking:
            known = self._found.get(frame.time_s)
            if known is None:
                known = self._found[frame.time_s] = self.detector.detect(frame)
            self._found.move_to_end(frame.time_s)
            if len(self._found) > _LOOKS_KEPT:
                self._found.popitem(last=False)
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
