"""Where a film is not one: cuts, zooms, frozen pictures, a clock that jumps; each told once, with frames and times."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from standoff.core.types import Frame

FROZEN = "the picture stood still"
JUMPED = "the clock jumped ahead"

_LEAST_FROZEN_S = 2.0
"""Films hold a picture for a frame or two, a fixed camera over a quiet site for longer; beyond, it is a fault of
the link or the file."""

_LEAST_JUMP_S, _JUMP_STEPS, _MOST_STEPS = 1.0, 10.0, 50
_TOGETHER_S = 1.0
"""What happens again so soon is one event: a zoom takes many frames."""

_MOST_NAMED = 5


@dataclass(slots=True)
class _Span:
    """From when to when something lasted: frames and seconds."""

    first: tuple[int, float]
    last: tuple[int, float]

    @property
    def duration_s(self) -> float:
        return self.last[1] - self.first[1]

    def __str__(self) -> str:
        if self.first == self.last:
            return f"at frame {self.first[0]} ({self.first[1]:.2f} s)"
        return f"in frames {self.first[0]} to {self.last[0]} ({self.first[1]:.2f} to {self.last[1]:.2f} s)"


@dataclass
class Breaks:
    """What has happened to one stream so far."""

    _spans: dict[str, list[_Span]] = field(default_factory=dict)
    _steps_s: deque[float] = field(default_factory=lambda: deque(maxlen=_MOST_STEPS))
    _before: tuple[int, float] | None = None

    def note(self, frame: Frame, broken: str, *, repeated: bool) -> None:
        """Take note of a frame.

        Args:
            frame: Frames in the order in which they came.
            broken: What happened between it and the one before; "" where nothing did.
            repeated: Whether it shows what the one before showed.
        """
        now, before = (frame.index, frame.time_s), self._before
        if before is not None:
            step_s = now[1] - before[1]
            usual_s = median(self._steps_s) if self._steps_s else np.inf
            if step_s > max(_LEAST_JUMP_S, _JUMP_STEPS * usual_s):
                self._add(JUMPED, before, now)
            elif step_s > 0.0:
                self._steps_s.append(step_s)
        if broken:
            self._add(broken, now, now)
        if repeated and before is not None:
            self._add(FROZEN, before, now)
        self._before = now

    def _add(self, what: str, first: tuple[int, float], last: tuple[int, float]) -> None:
        spans = self._spans.setdefault(what, [])
        # A picture that stands still twice has moved in between, and each jump of the clock is one by itself.
        slack_s = {FROZEN: 0.0, JUMPED: -np.inf}.get(what, _TOGETHER_S)
        if spans and 0.0 <= first[1] - spans[-1].last[1] <= slack_s:
            spans[-1].last = last
        else:
            spans.append(_Span(first, last))

    @property
    def warnings(self) -> list[str]:
        """A clause for each kind of thing that happened."""
        texts = []
        for what, spans in self._spans.items():
            named = [span for span in spans if what != FROZEN or span.duration_s >= _LEAST_FROZEN_S]
            more = f" and {len(named) - _MOST_NAMED} times more" if len(named) > _MOST_NAMED else ""
            if named:
                texts.append(f"{what} {', '.join(map(str, named[:_MOST_NAMED]))}{more}")
        return texts
