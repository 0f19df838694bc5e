"""What is measured for the first time: a track that was away for a moment comes back under its number."""

from __future__ import annotations

from collections.abc import Collection, Hashable
from typing import Final, Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)

_FORGOTTEN_S: Final = 60.0
"""No track comes back after so long."""


class Newcomers(Generic[Key]):
    """Remember what was measured before.

    >>> newcomers = Newcomers[int]()
    >>> [newcomers.among(time_s, keys) for time_s, keys in ((0.0, {1}), (1.0, {2}), (2.0, {1, 3}), (90.0, {1}))]
    [{1}, {2}, {3}, {1}]
    """

    def __init__(self) -> None:
        self._met_s: dict[Key, float] = {}

    def among(self, time_s: float, measured: Collection[Key]) -> set[Key]:
        """Return which of all that is measured at a time never was before."""
        met_s = {key: at_s for key, at_s in self._met_s.items() if time_s - at_s < _FORGOTTEN_S}
        self._met_s = met_s | dict.fromkeys(measured, time_s)
        return set(measured) - met_s.keys()
