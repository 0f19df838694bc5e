"""Which output has which schema: the files of a run that programs read, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

from standoff.clips.reviews import REVIEW_FILE
from standoff.core.outputs import OUTPUTS, RECORD_FILE, SCHEMA_VERSION, ZONES_FILE
from standoff.schemas.events import event_schema, review_schema
from standoff.schemas.messages import MESSAGE_SCHEMAS
from standoff.schemas.record import record_schema
from standoff.schemas.rows import row_schema
from standoff.schemas.zones import zones_schema
from standoff.stages.sinks import DETECTIONS, FRAMES, PROXIMITY, ZONED_TRACKS

_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_MAKERS: Final[Mapping[str, tuple[str, Callable[[], dict[str, Any]]]]] = MappingProxyType(
    {
        "run": (RECORD_FILE, record_schema),
        "hazards": (f"{OUTPUTS['hazards']}, one line", event_schema),
        "tracks": (f"{OUTPUTS['tracks']}, one row", lambda: row_schema(ZONED_TRACKS.schema, optional={"zones"})),
        "proximity": (f"{OUTPUTS['proximity']}, one row", lambda: row_schema(PROXIMITY.schema)),
        "frames": (f"{OUTPUTS['frames']}, one row", lambda: row_schema(FRAMES.schema)),
        "detections": (f"{OUTPUTS['detections']}, one row", lambda: row_schema(DETECTIONS.schema)),
        "zones": (ZONES_FILE, zones_schema),
        "review": (f"{REVIEW_FILE}, one line", review_schema),
        **{name: (f"{name}, one message", make) for name, make in MESSAGE_SCHEMAS.items()},
    }
)


def _whole(name: str) -> dict[str, Any]:
    title, make = _MAKERS[name]
    identity = f"urn:standoff:{name}:{SCHEMA_VERSION}"
    return {"$schema": _DIALECT, "$id": identity, "title": title, "schema_version": SCHEMA_VERSION, **make()}


def _maker(name: str) -> Callable[[], dict[str, Any]]:
    return lambda: _whole(name)


SCHEMAS: Final[Mapping[str, Callable[[], dict[str, Any]]]] = MappingProxyType({name: _maker(name) for name in _MAKERS})
"""What makes the schema of each output. All are open: later versions may add keys and columns, and readers pass over
what they do not know. `unit` and `schema_version` are annotations that validators pass over."""
