"""Survey files: what they say becomes a map, and what is wrong with one is told in a line."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated
from stages.ground.test_surveyed_ground import LENS, updated

from standoff.core.errors import GroundError
from standoff.core.geographic import east_north_m
from standoff.stages.ground.survey_file import load_survey

_SURVEY = """
image_size_px: [1280, 720]
points:
  - {name: kerb, px: [100, 100], m: [0, 3]}
  - {name: manhole, px: [500, 100], m: [4, 3]}
  - {px: [500, 400], m: [4, 0]}
  - {px: [100, 400], m: [0, 0]}
"""


def survey_file(folder: Path, text: str) -> Path:
    path = folder / "survey.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_survey_file_gives_the_map_of_its_points(tmp_path: Path) -> None:
    ground = load_survey(survey_file(tmp_path, _SURVEY))
    mapped, _ = updated(ground).to_ground(np.array([[300.0, 250.0]]))
    np.testing.assert_allclose(mapped, [[2.0, 1.5]], atol=1e-9)
    assert [row["name"] for row in ground.describe()["points"]] == ["kerb", "manhole", "point 3", "point 4"]


def test_a_survey_files_camera_is_found_beside_it_and_can_be_replaced(tmp_path: Path) -> None:
    (tmp_path / "lens.yaml").write_text(
        "{width_px: 1280, height_px: 720, fx: 1000, fy: 1000, cx: 640, cy: 360, k1: -0.2}"
    )
    extra = "camera: lens.yaml\narea_px: [[0, 0], [1279, 0], [640, 719]]\npoint_sigma_px: 2.5\n"
    ground = load_survey(survey_file(tmp_path, _SURVEY + extra))
    camera = updated(ground).camera
    assert camera is not None
    assert camera.distortion[0] == -0.2
    assert ground.fit.sigma_px == pytest.approx(2.5)
    assert len(updated(ground).valid_px) > 3
    replaced = updated(load_survey(survey_file(tmp_path, _SURVEY + extra), camera=LENS)).camera
    assert replaced is not None
    assert replaced.distortion[0] == -0.25


def geographic_survey(key: str, offset_deg: tuple[float, float], span_deg: float) -> str:
    """Write the four points as degrees."""
    rows = [
        f"  - {{px: [{x}, {y}], {key}: [{offset_deg[0] + span_deg * a:.9f}, {offset_deg[1] + span_deg * b:.9f}]}}"
        for x, y, a, b in ((100, 100, 0, 3), (500, 100, 4, 3), (500, 400, 4, 0), (100, 400, 0, 0))
    ]
    return "image_size_px: [1280, 720]\npoints:\n" + "\n".join(rows) + "\n"


@given(longitude=st.floats(-180, 180), latitude=st.floats(-75, 75))
@examples(30)
def test_degrees_become_metres_as_the_ellipsoid_says(longitude: float, latitude: float) -> None:
    found_m = east_north_m(np.array([[longitude, latitude], [longitude + 0.002, latitude + 0.001]]))
    # From the ellipsoid in space: the chord between the two places.
    places = []
    for lon, lat in ((longitude, latitude), (longitude + 0.002, latitude + 0.001)):
        east, north = np.deg2rad([lon, lat])
        radius_m = 6378137.0 / np.sqrt(1 - 0.00669437999014 * np.sin(north) ** 2)
        places.append(
            radius_m
            * np.array(
                [np.cos(north) * np.cos(east), np.cos(north) * np.sin(east), (1 - 0.00669437999014) * np.sin(north)]
            )
        )
    assert np.linalg.norm(found_m[1] - found_m[0]) == pytest.approx(np.linalg.norm(places[1] - places[0]), rel=2e-6)


@pytest.mark.parametrize("offset_deg", [(8.5, 50.1), (-81.196, 28.605), (0.0, 0.0), (28.605, -81.196)])
def test_degrees_that_are_said_to_be_metres_are_refused(tmp_path: Path, offset_deg: tuple[float, float]) -> None:
    with pytest.raises(GroundError, match="probably degrees"):
        load_survey(survey_file(tmp_path, geographic_survey("m", offset_deg, 1e-4)))


@pytest.mark.parametrize(
    ("offset", "span", "unit"),
    [
        ((0.0, 0.0), 0.01, "probably kilometres"),
        ((-0.013, 0.003), 0.008, "probably kilometres"),
        ((512.345123, 5612.345678), 0.008, "probably kilometres"),
        ((-811961334.0, 286050246.0), 600.0, r"probably degrees times 10\^7"),
        ((512345123.0, 5612345678.0), 8000.0, "probably millimetres of a map"),
    ],
)
def test_other_units_that_no_metres_can_be_are_refused_by_name(
    tmp_path: Path, offset: tuple[float, float], span: float, unit: str
) -> None:
    with pytest.raises(GroundError, match=unit):
        load_survey(survey_file(tmp_path, geographic_survey("m", offset, span)))


@pytest.mark.parametrize("offset_m", [(0.0, 0.0), (512345.1, 5612345.7), (-9038000.0, 3325000.0)])
def test_metres_of_a_site_and_of_a_map_are_metres(tmp_path: Path, offset_m: tuple[float, float]) -> None:
    load_survey(survey_file(tmp_path, geographic_survey("m", offset_m, 8.0)))


def test_a_survey_in_degrees_gives_metres(tmp_path: Path) -> None:
    ground = load_survey(survey_file(tmp_path, geographic_survey("lonlat", (8.5, 50.1), 1e-4)))
    places_m, _ = updated(ground).to_ground(np.array([[100.0, 400.0], [500.0, 400.0], [100.0, 100.0]]))
    east_m, north_m = places_m[1] - places_m[0], places_m[2] - places_m[0]
    np.testing.assert_allclose([east_m, north_m], [[28.61, 0.0], [0.0, 33.37]], atol=0.01)


def test_latitude_before_longitude_is_refused(tmp_path: Path) -> None:
    swapped = re.sub(
        r"lonlat: \[([^,]+), ([^\]]+)\]", r"lonlat: [\2, \1]", geographic_survey("lonlat", (8.5, 50.1), 1e-4)
    )
    with pytest.raises(GroundError, match="Write the longitude first"):
        load_survey(survey_file(tmp_path, swapped))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (_SURVEY.replace("image_size_px", "size"), "only the keys"),
        (_SURVEY.replace("image_size_px: [1280, 720]", ""), "image_size_px in a survey file"),
        (_SURVEY.replace("[1280, 720]", "1280x720"), "2 numbers for image_size_px"),
        (_SURVEY.replace("[100, 100]", "[100]"), "2 numbers for px of 'kerb'"),
        (_SURVEY.replace("[100, 100]", "[true, 100]"), "found [True, 100], true or false where a number should be"),
        (_SURVEY.replace("[100, 100]", "[[100, 100]]"), "2 numbers for px of 'kerb'"),
        (_SURVEY.replace("m: [0, 3]", "m: [0, true]"), "2 numbers for m of 'kerb'"),
        (_SURVEY.replace("[1280, 720]", "[1280, true]"), "2 numbers for image_size_px"),
        (_SURVEY + "area_px: [[0, 0], [9, 0], [9, false]]\n", "true or false"),
        (_SURVEY.replace("m: [0, 3]", "m: [0, .nan]"), "finite numbers for m of 'kerb'"),
        (_SURVEY.replace(", m: [0, 3]", ""), "2 numbers for m of 'kerb'"),
        (_SURVEY.replace("m: [0, 3]", "metres: [0, 3]"), "only the keys lonlat, m, name, px"),
        (_SURVEY.replace("m: [0, 3]", "lonlat: [8.1, 50.2]"), "points in m or in lonlat"),
        (
            _SURVEY.replace("m: [0, ", "lonlat: [8, 9").replace("m: [4, ", "lonlat: [8, 9"),
            "degrees [longitude, latitude]",
        ),
        (_SURVEY.replace("manhole", "kerb"), "'kerb' twice"),
        (_SURVEY.rsplit("  -", 1)[0], "four or more points, each with px and m, found 3"),
        ("image_size_px: [1280, 720]\npoints: none\n", "a list of points"),
        (_SURVEY + "area_px: [[0, 0], [9, 0], [9]]\n", "rows of different lengths"),
        (_SURVEY + "camera: missing.yaml\n", "a camera file at"),
        (_SURVEY + "point_sigma_px: wide\n", "a number for point_sigma_px"),
        ("points: [", "not YAML"),
    ],
)
def test_a_survey_file_that_is_wrong_gets_one_line_that_says_how(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(GroundError) as caught:
        load_survey(survey_file(tmp_path, text))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@examples(200)
@given(mutated(st.just(_SURVEY.encode())))
def test_a_damaged_survey_file_is_a_map_or_one_line(content: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "survey.yaml"
        path.write_bytes(content)
        try:
            ground = load_survey(path)
        except GroundError as error:
            assert "\n" not in str(error)
        else:
            assert np.isfinite(ground.fit.image_to_ground).all()
