"""How far off a run's distances and positions are, and how true the errors that it states: over one clip or many."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.evaluation.coverage.samples import ClipSamples
from standoff.evaluation.paper.metrics import DistanceScore, score_distances
from standoff.evaluation.resampling import LEAST_GROUPS, draw_groups, interval_of
from standoff.evaluation.run_and_clip import SIGHTS
from standoff.evaluation.stated_errors import (
    ONE_SIGMA,
    PROBABILITIES,
    Coverage,
    plane_sigmas,
    plane_sigmas2_around,
    score_coverage,
    sigmas_around,
    sigmas_off,
)

ALL = "all"
DISTANCES_M = (0.0, 5.0, 10.0, 25.0, np.inf)
"""Edges of the bands of true distance."""

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PairRow:
    """All pairs of a kind, or those of them that are so far apart or show so well.

    Attributes:
        kind: "worker-excavator"; "all" where there are several kinds.
        by: "all", "distance" or "visibility".
        band: Of these; empty with "all".
        score: Of the distances against the truth; `frames` counts visible pairs.
        coverage: Of the stated errors.
        intervals: By figure ("measured_share", "made_m", "mape_percent", "inside_68", "inside_95"), what 95 % of 1000
            choices of as many clips with repetition give; empty with too few clips.
    """

    kind: str
    by: str
    band: str
    score: DistanceScore
    coverage: Coverage
    intervals: Mapping[str, Interval]

    def to_dict(self) -> dict[str, Any]:
        """Return it on one level, as JSON types; NaN stays NaN."""
        figures = asdict(self.score) | asdict(self.coverage)
        return {"pair": self.kind, "by": self.by, "band": self.band, **figures, "intervals": dict(self.intervals)}


@dataclass(frozen=True, slots=True)
class PositionRow:
    """All positions of a class; NaN where nothing was located.

    Attributes:
        class_name: As in `CLASSES`.
        visible: Entities in frames in which they can be seen.
        located: Of these, with a position.
        median_m: Of the distance from the true place.
        p95_m: 95th percentile of the same.
        inside_68: Share of the located whose true place is in the stated ellipse of 68.3 %.
        inside_95: The same of 95 %.
        sigma_m: Median of the stated standard error of one coordinate.
        intervals: Of "inside_68" and "inside_95", as in `PairRow`.
    """

    class_name: str
    visible: int
    located: int
    median_m: float
    p95_m: float
    inside_68: float
    inside_95: float
    sigma_m: float
    intervals: Mapping[str, Interval]


@dataclass(frozen=True, slots=True)
class CoverageResult:
    """Runs against the truth of their clips.

    Attributes:
        runs: Folder of each run and of its clip.
        clips: Different clips among them.
        frames: That the runs read.
        pairs: By kind; of each kind all, then by true distance, then by visibility.
        positions: By class.
        runs_without_positions: How many runs count their places from somewhere else than the truth.
    """

    runs: tuple[tuple[Path, Path], ...]
    clips: int
    frames: int
    pairs: tuple[PairRow, ...]
    positions: tuple[PositionRow, ...]
    runs_without_positions: int

    def whole_kinds(self) -> list[PairRow]:
        """Return the rows that hold all pairs of their kind."""
        return [row for row in self.pairs if row.by == ALL]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN stays NaN."""
        return {
            "runs": [{"run": str(run), "clip": str(clip)} for run, clip in self.runs],
            "clips": self.clips,
            "frames": self.frames,
            "probabilities": list(PROBABILITIES),
            "pairs": [row.to_dict() for row in self.pairs],
            "positions": [asdict(row) for row in self.positions],
            "runs_without_positions": self.runs_without_positions,
        }


def score_samples(clips: Sequence[ClipSamples]) -> CoverageResult:
    """Pool what runs said of clips.

    Runs of one clip are right or wrong together: the bootstrap draws clips.

    Args:
        clips: One at least.

    Raises:
        DataError: No clip shows a person and a machine at once.
    """
    if not any(len(one.pairs.kind) for one in clips):
        raise DataError(
            expected="a worker and a machine that can be seen at once",
            found=f"none in {', '.join(str(one.clip) for one in clips)}",
            fix="choose another clip",
        )
    folders = [one.clip.resolve() for one in clips]
    different = sorted(set(folders))
    own = np.array([different.index(folder) for folder in folders])
    return CoverageResult(
        runs=tuple((one.run, one.clip) for one in clips),
        clips=len(different),
        frames=sum(one.frames for one in clips),
        pairs=tuple(_pair_rows(clips, own, len(different))),
        positions=tuple(_position_rows(clips, own, len(different))),
        runs_without_positions=sum(one.positions is None for one in clips),
    )


