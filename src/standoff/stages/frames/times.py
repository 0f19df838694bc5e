"""When the frames of a film are shown, where its file says so badly."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Final, TypeVar

from standoff.core.errors import SourceError

_SHORTEST_STEP_S: Final = 1e-3
"""Between two pictures; no camera of a site takes more than 1000 a second, and rewrapped doubles lie closer."""
_STEP_ROUNDING_S: Final = 1e-4
"""Of the millisecond in which Matroska counts."""
_SKIPPED_IN_A_ROW: Final = 5
"""More of them are no slips, but a clock that was set back."""
_NAMED: Final = 3


_READ_AHEAD: Final = 3
_Shown = TypeVar("_Shown")


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
    _in_a_row: list[tuple[float, str]] = field(default_factory=list)
    _named: list[str] = field(default_factory=list)

    def in_order(self, shown: Iterable[tuple[float, str, _Shown]]) -> Iterator[tuple[float, _Shown]]:
        """Yield what is shown later than what was before, with its time; two frames are read ahead of it.

        A frame that is ahead of the two after it, which are in order, is itself the one whose time is wrong.

        Args:
            shown: Times, labels for messages, and frames.

        Raises:
            SourceError: None has been later for a while: the clock does not rise.
        """
        frames, ahead = iter(shown), deque[tuple[float, str, _Shown]]()
        failed = self._read_ahead(frames, ahead)
        while ahead:
            time_s, label, one = ahead.popleft()
            following_s = [later_s for later_s, _, _ in ahead]
            if len(following_s) == _READ_AHEAD - 1 and self._is_ahead_of(time_s, *following_s):
                self._skip(f"{time_s:.3f} s before {following_s[0]:.3f} s at {label}")
            elif self.passes(time_s, label):
                yield time_s, one
            failed = failed or self._read_ahead(frames, ahead)
        if failed is not None:
            raise failed

    def _read_ahead(self, frames: Iterator[_Shown], ahead: deque[_Shown]) -> SourceError | None:
        """Fill up; return why that is not possible, to be raised after what came before."""
        try:
            ahead.extend(islice(frames, _READ_AHEAD - len(ahead)))
        except SourceError as error:
            return error
        return None

    def _is_ahead_of(self, time_s: float, next_s: float, second_s: float) -> bool:
        return next_s < second_s <= time_s and (self._last_s is None or _is_later(next_s, self._last_s))

    def passes(self, time_s: float, label: str) -> bool:
        """Return whether the frame is later than the last one that passed.

        Raises:
            SourceError: None has been for a while: the clock does not rise.
        """
        if self._last_s is None or _is_later(time_s, self._last_s):
            self._last_s = time_s
            self._in_a_row.clear()
            return True
        clause = f"{time_s:.3f} s after {self._last_s:.3f} s at {label}"
        self._skip(clause)
        self._in_a_row.append((time_s, clause))
        if len(self._in_a_row) > _SKIPPED_IN_A_ROW:
            raise self._restart()
        return False

    def _skip(self, clause: str) -> None:
        self.skipped += 1
        if len(self._named) < _NAMED:
            self._named.append(clause)

    def _restart(self) -> SourceError:
        return SourceError(
            expected="timestamps that increase",
            found=f"{self._in_a_row[0][1]} of {self.film}, and on from there",
            fix="rewrap the file with ffmpeg, or give its frame rate (--fps) to replace its timestamps",
        )

    def check_end(self) -> None:
        """Make sure that the film does not end with a clock that was set back and runs from there.

        Raises:
            SourceError: It does.
        """
        times_s = [time_s for time_s, _ in self._in_a_row]
        if len(times_s) > 1 and all(map(_is_later, times_s[1:], times_s)):
            raise self._restart()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was skipped, as a clause."""
        if not self.skipped:
            return ()
        more = ", ..." if self.skipped > len(self._named) else ""
        count = "1 frame is" if self.skipped == 1 else f"{self.skipped} frames are"
        return (f"{self.film}: {count} skipped, of a time that is not later ({', '.join(self._named)}{more})",)


def _is_later(time_s: float, than_s: float) -> bool:
    return time_s - than_s >= _SHORTEST_STEP_S - _STEP_ROUNDING_S
