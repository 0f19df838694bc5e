"""Everything that a run said of one clip's visible pairs and entities, beside what is true: from tables alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray, TextArray
from standoff.evaluation.coverage.site_frame import rests_on_reference, shared_turning
from standoff.evaluation.matching import NOTHING
from standoff.evaluation.paper.corner_order import CornerOrder
from standoff.evaluation.run_and_clip import BesideTruth, read_beside_truth


@dataclass(frozen=True, slots=True, eq=False)
class PairSamples:
    """A person and a machine, both visible in one frame, N times.

    Attributes:
        kind: (N,) "worker-excavator", by the true classes.
        true_m: (N,) distance, centre to centre.
        measured_m: (N,) as the run has it; NaN where it has none: not measured, or one of the two not found.
        sigma_m: (N,) standard error that the run states; NaN where it states none.
        sight: (N,) of `SIGHTS`.
    """

    kind: TextArray
    true_m: FloatArray
    measured_m: FloatArray
    sigma_m: FloatArray
    sight: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class PositionSamples:
    """One entity that is visible in one frame, N times.

    Attributes:
        class_name: (N,) its true class.
        off_m: (N, 2) its position less the true one, site frame; NaN where it has none.
        covariance_m2: (N, 2, 2) that the run states; NaN with it.
    """

    class_name: TextArray
    off_m: FloatArray
    covariance_m2: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ClipSamples:
    """One run of one clip.

    Attributes:
        run: Folder.
        clip: Folder.
        frames: That the run read.
        pairs: Visible pairs in them.
        positions: Visible entities in them; None where the run counts its places from somewhere else than the truth.
    """

    run: Path
    clip: Path
    frames: int
    pairs: PairSamples
    positions: PositionSamples | None


def read_samples(run: Path, clip: Path) -> ClipSamples:
    """Compare a run's tables with a clip's truth, in every frame that the run read.

    Args:
        run: Folder with `tracks.parquet`, `proximity.parquet` and `frames.parquet`.
        clip: Folder that `standoff simulate` wrote, with or without a film.

    Raises:
        DataError: A file is missing or not what it should be, or the run is not one of this clip.
    """
    beside = read_beside_truth(run, clip)
    turning = shared_turning(beside.record.get("settings") or {}, clip)
    return ClipSamples(
        run=run,
        clip=clip,
        frames=len(beside.frames["frame"]),
        pairs=_pairs(beside),
        positions=None if turning is None else _positions(beside, turning),
    )


def _pairs(beside: BesideTruth) -> PairSamples:
    truth, known = beside.truth, np.isfinite(beside.true_m)
    ends = beside.ends[0][known], beside.ends[1][known]
    names = _names(truth["class_id"])
    return PairSamples(
        kind=names[ends[0]] + "-" + names[ends[1]],
        true_m=beside.true_m[known],
        measured_m=beside.measured_m[known],
        sigma_m=beside.sigma_m[known],
        sight=np.maximum(*(truth["sight"][end] for end in ends)),
    )


def _positions(beside: BesideTruth, turning: CornerOrder) -> PositionSamples:
    truth, tracks, track_row, frames = beside.truth, beside.tracks, beside.track_row, beside.frames
    found = track_row != NOTHING
    rows = track_row[found]
    xy_m, covariance_m2 = np.full((len(found), 2), np.nan), np.full((len(found), 2, 2), np.nan)
    xy_m[found] = np.column_stack([tracks["x_m"], tracks["y_m"]])[rows]
    sigma_x_m, sigma_y_m, shared_m2 = (tracks[name][rows] for name in ("sigma_x_m", "sigma_y_m", "cov_xy_m2"))
    covariance_m2[found] = np.stack([sigma_x_m**2, shared_m2, shared_m2, sigma_y_m**2], axis=1).reshape(-1, 2, 2)
    true_m = np.column_stack([truth["x_m"], truth["y_m"]])
    mapped = np.array([rests_on_reference(method) for method in frames["map_method"].tolist()], dtype=np.bool_)
    xy_m[~np.isin(truth["frame"], frames["frame"][mapped])] = np.nan
    placed = np.flatnonzero(np.isfinite(xy_m).all(axis=1))
    # A square looks the same four ways: the turn that brings a frame's places nearest to the truth counts.
    for here in np.split(placed, np.flatnonzero(np.diff(truth["frame"][placed])) + 1) if len(placed) else ():
        turn = turning.nearest(xy_m[here], true_m[here])
        xy_m[here] = turning.to_site(xy_m[here], turn)
        covariance_m2[here] = turning.covariance_to_site(covariance_m2[here], turn)
    return PositionSamples(_names(truth["class_id"]), xy_m - true_m, covariance_m2)


def _names(class_id: IntArray) -> TextArray:
    names: TextArray = np.array([site_class.name for site_class in CLASSES], dtype=object)[class_id]
    return names
