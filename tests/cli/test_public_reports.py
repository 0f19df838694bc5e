"""Small inputs that others' public troubles suggested, each with its right value; the rows of the folder's README."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from cli.calling import Call

from standoff.core.errors import DataError, GroundError
from standoff.core.types import Frame, ImageArray
from standoff.labels import LabelledData, read_data
from standoff.stages.frames import open_source
from standoff.stages.ground import load_camera, load_survey

pytestmark = pytest.mark.shared
_CODING = 6.0
"""Mean difference of grey values between two codings of one picture; another picture differs by several times that."""


@pytest.fixture(scope="session")
def reports(shared_data: Path) -> Path:
    """Find the folder."""
    return shared_data / "public_reports"


# --- films ---


@pytest.fixture(scope="session")
def film(reports: Path) -> list[Frame]:
    """Read the film that the others are made of."""
    return frames_of(reports / "video" / "b8.mp4")


def frames_of(path: Path) -> list[Frame]:
    with open_source(path) as source:
        return list(source)


def difference(a: ImageArray, b: ImageArray) -> float:
    return float(np.abs(a.astype(float) - b).mean())


@pytest.mark.parametrize("name", ["b8hflip.mp4", "b8sar.mp4"])
def test_a_mirrored_film_and_one_of_oblong_pixels_show_what_the_plain_one_does(
    reports: Path, film: list[Frame], name: str
) -> None:
    shown = frames_of(reports / "video" / name)
    assert len(shown) == len(film) == 8
    for one, plain in zip(shown, film, strict=True):
        assert one.size_px == plain.size_px
        assert difference(one.image, plain.image) < _CODING
    assert difference(shown[0].image, film[0].image[:, ::-1]) > 3 * _CODING


def test_of_two_streams_the_film_is_read_and_not_its_preview(reports: Path) -> None:
    frames = frames_of(reports / "video" / "two.mp4")
    assert len(frames) == 25
    assert {frame.size_px for frame in frames} == {(320, 180)}  # the preview is 160 wide


def test_a_frame_that_repeats_a_time_is_left_out_and_counted(reports: Path) -> None:
    with open_source(reports / "video" / "dup.mkv") as source:
        times_s = [frame.time_s for frame in source]
        description = source.describe()
    assert (np.diff(times_s) > 0.0).all()
    assert (len(times_s), description["skipped_frames"]) == (24, 1)


def test_frames_that_were_coded_out_of_order_in_avi_are_all_there(reports: Path) -> None:
    times_s = [frame.time_s for frame in frames_of(reports / "video" / "bf.avi")]
    assert len(times_s) == 25
    assert times_s[-2:] == pytest.approx([0.92, 0.96], abs=1e-6)


# --- distances, with the detector and the tracker that everybody gets ---


def measured(call: Call, video: Path, ground: object, out: Path) -> tuple[int, str, list[float]]:
    """Return the exit code, what was said, and the distances of a run."""
    words = ("--ground", ground, "--out", out, "--quiet", "--outputs", "proximity")
    settings = out.with_suffix(".yaml")
    settings.write_text("locate: {anchor: bottom_centre}\n", encoding="utf-8")
    code, _, said = call("run", video, "--config", settings, *words)
    table = out / "proximity.parquet"
    distances = pq.read_table(table)["distance_m"].to_pylist() if table.exists() else []
    return code, said, [value for value in distances if value is not None and np.isfinite(value)]


@pytest.mark.live
@pytest.mark.parametrize("name", ["b8.mp4", "b8hflip.mp4", "b8sar.mp4"])
def test_the_loader_is_as_far_from_the_worker_however_the_film_is_stored(
    call: Call, reports: Path, tmp_path: Path, name: str
) -> None:
    survey = reports / "survey" / "good.yaml"
    _, _, distances = measured(call, reports / "video" / name, survey, tmp_path / "run")
    assert distances
    assert any(5.7 < value < 6.2 for value in distances)


@pytest.mark.live
@pytest.mark.parametrize(("name", "unit"), [("mm", "millimetres"), ("cm", "centimetres")])
def test_a_survey_in_another_unit_gives_no_distance_and_names_the_unit(
    call: Call, reports: Path, tmp_path: Path, name: str, unit: str
) -> None:
    survey = reports / "survey" / f"{name}.yaml"
    code, said, distances = measured(call, reports / "video" / "b8.mp4", survey, tmp_path / "run")
    assert (code, distances) == (1, [])
    assert unit in said


@pytest.mark.live
def test_a_side_in_centimetres_gives_no_distance(call: Call, reports: Path, tmp_path: Path) -> None:
    words = ("--reference-box", "546,386,691,510", "--out", tmp_path / "out", "--quiet", "--outputs", "proximity")
    code, _, said = call("run", reports / "video" / "b8.mp4", "--ground", "square:289", *words)
    assert code == 1 and "centimetres" in said
    values = pq.read_table(tmp_path / "out" / "proximity.parquet")["distance_m"].to_pylist()
    assert not [value for value in values if value is not None and np.isfinite(value)]


@pytest.mark.live
def test_one_repeated_time_costs_one_frame(call: Call, reports: Path, tmp_path: Path) -> None:
    survey = reports / "survey" / "good.yaml"
    words = ("--ground", survey, "--out", tmp_path / "out", "--quiet", "--outputs", "frames")
    call("run", reports / "video" / "dup.mkv", *words)
    counts = json.loads((tmp_path / "out" / "run.json").read_text())["counts"]
    assert counts["frames"] == pq.read_table(tmp_path / "out" / "frames.parquet").num_rows > 1


# --- surveys ---


@pytest.mark.parametrize("name", ["degrees_lonlat", "calpnp"])
def test_degrees_are_not_metres(reports: Path, name: str) -> None:
    with pytest.raises(GroundError, match="degrees"):
        load_survey(reports / "survey" / f"{name}.yaml")


def test_a_key_twice_is_refused_with_both_lines(reports: Path) -> None:
    with pytest.raises(GroundError, match="line 2: the key `image_size_px` a second time, after line 1"):
        load_survey(reports / "survey" / "dup.yaml")


# --- camera files ---


@pytest.mark.parametrize("name", ["opencv_fisheye.yml", "kalibr.yaml"])
def test_a_fisheye_is_read_as_one(reports: Path, name: str) -> None:
    camera = load_camera(reports / "camera" / name)
    assert camera.lens == "fisheye"
    np.testing.assert_allclose(camera.undistort(np.array([[1200.0, 650.0]])), [[1559.0, 836.0]], atol=0.5)


def test_a_focal_length_in_millimetres_is_refused(reports: Path) -> None:
    with pytest.raises(GroundError, match="millimetres"):
        load_camera(reports / "camera" / "mm_focal.yaml")


@pytest.mark.parametrize(
    ("name", "fx", "centre_px", "k1"),
    [("ros.yaml", 914.0, (653.3, 359.9), -0.1213), ("odm_cameras.json", 3000.0, (1999.5, 1499.5), 0.01)],
)
def test_cameras_of_other_programs_are_read(
    reports: Path, name: str, fx: float, centre_px: tuple[float, float], k1: float
) -> None:
    camera = load_camera(reports / "camera" / name)
    assert camera.lens == "brown"
    assert camera.matrix[0, 0] == fx
    assert tuple(camera.matrix[:2, 2]) == centre_px
    assert camera.distortion[0] == k1


# --- labels ---


def data_of(reports: Path, name: str) -> LabelledData:
    return read_data(reports / "labels" / name)


def boxes_of(data: LabelledData) -> list[list[float]]:
    return [box for split in data.splits.values() for one in split for box in one.xyxy_px.round(3).tolist()]


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("pixels", "pixels"),
        ("c_xyxy", "xyxy"),
        ("exif", "EXIF"),
        ("v_sizeswap", "width and height swapped"),
        ("classes_cp1252", "Windows-1252"),
    ],
)
def test_a_set_that_cannot_be_placed_is_refused_by_its_cause(reports: Path, name: str, cause: str) -> None:
    with pytest.raises(DataError, match=cause):
        data_of(reports, name)


@pytest.mark.parametrize(
    ("name", "box_px"),
    [
        ("polygon", [5.9, 4.3, 25.1, 18.7]),
        ("obb", [5.9, 4.3, 25.1, 18.7]),
        ("pose", [25.1, 16.3, 37.9, 30.7]),
        ("c_strimg", [9.5, 11.5, 29.5, 27.5]),
        ("c_labelstudio", [9.5, 11.5, 29.5, 27.5]),
        ("y_win", [25.1, 16.3, 37.9, 30.7]),
        ("y_roboflow", [25.1, 16.3, 37.9, 30.7]),
        ("y_norway", [25.1, 16.3, 37.9, 30.7]),
    ],
)
def test_every_picture_of_another_program_keeps_its_box(reports: Path, name: str, box_px: list[float]) -> None:
    data = data_of(reports, name)
    pictures = [picture for split in data.splits.values() for picture in split]
    assert pictures and all(len(picture.xyxy_px) == 1 for picture in pictures)
    assert box_px in boxes_of(data)


def test_names_are_as_they_are_written(reports: Path) -> None:
    assert data_of(reports, "y_norway").classes == ("no", "yes")
