"""What a DJI drone says of itself over MQTT (DJI Cloud API, topic `thing/product/SERIAL/osd`), as telemetry.

Names are those of the published schema: `height` above the ellipsoid or the sea, `elevation` above the point of
take-off, `latitude`, `longitude`, `attitude_head`, and for each payload, under its index (`52-0-0`), `gimbal_pitch` (0
looks at the horizon, -90 down), `gimbal_roll`, `gimbal_yaw` (from north, clockwise).
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any, Final

from standoff.core.telemetry import Telemetry
from standoff.messages import Unreadable
from standoff.stages.frames import PROFESSIONAL_ERRORS, telemetry_of

_PAYLOAD: Final = re.compile(r"\d{1,5}-\d-\d")
_LARGEST_BYTES: Final = 65_536
_FRESH_S: Final = 1.5
"""Telemetry comes twice a second; a drone turns meanwhile by more than any error if it is older."""
_ORIGIN: Final = "DJI Cloud API"
_BOUNDS: Final[Mapping[str, tuple[float, float]]] = {
    "height_m": (-500.0, 10_000.0),
    "pitch_deg": (-90.0, 120.0),
    "roll_deg": (-180.0, 180.0),
    "heading_deg": (-360.0, 360.0),
    "latitude_deg": (-90.0, 90.0),
    "longitude_deg": (-180.0, 180.0),
    "altitude_m": (-500.0, 10_000.0),
}


def osd_topic(serial: str) -> str:
    """Return the topic of a drone's telemetry."""
    return f"thing/product/{serial}/osd"


def read_osd(payload: bytes) -> dict[str, float]:
    """Return the readings of a message, by field of `Telemetry`; only those that are there.

    Raises:
        Unreadable: It is no such message, or tells nothing.

    >>> read_osd(b'{"data": {"elevation": 30.5, "52-0-0": {"gimbal_pitch": -60.0, "gimbal_yaw": 12.0}}}')
    {'height_m': 30.5, 'pitch_deg': 60.0, 'heading_deg': 12.0}
    """
    if len(payload) > _LARGEST_BYTES:
        raise Unreadable(f"expected at most {_LARGEST_BYTES} bytes, found {len(payload)}")
    try:
        told = json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise Unreadable(f"expected JSON, found {str(error)[:120]}") from None
    data = told.get("data") if isinstance(told, dict) else None
    if not isinstance(data, dict):
        raise Unreadable("expected `data` by name")
    gimbal = next((one for name, one in data.items() if _PAYLOAD.fullmatch(name) and isinstance(one, dict)), {})
    found = {
        "height_m": _number(data.get("elevation")),
        "pitch_deg": -_number(gimbal.get("gimbal_pitch")),
        "roll_deg": _number(gimbal.get("gimbal_roll")),
        "heading_deg": _number(gimbal.get("gimbal_yaw")),
        "latitude_deg": _number(data.get("latitude")),
        "longitude_deg": _number(data.get("longitude")),
        "altitude_m": _number(data.get("height")),
    }
    readings = {name: value for name, value in found.items() if _BOUNDS[name][0] <= value <= _BOUNDS[name][1]}
    # A drone without a fix says that it is where the equator meets Greenwich.
    if not {"latitude_deg", "longitude_deg"} <= readings.keys() or (
        readings["latitude_deg"] == 0.0 and readings["longitude_deg"] == 0.0
    ):
        readings.pop("latitude_deg", None)
        readings.pop("longitude_deg", None)
    if not readings:
        raise Unreadable("expected readings of the drone, found none that can be")
    return readings


def telemetry_at(word: Mapping[str, Any] | None, time_s: float, arrived_s: float) -> Telemetry | None:
    """Return what a stream's drone says for a picture; None where it said nothing just before.

    Args:
        word: Its readings, and when they came, `at_s`; None: it never said anything.
        time_s: Of the picture, in its stream.
        arrived_s: When the picture came, monotonic.
    """
    if word is None or abs(arrived_s - word["at_s"]) > _FRESH_S:
        return None
    return telemetry_of(word["readings"], time_s, _ORIGIN, PROFESSIONAL_ERRORS)


def _number(value: object) -> float:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if is_number and abs(value) < 1e9 else math.nan  # type: ignore[arg-type]
