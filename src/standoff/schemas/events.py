"""A line of a run's hazards, and of what people say of them, as JSON Schema."""

from __future__ import annotations

from typing import Any

from standoff.clips import FRAME_COLUMNS, schema_of
from standoff.clips.reviews import Review
from standoff.core.hazards import Hazard
from standoff.schemas.documented import dataclass_properties
from standoff.schemas.rows import row_schema


def event_schema() -> dict[str, Any]:
    """Return what one event is: where in the stream, the hazard's own fields, and the classes of its tracks."""
    moment = row_schema(schema_of([column for column in FRAME_COLUMNS if column[0] != "time_s"]))["properties"]
    for column in moment.values():
        kinds = column["type"] if isinstance(column["type"], list) else [column["type"]]
        column["type"] = [*kinds, *({"null"} - set(kinds))]
    classes = {
        "type": "array",
        "items": {"type": ["string", "null"]},
        "description": "Of each of track_ids, as it was when the hazard opened; null: unknown.",
    }
    properties = {**moment, **dataclass_properties(Hazard), "classes": classes}
    return {
        "type": "object",
        "description": "Frame and times are those of the event; null where it was said before the first frame.",
        "properties": properties,
        "required": [name for name in properties if name != "zone"],
    }


def review_schema() -> dict[str, Any]:
    """Return what one line of a run's reviews is; the last one of a hazard counts."""
    properties = dataclass_properties(Review)
    return {
        "type": "object",
        "description": "What somebody says of a hazard; lines are only ever added.",
        "properties": properties,
        "required": [*properties],
    }
