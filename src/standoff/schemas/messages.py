"""What a live site sends, and what devices send it, as JSON Schema."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from pydantic import TypeAdapter

from standoff.messages import EVENT_TYPES, Acknowledgement, DevicePosition, Echo, Timing, WatchedZone
from standoff.schemas.documented import attribute_meanings

_DEVICE: Final[Mapping[str, type]] = {
    "device-position": DevicePosition,
    "device-ack": Acknowledgement,
    "device-echo": Echo,
}
_EXTENSIONS: Final = {"clock": "clock", "sentms": "sent_ms", "remainingms": "remaining_ms", "agems": "age_ms"}


def event_message_schema(kind: type) -> dict[str, Any]:
    """Return the schema of a CloudEvent with data of some kind."""
    data = _documented(kind)
    definitions = data.pop("$defs", {})
    timing = _documented(Timing)["properties"]
    text = {"type": "string", "minLength": 1}
    properties = {
        "specversion": {"const": "1.0"},
        "id": {**text, "description": "The same whenever it is sent again: drop what you know."},
        "source": {**text, "description": "standoff/SITE, or standoff/SITE/stream/NAME."},
        "type": {"const": EVENT_TYPES[kind]},
        "subject": {**text, "description": "The hazard, the stream or the device that it is about."},
        "time": {"type": "string", "format": "date-time", "description": "When it happened."},
        "datacontenttype": {"const": "application/json"},
        "dataschema": text,
        "data": data,
        **{short: timing[name] for short, name in _EXTENSIONS.items()},
    }
    return {
        "type": "object",
        "description": "A CloudEvent 1.0 in structured JSON.",
        "properties": properties,
        "required": [*properties],
        "$defs": definitions,
    }


def device_message_schema(kind: type) -> dict[str, Any]:
    """Return the schema of what a device sends."""
    return _documented(kind)


def _documented(kind: type) -> dict[str, Any]:
    made: dict[str, Any] = TypeAdapter(kind).json_schema(mode="serialization")
    _describe(made, kind)
    classes = {one.__name__: one for one in (*EVENT_TYPES, WatchedZone)}
    for name, part in made.get("$defs", {}).items():
        _describe(part, classes[name])
    return made


def _describe(schema: dict[str, Any], kind: type) -> None:
    meanings = attribute_meanings(kind)
    schema.pop("title", None)
    schema["description"] = (kind.__doc__ or "").partition("\n")[0]
    for name, part in schema["properties"].items():
        part.pop("title", None)
        part["description"] = meanings.get(name, "")


MESSAGE_SCHEMAS: Final = {
    **{
        name.replace("standoff.", "message-"): partial(event_message_schema, kind) for kind, name in EVENT_TYPES.items()
    },
    **{name: partial(device_message_schema, kind) for name, kind in _DEVICE.items()},
}
"""By name, what makes the schema of each message."""
