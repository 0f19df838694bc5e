"""How a stream is: whether what it shows is now, and if not, why not."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Final, Literal, get_args

StreamState = Literal[
    "connecting",
    "waiting_for_keyframe",
    "live",
    "stale",
    "lost",
    "backing_off",
    "frozen",
    "late",
    "refused",
    "disabled",
]
STREAM_STATES: Final[tuple[StreamState, ...]] = get_args(StreamState)
"""Only of "live" may anything about safety be concluded."""


@dataclass(frozen=True, slots=True)
class Health:
    """A change of a stream's state.

    Attributes:
        stream_id: Name of the stream.
        state: What it is from now on: "connecting", "waiting_for_keyframe"; "live"; "stale" when no picture came for a
            moment, "lost" when none came for longer, "backing_off" between two attempts to connect; "frozen" where all
            pictures are the same, "late" where they are too old; "refused" where credentials are not accepted;
            "disabled" by the settings.
        reason: A short clause; empty where it is live.
        time_s: Of the stream, as of its frames.
        since: Aware UTC of the change.
    """

    stream_id: str
    state: StreamState
    reason: str
    time_s: float
    since: datetime

    @property
    def is_live(self) -> bool:
        """Whether what the stream shows is now."""
        return self.state == "live"
