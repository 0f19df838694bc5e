"""Streams and receivers announced to Home Assistant (MQTT discovery), so that they appear there by themselves."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final

from standoff import __version__
from standoff.config import SiteSettings
from standoff.messages import Topics

_PREFIX: Final = "homeassistant"


def discovery(site: SiteSettings, topics: Topics) -> Iterator[tuple[str, bytes]]:
    """Yield topics and payloads, to be retained.

    Args:
        site: The settings.
        topics: Of the site.
    """
    name = site.live.site
    device = {"identifiers": [f"standoff-{name}"], "name": f"standoff {name}", "sw_version": __version__}
    available = {
        "availability_topic": topics.service,
        "payload_available": "online",
        "payload_not_available": "offline",
    }
    for stream in site.streams:
        told: dict[str, Any] = {
            **available,
            "name": f"{stream} watched",
            "unique_id": f"standoff-{name}-{stream}-watched",
            "device_class": "connectivity",
            "state_topic": topics.health(stream),
            "value_template": "{{ 'ON' if value_json.data.state == 'live' else 'OFF' }}",
            "json_attributes_topic": topics.health(stream),
            "json_attributes_template": "{{ value_json.data | tojson }}",
            "device": device,
        }
        yield f"{_PREFIX}/binary_sensor/standoff-{name}/{stream}/config", json.dumps(told).encode()
    for receiver in site.live.receivers:
        told = {
            **available,
            "name": f"{receiver} supervised",
            "unique_id": f"standoff-{name}-{receiver}-supervised",
            "device_class": "safety",
            # Home Assistant's "safety" is on where it is unsafe.
            "state_topic": topics.device(receiver).supervision,
            "value_template": "{{ 'OFF' if value_json.data.supervised else 'ON' }}",
            "expire_after": 3,
            "device": device,
        }
        yield f"{_PREFIX}/binary_sensor/standoff-{name}/{receiver}-device/config", json.dumps(told).encode()
