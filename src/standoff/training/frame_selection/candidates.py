"""Look through a source for frames that could be chosen."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

from standoff.core.protocols import Detector
from standoff.core.types import Detections, Frame
from standoff.training.frame_selection.appearance import describe, sharpness
from standoff.training.frame_selection.doubt import doubt, flickering
from standoff.training.frame_selection.selection import CandidateFrame

_CONSECUTIVE_S = 0.2
"""Frames further apart show other things, not the same things found and lost."""
_ROUNDING_S = 1e-6


def look_through(
    frames: Iterable[Frame],
    detector: Detector,
    every_s: float,
    threshold: float,
    wanted: Mapping[float, str] | None = None,
) -> Iterator[CandidateFrame]:
    """Yield a candidate each `every_s` seconds; the frame right after it tells which of its boxes flicker.

    Args:
        frames: All frames of the source, in order.
        detector: Its unsure boxes are needed, too.
        every_s: Least time between two candidates; 0: every frame is one.
        threshold: Score from which a box counts.
        wanted: Times of frames that somebody asks for, which are candidates too, and why; the first one at each time or
            after it.
    """
    due_s = float("-inf")
    asked = deque(sorted((wanted or {}).items()))
    seen: dict[int, Detections] = {}
    for frame, following in _with_next(frames):
        reasons = []
        while asked and asked[0][0] <= frame.time_s + _ROUNDING_S:
            reasons.append(asked.popleft()[1])
        is_due = frame.time_s >= due_s - _ROUNDING_S
        if not is_due and not reasons:
            continue
        due_s = frame.time_s + every_s if is_due else due_s
        now = seen.pop(frame.index) if frame.index in seen else detector.detect(frame)
        flicker = 0
        if following is not None and following.time_s - frame.time_s <= _CONSECUTIVE_S:
            seen = {following.index: detector.detect(following)}
            flicker = int(flickering(now, seen[following.index], threshold).sum())
        yield CandidateFrame(
            index=frame.index,
            time_s=frame.time_s,
            detections=now,
            doubt=float(doubt(now.score, threshold).sum()),
            flicker=flicker,
            sharpness=sharpness(frame.picture),
            look=describe(frame.picture, now),
            wanted="; ".join(dict.fromkeys(reasons)),
        )


def _with_next(frames: Iterable[Frame]) -> Iterator[tuple[Frame, Frame | None]]:
    """Yield each frame with the one after it, and the last one with None."""

    def ended() -> Iterator[Frame | None]:
        yield from frames
        yield None

    for frame, following in pairwise(ended()):
        if frame is not None:
            yield frame, following