def _pair_rows(clips: Sequence[ClipSamples], own: IntArray, count: int) -> Iterator[PairRow]:
    kind, true_m, measured_m, sigma_m, sight = (
        np.concatenate([getattr(one.pairs, name) for one in clips])
        for name in ("kind", "true_m", "measured_m", "sigma_m", "sight")
    )
    clip = np.repeat(own, [len(one.pairs.kind) for one in clips])
    kinds = sorted(set(kind.tolist()))
    for name in ([ALL] if len(kinds) > 1 else []) + kinds:
        of_kind = np.ones(len(kind), np.bool_) if name == ALL else kind == name
        for by, band, in_band in _bands(true_m, sight):
            rows = of_kind & in_band
            if not rows.any():
                continue
            series = true_m[rows], measured_m[rows], sigma_m[rows]
            intervals = _intervals(_pair_samples(*series), clip[rows], count)
            yield PairRow(name, by, band, score_distances(*series[:2]), score_coverage(*series), intervals)


def _bands(true_m: FloatArray, sight: IntArray) -> Iterator[tuple[str, str, BoolArray]]:
    yield ALL, "", np.ones(len(true_m), dtype=np.bool_)
    for low_m, high_m in pairwise(DISTANCES_M):
        name = f"{low_m:g}-{high_m:g} m" if np.isfinite(high_m) else f"{low_m:g}+ m"
        yield "distance", name, (true_m >= low_m) & (true_m < high_m)
    for place, name in enumerate(SIGHTS):
        yield "visibility", name, sight == place


def _pair_samples(true_m: FloatArray, measured_m: FloatArray, sigma_m: FloatArray) -> dict[str, FloatArray]:
    """Return what the figures are means of, NaN where a sample has no part in one."""
    error_m = np.abs(measured_m - true_m)
    measured = np.isfinite(error_m)
    off = np.full(len(error_m), np.nan)
    off[measured] = sigmas_off(error_m[measured], sigma_m[measured])
    return {
        "measured_share": measured.astype(np.float64),
        "made_m": error_m,
        "mape_percent": 100.0 * error_m / true_m,
        "inside_68": _within(off, sigmas_around(ONE_SIGMA)),
        "inside_95": _within(off, sigmas_around(0.95)),
    }


def _within(off: FloatArray, limit: float) -> FloatArray:
    return np.where(np.isnan(off), np.nan, off <= limit)


def _position_rows(clips: Sequence[ClipSamples], own: IntArray, count: int) -> Iterator[PositionRow]:
    known = [(one.positions, clip) for one, clip in zip(clips, own.tolist(), strict=True) if one.positions is not None]
    if not known:
        return
    class_name, off_m, covariance_m2 = (
        np.concatenate([getattr(one, name) for one, _ in known]) for name in ("class_name", "off_m", "covariance_m2")
    )
    clip = np.repeat([place for _, place in known], [len(one.class_name) for one, _ in known])
    located = np.isfinite(off_m).all(axis=1)
    sigmas2 = np.full(len(off_m), np.nan)
    # A position without a stated error is never inside.
    stated = located & np.isfinite(covariance_m2).all(axis=(1, 2))
    sigmas2[located] = np.inf
    sigmas2[stated] = plane_sigmas(off_m[stated], covariance_m2[stated]) ** 2
    sigma_m = np.sqrt(np.trace(covariance_m2, axis1=1, axis2=2) / 2.0)
    for name in sorted(set(class_name.tolist())):
        rows = class_name == name
        samples = {
            label: _within(sigmas2[rows], plane_sigmas2_around(probability))
            for label, probability in (("inside_68", ONE_SIGMA), ("inside_95", 0.95))
        }
        error_m = np.linalg.norm(off_m[rows & located], axis=1)
        yield PositionRow(
            class_name=name,
            visible=int(rows.sum()),
            located=len(error_m),
            median_m=_percentile(error_m, 50),
            p95_m=_percentile(error_m, 95),
            inside_68=_mean(samples["inside_68"]),
            inside_95=_mean(samples["inside_95"]),
            sigma_m=_percentile(sigma_m[rows & stated], 50),
            intervals=_intervals(samples, clip[rows], count),
        )


def _intervals(samples: Mapping[str, FloatArray], clip: IntArray, count: int) -> dict[str, Interval]:
    """Return how far another choice of clips would move the mean of each kind of samples."""
    if count < LEAST_GROUPS:
        return {}
    draws = draw_groups(count)
    found = {}
    for name, values in samples.items():
        known = np.isfinite(values)
        sums, counts = (np.bincount(clip[known], what, count) for what in (values[known], np.ones(known.sum())))
        of_draw = draws @ counts
        found[name] = interval_of(np.divide(draws @ sums, of_draw, out=np.full(len(draws), np.nan), where=of_draw > 0))
    return found


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _percentile(values: FloatArray, percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else float("nan")
