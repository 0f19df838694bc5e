"""When the frames of a film are shown, where its file says so badly."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Final

from standoff.core.errors import SourceError

_SHORTEST_STEP_S: Final = 1e-3
"""Between two pictures; no camera of a site takes more than 1000 a second, and rewrapped doubles lie closer."""
_STEP_ROUNDING_S: Final = 1e-4
"""Of the millisecond in which Matroska counts."""
_SKIPPED_IN_A_ROW: Final = 5
"""More of them are no slips, but a clock that was set back."""
_NAMED: Final = 3


class AviTicks:
    """Tell when AVI's frames are shown, which its file does not say.

    A frame leaves the decoder together with the packet whose decoding time differs from its presentation time by a
    constant; the last few have no packet left, and follow at the film's usual step.
    """

    def __init__(self) -> None:
        self._last = -1
        self._steps: Counter[int] = Counter()

    def of(self, decoding_tick: int | None) -> int:
        """Return the time of the next frame that is shown, in ticks, from the decoding time that it came with."""
        if decoding_tick is None:
            decoding_tick = self._last + (self._steps.most_common(1)[0][0] if self._steps else 1)
        elif self._last >= 0:
            self._steps[decoding_tick - self._last] += 1
        self._last = decoding_tick
        return decoding_tick


@dataclass(slots=True)
class RisingTimes:
    """Let frames pass whose times rise, and count those that have the time of one before, or an earlier one.

    Args:
        film: Name of the file, for messages.

    Attributes:
        skipped: How many so far.
    """

    film: str
    skipped: int = 0
    _last_s: float | None = None
    _in_a_row: list[str] = field(default_factory=list)
    _named: list[str] = field(default_factory=list)

    def passes(self, time_s: float, label: str) -> bool:
        """Return whether the frame is later than the last one that passed.

        Raises:
            SourceError: None has been for a while: the clock does not rise.
        """
        if self._last_s is None or time_s - self._last_s >= _SHORTEST_STEP_S - _STEP_ROUNDING_S:
            self._last_s = time_s
            self._in_a_row.clear()
            return True
        self.skipped += 1
        clause = f"{time_s:.3f} s after {self._last_s:.3f} s at {label}"
        self._in_a_row.append(clause)
        if len(self._named) < _NAMED:
            self._named.append(clause)
        if len(self._in_a_row) > _SKIPPED_IN_A_ROW:
            raise SourceError(
                expected="timestamps that increase",
                found=f"{self._in_a_row[0]} of {self.film}, and on from there",
                fix="rewrap the file with ffmpeg, or give its frame rate (--fps) to replace its timestamps",
            )
        return False

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was skipped, as a clause."""
        if not self.skipped:
            return ()
        more = ", ..." if self.skipped > len(self._named) else ""
        count = "1 frame is" if self.skipped == 1 else f"{self.skipped} frames are"
        return (f"{self.film}: {count} skipped, of a time that is not later ({', '.join(self._named)}{more})",)
