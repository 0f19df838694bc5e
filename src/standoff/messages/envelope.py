"""CloudEvents 1.0 in structured JSON, written and read strictly."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime
from functools import cache
from types import MappingProxyType
from typing import Any, Final, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError, with_config
from pydantic_core import to_jsonable_python

from standoff.messages.events import Alert, HazardNews, HealthNews, Heartbeat, Supervision, Timing

CONTENT_TYPE: Final = "application/cloudevents+json"
_VERSION: Final = "1.0"
_LARGEST_BYTES: Final = 65_536
_LONGEST_REASON: Final = 300

EVENT_TYPES: Final[Mapping[type, str]] = MappingProxyType(
    {
        HazardNews: "standoff.hazard",
        Alert: "standoff.alert",
        Heartbeat: "standoff.heartbeat",
        Supervision: "standoff.supervision",
        HealthNews: "standoff.health",
    }
)
"""The CloudEvents type of each kind of news."""

Told = TypeVar("Told")


class Unreadable(ValueError):
    """A message that cannot be read, and why, in one short line.

    Args:
        reason: Why; what stands in the message may be part of it.
    """

    def __init__(self, reason: str) -> None:
        line = "".join(sign if sign.isprintable() else " " for sign in reason)
        super().__init__(" ".join(line.split())[:_LONGEST_REASON])


def event_text(
    news: object, *, event_id: str, source: str, subject: str, at: datetime, timing: Timing | None = None
) -> str:
    """Return a CloudEvent as JSON.

    Args:
        news: Its data: an instance of one of `EVENT_TYPES`.
        event_id: Unique in its source; the same again for the same event.
        source: Who says it, as `standoff/SITE/stream/NAME`.
        subject: Of what it is: a hazard's id, for instance.
        at: When it happened.
        timing: When it is sent, and how long it holds; beside the data, as the extension `timing`'s parts.
    """
    kind = EVENT_TYPES[type(news)]
    event: dict[str, Any] = {
        "specversion": _VERSION,
        "id": event_id,
        "source": source,
        "type": kind,
        "subject": subject,
        "time": at.isoformat(timespec="milliseconds"),
        "datacontenttype": "application/json",
        "dataschema": f"urn:standoff:schema:{kind.removeprefix('standoff.')}:1",
        "data": to_jsonable_python(news, inf_nan_mode="null"),
    }
    return json.dumps(
        event if timing is None else with_timing(event, timing), ensure_ascii=False, separators=(",", ":")
    )


def with_timing(event: Mapping[str, Any], timing: Timing) -> dict[str, Any]:
    """Return an event with the moment of its sending; CloudEvents extensions are plain values with short names."""
    told = to_jsonable_python(timing, inf_nan_mode="null")
    return {**event, "clock": told["clock"], **{_EXTENSIONS[name]: told[name] for name in _EXTENSIONS}}


_EXTENSIONS: Final = {"sent_ms": "sentms", "remaining_ms": "remainingms", "age_ms": "agems"}
"""Names of extensions have letters and digits only."""


def read_event(payload: bytes, kind: type[Told]) -> tuple[str, Told, Timing | None]:
    """Read a CloudEvent of one kind.

    Returns:
        Its id, its data, and when it was sent; None where it does not say.

    Raises:
        Unreadable: It is none.
    """
    event = _json_object(payload)
    wanted = EVENT_TYPES[kind]
    if event.get("specversion") != _VERSION or event.get("type") != wanted:
        raise Unreadable(f"expected a CloudEvent {_VERSION} of type {wanted}, found {str(event.get('type'))[:60]!r}")
    event_id = event.get("id")
    if not isinstance(event_id, str) or not 0 < len(event_id) <= 200:
        raise Unreadable("expected an id, a text of 1 to 200 letters")
    timing = None
    if "clock" in event:
        told = {"clock": event["clock"], **{name: event.get(short) for name, short in _EXTENSIONS.items()}}
        timing = _checked(told, Timing)
    return event_id, _checked(event.get("data"), kind), timing


def read_message(payload: bytes, kind: type[Told]) -> Told:
    """Read a device's message.

    Raises:
        Unreadable: It is none.
    """
    return _checked(_json_object(payload), kind)


def _json_object(payload: bytes) -> dict[str, Any]:
    if len(payload) > _LARGEST_BYTES:
        raise Unreadable(f"expected at most {_LARGEST_BYTES} bytes, found {len(payload)}")
    try:
        found = json.loads(payload, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise Unreadable(f"expected JSON, found {str(error)[:120]}") from None
    if not isinstance(found, dict):
        raise Unreadable(f"expected a JSON object, found {type(found).__name__}")
    return found


def _no_number(name: str) -> float:
    raise ValueError(f"{name}, which is no JSON")


@cache
def _adapter(kind: type[Any]) -> TypeAdapter[Any]:
    return TypeAdapter(with_config(ConfigDict(extra="ignore", allow_inf_nan=False))(kind))


def _checked(given: object, kind: type[Told]) -> Told:
    try:
        any_kind: Any = kind
        checked: Told = _adapter(any_kind).validate_json(json.dumps(given), strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "the message"
        raise Unreadable(f"{where}: {first['msg'][:200]}") from None
    except (ValueError, RecursionError) as error:
        raise Unreadable(str(error)[:200]) from None
    return checked
