"""Whose turn it is: each stream has its share of the time, whatever its pictures cost."""

from __future__ import annotations

from collections.abc import Collection


class Turns:
    """Gives the next turn to whom the least time was given so far.

    Who comes back after a rest begins where the others are: nobody saves time up.
    """

    def __init__(self) -> None:
        self._used_s: dict[str, float] = {}
        self._floor_s = 0.0

    def next_of(self, waiting: Collection[str]) -> str:
        """Return who is next.

        Args:
            waiting: Who wants a turn; at least one.

        >>> turns = Turns()
        >>> turns.used("slow", 0.3); turns.used("quick", 0.1)
        >>> turns.next_of(["slow", "quick"])
        'quick'
        """
        # A stream that is new, or was away, is not ahead of who has waited all the time.
        for name in waiting:
            self._used_s[name] = max(self._used_s.get(name, 0.0), self._floor_s)
        chosen = min(waiting, key=lambda name: (self._used_s[name], name))
        self._floor_s = max(self._floor_s, self._used_s[chosen])
        return chosen

    def used(self, name: str, duration_s: float) -> None:
        """Take that a turn took so long."""
        self._used_s[name] = self._used_s.get(name, 0.0) + duration_s
