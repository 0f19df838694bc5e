"""Everything measured on one clip, and each figure of the paper beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from standoff.clips import Clip
from standoff.evaluation.paper.answers import FrameByFrame, score_frames
from standoff.evaluation.paper.board import BoardScore, score_board, view_board
from standoff.evaluation.paper.localisation import ClassLocalisation, score_localisation
from standoff.evaluation.paper.map_only import MapScore, score_map
from standoff.evaluation.paper.monitor_setup import MonitorSetup, settings_for
from standoff.evaluation.paper.monitored_clip import MonitoredClip, monitor_clip
from standoff.evaluation.paper.pairs import (
    AFTER,
    AGAINST_BENCHMARK,
    BEFORE,
    FILLED,
    PairGroup,
    PairSeries,
    group_pairs,
    pair_series,
)
from standoff.evaluation.paper.published import BENCHMARK_PRESETS, PUBLISHED
from standoff.evaluation.paper.rectified import RectificationScore, score_rectification
from standoff.evaluation.paper.warning_time import Breach, find_breaches


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """One figure of the paper beside the measured one.

    Attributes:
        name: Key in `PUBLISHED`.
        label: For people.
        paper: The paper's value.
        measured: The same made in the same way, against the paper's substitute for truth where it had one; NaN where
            nothing could be measured.
        exact_before: Against exact truth, before the outlier filter; NaN where that says nothing else.
        exact_after: Against exact truth, after the filter; NaN as before.
        unit: Of all of them.
        where: In the paper.
        count: Frames with an estimate, those that a filter filled not counted.
        of: Frames that should have one.
    """

    name: str
    label: str
    paper: float
    measured: float
    exact_before: float
    exact_after: float
    unit: str
    where: str
    count: int
    of: int


@dataclass(frozen=True, slots=True, eq=False)
class ClipResult:
    """One clip.

    Attributes:
        clip: The truth.
        setup: What was tried.
        monitored: What the monitor said; None for a clip without a reference object.
        rectification: None without a reference object.
        map_only: The ground map alone; None without a reference object.
        localisation: By class.
        groups: Of pairs, by class.
        series: Of each pair.
        answers: Danger, warning, clear or unknown in every frame; None without a reference object.
        breaches: In the order of time, and how long before each of them it was said.
        board: None without a checkerboard.
    """

    clip: Clip
    setup: MonitorSetup
    monitored: MonitoredClip | None = None
    rectification: RectificationScore | None = None
    map_only: MapScore | None = None
    localisation: tuple[ClassLocalisation, ...] = ()
    groups: tuple[PairGroup, ...] = ()
    series: tuple[PairSeries, ...] = ()
    answers: FrameByFrame | None = None
    breaches: tuple[Breach, ...] = ()
    board: BoardScore | None = None

    def figures(self) -> tuple[PaperFigure, ...]:
        """Return every figure that the paper has for this clip, measured or not."""
        return (*_rectification_figures(self), *_pair_figures(self), *_ale_figures(self), *_board_figures(self))

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the series as JSON types; NaN stays NaN."""
        return {
            "clip": self.clip.name,
            "preset": self.clip.preset,
            "clip_seed": self.clip.seed,
            "frames": self.clip.frame_count,
            "size_px": None if self.monitored is None else list(self.monitored.size_px),
            "trial": self.setup.describe(),
            "paper": [asdict(figure) for figure in self.figures()],
            "rectification": None if self.rectification is None else asdict(self.rectification),
            "map_only": None if self.map_only is None else asdict(self.map_only),
            "localisation": [asdict(score) for score in self.localisation],
            "pairs": [asdict(group) for group in self.groups],
            "frame_by_frame": None if self.answers is None else self.answers.to_dict(),
            "breaches": [asdict(one) for one in self.breaches],
            "board": None if self.board is None else asdict(self.board),
        }


