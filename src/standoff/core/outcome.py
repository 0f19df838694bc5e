"""What a stream says when it says nothing, and how a run ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from standoff.core.hazards import Hazard, OpenHazards
from standoff.core.run_counts import RunCounts

Status = Literal["complete", "interrupted", "failed"]
"""How a run can end."""


@dataclass(frozen=True, slots=True)
class Silence:
    """A moment at which a stream should have told something and did not: nothing that was true before is known now.

    Attributes:
        stream_id: Name of the stream.
        time_s: When, in presentation time.
        reason: Why nothing arrives.
        hazards: The events of this moment.
        open_hazards: Which hazards are open after them.
    """

    stream_id: str
    time_s: float
    reason: str
    hazards: tuple[Hazard, ...]
    open_hazards: OpenHazards


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run ended; sinks are closed with it.

    Attributes:
        status: "complete"; "interrupted" by the operator; "failed" with the source, the model or a stage; a stream that
            was lost has failed.
        message: One line; empty when complete.
        hazards: The last events of the hazards that were open when the stream ended: closed, or unknown where it
            failed.
        sink_errors: Message of each sink that gave up during the run, by sink name.
        counts: What happened in it.
        about: What its source and stages say of themselves at the end, by heading; `warnings` among them.
    """

    status: Status
    message: str = ""
    hazards: tuple[Hazard, ...] = ()
    sink_errors: Mapping[str, str] = field(default_factory=dict)
    counts: RunCounts = field(default_factory=RunCounts)
    about: Mapping[str, Any] = field(default_factory=dict)
