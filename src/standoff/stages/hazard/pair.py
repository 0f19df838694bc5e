"""The hazard of one pair of tracks."""

from __future__ import annotations

from standoff.core.types import Hazard
from standoff.stages.hazard.levels import levels_of
from standoff.stages.hazard.life import Reading
from standoff.stages.hazard.params import HazardParams
from standoff.stages.hazard.watch import Watch


class PairWatch(Watch):
    """Watch one pair: what is near and what is a breach, `HazardParams.rule` says.

    Args:
        track_ids: Smaller id first.
        params: Settings.
    """

    def __init__(self, track_ids: tuple[int, int], params: HazardParams) -> None:
        super().__init__("proximity", track_ids, params)

    def measurable(self, reading: Reading) -> bool:
        """Tell whether a reading says how near the pair is; NaN never does."""
        return levels_of(reading, self._params) is not None

    def measure_pair(self, time_s: float, reading: Reading, *, rare: bool) -> Hazard | None:
        """Take a measurement and return what there is to say of it; `rare` as in `measure`."""
        levels = levels_of(reading, self._params)
        if levels is None:
            raise ValueError("a reading that tells nothing is a miss")
        return self.measure(time_s, reading, levels.near, levels.breached, rare=rare)
