"""A drawn site that a camera looks straight down on: a red worker, a blue machine, on rough ground that never is quite
the same twice; and the detector that finds them by their colours.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.finding import KEY
from standoff.core.protocols import Detector
from standoff.core.types import Detections, Frame, ImageArray

SPAN_M = 64.0
"""Width of the picture on the ground."""
_WORKER_M, _MACHINE_M = 1.5, 4.0
_SMALL_PX = (480, 270)


class DrawnSite:
    """Draws.

    Args:
        size_px: (width, height).
        seed: Of the ground.
    """

    def __init__(self, size_px: tuple[int, int] = (1280, 720), seed: int = 0) -> None:
        self.size_px = size_px
        self._rng = np.random.default_rng(seed)
        width_px, height_px = size_px
        coarse = self._rng.integers(90, 170, (height_px // 8 + 1, width_px // 8 + 1), dtype=np.uint8)
        ground = np.kron(coarse, np.ones((8, 8), np.uint8))[:height_px, :width_px]
        self._ground = np.repeat(ground[..., None], 3, axis=2)
        self._noise = self._rng.integers(0, 12, (64, width_px, 3), dtype=np.uint8)
        self.m_per_px = SPAN_M / width_px

    def picture(self, worker_m: tuple[float, float] | None, machine_m: tuple[float, float] | None) -> ImageArray:
        """Return (H, W, 3) uint8, blue first: both where they stand, x to the right and y upwards from the middle."""
        image = self._ground.copy()
        row = int(self._rng.integers(0, self.size_px[1] - 64))
        image[row : row + 64] += self._noise
        for place_m, side_m, colour in ((machine_m, _MACHINE_M, (255, 0, 0)), (worker_m, _WORKER_M, (0, 0, 255))):
            if place_m is not None:
                x, y = self.to_px(place_m)
                half = side_m / self.m_per_px / 2.0
                left, top, right, bottom = (max(0, round(v)) for v in (x - half, y - half, x + half, y + half))
                image[top:bottom, left:right] = colour
        return image

    def to_px(self, place_m: tuple[float, float]) -> tuple[float, float]:
        width_px, height_px = self.size_px
        return (width_px - 1) / 2.0 + place_m[0] / self.m_per_px, (height_px - 1) / 2.0 - place_m[1] / self.m_per_px

    def write_survey(self, path: Path) -> Path:
        """Write where eight points of the picture are on the ground."""
        half = SPAN_M / 2.0
        high = half * self.size_px[1] / self.size_px[0]
        places = [(x * half, y * high) for x in (-0.9, 0.0, 0.9) for y in (-0.9, 0.0, 0.9)]
        lines = [f"image_size_px: [{self.size_px[0]}, {self.size_px[1]}]", "points:"]
        for number, place in enumerate(places):
            x, y = self.to_px(place)
            lines.append(f"  - {{name: p{number}, px: [{x:.3f}, {y:.3f}], m: [{place[0]:.4f}, {place[1]:.4f}]}}")
        path.write_text("\n".join([*lines, ""]))
        return path


class ColourDetector(Detector):
    """Finds what is red and what is blue.

    Args:
        work_ms: How long it works at each picture beside that.
    """

    def __init__(self, work_ms: float = 0.0) -> None:
        self._work_s = work_ms / 1e3

    def describe(self) -> Mapping[str, Any]:
        return {
            "class_map": {"red": "worker", "blue": "wheel_loader"},
            KEY: {"height_px": [1.0, 2.0], "share": [1.0, 1.0]},
        }

    def detect(self, frame: Frame) -> Detections:
        until_s = time.perf_counter() + self._work_s
        small = frame.picture.resized_bgr(*_SMALL_PX).astype(np.int16)
        blue, green, red = small[..., 0], small[..., 1], small[..., 2]
        found = []
        for mask, class_id in ((red - np.maximum(blue, green) > 90, 0), (blue - np.maximum(red, green) > 90, 2)):
            rows, columns = np.nonzero(mask)
            if len(rows) >= 4:
                scale_x, scale_y = frame.size_px[0] / _SMALL_PX[0], frame.size_px[1] / _SMALL_PX[1]
                box = (columns.min() * scale_x, rows.min() * scale_y)
                found.append((*box, (columns.max() + 1) * scale_x, (rows.max() + 1) * scale_y, class_id))
        while time.perf_counter() < until_s:
            pass
        rows_found = np.array(found, dtype=np.float64).reshape(-1, 5)
        middle = (rows_found[:, :2] + rows_found[:, 2:4]) / 2.0
        return Detections(
            xyxy_px=rows_found[:, :4],
            score=np.full(len(rows_found), 0.95),
            class_id=rows_found[:, 4].astype(np.int64),
            foot_px=middle,
            foot_covariance_px2=np.tile(np.eye(2), (len(rows_found), 1, 1)),
        )
