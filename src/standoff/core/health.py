"""How a stream is: whether what it shows is now, and if not, why not."""

from __future__ import annotations

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
"""Only of "live" may anything about safety be concluded.

"connecting", "waiting_for_keyframe"; "stale" when no picture came for a moment, "lost" when none came for longer,
"backing_off" between two attempts to connect; "frozen" where all pictures are the same, "late" where they are too old;
"refused" where credentials are not accepted; "disabled" by the settings.
"""
