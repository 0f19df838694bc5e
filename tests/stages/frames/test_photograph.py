from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from PIL import ExifTags, Image
from stages.frames.photographs import GPS, XMP, write_photograph

from standoff.stages.frames import open_source
from standoff.stages.frames.photograph import read_photograph


def test_a_picture_tells_where_and_how_it_was_taken(tmp_path: Path) -> None:
    photograph = read_photograph(write_photograph(tmp_path / "a.jpg"), 2.0)
    telemetry = photograph.telemetry
    assert telemetry is not None
    assert (telemetry.time_s, telemetry.origin) == (2.0, "EXIF of a.jpg")
    assert (telemetry.height_m, telemetry.altitude_m) == (39.8, 198.31)
    assert (telemetry.pitch_deg, telemetry.roll_deg, telemetry.heading_deg) == (89.9, 0.0, 45.0)
    assert telemetry.latitude_deg == pytest.approx(46.0 + 50.0 / 60.0 + 33.3855 / 3600.0, abs=1e-6)
    assert telemetry.longitude_deg == pytest.approx(-(91.0 + 59.0 / 60.0 + 40.4156 / 3600.0), abs=1e-6)
    assert (photograph.focal_mm_35, photograph.problems) == (20.0, ())
    assert photograph.drone is not None
    assert photograph.drone.name == "DJI Phantom 3"


def _without(given: dict[Any, Any], name: Any) -> dict[Any, Any]:
    return {key: value for key, value in given.items() if key != name}


@pytest.mark.parametrize(
    ("changed", "problem", "lost"),
    [
        ({"xmp": {**XMP, "GimbalPitchDegree": "-989.9"}}, "GimbalPitchDegree", ("pitch_deg", "heading_deg")),
        ({"xmp": {**XMP, "GimbalPitchDegree": "-8x"}}, "GimbalPitchDegree", ("pitch_deg", "roll_deg")),
        ({"xmp": _without(XMP, "GimbalRollDegree")}, "GimbalRollDegree is missing", ("pitch_deg", "heading_deg")),
        ({"xmp": {**XMP, "RelativeAltitude": "+51234"}}, "RelativeAltitude", ("height_m",)),
        ({"gps": _without(dict(GPS), ExifTags.GPS.GPSLatitudeRef)}, "GPSLatitude is incomplete", ("latitude_deg",)),
        ({"gps": {**GPS, ExifTags.GPS.GPSLatitude: (96.0, 50.0, 1.0)}}, "GPSLatitude is 96", ("longitude_deg",)),
        ({"orientation": 6}, "turned after it was taken", ("pitch_deg",)),
        ({"focal_mm_35": 2}, "FocalLengthIn35mmFilm", ("focal_mm_35",)),
        ({"photo": {ExifTags.Base.DigitalZoomRatio: 2.0}}, "digital zoom 2", ("focal_mm_35",)),
    ],
)  # fmt: skip
def test_half_read_and_absurd_values_are_refused_by_name(
    tmp_path: Path, changed: dict[str, Any], problem: str, lost: tuple[str, ...]
) -> None:
    photograph = read_photograph(write_photograph(tmp_path / "odd.jpg", **changed), 0.0)
    assert photograph.telemetry is not None
    assert all(math.isnan(getattr(photograph.telemetry, name)) for name in lost)
    assert len(photograph.problems) == 1
    assert photograph.problems[0].startswith("odd.jpg: ")
    assert problem in photograph.problems[0]


def test_zeros_are_no_place_and_no_problem(tmp_path: Path) -> None:
    zero = (0.0, 0.0, 0.0)
    gps = {**GPS, ExifTags.GPS.GPSLatitude: zero, ExifTags.GPS.GPSLongitude: zero}
    photograph = read_photograph(write_photograph(tmp_path / "a.jpg", gps=gps), 0.0)
    assert photograph.telemetry is not None
    assert not photograph.telemetry.has_position
    assert photograph.problems == ()


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp", ".tif"])
def test_a_picture_of_no_drone_says_nothing(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"plain{suffix}"
    Image.new("RGB", (8, 8)).save(path)
    photograph = read_photograph(path, 0.0)
    assert photograph.telemetry is None
    assert photograph.problems == ()


def test_the_makers_own_focal_length_is_for_the_whole_picture_only(tmp_path: Path) -> None:
    xmp = {**XMP, "CalibratedFocalLength": "64.5"}
    whole = write_photograph(tmp_path / "a.jpg", xmp=xmp, photo={ExifTags.Base.ExifImageWidth: 96})
    shrunk = write_photograph(tmp_path / "b.jpg", xmp=xmp, photo={ExifTags.Base.ExifImageWidth: 5280})
    assert read_photograph(whole, 0.0).calibrated_focal_px == 64.5
    assert math.isnan(read_photograph(shrunk, 0.0).calibrated_focal_px)
    shrunk.unlink()
    prior = open_source(tmp_path, fps=1.0).camera_prior
    assert (prior.camera.matrix[0, 0], prior.origin) == (64.5, "XMP")


def test_a_folder_of_pictures_gives_each_frame_its_own_readings(tmp_path: Path) -> None:
    write_photograph(tmp_path / "a.jpg")
    write_photograph(tmp_path / "b.jpg", xmp={**XMP, "RelativeAltitude": "+41.00"})
    with open_source(tmp_path, fps=2.0) as source:
        readings = [frame.telemetry for frame in source]
        assert source.warnings == ()
        assert source.camera_prior.origin == "EXIF"
    assert [(t.time_s, t.height_m) for t in readings if t is not None] == [(0.0, 39.8), (0.5, 41.0)]
    with open_source(tmp_path, fps=2.0, telemetry="none") as source:
        assert all(frame.telemetry is None for frame in source)


def test_pictures_that_disagree_are_told(tmp_path: Path) -> None:
    write_photograph(tmp_path / "a.jpg")
    write_photograph(tmp_path / "b.jpg", model="FC8282", focal_mm_35=24)
    write_photograph(tmp_path / "c.jpg", model="FC8282", focal_mm_35=24, gps={}, xmp={})
    with open_source(tmp_path, fps=1.0) as source:
        assert source.warnings == (
            "the pictures' focal lengths differ: 20 to 24 mm",
            "the pictures are of several cameras: FC300S, FC8282",
            "1 of 3 pictures looked at say nothing of the flight",
        )
        assert source.camera_prior.focal_sigma > 0.15


@pytest.mark.shared
def test_photographs_of_a_real_drone_are_from_40_m_straight_down(shared_data: Path) -> None:
    paths = sorted((shared_data / "drone_photos").glob("*.JPG"))
    assert len(paths) == 3
    for path in paths:
        photograph = read_photograph(path, 0.0)
        assert photograph.problems == ()
        assert photograph.telemetry is not None
        assert photograph.telemetry.height_m == pytest.approx(40.0, abs=0.21)
        assert photograph.telemetry.pitch_deg == 89.9
        assert photograph.telemetry.longitude_deg == pytest.approx(-91.994, abs=1e-3)
