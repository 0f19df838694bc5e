"""How well a run's tracks stand where people stood, and how well its distances between them hold.

Truth is a CSV file with the columns `frame,id,x,y,w,h,conf,X,Y,Z` (MOTChallenge's order): frames from 1, boxes in
pixels, X and Y in metres on the ground. Truth frame n is the run's frame index n - 1. Rows with conf 0 are not
scored: neither they nor the tracks matched to them count for or against the run.

In each frame, tracks are matched one to one with truth: by box overlap (IoU of at least 0.5) where the truth has boxes,
else by distance on the ground (at most 2 m). Everything is scored twice: as reported, coasting tracks included,
because that is what people see; and `observed_`, without the coasting ones. Distances are those of
`proximity.parquet`, after the outlier filter: the product's claim, not one that is computed again here. Truth that no
track covers is missing, and so are true pairs that were not measured: both are counted.

Precision is a lower bound wherever not everybody is labelled: a track on somebody without a label counts as wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.stages.track.association import assign, overlaps

NOTE = "Precision is a lower bound where not everybody is labelled. Missed truth and unmeasured pairs are counted."
_TRUTH_COLUMNS = ("frame", "id", "x", "y", "w", "h", "conf", "X", "Y")
_TRACK_COLUMNS = ("frame", "track_id", "class", "x1_px", "y1_px", "x2_px", "y2_px", "observed", "x_m", "y_m")
_PAIR_COLUMNS = ("frame", "track_a", "track_b", "distance_m", "sigma_m", "measured")
_MIN_OVERLAP = 0.5
_MAX_GROUND_M = 2.0

Columns = Mapping[str, npt.NDArray[Any]]
_PairKey = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class PositionScore:
    """Figures over all scored frames; NaN where nothing could be measured.

    Attributes:
        truths: Scored truth rows.
        tracks: Track rows, without those matched to truth that is not scored.
        matched: Truth rows with a track.
        located: Of these, with a valid position.
        recall: matched / truths.
        precision: matched / tracks; a lower bound.
        position_median_m: Median distance of a track's position from the true one.
        position_mean_m: Mean of the same.
        position_p95_m: 95th percentile of the same.
        true_pairs: Pairs of scored truth in one frame, up to the limit.
        pairs: Of these, measured.
        pairs_share: pairs / true_pairs.
        made_m: Mean absolute distance error over the measured pairs (the paper's Eq. 8).
        mape_percent: Mean absolute percentage error over the same (Eq. 9).
        median_signed_m: Median of measured less true distance.
        p95_m: 95th percentile of the absolute distance error.
        within_2_sigma: Share of the measured pairs whose error is at most two of its own standard errors.
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
    true_pairs: int
    pairs: int
    pairs_share: float
    made_m: float
    mape_percent: float
    median_signed_m: float
    p95_m: float
    within_2_sigma: float


@dataclass(frozen=True, slots=True)
class PositionsResult:
    """A run against truth.

    Attributes:
        first_frame: First scored truth frame, counted from 1.
        last_frame: Last one.
        frames: Number of scored frames.
        frames_without_tracks: Of these, in how many the run reports nothing; their truth is missed.
        pairs_up_to_m: Largest true distance of a scored pair.
        reported: All tracks.
        observed: Without those that coast.
    """

    first_frame: int
    last_frame: int
    frames: int
    frames_without_tracks: int
    pairs_up_to_m: float
    reported: PositionScore
    observed: PositionScore

    def to_dict(self) -> dict[str, float | int | None]:
        """Return one flat level of numbers, None where nothing was measured; `observed_` without coasting tracks."""
        figures = {
            **asdict(self.reported),
            "frames": self.frames,
            "frames_without_tracks": self.frames_without_tracks,
            "first_frame": self.first_frame,
            "last_frame": self.last_frame,
            "pairs_up_to_m": self.pairs_up_to_m,
            **{f"observed_{name}": value for name, value in asdict(self.observed).items()},
        }
        return {name: value if np.isfinite(value) else None for name, value in figures.items()}


def evaluate_positions(
    run_folder: Path | str,
    truth_file: Path | str,
    *,
    frames: tuple[int, int] | None = None,
    pairs_up_to_m: float = 15.0,
    class_name: str = "worker",
) -> PositionsResult:
    """Compare a run's tables with a truth file.

    Args:
        run_folder: Holds `tracks.parquet` and `proximity.parquet`.
        truth_file: CSV as at this module's head.
        frames: First and last truth frame, from 1, all of them completely labelled; None: frames with labels.
        pairs_up_to_m: Pairs truly further apart are not scored.
        class_name: What the truth shows; tracks of other classes are left out.

    Raises:
        DataError: A file is missing or not what it should be, or the run measured no such pairs.
    """
    folder = Path(run_folder)
    tracks = _read_table(folder / "tracks.parquet", _TRACK_COLUMNS)
    pairs = _read_table(folder / "proximity.parquet", _PAIR_COLUMNS)
    truth = read_truth(truth_file)
    wanted = tracks["class"] == class_name
    tracks = {name: column[wanted] for name, column in tracks.items()}
    return score_positions(tracks, pairs, truth, frames=frames, pairs_up_to_m=pairs_up_to_m)


def score_positions(
    tracks: Columns,
    pairs: Columns,
    truth: Columns,
    *,
    frames: tuple[int, int] | None = None,
    pairs_up_to_m: float = 15.0,
) -> PositionsResult:
    """Compare tracks and distances with truth.

    Args:
        tracks: Columns of `tracks.parquet`: frame (from 0), track_id, x1_px, y1_px, x2_px, y2_px, observed, x_m, y_m
            (NaN where invalid).
        pairs: Columns of `proximity.parquet`: frame (from 0), track_a, track_b, distance_m, sigma_m, measured.
        truth: Columns of the truth file; frame from 1; x, y, w, h may be NaN throughout.
        frames: First and last truth frame, from 1, all of them completely labelled; None: frames with labels.
        pairs_up_to_m: Pairs truly further apart are not scored.

    Raises:
        DataError: No truth in these frames, or no distance between matched tracks was asked of the run.
    """
    scored = np.unique(truth["frame"]) if frames is None else np.arange(frames[0], frames[1] + 1)
    truth = _rows(truth, np.isin(truth["frame"], scored))
    if not (truth["conf"] > 0).any():
        found = f"none in frames {frames[0]} to {frames[1]}" if frames else "none"
        raise DataError(expected="truth with conf above 0", found=found, fix="choose frames that are labelled")
    tracks = _rows(tracks, np.isin(tracks["frame"] + 1, scored))
    distances = _distances_by_pair(_rows(pairs, np.isin(pairs["frame"] + 1, scored)))
    return PositionsResult(
        first_frame=int(scored[0]),
        last_frame=int(scored[-1]),
        frames=len(scored),
        frames_without_tracks=len(scored) - len(np.unique(tracks["frame"])),
        pairs_up_to_m=pairs_up_to_m,
        reported=_score(tracks, distances, truth, pairs_up_to_m),
        observed=_score(_rows(tracks, tracks["observed"]), distances, truth, pairs_up_to_m),
    )


def read_truth(path: Path | str) -> Columns:
    """Read a truth file and check it.

    Returns:
        Float columns frame, id, x, y, w, h, conf, X, Y; x, y, w, h are NaN throughout where the file has no boxes.

    Raises:
        DataError: The file is missing, not such a CSV, or contradicts itself.
    """
    types = {name: pa.float64() for name in _TRUTH_COLUMNS}
    try:
        table = pyarrow.csv.read_csv(path, convert_options=pyarrow.csv.ConvertOptions(column_types=types))
    except (OSError, pa.ArrowException) as error:
        fix = "give the file of true positions"
        raise DataError(expected=_TRUTH_FORM, found=f"{path}: {error}", fix=fix) from error
    truth = _columns(table, _TRUTH_COLUMNS, path, _TRUTH_FORM)
    box = np.column_stack([truth[name] for name in ("x", "y", "w", "h")])
    position = np.column_stack([truth["X"], truth["Y"]])
    keys = np.column_stack([truth["frame"], truth["id"]])
    checks = {
        "frames that are whole numbers from 1, ids and conf that are numbers": (
            np.isfinite(keys).all(axis=1) & np.isfinite(truth["conf"]) & (keys[:, 0] >= 1) & (keys[:, 0] % 1 == 0)
        ),
        "X and Y in metres for every row with conf above 0": np.isfinite(position).all(axis=1) | (truth["conf"] <= 0),
        "a box with positive width and height in every row, or in none": (
            np.isnan(box).all(keepdims=True)[0] | (np.isfinite(box).all(axis=1) & (box[:, 2:] > 0).all(axis=1))
        ),
        "every id once in a frame": _is_first(keys),
    }
    for expected, right in checks.items():
        if not right.all():
            line = int(np.flatnonzero(~right)[0]) + 2
            raise DataError(expected=expected, found=f"otherwise in line {line} of {path}", fix="correct the truth file")
    return truth


def _is_first(keys: FloatArray) -> BoolArray:
    first = np.zeros(len(keys), dtype=np.bool_)
    first[np.unique(keys, axis=0, return_index=True)[1]] = True
    return first


def _read_table(path: Path, names: tuple[str, ...]) -> Columns:
    fix = "run `standoff run` with the output on, to its end"
    if not path.is_file():
        raise DataError(expected=f"{path.name} in the run folder", found=f"no {path}", fix=fix)
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise DataError(expected=f"a Parquet table of a run in {path}", found=str(error), fix=fix) from error
    return _columns(table, names, path, f"a table of `standoff run` with {', '.join(names)}")


def _columns(table: pa.Table, names: tuple[str, ...], path: Path | str, expected: str) -> Columns:
    missing = [name for name in names if name not in table.column_names]
    if missing:
        fix = "check that it is the right file"
        raise DataError(expected=expected, found=f"{path} without {', '.join(missing)}", fix=fix)
    columns = {name: table.column(name) for name in names}
    return {
        name: (column.cast(pa.string()) if pa.types.is_dictionary(column.type) else column).to_numpy()
        for name, column in columns.items()
    }


def _rows(columns: Columns, chosen: BoolArray) -> Columns:
    return {name: column[chosen] for name, column in columns.items()}


def _distances_by_pair(pairs: Columns) -> dict[_PairKey, tuple[float, float]]:
    """Return distance and standard error, NaN where not measured, by frame index and both track ids."""
    measured = pairs["measured"].astype(np.bool_)
    keys = zip(pairs["frame"].tolist(), pairs["track_a"].tolist(), pairs["track_b"].tolist(), strict=True)
    distance_m, sigma_m = (np.where(measured, pairs[name], np.nan).tolist() for name in ("distance_m", "sigma_m"))
    return dict(zip(keys, zip(distance_m, sigma_m, strict=True), strict=True))


def _score(
    tracks: Columns, distances: Mapping[_PairKey, tuple[float, float]], truth: Columns, pairs_up_to_m: float
) -> PositionScore:
    is_scored = truth["conf"] > 0
    truth_rows, track_rows = _match(truth, tracks)
    wrong_or_right = len(tracks["frame"]) - int((~is_scored[truth_rows]).sum())
    kept = is_scored[truth_rows]
    truth_rows, track_rows = truth_rows[kept], track_rows[kept]
    error_m = np.hypot(
        tracks["x_m"][track_rows] - truth["X"][truth_rows], tracks["y_m"][track_rows] - truth["Y"][truth_rows]
    )
    error_m = error_m[np.isfinite(error_m)]
    track_of_truth = np.full(len(is_scored), _NO_TRACK)
    track_of_truth[truth_rows] = tracks["track_id"][track_rows]
    return PositionScore(
        truths=int(is_scored.sum()),
        tracks=wrong_or_right,
        matched=len(truth_rows),
        located=len(error_m),
        recall=_mean(is_scored[is_scored] & (track_of_truth[is_scored] != _NO_TRACK)),
        precision=len(truth_rows) / wrong_or_right if wrong_or_right else np.nan,
        position_median_m=_percentile(error_m, 50),
        position_mean_m=_mean(error_m),
        position_p95_m=_percentile(error_m, 95),
        **_score_pairs(truth, track_of_truth, distances, pairs_up_to_m),
    )


def _match(truth: Columns, tracks: Columns) -> tuple[IntArray, IntArray]:
    """Return rows of the truth and the rows of the tracks matched to them."""
    has_boxes = not np.isnan(truth["x"]).all()
    matched: list[IntArray] = [np.zeros((2, 0), np.int64)]
    for frame in np.unique(truth["frame"]):
        rows, columns = np.flatnonzero(truth["frame"] == frame), np.flatnonzero(tracks["frame"] == frame - 1)
        if has_boxes:
            first, second = assign(_overlap(_rows(truth, rows), _rows(tracks, columns)), _MIN_OVERLAP)
        else:
            nearness = _nearness(_rows(truth, rows), _rows(tracks, columns))
            first, second = assign(nearness, 1.0 / (1.0 + _MAX_GROUND_M))
        matched.append(np.stack([rows[first], columns[second]]))
    truth_rows, track_rows = np.concatenate(matched, axis=1)
    return truth_rows, track_rows
