"""How long before each breach it was said that one comes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from standoff.clips import Clip
from standoff.config import Settings
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.evaluation.paper.answers import both_radii_m, seen_together
from standoff.evaluation.paper.monitored_clip import MonitoredClip

AHEAD_S = 2.0
"""So long before it a breach should be said: time to look up and take a step."""


@dataclass(frozen=True, slots=True)
class Breach:
    """A worker and a machine whose action radii really overlapped, once, while both could be seen.

    Attributes:
        names: Worker, machine.
        start_s: When the gap fell below 0.
        warned_s: For how long a warning or a danger of this pair had been open then, without a break; negative: it was
            opened so long after; NaN: not before the breach was over.
        from_start: It had begun when the clip began: nobody could foretell it.
    """

    names: tuple[str, str]
    start_s: float
    warned_s: float
    from_start: bool


@dataclass(frozen=True, slots=True)
class WarningTimes:
    """The breaches that began within the clips.

    Attributes:
        breaches: How many.
        missed: Of these, never said.
        late: Of these, said after they began.
        median_s: Median time ahead of those that were said; NaN without.
        ahead: Said at least 2 s ahead.
        foreseeable: Of the breaches, those that began at least 2 s into their clip.
    """

    breaches: int
    missed: int
    late: int
    median_s: float
    ahead: int
    foreseeable: int


def find_breaches(clip: Clip, monitored: MonitoredClip, settings: Settings) -> tuple[Breach, ...]:
    """Find every true breach, and when the monitor first said so of it."""
    names = clip.names()
    together = seen_together(clip)
    gap_m = clip.distance_m - both_radii_m(clip, settings)
    found = []
    for column, (first, second) in enumerate(clip.pairs.tolist()):
        for rows in _breached(gap_m[:, column]):
            if together[rows, column].any():
                warned_s = warned_before_s(monitored.time_s, monitored.alarmed[:, column], rows)
                start_s = float(monitored.time_s[rows[0]])
                found.append(Breach((names[first], names[second]), start_s, warned_s, from_start=bool(rows[0] == 0)))
    return tuple(sorted(found, key=lambda one: one.start_s))


def _breached(gap_m: FloatArray) -> Iterator[IntArray]:
    """Yield the frames of each breach, one after another."""
    rows = np.flatnonzero(gap_m < 0.0)
    if len(rows):
        yield from np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)


def warned_before_s(time_s: FloatArray, alarmed: BoolArray, breach: IntArray) -> float:
    """Return for how long an alarm had been open when a breach began.

    Args:
        time_s: (F,) of the frames.
        alarmed: (F,) whether one is open.
        breach: Frames of the breach, without a gap.

    >>> time_s, alarmed = np.arange(6.0), np.array([True, False, True, True, True, False])
    >>> [warned_before_s(time_s, alarmed, np.array(rows)) for rows in ([4], [1, 2], [5])]
    [2.0, -1.0, nan]
    """
    start = int(breach[0])
    if alarmed[start]:
        silent = np.flatnonzero(~alarmed[:start])
        return float(time_s[start] - time_s[silent[-1] + 1 if len(silent) else 0])
    late = breach[alarmed[breach]]
    return float(time_s[start] - time_s[late[0]]) if len(late) else float("nan")


def summarise(breaches: Sequence[Breach]) -> WarningTimes:
    """Summarise the breaches of one clip or of several; films begin at 0 s."""
    begun = [one for one in breaches if not one.from_start]
    warned_s = np.array([one.warned_s for one in begun])
    said_s = warned_s[np.isfinite(warned_s)]
    return WarningTimes(
        breaches=len(begun),
        missed=len(warned_s) - len(said_s),
        late=int((said_s < 0.0).sum()),
        median_s=float(np.median(said_s)) if len(said_s) else float("nan"),
        ahead=int((said_s >= AHEAD_S).sum()),
        foreseeable=sum(one.start_s >= AHEAD_S for one in begun),
    )
