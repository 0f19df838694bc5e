"""Small pictures with the EXIF and XMP data of a drone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image

XMP = {
    "RelativeAltitude": "+39.80",
    "AbsoluteAltitude": "+198.31",
    "GimbalPitchDegree": "-89.90",
    "GimbalRollDegree": "+0.00",
    "GimbalYawDegree": "+45.00",
}
GPS: Mapping[int, Any] = {
    ExifTags.GPS.GPSLatitudeRef: "N",
    ExifTags.GPS.GPSLatitude: (46.0, 50.0, 33.3855),
    ExifTags.GPS.GPSLongitudeRef: "W",
    ExifTags.GPS.GPSLongitude: (91.0, 59.0, 40.4156),
    ExifTags.GPS.GPSAltitudeRef: b"\x00",
    ExifTags.GPS.GPSAltitude: 198.309,
}


def write_photograph(
    path: Path,
    *,
    model: str = "FC300S",
    focal_mm_35: int | None = 20,
    gps: Mapping[int, Any] = GPS,
    xmp: Mapping[str, str] = XMP,
    photo: Mapping[int, Any] | None = None,
    orientation: int = 1,
    size_px: tuple[int, int] = (96, 54),
) -> Path:
    """Write a grey picture."""
    exif = Image.Exif()
    exif[ExifTags.Base.Make], exif[ExifTags.Base.Model] = "DJI", model + "\0\0"
    exif[ExifTags.Base.Orientation] = orientation
    exif.get_ifd(ExifTags.IFD.Exif).update(photo or {})
    if focal_mm_35 is not None:
        exif.get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.FocalLengthIn35mmFilm] = focal_mm_35
    exif.get_ifd(ExifTags.IFD.GPSInfo).update(gps)
    attributes = " ".join(f'drone-dji:{name}="{value}"' for name, value in xmp.items())
    text = f'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description {attributes}/></x:xmpmeta>'
    Image.new("RGB", size_px, (90, 90, 90)).save(path, exif=exif, xmp=text.encode())
    return path
