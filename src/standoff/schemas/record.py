"""The record of a run as JSON Schema."""

from __future__ import annotations

import inspect
from typing import Any, Final, get_args

from standoff.config import Settings
from standoff.core.hazards import Severity
from standoff.core.run_counts import ROW_COUNTS, TALLIES
from standoff.core.stage_durations import Durations
from standoff.core.watched_shares import WatchedShares
from standoff.monitor import ABOUT, RunRecord
from standoff.schemas.documented import dataclass_properties, number

_AT_START: Final = ("status", "message", "started_at", "versions")
_AT_END: Final = ("stages", "finished_at", "wall_s", "sink_errors")
_LESS: Final = "Counts of what happened; zones only where a zone had a hazard."


def record_schema() -> dict[str, Any]:
    """Return what the record is: less of it while the run goes on, all of it once the run is complete."""
    settings = Settings.model_json_schema(mode="serialization")
    # References within the settings lead to the definitions at the head of the whole.
    shared = settings.pop("$defs", {})
    begun = {
        **dataclass_properties(RunRecord, _AT_START),
        "schema_version": {"type": "integer", "description": "Version of the files of the run; absent: before 1."},
        **_about(settings),
    }
    ended = {
        **dataclass_properties(RunRecord, _AT_END),
        "frames_per_s": {"type": ["number", "null"], "description": _doc(RunRecord.frames_per_s)},
        "counts": _counts(),
        "watched_ground": _watched(),
    }
    ended["stages"]["additionalProperties"]["required"] = [*Durations().summary()]
    whole = {"properties": {"status": {"const": "complete"}}}
    return {
        "type": "object",
        "description": "A run without room for its whole record says status, message and sink_errors only.",
        "properties": {**begun, **ended},
        "required": ["status", "message"],
        "if": whole,
        "then": {"required": [*begun, *ended]},
        "$defs": shared,
    }


def _about(settings: dict[str, Any]) -> dict[str, Any]:
    kinds: dict[str, dict[str, Any]] = {
        "settings": settings,
        "alarms": {"type": ["object", "null"]},
        "warnings": {"type": "array", "items": {"type": "string"}},
    }
    return {name: {**kinds.get(name, {"type": "object"}), "description": text} for name, text in ABOUT.items()}


def _counts() -> dict[str, Any]:
    count = {"type": "integer", "minimum": 0}
    tally = {"type": "object", "additionalProperties": count}
    by_severity = {"type": "object", "properties": dict.fromkeys(get_args(Severity), count)}
    rows = {name: {**count, "description": text} for name, text in ROW_COUNTS.items()}
    tallies = {name: {**tally, "description": text} for name, text in TALLIES.items()}
    zones = {"type": "object", "additionalProperties": by_severity, "description": "hazards of each zone that had any"}
    required = [*rows, *tallies]
    properties = {**rows, **tallies, "zones": zones}
    return {"type": "object", "properties": properties, "required": required, "description": _LESS}


def _watched() -> dict[str, Any]:
    unwatched = {"type": "object", "additionalProperties": {"type": "number"}}
    properties = {
        "share": number(_doc(WatchedShares.share)),
        "unwatched": {**unwatched, "description": _doc(WatchedShares.unwatched)},
        "missed_share": number(_doc(WatchedShares.missed_share)),
    }
    return {
        "type": "object",
        "properties": properties,
        "required": [*properties],
        "description": _doc(WatchedShares),
    }


def _doc(documented: object) -> str:
    return (inspect.getdoc(documented) or "").partition("\n")[0]
