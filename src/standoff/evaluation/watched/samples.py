"""Every worker of a clip in every frame: on what ground he stands, and whether the run shows him."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from standoff.core.classes import CLASSES
from standoff.core.errors import DataError
from standoff.core.finding import WorkerFinding
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.core.watched_ground import COLUMNS, MAYBE_SOMEBODY, ROWS, cell_of
from standoff.evaluation.matching import NOTHING
from standoff.evaluation.run_and_clip import WHOLE, BesideTruth, read_beside_truth

_RADIUS_M = np.array([site_class.action_radius_m for site_class in CLASSES])


@dataclass(frozen=True, slots=True, eq=False)
class WorkerSamples:
    """A worker who can be seen in one frame and whose feet are in the picture, N times.

    Attributes:
        clip: Folder.
        frames: That the run read.
        watched_share: Of the ground in the picture, mean of the frames.
        detector: What it says of the workers that it finds.
        height_px: (N,) of the box of all of him.
        input_height_px: (N,) the same in the detector's input.
        whole: (N,) whether less than a tenth of him is hidden, and nothing cut off by the picture's edge.
        cell: (N,) what the run says of the ground there, as in `WatchedGround.cells`.
        found: (N,) whether a track shows him.
        suspected: (N,) whether none does, and the run says that somebody may stand there.
        in_breach: (N,) whether his circle truly touches that of a machine that can be seen.
        called_clear: (N,) whether, of such a machine, the run says nothing because no track shows him, or measures
            that the circles are a metre apart or more.
    """

    clip: Path
    frames: int
    watched_share: float
    detector: WorkerFinding
    height_px: FloatArray
    input_height_px: FloatArray
    whole: BoolArray
    cell: IntArray
    found: BoolArray
    suspected: BoolArray
    in_breach: BoolArray
    called_clear: BoolArray


_CLEAR_GAP_M = 1.0


def read_worker_samples(run: Path, clip: Path) -> WorkerSamples:
    """Read what a run said of the ground under each worker.

    Args:
        run: Folder with `tracks.parquet`, `proximity.parquet` and `frames.parquet`.
        clip: Folder that `standoff simulate` wrote.

    Raises:
        DataError: A file is missing or not what it should be, or the run is not one of this clip.
    """
    beside = read_beside_truth(run, clip, ("watched_cells", "watched_share"), ("foot_x_px", "foot_y_px"))
    truth, frames = beside.truth, beside.frames
    foot_px = np.column_stack([truth["foot_x_px"], truth["foot_y_px"]])
    place, inside = cell_of(foot_px, beside.size_px)
    asked = np.flatnonzero(beside.is_person & inside)
    cells = _cells(frames["watched_cells"], run)
    row = np.searchsorted(frames["frame"], truth["frame"][asked])
    in_breach, called_clear = _breaches(beside)
    detector = WorkerFinding.of_detector(beside.record.get("model") or {})
    height_px = (truth["full_y2_px"] - truth["full_y1_px"])[asked]
    cell = cells[row, place[asked, 0], place[asked, 1]]
    found = beside.track_row[asked] != NOTHING
    return WorkerSamples(
        clip=clip,
        frames=len(cells),
        watched_share=float(np.nanmean(frames["watched_share"])),
        detector=detector,
        height_px=height_px,
        input_height_px=height_px / detector.picture_px_per_input_px(beside.size_px),
        whole=truth["sight"][asked] == WHOLE,
        cell=cell,
        found=found,
        suspected=~found & (cell == MAYBE_SOMEBODY),
        in_breach=in_breach[asked],
        called_clear=called_clear[asked],
    )


def _cells(column: FloatArray, run: Path) -> IntArray:
    try:
        return np.array([list(one) for one in column], dtype=np.int64).reshape(-1, ROWS, COLUMNS)
    except (TypeError, ValueError) as error:
        raise DataError(
            expected=f"{ROWS} x {COLUMNS} cells in every frame of {run}",
            found="a run in which nobody judged the ground",
            fix="repeat `standoff run` with this version",
        ) from error


def _breaches(beside: BesideTruth) -> tuple[BoolArray, BoolArray]:
    """Return (T,) whether each person is in a breach, and whether a breach of his is called clear."""
    truth, (people, machines) = beside.truth, beside.ends
    radii_m = _RADIUS_M[truth["class_id"][people]] + _RADIUS_M[truth["class_id"][machines]]
    breach = beside.true_m < radii_m
    silent = (beside.track_id[people] == NOTHING) | (beside.measured_m - radii_m >= _CLEAR_GAP_M)
    in_breach, called_clear = (np.zeros(len(truth["frame"]), dtype=np.bool_) for _ in range(2))
    in_breach[people[breach]] = True
    called_clear[people[breach & silent]] = True
    return in_breach, called_clear
