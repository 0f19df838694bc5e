"""What is said of each worker and machine in every frame: the hazards' events folded into states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from standoff.core.homography import BoolArray
from standoff.core.types import Hazard, IntArray, Severity, TextArray
from standoff.evaluation.matching import NOTHING

_RISING = ("", "unknown", "warning", "danger")


@dataclass(frozen=True, slots=True)
class _Open:
    column: int
    severity: Severity
    is_sure: bool


class PairAlarms:
    """Follows the hazards of a run; a hazard belongs to the pair that its tracks showed when last told apart.

    Args:
        pairs: (P, 2) rows of the entities of each pair.
    """

    def __init__(self, pairs: IntArray) -> None:
        self._columns = {frozenset(pair): column for column, pair in enumerate(pairs.tolist())}
        self._open: dict[str, _Open] = {}

    def take(self, events: Iterable[Hazard], entity_of: Mapping[int, int]) -> tuple[TextArray, BoolArray]:
        """Take a frame.

        Args:
            events: Of the frame.
            entity_of: The entity that each of the frame's tracks shows, for those that show one.

        Returns:
            (P,) the worst severity that is said and measured in this frame, "unknown" or empty with it; and whether a
            hazard of severity warning or danger is open, though the pair may not be measured just now.
        """
        for event in events:
            if event.phase == "closed":
                self._open.pop(event.hazard_id, None)
            elif len(event.track_ids) == 2:
                self._open[event.hazard_id] = self._opened(event, entity_of)
        said = np.full(len(self._columns), "", dtype=object)
        alarmed = np.zeros(len(self._columns), dtype=np.bool_)
        for one in self._open.values():
            if one.column == NOTHING:
                continue
            now = one.severity if one.is_sure else "unknown"
            said[one.column] = max(said[one.column], now, key=_RISING.index)
            alarmed[one.column] |= one.severity != "unknown"
        return said, alarmed

    def _opened(self, event: Hazard, entity_of: Mapping[int, int]) -> _Open:
        shown = frozenset(entity_of.get(track_id, NOTHING) for track_id in event.track_ids)
        before = self._open.get(event.hazard_id)
        column = self._columns.get(shown, NOTHING if before is None else before.column)
        return _Open(column, event.severity, event.phase != "unknown")
