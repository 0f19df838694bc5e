"""Say of every part of a picture whether a worker who stands there would be found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from standoff.core import protocols
from standoff.core.finding import WorkerFinding
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.roles import IS_EQUIPMENT
from standoff.core.types import Detections, Frame, GroundMap, GroundPositions, NoGroundMap, Tracks
from standoff.core.watched_ground import (
    BEHIND_MACHINE,
    BLURRED,
    COLUMNS,
    MAYBE_SOMEBODY,
    NO_CONTRAST,
    NO_GROUND,
    NO_MAP,
    OUTSIDE_MAP,
    ROWS,
    TOO_DARK,
    TOO_SMALL,
    UNSURE_MAP,
    WATCHED,
    CellArray,
    WatchedGround,
    cell_middles_px,
    cell_of,
)
from standoff.stages.watched.ground_cells import ground_cells
from standoff.stages.watched.params import WatchedParams
from standoff.stages.watched.quality import PictureQuality, picture_quality
from standoff.stages.watched.suspects import Suspects

_PARTS: Final = (ROWS // 2, COLUMNS // 2)
_GUESSED: Final = "nobody measured how small a worker the detector finds: which ground is watched is a guess"
_FOOT_LEVEL: Final = 0.8
"""Where a machine without a ground point stands in its box: what is higher up in the box may be behind it."""
_MOST_PERCENT: Final = 90.0
_OPAQUE_SHARE: Final = 0.2
_RINGS: Final = 4
_TIME_ROUNDING_S: Final = 1e-6


class GroundWatcher(protocols.GroundWatcher):
    """Judge the pictures of one stream.

    Ground is watched where the map is sure, the picture is sharp, bright and clear enough, and a worker would be tall
    enough for the detector; but not where the detector sees what may be one. What else may hide a worker, a wall or a
    heap, nobody knows.

    Args:
        params: Settings; the defaults when left out.
        finding: What the detector finds.
        worker_radius_m: Action radius of a worker, which together with a machine's makes the circle about the machine.
    """

    def __init__(
        self,
        params: WatchedParams | None = None,
        finding: WorkerFinding | None = None,
        worker_radius_m: float = 2.0,
    ) -> None:
        self._params = params or WatchedParams()
        self._finding = finding or WorkerFinding()
        self._worker_radius_m = worker_radius_m
        self.reset()

    def reset(self) -> None:
        """Forget the stream."""
        self._judged_s = -math.inf
        self._cells: CellArray = np.zeros((ROWS, COLUMNS), dtype=np.int8)
        self._found: FloatArray = np.zeros((ROWS, COLUMNS))
        self._suspects = Suspects(self._params)
        self._looks = self._judged = self._judged_small = 0
        self._usual_px = 0.0

    def describe(self) -> Mapping[str, Any]:
        """Return what is taken for granted of the detector, for the record."""
        finding = self._finding
        return {
            "worker_height_px": finding.height_px,
            "found_share": finding.share,
            "measured": finding.measured,
            "warnings": self._warnings(),
        }

    def _warnings(self) -> list[str]:
        """Return that the heights are a guess, or what would make ground watched that is not."""
        if not self._finding.measured:
            return [_GUESSED]
        if 2 * self._judged_small <= self._looks:
            return []
        usual_px, share = self._usual_px / self._judged, self._params.found_share
        least_px = self._finding.least_height_px(share)
        return [
            f"most ground is not watched: a worker there is about {usual_px:.0f} px tall in the detector's input, and "
            f"{100.0 * share:.0f} % of them are found from {least_px:.0f} px on: fly lower, zoom in, or set "
            "detect.slices"
        ]

    def update(
        self,
        frame: Frame,
        detections: Detections,
        ground: GroundMap | NoGroundMap,
        tracks: Tracks,
        positions: GroundPositions,
    ) -> WatchedGround:
        """Judge one frame.

        Args:
            frame: With its picture.
            detections: Unsure ones, too: who is in no track may stand there all the same.
            ground: The frame's map, or why there is none.
            tracks: What is seen, machines among it.
            positions: Of the tracks, row by row.
        """
        nothing = np.full((ROWS, COLUMNS), np.nan)
        if isinstance(ground, NoGroundMap):
            self._judged_s = -math.inf
            self._looks += 1
            cells = np.full((ROWS, COLUMNS), NO_MAP, dtype=np.int8)
            nowhere = np.zeros(len(tracks), dtype=np.bool_)
            return WatchedGround(cells, nothing, np.full(len(tracks), np.nan), nowhere)
        if frame.time_s - self._judged_s >= self._params.judge_every_s - _TIME_ROUNDING_S:
            self._judge(frame, ground)
            self._looks += 1
            self._judged_s = frame.time_s
        cells = self._cells.copy()
        cells[self._behind_machines(tracks, frame.size_px) & (cells == WATCHED)] = BEHIND_MACHINE
        self._suspects.note(frame.time_s, detections, tracks, ground)
        cells[self._suspects.cells(ground, frame.size_px, _DISC) & (cells != NO_GROUND)] = MAYBE_SOMEBODY
        around, suspects = np.full(len(positions), np.nan), np.zeros(len(positions), dtype=np.bool_)
        machines = positions.valid & IS_EQUIPMENT[positions.class_id]
        if machines.any():
            xy_m, reach_m = positions.xy_m[machines], positions.radius_m[machines] + self._worker_radius_m
            around[machines] = _around(cells, xy_m, reach_m, ground, frame.size_px)
            suspects[machines] = self._suspects.near(xy_m, reach_m)
        return WatchedGround(cells, np.where(cells == WATCHED, self._found, np.nan), around, suspects)

    def _judge(self, frame: Frame, ground: GroundMap) -> None:
        params, size_px = self._params, frame.size_px
        asked = ground_cells(ground, size_px, params.stature_m)
        self._found = self._finding.share_found(asked.height_px, size_px).reshape(ROWS, COLUMNS)
        small_px = self._finding.picture_px_per_input_px(size_px)
        if asked.is_ground.any():
            self._judged += 1
            self._usual_px += float(np.median(asked.height_px[asked.is_ground])) / small_px
            found = self._found[asked.is_ground.reshape(ROWS, COLUMNS)]
            self._judged_small += int((found < params.found_share).mean() > 0.5)
        dark, faint, blurred = self._unusable(picture_quality(frame.picture, *_PARTS), small_px)
        causes = (
            (~asked.is_ground, NO_GROUND),
            (~asked.in_map, OUTSIDE_MAP),
            (dark, TOO_DARK),
            (faint, NO_CONTRAST),
            (blurred, BLURRED),
            (self._found < params.found_share, TOO_SMALL),
            (~(asked.sigma_m <= params.largest_sigma_m), UNSURE_MAP),
        )
        self._cells = np.full((ROWS, COLUMNS), WATCHED, dtype=np.int8)
        for affected, reason in reversed(causes):
            self._cells[affected.reshape(ROWS, COLUMNS)] = reason

    def _unusable(self, quality: PictureQuality, small_px: float) -> tuple[BoolArray, BoolArray, BoolArray]:
        """Tell (ROWS, COLUMNS) where it is too dark, where there is no contrast and where the picture is blurred."""
        params = self._params
        contrast = quality.contrast / np.maximum(quality.brightness, 1.0)
        # Even ground has little contrast of its own: what else there is beside it, and further away, which is above it
        # in the picture, shows how clear the air is. Where there is next to none, something lies on the lens.
        clear = np.maximum.accumulate(np.percentile(contrast, _MOST_PERCENT, axis=1))[:, None]
        faint = (clear < params.least_contrast) | (contrast < _OPAQUE_SHARE * params.least_contrast)
        signal = np.percentile(quality.contrast, _MOST_PERCENT)
        dark = np.full_like(faint, signal < params.least_signal * quality.noise)
        blurred = _usual_near(quality.blur_px) > params.largest_blur_px * small_px
        return _finer(dark), _finer(faint), _finer(blurred)

    @staticmethod
    def _behind_machines(tracks: Tracks, size_px: tuple[int, int]) -> BoolArray:
        machines = IS_EQUIPMENT[tracks.class_id]
        left, top, right, bottom = tracks.xyxy_px[machines].T[:, :, None]
        foot_y = tracks.foot_px[machines, 1:]
        foot_y = np.where(np.isfinite(foot_y), foot_y, top + _FOOT_LEVEL * (bottom - top))
        x, y = cell_middles_px(size_px).T
        behind = (x >= left) & (x <= right) & (y >= top) & (y <= np.minimum(foot_y, bottom))
        return np.asarray(behind.any(axis=0).reshape(ROWS, COLUMNS))


def _around(
    cells: CellArray, xy_m: FloatArray, reach_m: FloatArray, ground: GroundMap, size_px: tuple[int, int]
) -> FloatArray:
    """Return (N,) what share of the circle about each machine is watched."""
    points_m = xy_m[:, None] + reach_m[:, None, None] * _DISC
    points_px, seen = ground.to_image(points_m.reshape(-1, 2))
    places, inside = cell_of(points_px, size_px)
    watched = seen & inside & (cells[places[:, 0], places[:, 1]] == WATCHED)
    share: FloatArray = watched.reshape(len(reach_m), -1).mean(axis=1)
    return share


def _disc() -> FloatArray:
    """Return (N, 2) points that stand for equal parts of the unit circle: rings of 1, 6, 12, ... of them."""
    points = [np.zeros((1, 2))]
    for ring in range(1, _RINGS + 1):
        turns = 2.0 * np.pi * np.arange(6 * ring) / (6 * ring)
        points.append(np.column_stack([np.cos(turns), np.sin(turns)]) * ring / (_RINGS + 0.5))
    return np.concatenate(points)


_DISC: Final = _disc()


def _finer(parts: BoolArray) -> BoolArray:
    return np.kron(parts, np.ones((ROWS // parts.shape[0], COLUMNS // parts.shape[1]), dtype=np.bool_))


def _usual_near(values: FloatArray) -> FloatArray:
    """Return the median of the three by three parts about each; NaN, where none of them tells, as usual elsewhere."""
    around = np.pad(values, 1, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(around, (3, 3)).reshape(*values.shape, 9)
    told = np.isfinite(windows).sum(axis=2)
    # Sorted, what is not known comes last.
    in_order, last = np.sort(windows, axis=2), np.maximum(told - 1, 0)
    middle = [np.take_along_axis(in_order, k[:, :, None], axis=2)[:, :, 0] for k in (last // 2, (last + 1) // 2)]
    usual: FloatArray = (middle[0] + middle[1]) / 2.0
    usual[told == 0] = np.nanmedian(values) if (told > 0).any() else 0.0
    return usual
