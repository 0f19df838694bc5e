"""People made unrecognisable in pictures, as far as anything tells where they are."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core import homography
from standoff.core.boxes import areas_px2, shared_px2
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.picture_step import picture_step
from standoff.core.roles import PERSON_ROLE, ROLE_OF_CLASS
from standoff.core.types import CameraMotion, FrameResult, ImageArray, IntArray, NoCameraMotion

_SEEN, _COASTING, _PER_S = 0.12, 0.35, 0.8
"""By how much of its longer side a box is widened: one that is seen, one that is predicted, and for each second since
somebody was seen there (a walker goes 0.8 of his height in one)."""
_REMEMBERED_S = 1.0
_HIDDEN = 0.75
"""Share of a remembered box in another one from which it is taken for the same person, or for well hidden by him."""
_BLOCKS, _LEAST_BLOCK_PX = 10.0, 4.0
"""Along the longer side of a widened box: a head is about one block, and who wears a vest still looks like it."""

_NOBODY = np.zeros((0, 4))


class PeopleWatch:
    """Tell where people may be in each frame of a stream: everybody tracked, and every detection however unsure.

    Whoever is missed is still looked for where he was for a second, so that no single frame shows him.

    Args:
        wanted: False: nobody is ever told of.
    """

    def __init__(self, *, wanted: bool) -> None:
        self._wanted = wanted
        self._boxes, self._seen_s = _NOBODY, np.zeros(0)
        self._motion: CameraMotion | NoCameraMotion = NoCameraMotion("no frame before")
        self._time_s = -np.inf

    def update(self, result: FrameResult) -> FloatArray:
        """Return (N, 4) left, top, right, bottom of all places to hide, in full-size pixels, widened."""
        if not self._wanted:
            return _NOBODY
        time_s = result.frame.time_s
        tracked, detected = _is_person(result.tracks.class_id), _is_person(result.detections.class_id)
        seen = np.concatenate([result.tracks.xyxy_px[tracked], result.detections.xyxy_px[detected]])
        coasts = np.zeros(len(seen), dtype=bool)
        coasts[: tracked.sum()] = ~result.tracks.observed[tracked]
        shown = _widened(seen, np.where(coasts, _COASTING, _SEEN))
        self._carry(result)
        self._forget(shown, time_s)
        remembered = _widened(self._boxes, _SEEN + _PER_S * (time_s - self._seen_s))
        # What is only predicted does not make the memory younger.
        self._boxes = np.concatenate([self._boxes, seen[~coasts]])
        self._seen_s = np.concatenate([self._seen_s, np.full(int((~coasts).sum()), time_s)])
        self._motion, self._time_s = result.motion, time_s
        return np.concatenate([shown, remembered])

    def _carry(self, result: FrameResult) -> None:
        """Move what is remembered with the picture; the lens bends next to nothing from one frame to the next."""
        step = picture_step(self._motion, self._time_s, result.motion)
        if step is None or not len(self._boxes):
            return
        moved, valid = homography.apply(step, self._boxes.reshape(-1, 2))
        low, high = np.sort(moved.reshape(-1, 2, 2), axis=1).transpose(1, 0, 2)
        known = np.asarray(valid.reshape(-1, 2).all(axis=1))
        self._boxes = np.where(known[:, None], np.concatenate([low, high], axis=1), self._boxes)

    def _forget(self, shown: FloatArray, time_s: float) -> None:
        area = np.maximum(areas_px2(self._boxes), 1.0)
        hidden = (shared_px2(self._boxes, shown) > _HIDDEN * area[:, None]).any(axis=1)
        # A stream whose clock is set back begins anew.
        kept = ~hidden & (np.abs(time_s - self._seen_s) <= _REMEMBERED_S)
        self._boxes, self._seen_s = self._boxes[kept], self._seen_s[kept]


def blur(picture: ImageArray, boxes_px: FloatArray, region_px: FloatArray) -> None:
    """Leave of each box only the means of a few blocks, in place.

    Args:
        picture: (H, W, 3) uint8, a region of the frame at any size.
        boxes_px: (N, 4) left, top, right, bottom edges in full-size pixels.
        region_px: (4,) edges of the region in the same.
    """
    height, width = picture.shape[:2]
    factor = np.array([width, height]) / (region_px[2:] - region_px[:2])
    mosaics: list[tuple[ImageArray, ImageArray]] = []
    for low, high in (boxes_px.reshape(-1, 2, 2) - region_px[:2]) * factor:
        x0, y0 = np.maximum(np.floor(low), 0).astype(int)
        x1, y1 = np.minimum(np.ceil(high), [width, height]).astype(int)
        if x0 >= x1 or y0 >= y1:
            continue
        block_px = max(float((high - low).max()) / _BLOCKS, _LEAST_BLOCK_PX)
        area = picture[y0:y1, x0:x1]
        blocks = max(1, round((x1 - x0) / block_px)), max(1, round((y1 - y0) / block_px))
        means = cv2.resize(area, blocks, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
        mosaics.append((area, means))
    # Only once all are read: of somebody who is in two boxes, twice averaged, too little would be left to see.
    for area, means in mosaics:
        cv2.resize(means, area.shape[1::-1], dst=area, interpolation=cv2.INTER_NEAREST)


def _is_person(class_id: IntArray) -> BoolArray:
    return np.asarray(ROLE_OF_CLASS[class_id] == PERSON_ROLE)


def _widened(xyxy_px: FloatArray, share: FloatArray) -> FloatArray:
    margin = share * (xyxy_px[:, 2:] - xyxy_px[:, :2]).max(axis=1)
    widened: FloatArray = xyxy_px + margin[:, None] * np.array([-1.0, -1.0, 1.0, 1.0])
    return widened
