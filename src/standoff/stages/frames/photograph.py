"""What a drone writes into its photographs: EXIF and XMP data, each value whole or refused by name."""

from __future__ import annotations

import math
import re
import struct
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image

from standoff.core.telemetry import Telemetry
from standoff.stages.frames.drone_cameras import FULL_FRAME_DIAGONAL_MM, DroneCamera, find_drone_camera
from standoff.stages.frames.flight_text import UnreadableText, check_ranges
from standoff.stages.frames.flight_text import number as number_in
from standoff.stages.frames.instruments import CONSUMER, PROFESSIONAL, telemetry_of

_XMP_ANGLES = {
    "GimbalPitchDegree": "pitch_deg",
    "GimbalRollDegree": "roll_deg",
    "GimbalYawDegree": "heading_deg",
}
_XMP_HEIGHTS = {"RelativeAltitude": "height_m", "AbsoluteAltitude": "altitude_m"}
_UPRIGHT = (None, 1)
_WRITTEN_BY_CAMERAS = frozenset({"JPEG", "MPO", "TIFF"})  # of a PNG, Pillow would decode the pixels to find EXIF data


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """What one picture says of itself.

    Attributes:
        model: Of the camera; empty when it does not say.
        telemetry: Of the moment, or None when it holds nothing of a flight.
        focal_mm_35: In terms of 35 mm film; NaN when not known.
        calibrated_focal_px: As the maker has measured it, for these pixels; NaN when not known.
        digitally_zoomed: Whether the picture is a cut-out of the lens's.
        problems: What is there but not used, a clause each.
    """

    model: str = ""
    telemetry: Telemetry | None = None
    focal_mm_35: float = math.nan
    calibrated_focal_px: float = math.nan
    digitally_zoomed: bool = False
    problems: tuple[str, ...] = ()

    @property
    def drone(self) -> DroneCamera | None:
        """The camera, if its model is known."""
        return find_drone_camera(self.model)


@dataclass(frozen=True, slots=True)
class _Tags:
    main: Mapping[int, Any]
    photo: Mapping[int, Any]
    gps: Mapping[int, Any]
    xmp: str
    width_px: int


def read_photograph(path: Path, time_s: float) -> Photograph:
    """Read a picture's EXIF and XMP data; its pixels are not decoded.

    Args:
        path: The picture.
        time_s: Of the frame that it becomes.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what cannot be read is told below, by the picture's name
            tags = _tags(path)
        if tags is None:
            return Photograph()
    except (OSError, ValueError, SyntaxError, KeyError, TypeError, struct.error, Image.DecompressionBombError):
        return Photograph(problems=(f"{path.name}: its EXIF data cannot be read",))
    problems: list[str] = []
    readings = _readings(tags, problems)
    model = str(tags.main.get(ExifTags.Base.Model, "")).strip("\0 ")
    drone = find_drone_camera(model)
    zoom = _float(tags.photo.get(ExifTags.Base.DigitalZoomRatio))
    zoomed = zoom > 1.01
    if zoomed:
        problems.append(f"digital zoom {zoom:g}: the focal length is not known")
    focal = math.nan if zoomed else _focal_mm_35(tags, drone, problems)
    known = {name: value for name, value in readings.items() if math.isfinite(value)}
    telemetry = None
    if known:
        errors = PROFESSIONAL if drone is not None and drone.professional else CONSUMER
        telemetry = telemetry_of({**known, "focal_mm_35": focal}, time_s, f"EXIF of {path.name}", errors)
    return Photograph(
        model,
        telemetry,
        focal,
        math.nan if zoomed else _calibrated_focal_px(tags, problems),
        zoomed,
        tuple(f"{path.name}: {problem}" for problem in problems),
    )


def _tags(path: Path) -> _Tags | None:
    with Image.open(path) as picture:
        if picture.format not in _WRITTEN_BY_CAMERAS:
            return None
        exif = picture.getexif()
        main = dict(exif)
        photo, gps = dict(exif.get_ifd(ExifTags.IFD.Exif)), dict(exif.get_ifd(ExifTags.IFD.GPSInfo))
        xmp = picture.info.get("xmp") or main.get(ExifTags.Base.XMLPacket) or b""
        text = xmp.decode("utf-8", errors="replace") if isinstance(xmp, bytes) else str(xmp)
        return _Tags(main, photo, gps, text, picture.width)


def _float(value: Any) -> float:  # noqa: ANN401 - EXIF values are rationals, numbers, tuples or text
    try:
        return float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return math.nan


def _xmp_value(xmp: str, name: str) -> str | None:
    """Return DJI's value of that name, written as an attribute or as an element; None when absent."""
    match = re.search(rf'drone-dji:{name}(?:="([^"]*)"|>([^<]*)<)', xmp)
    return None if match is None else (match[1] if match[1] is not None else match[2])


