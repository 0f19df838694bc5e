"""How much of the ground was watched in a run, and why the rest was not."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.watched_ground import WatchedGround


def percent_text(share: float | None) -> str:
    """Return a share in whole percent, rounded down: only all of it is 100 %.

    >>> percent_text(0.745), percent_text(0.999), percent_text(1.0), percent_text(None)
    ('74 %', '99 %', '100 %', 'unknown')
    """
    return "unknown" if share is None or math.isnan(share) else f"{math.floor(100.0 * share + 1e-9)} %"


def around_tracks(watched: WatchedGround, count: int) -> FloatArray:
    """Return (count,) what share of the circle about each track is watched; NaN of all where nobody judged."""
    return watched.around if len(watched.around) == count else np.full(count, np.nan)


class WatchedShares:
    """Means over all frames that somebody judged.

    Attributes:
        frames: How many they are.
        frames_watched: In how many of them some ground is watched.
    """

    def __init__(self) -> None:
        self.frames = 0
        self._share = self._missed = 0.0
        self.frames_watched = 0
        self._unwatched: Counter[str] = Counter()

    def add(self, watched: WatchedGround) -> None:
        """Take a frame."""
        if not watched.judged:
            return
        self.frames += 1
        self._share += watched.share
        self._unwatched.update(watched.unwatched)
        if watched.watched.any():
            self._missed += watched.missed_share
            self.frames_watched += 1

    @property
    def share(self) -> float:
        """Mean share of the ground that was watched; NaN without frames."""
        return self._share / self.frames if self.frames else float("nan")

    @property
    def unwatched(self) -> dict[str, float]:
        """Mean share of the ground by the reason why it was not, largest first."""
        return {reason: total / self.frames for reason, total in self._unwatched.most_common()}

    @property
    def missed_share(self) -> float:
        """Of the workers on watched ground, how many are missed in one picture; NaN where none was watched."""
        return self._missed / self.frames_watched if self.frames_watched else float("nan")

    def summary(self) -> dict[str, Any]:
        """Return all of it for the record, to a tenth of a percent."""
        return {
            "share": round(self.share, 3),
            "unwatched": {reason: round(share, 3) for reason, share in self.unwatched.items()},
            "missed_share": round(self.missed_share, 3),
        }
