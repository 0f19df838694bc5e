"""How well a run's tracks stand where people stood, and how well its distances between them hold.

Truth is a CSV file with the columns `frame,id,x,y,w,h,conf,X,Y` (MOTChallenge's order): frames from 1, boxes in
pixels, X and Y in metres on the ground. Truth frame n is the run's frame index n - 1. Truth with conf 0 is not scored:
neither it nor the tracks matched to it count for or against the run.

In each frame, tracks are matched one to one with truth: on the ground, where both stand at most 2 m apart, which is a
worker's own action radius (paper, Table 6); or, when a smallest overlap is given, by their boxes. The first rule asks
whether the run knows that somebody is there; it leaves out position errors above 2 m, which count as a miss and a false
alarm instead. The second also asks for a tight box, and keeps position errors of any size. A track without a position
claims nothing on the ground: the first rule leaves it out.

Everything is scored twice: as reported, coasting tracks included, because that is what people see; and without the
coasting ones. Distances are those of `proximity.parquet`, after the outlier filter: what the run claims, not what could
be computed again from its positions. Truth that no track covers is missed, and a true pair without a measured distance
is missing from `pairs_share`: nothing is dropped silently.

Precision is a lower bound wherever not everybody is labelled: a track on somebody without a label counts as wrong.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from standoff.clips import Columns, RunFolder, chosen_rows
from standoff.core.assignment import assign
from standoff.core.boxes import overlaps
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray
from standoff.evaluation.matching import NOTHING
from standoff.evaluation.pair_rows import PAIR_COLUMNS, distances_of
from standoff.evaluation.positions_input import (
    TRACK_COLUMNS,
    read_truth,
)

NOTE = "Precision is a lower bound where not everybody is labelled. Missed truth and unmeasured pairs are counted."
_MAX_GROUND_M = 2.0


@dataclass(frozen=True, slots=True)
class EntityScore:
    """Who was found, and where.

    Attributes:
        truths: Truth rows that are scored.
        tracks: Track rows, less those matched to truth that is not scored.
        matched: Truth rows with a track.
        located: Of these, with a valid position.
        recall: matched / truths.
        precision: matched / tracks, a lower bound; NaN without tracks.
        position_median_m: Median distance between reported and true position; NaN where nothing was located.
        position_mean_m: Mean of the same.
        position_p95_m: 95th percentile of the same.
    """

    truths: int
    tracks: int
    matched: int
    located: int
    recall: float
    precision: float
    position_median_m: float
    position_mean_m: float
    position_p95_m: float


@dataclass(frozen=True, slots=True)
class PairScore:
    """How well distances hold; errors are NaN where no pair was measured.

    Attributes:
        true_pairs: Pairs of scored truth in one frame whose true distance is within the limit and not 0.
        pairs: Of these, measured.
        pairs_share: pairs / true_pairs; NaN without true pairs.
        made_m: Mean absolute distance error (the paper's Eq. 8).
        mape_percent: Mean absolute percentage error (Eq. 9).
        median_signed_error_m: Median of measured less true distance.
        p95_error_m: 95th percentile of the absolute error.
        within_2_sigma: Share of the measured pairs whose error is at most two of their own standard errors.
    """

    true_pairs: int
    pairs: int
    pairs_share: float
    made_m: float
    mape_percent: float
    median_signed_error_m: float
    p95_error_m: float
    within_2_sigma: float


@dataclass(frozen=True, slots=True)
class PositionsResult:
    """A run against truth.

    Attributes:
        first_frame: First scored truth frame, counted from 1.
        last_frame: Last one.
        frames: Number of scored frames.
        frames_without_tracks: Of these, those in which the run reports nobody; their truth is missed.
        pairs_up_to_m: Largest true distance of a scored pair.
        min_overlap: Smallest IoU of a match; None: matched on the ground.
        entities: With all reported tracks.
        pairs: The same.
        observed_entities: Without tracks that coast.
        observed_pairs: The same.
    """

    first_frame: int
    last_frame: int
    frames: int
    frames_without_tracks: int
    pairs_up_to_m: float
    min_overlap: float | None
    entities: EntityScore
    pairs: PairScore
    observed_entities: EntityScore
    observed_pairs: PairScore

    def to_dict(self) -> dict[str, float | int | None]:
        """Return all figures on one level, None where nothing was measured; `observed_` is without coasting tracks."""
        observed = asdict(self.observed_entities) | asdict(self.observed_pairs)
        figures = asdict(self.entities) | asdict(self.pairs)
        figures |= {f"observed_{name}": value for name, value in observed.items()}
        for name in ("first_frame", "last_frame", "frames", "frames_without_tracks", "pairs_up_to_m", "min_overlap"):
            figures[name] = getattr(self, name)
        return {name: None if value is None or np.isnan(value) else value for name, value in figures.items()}


def evaluate_positions(
    run_folder: Path | str,
    truth_file: Path | str,
    *,
    frames: tuple[int, int] | None = None,
    pairs_up_to_m: float = 15.0,
    min_overlap: float | None = None,
    class_name: str = "worker",
) -> PositionsResult:
    """Compare a run's tables with a truth file.

    Args:
        run_folder: Holds `tracks.parquet` and `proximity.parquet`.
        truth_file: CSV as at this module's head.
        frames: First and last truth frame, from 1, completely labelled between; None: the frames that have labels.
        pairs_up_to_m: Pairs that are truly further apart are not scored.
        min_overlap: Smallest IoU of a track's box with the true one; None: match on the ground.
        class_name: What the truth shows; tracks of other classes are left out.

    Raises:
        DataError: A file is missing or not what it should be, or the run was not asked for such pairs.
    """
    run = RunFolder(Path(run_folder))
    tracks, pairs = run.table("tracks", TRACK_COLUMNS), run.table("proximity", PAIR_COLUMNS)
    tracks = chosen_rows(tracks, tracks["class"] == class_name)
    return score_positions(
        tracks, pairs, read_truth(truth_file), frames=frames, pairs_up_to_m=pairs_up_to_m, min_overlap=min_overlap
    )


def score_positions(
    tracks: Columns,
    pairs: Columns,
    truth: Columns,
    *,
    frames: tuple[int, int] | None = None,
    pairs_up_to_m: float = 15.0,
    min_overlap: float | None = None,
) -> PositionsResult:
    """Compare tracks and distances with truth, given as columns.

    Args:
        tracks: frame (from 0), track_id, x1_px, y1_px, x2_px, y2_px, observed, x_m, y_m (NaN where invalid).
        pairs: frame (from 0), track_a, track_b (the larger), distance_m, sigma_m, measured.
        truth: As from `read_truth`.
        frames: As for `evaluate_positions`.
        pairs_up_to_m: As for `evaluate_positions`.
        min_overlap: As for `evaluate_positions`.

    Raises:
        DataError: Nothing to score in these frames, or the run was not asked for such pairs.
    """
    scored = np.unique(truth["frame"]) if frames is None else np.arange(frames[0], frames[1] + 1)
    truth = chosen_rows(truth, np.isin(truth["frame"], scored))
    if not (truth["conf"] > 0).any():
        found = f"none in frames {frames[0]} to {frames[1]}" if frames else "none"
        raise DataError(expected="truth with conf above 0", found=found, fix="choose frames that are labelled")
    tracks = chosen_rows(tracks, np.isin(tracks["frame"] + 1, scored))
    if min_overlap is None:
        tracks = chosen_rows(tracks, np.isfinite(tracks["x_m"]) & np.isfinite(tracks["y_m"]))
    elif np.isnan(truth["x"]).all():
        raise DataError(expected="truth with boxes", found="none", fix="leave out --min-overlap to match on the ground")
    pairs = chosen_rows(pairs, np.isin(pairs["frame"] + 1, scored))
    observed = chosen_rows(tracks, tracks["observed"].astype(np.bool_))
    (entities, pair_score), (observed_entities, observed_pairs) = (
        _score(truth, rows, _match(truth, rows, min_overlap), pairs, pairs_up_to_m) for rows in (tracks, observed)
    )
    return PositionsResult(
        first_frame=int(scored[0]),
        last_frame=int(scored[-1]),
        frames=len(scored),
        frames_without_tracks=len(scored) - len(np.unique(tracks["frame"])),
        pairs_up_to_m=pairs_up_to_m,
        min_overlap=min_overlap,
        entities=entities,
        pairs=pair_score,
        observed_entities=observed_entities,
        observed_pairs=observed_pairs,
    )


def _score(
    truth: Columns, tracks: Columns, track_row: IntArray, pairs: Columns, pairs_up_to_m: float
) -> tuple[EntityScore, PairScore]:
    is_scored = truth["conf"] > 0
    ignored_tracks = int((track_row[~is_scored] != NOTHING).sum())
    truth, track_row = chosen_rows(truth, is_scored), track_row[is_scored]
    entities = _score_entities(truth, tracks, track_row, len(tracks["frame"]) - ignored_tracks)
    found = track_row != NOTHING
    track_id = np.full(len(track_row), NOTHING)
    track_id[found] = tracks["track_id"][track_row[found]]
    return entities, _score_pairs(truth, track_id, pairs, pairs_up_to_m)


def _match(truth: Columns, tracks: Columns, min_overlap: float | None) -> IntArray:
    """Return for every truth row the row of its track, or -1."""
    track_row = np.full(len(truth["frame"]), NOTHING)
    similarity, at_least = (_nearness, 1.0 / (1.0 + _MAX_GROUND_M)) if min_overlap is None else (_overlap, min_overlap)
    for frame in np.unique(truth["frame"]):
        rows, columns = np.flatnonzero(truth["frame"] == frame), np.flatnonzero(tracks["frame"] == frame - 1)
        first, second = assign(similarity(chosen_rows(truth, rows), chosen_rows(tracks, columns)), at_least)
        track_row[rows[first]] = columns[second]
    return track_row


def _overlap(truth: Columns, tracks: Columns) -> FloatArray:
    true_px = np.column_stack([truth["x"], truth["y"], truth["x"] + truth["w"], truth["y"] + truth["h"]])
    track_px = np.column_stack([tracks[f"{edge}_px"] for edge in ("x1", "y1", "x2", "y2")])
    return overlaps(true_px, track_px)


def _nearness(truth: Columns, tracks: Columns) -> FloatArray:
    """Return 1 where both stand in one place, less the further apart, 0 where one has no position."""
    distance_m = np.hypot(truth["X"][:, None] - tracks["x_m"], truth["Y"][:, None] - tracks["y_m"])
    nearness: FloatArray = np.nan_to_num(1.0 / (1.0 + distance_m), nan=0.0)
    return nearness


def _score_entities(truth: Columns, tracks: Columns, track_row: IntArray, track_count: int) -> EntityScore:
    found = track_row != NOTHING
    rows, count = track_row[found], int(found.sum())
    error_m = np.hypot(tracks["x_m"][rows] - truth["X"][found], tracks["y_m"][rows] - truth["Y"][found])
    error_m = error_m[np.isfinite(error_m)]
    return EntityScore(
        truths=len(track_row),
        tracks=track_count,
        matched=count,
        located=len(error_m),
        recall=count / len(track_row),
        precision=count / track_count if track_count else np.nan,
        position_median_m=_percentile(error_m, 50),
        position_mean_m=_mean(error_m),
        position_p95_m=_percentile(error_m, 95),
    )


def _score_pairs(truth: Columns, track_id: IntArray, pairs: Columns, pairs_up_to_m: float) -> PairScore:
    first, second = _rows_of_pairs(truth["frame"])
    true_m = np.hypot(truth["X"][first] - truth["X"][second], truth["Y"][first] - truth["Y"][second])
    scored = (true_m > 0) & (true_m <= pairs_up_to_m)
    first, second, true_m = first[scored], second[scored], true_m[scored]
    frame = (truth["frame"][first] - 1).astype(np.int64)
    ends = track_id[first], track_id[second]
    measured_m, sigma_m, listed = distances_of(pairs, frame, *ends)
    if (np.minimum(*ends) != NOTHING).any() and not listed.any():
        raise DataError(
            expected="distances between the tracks that the truth shows",
            found="no such pair in the run's proximity table",
            fix="repeat the run with these classes among proximity.pairs, for people worker and worker",
        )
    measured = np.isfinite(measured_m)
    error_m = (measured_m - true_m)[measured]
    return PairScore(
        true_pairs=len(true_m),
        pairs=len(error_m),
        pairs_share=_mean(measured),
        made_m=_mean(np.abs(error_m)),
        mape_percent=100.0 * _mean(np.abs(error_m) / true_m[measured]),
        median_signed_error_m=_percentile(error_m, 50),
        p95_error_m=_percentile(np.abs(error_m), 95),
        within_2_sigma=_mean(np.abs(error_m) <= 2.0 * sigma_m[measured]),
    )


def _rows_of_pairs(frame: FloatArray) -> tuple[IntArray, IntArray]:
    """Return both rows of every pair of truth rows that share a frame."""
    pairs = [np.zeros((2, 0), np.int64)]
    for value in np.unique(frame):
        rows = np.flatnonzero(frame == value)
        pairs.append(rows[np.stack(np.triu_indices(len(rows), k=1))])
    first, second = np.concatenate(pairs, axis=1)
    return first, second


def _mean(values: FloatArray) -> float:
    return float(np.mean(values)) if len(values) else np.nan


def _percentile(values: FloatArray, percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else np.nan