def _readings(tags: _Tags, problems: list[str]) -> dict[str, float]:
    readings = _place(tags.gps, problems)
    readings |= _checked_xmp(tags.xmp, _XMP_HEIGHTS, problems, whole=False)
    if not math.isfinite(readings.get("altitude_m", math.nan)):
        readings |= _exif_altitude(tags.gps, problems)
    angles = _checked_xmp(tags.xmp, _XMP_ANGLES, problems, whole=True)
    if angles and tags.main.get(ExifTags.Base.Orientation) not in _UPRIGHT:
        problems.append("the picture was turned after it was taken: its gimbal angles are not used")
        angles = {}
    if angles:
        angles["pitch_deg"] = -angles["pitch_deg"]
    return readings | angles


def _checked_xmp(xmp: str, fields: Mapping[str, str], problems: list[str], *, whole: bool) -> dict[str, float]:
    """Read values by name; where `whole`, all of them or none."""
    readings: dict[str, float] = {}
    texts = {name: text for name in fields if (text := _xmp_value(xmp, name)) is not None}
    bad = [f"{name} is missing" for name in fields if whole and texts and name not in texts]
    for name, text in texts.items():
        try:
            reading = {fields[name]: number_in(text, name)}
            check_ranges(reading)
        except UnreadableText as error:
            bad.append(str(error) if name in str(error) else f"{name}: {error}")
            continue
        readings |= reading
    if bad and whole:
        readings = {}
    problems.extend(bad)
    return readings


def _place(gps: Mapping[int, Any], problems: list[str]) -> dict[str, float]:
    """Read latitude and longitude, both or none."""
    wanted = (
        (ExifTags.GPS.GPSLatitude, ExifTags.GPS.GPSLatitudeRef, "NS", 90.0),
        (ExifTags.GPS.GPSLongitude, ExifTags.GPS.GPSLongitudeRef, "EW", 180.0),
    )
    if not any(tag in gps for tag, *_ in wanted):
        return {}
    degrees: list[float] = []
    for tag, reference_tag, letters, limit in wanted:
        parts, letter = gps.get(tag), str(gps.get(reference_tag, "")).strip("\0 ")
        if not isinstance(parts, tuple) or len(parts) != 3 or letter not in tuple(letters):
            problems.append(f"{ExifTags.GPS(tag).name} is incomplete")
            return {}
        whole, minutes, seconds = (_float(part) for part in parts)
        value = (whole + minutes / 60.0 + seconds / 3600.0) * (1.0 if letter == letters[0] else -1.0)
        if not (abs(value) <= limit and min(whole, minutes, seconds) >= 0.0 and max(minutes, seconds) < 60.5):
            problems.append(f"{ExifTags.GPS(tag).name} is {whole:g}, {minutes:g}, {seconds:g}, which is no angle")
            return {}
        degrees.append(value)
    if degrees == [0.0, 0.0]:  # before GPS has found itself
        return {}
    return {"latitude_deg": degrees[0], "longitude_deg": degrees[1]}


def _exif_altitude(gps: Mapping[int, Any], problems: list[str]) -> dict[str, float]:
    if ExifTags.GPS.GPSAltitude not in gps:
        return {}
    below = gps.get(ExifTags.GPS.GPSAltitudeRef) in (b"\x01", 1)
    reading = {"altitude_m": _float(gps[ExifTags.GPS.GPSAltitude]) * (-1.0 if below else 1.0)}
    try:
        check_ranges(reading)
    except UnreadableText as error:
        problems.append(f"GPSAltitude: {error}")
        return {}
    return reading


def _focal_mm_35(tags: _Tags, drone: DroneCamera | None, problems: list[str]) -> float:
    """Return what EXIF data say, or what the true focal length makes of a known sensor."""
    name, focal = "FocalLengthIn35mmFilm", _float(tags.photo.get(ExifTags.Base.FocalLengthIn35mmFilm))
    if not focal > 0 and drone is not None:  # 0 is EXIF's word for unknown
        name, true_mm = "FocalLength", _float(tags.photo.get(ExifTags.Base.FocalLength))
        focal = true_mm * FULL_FRAME_DIAGONAL_MM / math.hypot(*drone.sensor_mm)
    if not focal > 0:
        return math.nan
    try:
        check_ranges({"focal_mm_35": focal})
    except UnreadableText as error:
        problems.append(f"{name}: {error}")
        return math.nan
    return focal


def _calibrated_focal_px(tags: _Tags, problems: list[str]) -> float:
    text = _xmp_value(tags.xmp, "CalibratedFocalLength")
    if text is None or tags.photo.get(ExifTags.Base.ExifImageWidth) != tags.width_px:
        return math.nan
    try:
        focal_px = number_in(text, "CalibratedFocalLength")
    except UnreadableText as error:
        problems.append(str(error))
        return math.nan
    if not 0.3 * tags.width_px < focal_px < 30.0 * tags.width_px:
        problems.append(f"CalibratedFocalLength is {focal_px:g} px for {tags.width_px} px of width")
        return math.nan
    return focal_px
