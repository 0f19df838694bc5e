"""One block of a drone's log as text becomes readings; every dialect that is known, and nothing guessed.

Dialects, and what each calls the height (from the logs of a dozen models):

- `bracketed`: `[latitude: 1.2] [rel_alt: 16.9 abs_alt: 102.2] [gb_yaw: 3.0 gb_pitch: -45.0 gb_roll: 0.0]`, a block a
  frame. `rel_alt` is above take-off, `abs_alt` above the sea. Older firmware writes `[longtitude : 1.2]`, focal
  lengths in tenths of a millimetre, and one `[altitude: 213.9]`, which is above the sea: at take-off it is not 0.
- `home`: `HOME(lon,lat)`, `GPS(lon,lat,satellites)`, and `BAROMETER:1.9` or `Hb:1.9`, above take-off; a block a second.
- `listed`: `F/2.8, SS 60, ISO 100, GPS (lon, lat, satellites), D 49.2m, H 45.6m, ... G.PRY (-24.4, 0.0, 110.4)`;
  H is above home, D the distance from it, G.PRY the gimbal's pitch, roll and yaw; a block a second.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

_BRACKETED_PAIR = re.compile(r"([A-Za-z_]+)\s*:\s*([^\s,\]]*)")
_NUMBER = re.compile(r"([+-]?\d+(?:\.\d+)?)\s*(?:m|M|°|�)?")
_ABSENT = frozenset({"", "n/a", "N/A", "NaN", "nan"})
_HOME_NAME = re.compile(r"([A-Za-z]+)(?=[:(])")
_LISTED_NAME = re.compile(r"(?:^|,\s+)([A-Z][A-Z.]*)(?=[ /])", re.MULTILINE)
_TENTHS_FROM_MM = 100.0

_RANGES = {
    "height_m": (-500.0, 3000.0),
    "altitude_m": (-1000.0, 10_000.0),
    "pitch_deg": (-180.0, 180.0),
    "roll_deg": (-180.0, 180.0),
    "heading_deg": (-360.0, 360.0),
    "latitude_deg": (-90.0, 90.0),
    "longitude_deg": (-180.0, 180.0),
    "focal_mm_35": (8.0, 1200.0),
}
"""What a reading can be at all; beyond, the file is not what it seems."""


class UnreadableText(ValueError):
    """The text is no reading of a drone, or only a part of one; the message is a clause that says what is wrong."""


def number(text: str, name: str) -> float:
    """Return a value, NaN where the drone itself writes that it has none.

    >>> number("200.70m", "H"), number("n/a", "H")
    (200.7, nan)

    Raises:
        UnreadableText: It is neither.
    """
    if text.strip() in _ABSENT:
        return math.nan
    match = _NUMBER.fullmatch(text.strip())
    if match is None:
        raise UnreadableText(f"{name} is {text.strip()!r}, which is no number")
    return float(match[1])


def check_ranges(readings: dict[str, float]) -> None:
    """Raise UnreadableText for a reading that no drone can have; NaN passes."""
    for name, value in readings.items():
        low, high = _RANGES[name]
        if value < low or value > high:
            raise UnreadableText(f"{name} is {value:g}, outside {low:g} to {high:g}")


def dialect_of(text: str) -> str | None:
    """Return the dialect's name, or None for text that no drone writes."""
    if re.search(r"\[iso\s*:", text) or re.search(r"\[latitude\s*:", text):
        return "bracketed"
    if "HOME(" in text or re.search(r"GPS\([^)]*\)\s*(?:BAROMETER|Hb):", text):
        return "home"
    if re.search(r"F/[\d.]+, SS ", text):
        return "listed"
    return None


def read_block(text: str, dialect: str) -> tuple[dict[str, float], frozenset[str]]:
    """Read one block.

    Returns:
        Readings by field of `standoff.core.telemetry.Telemetry`, NaN where the drone says that it has none; and the
        names of all values in the block, also of those that are not read. All blocks of one log have the same names:
        one that has fewer is cut off.

    Raises:
        UnreadableText: A bracket is not closed, or a value is no number or absurd.
    """
    if text.count("[") != text.count("]") or text.count("(") != text.count(")"):
        raise UnreadableText("it breaks off inside a bracket")
    if dialect == "bracketed":
        values = dict(_BRACKETED_PAIR.findall(text, max(0, text.find("["))))
        readings, names = _bracketed(values), frozenset(values)
    else:
        readings = _named(text)
        names = frozenset((_HOME_NAME if dialect == "home" else _LISTED_NAME).findall(text))
        names |= readings.keys()
    check_ranges(readings)
    place = readings.get("latitude_deg", math.nan), readings.get("longitude_deg", math.nan)
    if place == (0.0, 0.0) or math.isnan(sum(place)):  # zeros are written before GPS has found itself
        readings |= {"latitude_deg": math.nan, "longitude_deg": math.nan}
    return readings, names


_BRACKETED_FIELDS = {
    "latitude": "latitude_deg",
    "longitude": "longitude_deg",
    "longtitude": "longitude_deg",
    "rel_alt": "height_m",
    "abs_alt": "altitude_m",
    "altitude": "altitude_m",
    "gb_pitch": "pitch_deg",
    "gb_roll": "roll_deg",
    "gb_yaw": "heading_deg",
    "focal_len": "focal_mm_35",
}


def _bracketed(values: Mapping[str, str]) -> dict[str, float]:
    readings = {field: number(values[name], name) for name, field in _BRACKETED_FIELDS.items() if name in values}
    if "pitch_deg" in readings:  # DJI counts upwards from the horizon
        readings["pitch_deg"] = -readings["pitch_deg"]
    if "focal_mm_35" in readings:
        if "." not in values["focal_len"] and readings["focal_mm_35"] >= _TENTHS_FROM_MM:
            readings["focal_mm_35"] /= 10.0
        if _digitally_zoomed(values.get("dzoom_ratio", "")):
            readings["focal_mm_35"] = math.nan
    return readings


def _digitally_zoomed(text: str) -> bool:
    """Tell whether the picture is a cut-out of the lens's; ratios are written as 1.00 or as 10000."""
    ratio = number(text, "dzoom_ratio")
    return math.isfinite(ratio) and abs((ratio / 10_000.0 if ratio >= 1000.0 else ratio) - 1.0) > 0.01


def _named(text: str) -> dict[str, float]:
    readings: dict[str, float] = {}
    if (place := re.search(r"GPS ?\(([^()]*)\)", text)) is not None:
        parts = place[1].split(",")
        if len(parts) < 2:
            raise UnreadableText("GPS gives no two coordinates")
        readings |= {"longitude_deg": number(parts[0], "GPS"), "latitude_deg": number(parts[1], "GPS")}
    if (height := re.search(r"(BAROMETER:|\bHb:|\bH )\s*([^\s,]*)", text)) is not None:
        readings["height_m"] = number(height[2], height[1].strip(" :"))
    if (gimbal := re.search(r"G\.PRY ?\(([^()]*)\)", text)) is not None:
        angles = [number(part, "G.PRY") for part in gimbal[1].split(",")]
        if len(angles) != 3:
            raise UnreadableText("G.PRY gives no three angles")
        readings |= {"pitch_deg": -angles[0], "roll_deg": angles[1], "heading_deg": angles[2]}
    return readings
