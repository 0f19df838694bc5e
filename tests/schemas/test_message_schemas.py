"""What is sent and what may be sent are what their schemas say."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any

import jsonschema
import pytest

from standoff.messages import (
    EVENT_TYPES,
    Alert,
    HazardNews,
    HealthNews,
    Heartbeat,
    Supervision,
    Timing,
    Unreadable,
    WatchedZone,
    event_text,
    read_message,
)
from standoff.messages.device import Acknowledgement, DevicePosition, Echo
from standoff.schemas import SCHEMAS

AT = datetime(2026, 3, 1, 12, 30, tzinfo=UTC)
HAZARD = HazardNews(
    "yard", "gate", "session", "hazard", "opened", "proximity", "danger", (1, 2), ("worker", "excavator"), "",
    4.0, -3.8, 0.3, 1.0, None, "", 12.5, AT, "told",
)  # fmt: skip
BEAT = Heartbeat(
    "yard", "gate", "session", 7, 120, 12.5, True, "", 0.8, {"too dark or too noisy": 0.2},
    (WatchedZone("pit", 0.5, "behind a machine"),), "told", ("hazard",),
)  # fmt: skip
NEWS: tuple[object, ...] = (
    HAZARD,
    Alert("wrist-1", HAZARD, "position", silent=False),
    HealthNews("yard", "gate", "lost", "no picture comes", 12.5, AT),
    Supervision("wrist-1", 3, False, "your position is not known", ()),
    BEAT,
)
DEVICE: tuple[tuple[str, type, dict[str, Any]], ...] = (
    ("device-position", DevicePosition, {"x_m": 1.0, "y_m": 2.0, "sigma_m": 0.5, "age_ms": 20.0}),
    ("device-ack", Acknowledgement, {"hazard_id": "hazard"}),
    ("device-echo", Echo, {"id": "alert", "held_ms": 3.5}),
)


def validator(name: str) -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(SCHEMAS[name](), format_checker=jsonschema.FormatChecker())


@pytest.mark.parametrize("news", NEWS, ids=lambda news: type(news).__name__)
@pytest.mark.parametrize("age_ms", [None, 120.5])
def test_an_event_is_what_its_schema_says(news: object, age_ms: float | None) -> None:
    timing = Timing("clock", 1000.0, 3000.0, age_ms)
    text = event_text(news, event_id="id", source="standoff/yard", subject="gate", at=AT, timing=timing)
    event, name = json.loads(text), EVENT_TYPES[type(news)].replace("standoff.", "message-")
    validator(name).validate(event)
    schema = SCHEMAS[name]()
    assert event.keys() == schema["properties"].keys()
    assert event["data"].keys() == schema["properties"]["data"]["properties"].keys()
    assert all(part["description"] for part in schema["properties"]["data"]["properties"].values())
    with pytest.raises(jsonschema.ValidationError):
        validator(name).validate(event | {"type": "standoff.other"})


@pytest.mark.parametrize(("name", "kind", "message"), DEVICE)
def test_what_a_schema_allows_of_a_device_is_read_and_what_it_does_not_is_refused(
    name: str, kind: type, message: dict[str, Any]
) -> None:
    validator(name).validate(message)
    read_message(json.dumps(message).encode(), kind)
    for key in message:
        wrong = message | {key: []}
        assert not validator(name).is_valid(wrong)
        with pytest.raises(Unreadable):
            read_message(json.dumps(wrong).encode(), kind)
