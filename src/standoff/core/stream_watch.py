"""From what the capture of a stream says, and from its silence, to the stream's state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final, Literal, NamedTuple

from annotated_types import Gt, Interval
from typing_extensions import Doc

from standoff.core.health import StreamState

CapturePhase = Literal["connecting", "waiting_for_keyframe", "receiving", "backing_off", "refused"]

_SILENT_CAPTURE_S: Final = 1.5
_DISABLED: Final = "disabled in the settings"
_NOT_ANSWERING: Final = "its capture does not answer"
_NOTHING_YET: Final = "no picture has come yet"
_NO_PICTURE: Final = "no picture comes"
_FROZEN: Final = "the picture stands still"
_LATE: Final = "its pictures are too old when they come"


@dataclass(frozen=True, slots=True)
class WatchLimits:
    """When a stream is not live any more."""

    stale_after_s: Annotated[float, Interval(gt=0, le=10), Doc("Stale without a picture for so many seconds.")] = 0.5
    lost_after_s: Annotated[float, Interval(gt=0, le=60), Doc("Lost without a picture for so many seconds.")] = 1.5
    frozen_after_s: Annotated[
        float,
        Gt(0),
        Doc("Frozen when the same picture came again and again for so many seconds; .inf: never, for a quiet scene."),
    ] = 5.0
    late_after_s: Annotated[
        float, Gt(0), Doc("Late when pictures are so many seconds old as they arrive, where that is known.")
    ] = 2.0

    def __post_init__(self) -> None:
        if not self.stale_after_s <= self.lost_after_s:
            raise ValueError("lost_after_s must not be less than stale_after_s")


class CaptureWord(NamedTuple):
    """What a capture says of itself.

    Attributes:
        phase: What it is doing.
        reason: Why; empty while pictures come.
        beat_s: When it said so, monotonic.
    """

    phase: CapturePhase
    reason: str
    beat_s: float


class PictureWord(NamedTuple):
    """What is known of the newest picture.

    Attributes:
        arrived_s: When, monotonic.
        changed_s: When the picture last was another one than the one before, monotonic.
        delay_s: From its capture to its arrival; NaN: unknown.
    """

    arrived_s: float
    changed_s: float
    delay_s: float = math.nan


class StreamCondition(NamedTuple):
    """A state and why.

    Attributes:
        state: Of the stream.
        reason: A short clause; empty where it is live.
    """

    state: StreamState
    reason: str = ""


def stream_condition(
    word: CaptureWord | None, picture: PictureWord | None, now_s: float, limits: WatchLimits, *, enabled: bool = True
) -> StreamCondition:
    """Return how a stream is at this moment; the same words for the same cause.

    Args:
        word: The latest of its capture; None: there is none yet.
        picture: The newest picture of the present connection or an earlier one; None: there was none.
        now_s: Monotonic, the same clock as the others.
        limits: When it is not live any more.
        enabled: Whether the settings want it.

    >>> from math import inf
    >>> word = CaptureWord("receiving", "", beat_s=99.9)
    >>> stream_condition(word, PictureWord(99.95, 99.95), 100.0, WatchLimits())
    StreamCondition(state='live', reason='')
    >>> stream_condition(word, PictureWord(99.2, 99.2), 100.0, WatchLimits())
    StreamCondition(state='stale', reason='no picture comes')
    """
    if not enabled:
        return StreamCondition("disabled", _DISABLED)
    silence_s = math.inf if picture is None else now_s - picture.arrived_s
    if silence_s <= limits.lost_after_s and picture is not None:
        return _of_pictures(picture, silence_s, limits)
    if word is None:
        return StreamCondition("connecting", "its capture begins")
    if now_s - word.beat_s > _SILENT_CAPTURE_S:
        return StreamCondition("lost", _NOT_ANSWERING)
    if word.phase == "receiving":
        return StreamCondition("lost", _NOTHING_YET if picture is None else _NO_PICTURE)
    return StreamCondition(word.phase, word.reason)


def _of_pictures(picture: PictureWord, silence_s: float, limits: WatchLimits) -> StreamCondition:
    """Return the state of a stream of which a picture came a moment ago."""
    if silence_s > limits.stale_after_s:
        return StreamCondition("stale", _NO_PICTURE)
    if picture.arrived_s - picture.changed_s > limits.frozen_after_s:
        return StreamCondition("frozen", _FROZEN)
    if picture.delay_s > limits.late_after_s:
        return StreamCondition("late", _LATE)
    return StreamCondition("live")
