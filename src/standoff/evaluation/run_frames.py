"""A run frame by frame, as it is scored: from its results while it goes on, or from its folder when it is over."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from standoff.clips import MAP_COLUMNS, Columns, RecordedDetections, RunFolder, chosen_rows, map_of
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.protocols import AnyGround
from standoff.core.types import Detections, FrameResult, Hazard, IntArray, TextArray
from standoff.evaluation.pair_rows import PAIR_COLUMNS
from standoff.evaluation.positions_input import TRACK_COLUMNS

_TRACKS = (*TRACK_COLUMNS, "reason")
_MAP = tuple(name for name, *_ in MAP_COLUMNS)


@dataclass(frozen=True, slots=True, eq=False)
class RunFrame:
    """What a run said of one frame: detections, tracks (M) and pairs of tracks (K).

    Attributes:
        index: Of the frame in the source.
        time_s: Its presentation timestamp.
        ground: The map, or why there is none.
        ground_s: Seconds spent on finding it; NaN where nobody timed it.
        detections: Empty where the detector rested.
        track_id: (M,).
        track_px: (M, 4) boxes.
        track_class_id: (M,).
        xy_m: (M, 2) positions, site frame; NaN where `reason` says why.
        reason: (M,) why there is no position; empty where there is one.
        pair_ids: (K, 2) tracks of each pair, the smaller id first.
        distance_m: (K,) NaN where not measured.
        sigma_m: (K,) standard error that is stated for it; NaN with it.
        hazards: The events.
    """

    index: int
    time_s: float
    ground: AnyGround
    ground_s: float
    detections: Detections
    track_id: IntArray
    track_px: FloatArray
    track_class_id: IntArray
    xy_m: FloatArray
    reason: TextArray
    pair_ids: IntArray
    distance_m: FloatArray
    sigma_m: FloatArray
    hazards: tuple[Hazard, ...]

    @classmethod
    def of_result(cls, result: FrameResult) -> Self:
        """Return a frame of a run that goes on."""
        tracks, near = result.tracks, result.proximities
        return cls(
            index=result.frame.index,
            time_s=result.frame.time_s,
            ground=result.ground,
            ground_s=result.stage_ms["ground"] / 1e3,
            detections=result.detections,
            track_id=tracks.track_id,
            track_px=tracks.xyxy_px,
            track_class_id=tracks.class_id,
            xy_m=result.positions.xy_m,
            reason=result.positions.reason,
            pair_ids=np.column_stack([near.track_a, near.track_b]),
            distance_m=near.distance_m,
            sigma_m=near.sigma_m,
            hazards=result.hazards,
        )


def read_run_frames(run: Path, seen: RecordedDetections) -> Iterator[RunFrame]:
    """Read the frames of a run from its folder, in their order.

    What the end of the run closed cannot be told from what closed in its last frame: both are left out of that frame.

    Args:
        run: Folder with `tracks`, `proximity`, `frames` and `hazards`.
        seen: Its detections.

    Raises:
        DataError: A file is missing or not what it should be.
    """
    told = RunFolder(run)
    frames, tracks = told.table("frames", ("frame", "time_s", *_MAP)), told.tracks(_TRACKS)
    pairs = told.table("proximity", PAIR_COLUMNS)
    pairs = chosen_rows(pairs, np.argsort(pairs["frame"], kind="stable"))
    events = told.hazards()
    indices = frames["frame"].tolist()
    for row, index in enumerate(indices):
        seen_row = seen.row_of(index)
        if seen_row is None:
            raise _broken(run, f"frame {index} in all tables")
        found, near, said = _of_frame(tracks, index), _of_frame(pairs, index), events.get(index, ())
        yield RunFrame(
            index=index,
            time_s=float(frames["time_s"][row]),
            ground=_ground(frames, row, seen.size_px, run),
            ground_s=np.nan,
            detections=seen.detections_at(seen_row),
            track_id=found["track_id"],
            track_px=np.column_stack([found[f"{edge}_px"] for edge in ("x1", "y1", "x2", "y2")]),
            track_class_id=found["class_id"],
            xy_m=np.column_stack([found["x_m"], found["y_m"]]),
            reason=found["reason"],
            pair_ids=np.column_stack([near["track_a"], near["track_b"]]),
            distance_m=near["distance_m"],
            sigma_m=near["sigma_m"],
            hazards=tuple(one for one in said if index != indices[-1] or one.phase != "closed"),
        )


def _ground(frames: Columns, row: int, size_px: tuple[int, int], run: Path) -> AnyGround:
    try:
        return map_of({name: frames[name][row] for name in _MAP}, size_px)
    except (TypeError, ValueError) as error:
        raise _broken(run, f"a ground map, or none, in every row of its frames ({error})") from error


def _of_frame(columns: Columns, index: int) -> Columns:
    start, end = np.searchsorted(columns["frame"], [index, index + 1])
    return {name: column[start:end] for name, column in columns.items()}


def _broken(run: Path, expected: str) -> DataError:
    return DataError(expected=expected, found=f"otherwise in {run}", fix="repeat `standoff run` to its end")
