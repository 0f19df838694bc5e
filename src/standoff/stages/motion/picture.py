"""The picture as it is followed: its luma, small."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import Frame, ImageArray, Picture

_THUMBNAIL_PX = (48, 27)
_BLANK_LEVELS = 1.5
"""A picture whose luma deviates less than this from its mean shows nothing: black, fog, a covered lens."""

_SAME_SHARE = 0.02
"""A repeated picture that was coded again differs by a level here and there; sensor noise differs everywhere."""

_CORNER_BLOCK = 5
_MIN_CORNER = 2e-5
"""OpenCV's smaller eigenvalue, a block of 5, at half the followed size: slopes of about half a level a pixel."""


def _shrunk(picture: Picture, width_px: int) -> tuple[ImageArray, FloatArray]:
    """Shrink to about the width, halving first: only that has a quick path, and only large steps alias.

    Returns:
        The small luma, and (2,) how many of the picture's pixels make one of it, along x and y.
    """
    times = 0
    while picture.width_px >> times >= 1.5 * width_px:
        times += 1
    gray, per_small = picture.halved_gray(times), np.full(2, 2.0**times)
    if gray.shape[1] > width_px:
        height_px = max(round(gray.shape[0] * width_px / gray.shape[1]), 1)
        per_small *= np.array([gray.shape[1] / width_px, gray.shape[0] / height_px])
        gray = cv2.resize(gray, (width_px, height_px), interpolation=cv2.INTER_LINEAR)
    return gray, per_small


@dataclass(frozen=True, slots=True, eq=False)
class FollowedPicture:
    """One frame's luma at the size at which it is followed.

    Attributes:
        time_s: Presentation timestamp of its frame.
        size_px: (width, height) of the frame itself.
        gray: (H, W) uint8.
        full_per_small: (2,) frame pixels in a followed pixel, along x and y.
    """

    time_s: float
    size_px: tuple[int, int]
    gray: ImageArray
    full_per_small: FloatArray

    @classmethod
    def of(cls, frame: Frame, width_px: int) -> FollowedPicture:
        """Shrink a frame's luma to about a width."""
        gray, full_per_small = _shrunk(frame.picture, width_px)
        return cls(frame.time_s, frame.size_px, gray, full_per_small)

    def to_full(self, small_px: FloatArray) -> FloatArray:
        """Turn (N, 2) followed pixels into pixels of the frame; the centre of the first pixel is (0, 0) in both."""
        full_px: FloatArray = (np.asarray(small_px, dtype=np.float64) + 0.5) * self.full_per_small - 0.5
        return full_px

    def to_small(self, full_px: FloatArray) -> FloatArray:
        """Turn (N, 2) pixels of the frame into followed pixels."""
        small_px: FloatArray = (np.asarray(full_px, dtype=np.float64) + 0.5) / self.full_per_small - 0.5
        return small_px

    def is_blank(self) -> bool:
        """Say whether there is nothing to see."""
        _, deviation = cv2.meanStdDev(self.gray[::4, ::4])
        return float(deviation[0, 0]) < _BLANK_LEVELS

    def repeats(self, other: FollowedPicture) -> bool:
        """Say whether this is the same picture as another, coded again perhaps, and not only the same scene."""
        if self.gray.shape != other.gray.shape or cv2.norm(self.gray, other.gray, cv2.NORM_INF) > 1:
            return False
        return cv2.norm(self.gray, other.gray, cv2.NORM_L1) <= _SAME_SHARE * self.gray.size

    def likeness(self, other: FollowedPicture) -> float:
        """Return the correlation of the two thumbnails, -1 to 1; 0 where one is blank."""
        first, second = (
            cv2.resize(picture.gray, _THUMBNAIL_PX, interpolation=cv2.INTER_AREA).astype(np.float64).ravel()
            for picture in (self, other)
        )
        first, second = first - first.mean(), second - second.mean()
        spread = float(np.linalg.norm(first) * np.linalg.norm(second))
        return float(first @ second) / spread if spread > 0 else 0.0

    def corners(self, count: int, avoid_px: FloatArray, margin_px: int) -> FloatArray:
        """Return the best-textured point of each cell of a grid, where it is textured at all.

        Args:
            count: About how many cells.
            avoid_px: (M, 4) boxes in frame pixels in which no point may lie.
            margin_px: Points keep this distance from the picture's edge; followed pixels.

        Returns:
            (N, 2) whole followed pixels; whole, because patches there need no interpolation.
        """
        half = cv2.resize(self.gray, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        strength = cv2.cornerMinEigenVal(half, _CORNER_BLOCK)
        for left, top, right, bottom in self._in_half(avoid_px):
            strength[top:bottom, left:right] = 0.0
        edge = margin_px // 2 + 1
        inner = strength[edge : strength.shape[0] - edge, edge : strength.shape[1] - edge]
        rows = max(round(np.sqrt(count * inner.shape[0] / max(inner.shape[1], 1))), 1)
        high, wide = inner.shape[0] // rows, inner.shape[1] // max(count // rows, 1)
        if high < 1 or wide < 1:
            return np.zeros((0, 2))
        columns = inner.shape[1] // wide
        cells = inner[: rows * high, : columns * wide].reshape(rows, high, columns, wide).swapaxes(1, 2)
        flat = cells.reshape(rows, columns, high * wide)
        row, column = np.divmod(flat.argmax(axis=2), wide)
        y = np.arange(rows)[:, None] * high + row + edge
        x = np.arange(columns) * wide + column + edge
        textured = flat.max(axis=2) > _MIN_CORNER
        return np.column_stack([x[textured], y[textured]]) * 2.0

    def _in_half(self, boxes_px: FloatArray) -> list[list[int]]:
        edges = np.concatenate([self.to_small(boxes_px[:, :2]), self.to_small(boxes_px[:, 2:])], axis=1) / 2.0
        whole = np.concatenate([np.floor(edges[:, :2]), np.ceil(edges[:, 2:]) + 1], axis=1)
        clipped: list[list[int]] = np.clip(whole, 0, None).astype(np.int64).tolist()
        return clipped