def evaluate_clip(clip: Clip, setup: MonitorSetup, on_frame: Callable[[], None] | None = None) -> ClipResult:
    """Run the paper's tests on one clip.

    Args:
        clip: From `load_clip`.
        setup: What to try.
        on_frame: Called after each frame.

    Raises:
        StandoffError: The video, the model or the clip cannot be used.
    """
    if clip.board is not None:
        return ClipResult(clip, setup, board=score_board(clip, clip.board, view_board(clip, clip.board, on_frame)))
    assert clip.reference is not None, "checked in load_clip"
    monitored, settings = monitor_clip(clip, setup, on_frame), settings_for(clip, setup)
    series = pair_series(clip, monitored, benchmark=clip.preset in BENCHMARK_PRESETS)
    return ClipResult(
        clip=clip,
        setup=setup,
        monitored=monitored,
        rectification=score_rectification(monitored, clip.reference),
        map_only=score_map(clip, monitored),
        localisation=score_localisation(clip, monitored),
        groups=group_pairs(series),
        series=series,
        answers=score_frames(clip, monitored, settings),
        breaches=find_breaches(clip, monitored, settings),
    )


def _figure(
    name: str, label: str, measured: float, counts: tuple[int, int], exact: tuple[float, float] = (np.nan, np.nan)
) -> tuple[PaperFigure, ...]:
    """Return the figure, or nothing where the paper has none of that name."""
    if name not in PUBLISHED:
        return ()
    paper = PUBLISHED[name]
    return (PaperFigure(name, label, paper.value, measured, *exact, paper.unit, paper.where, *counts),)


def _rectification_figures(result: ClipResult) -> tuple[PaperFigure, ...]:
    score, preset = result.rectification, result.clip.preset
    if score is None:
        return ()
    counts = (score.frames, score.frames)
    failed = _figure(f"{preset} failed", f"frames failed of {score.frames}", score.failed, counts)
    time = _figure("rectification time", "time to rectify", score.median_s, counts)
    share = _figure(f"{preset} failed share", "the same as a share", 100.0 * score.failed / score.frames, counts)
    return failed + share + (time if preset == "mobile" else ())


def _pair_figures(result: ClipResult) -> tuple[PaperFigure, ...]:
    figures: tuple[PaperFigure, ...] = ()
    for group in result.groups:
        before, after = group.scores[BEFORE], group.scores[AFTER]
        as_paper = group.scores.get(AGAINST_BENCHMARK, group.scores[FILLED])
        for short, (label, field) in _MEASURES.items():
            measured, *exact = (getattr(score, field) for score in (as_paper, before, after))
            name = f"{result.clip.preset} {short} {group.class_pair}"
            label = f"{label} {_readable(group.class_pair)}"
            figures += _figure(name, label, measured, (after.measured, after.frames), (exact[0], exact[1]))
    return figures


_MEASURES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "made": ("MADE", "made_m"),
        "mape": ("MAPE", "mape_percent"),
        "median": ("median residual", "median_m"),
    }
)


def _readable(class_pair: str) -> str:
    return class_pair.replace("_", " ")


def _ale_figures(result: ClipResult) -> tuple[PaperFigure, ...]:
    if result.clip.preset != "mobile":
        return ()
    figures: tuple[PaperFigure, ...] = ()
    for score in result.localisation:
        label = f"ALE {_readable(score.class_name)}"
        figures += _figure(f"ale {score.class_name}", label, score.ale_m, (score.detected, score.visible))
    return figures


def _board_figures(result: ClipResult) -> tuple[PaperFigure, ...]:
    board = result.board
    if board is None or result.clip.preset != "board":
        return ()
    worst = (np.nan, np.nan) if board.worst_frame < 0 else (
        float(board.before[board.worst_frame]), float(board.after[board.worst_frame])
    )  # fmt: skip
    rows = (
        ("board before", "accuracy before rectification", board.before_percent),
        ("board after", "accuracy after rectification", board.after_percent),
        ("board worst before", f"worst frame ({board.worst_frame}) before", worst[0]),
        ("board worst after", "the same frame after", worst[1]),
    )
    figures: tuple[PaperFigure, ...] = ()
    for name, label, measured in rows:
        figures += _figure(name, label, measured, (board.measured, board.frames))
    return figures
