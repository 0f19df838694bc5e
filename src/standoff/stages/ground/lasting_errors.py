"""Errors that are there in every frame: of each observer those of its best look, and what remains of them together."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.pose import SHIFT


class LastingErrors:
    """The lasting errors of one belief's observers, which have no cause in common."""

    def __init__(self) -> None:
        self._best: dict[str, tuple[float, FloatArray]] = {}

    def begin(self, by: str, covariance: FloatArray) -> None:
        """Begin anew with one observer's errors (S, S)."""
        self._best = {by: (_spread_m2(covariance), covariance)}

    def offer(self, by: str, covariance: FloatArray) -> None:
        """Take an observer's look with lasting errors (S, S), if it is its best one."""
        spread_m2 = _spread_m2(covariance)
        if by not in self._best or spread_m2 < self._best[by][0]:
            self._best[by] = spread_m2, covariance

    def carry(self, by_state: FloatArray) -> None:
        """Take all of them along with a change of the state, given its derivative (S, S)."""
        self._best = {by: (spread, by_state @ one @ by_state.T) for by, (spread, one) in self._best.items()}

    def total(self) -> FloatArray:
        """Return (S, S) the covariance that remains with all observers together."""
        covariances = [one for _, one in self._best.values()]
        if len(covariances) == 1:
            return covariances[0]
        together = np.linalg.inv(np.sum([np.linalg.inv(one) for one in covariances], axis=0))
        return np.asarray((together + together.T) / 2.0)


def _spread_m2(covariance: FloatArray) -> float:
    return float(np.trace(covariance[SHIFT, SHIFT]))
