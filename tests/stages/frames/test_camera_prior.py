from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags
from stages.frames.coded_video import Recipe, write_video
from stages.frames.photographs import write_photograph
from stages.frames.test_flight_log import block

from standoff.core.errors import SourceError
from standoff.stages.frames import open_source
from standoff.stages.frames.drone_cameras import DRONE_CAMERAS, FULL_FRAME_DIAGONAL_MM, find_drone_camera
from standoff.stages.frames.prior import drone_prior, focal_px, told_prior

WIDE = Recipe(size_px=(160, 90))


@pytest.mark.parametrize("camera", DRONE_CAMERAS, ids=lambda camera: camera.name)
def test_published_fields_of_view_and_focal_lengths_agree(camera: object) -> None:
    field_deg, focal_mm = camera.field_deg, camera.focal_mm_35  # type: ignore[attr-defined]
    if math.isfinite(field_deg):
        from_focal_deg = 2.0 * math.degrees(math.atan(FULL_FRAME_DIAGONAL_MM / 2.0 / focal_mm))
        assert from_focal_deg == pytest.approx(field_deg, abs=2.2)


def test_every_code_and_name_is_of_one_camera_only() -> None:
    names = [name for camera in DRONE_CAMERAS for name in (camera.name, *camera.codes)]
    assert len(set(names)) == len(names)
    for camera in DRONE_CAMERAS:
        assert all(find_drone_camera(name) is camera for name in (camera.name, *camera.codes))


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("FC300S\0\0\0", "DJI Phantom 3"), ("DJI Mini4 Pro", "DJI Mini 4 Pro"), ("l1d-20C", "DJI Mavic 2 Pro"),
        ("Mavic Air 2", "DJI Mavic Air 2"), ("M3E", "DJI Mavic 3E"), ("ZH20T", "DJI Zenmuse H20T"),
    ],
)  # fmt: skip
def test_drones_are_known_by_code_and_by_name(written: str, name: str) -> None:
    camera = find_drone_camera(written)
    assert camera is not None
    assert camera.name == name


@pytest.mark.parametrize("written", ["", "iPhone 12", "FC", "DJI", "Lavf61.7.100"])
def test_other_names_are_of_no_drone(written: str) -> None:
    assert find_drone_camera(written) is None


def test_a_wide_picture_keeps_the_width_of_its_sensor() -> None:
    # A Phantom 3: 3.61 mm in front of 6.2 to 6.3 mm of sensor, 4000 pixels wide in 4:3 and in 16:9.
    assert focal_px(20.0, (4000, 3000), 4 / 3) == pytest.approx(focal_px(20.0, (4000, 2250), 4 / 3))
    assert focal_px(20.0, (4000, 2250), 4 / 3) == pytest.approx(3.61 / 6.25 * 4000, rel=0.02)
    assert focal_px(20.0, (2250, 4000), 4 / 3) == focal_px(20.0, (4000, 2250), 4 / 3)


def test_a_guessed_sensor_is_within_its_own_uncertainty() -> None:
    guessed = told_prior((3840, 2160), [24.0], None, "", film=True)
    for aspect in (4 / 3, 3 / 2, 16 / 9):
        error = math.log(focal_px(24.0, (3840, 2160), aspect) / guessed.camera.matrix[0, 0])
        assert abs(error) < guessed.focal_sigma


def test_films_are_less_certain_than_photographs() -> None:
    for camera in DRONE_CAMERAS:
        still, film = (drone_prior((4000, 2250), camera, film=film) for film in (False, True))
        assert film.focal_sigma >= still.focal_sigma
        assert film.camera.matrix[0, 0] >= still.camera.matrix[0, 0]


def test_a_film_without_a_word_of_its_camera_has_any_drones(tmp_path: Path) -> None:
    with open_source(write_video(tmp_path / "film.mp4", 3, WIDE)) as source:
        assert source.camera_prior.origin == "a drone's usual lens"
        assert source.describe()["telemetry"] == {"origin": "none"}
        assert [frame.telemetry for frame in source] == [None] * 3


def test_a_films_own_header_names_its_drone(tmp_path: Path) -> None:
    film = write_video(tmp_path / "film.mp4", 3, Recipe(size_px=(160, 90), metadata={"comment": "DJI Mini3 Pro"}))
    with open_source(film) as source:
        assert source.camera_prior.origin == "DJI Mini 3 Pro"
        assert source.describe()["camera"]["origin"] == "DJI Mini 3 Pro"


def _film(folder: Path, blocks: int = 2) -> Path:
    film = write_video(folder / "film.mp4", 20, WIDE)
    (folder / "film.srt").write_text("".join(block(k) for k in range(blocks)), encoding="utf-8")
    return film


def test_the_log_beside_a_film_gives_readings_and_focal_length(tmp_path: Path) -> None:
    with open_source(_film(tmp_path)) as source:
        assert source.warnings == ()
        assert source.camera_prior.origin == "film.srt"
        assert source.camera_prior.camera.matrix[0, 0] == pytest.approx(24.0 / 36.0 * 160, rel=1e-3)
        assert source.describe()["telemetry"]["origin"] == "film.srt"
        assert "pitch_deg" in source.describe()["telemetry"]["readings"]
        frames = list(source)
    assert all(frame.telemetry is not None and frame.telemetry.time_s == frame.time_s for frame in frames)


def test_a_log_that_is_asked_for_comes_first_and_none_is_none(tmp_path: Path) -> None:
    film = _film(tmp_path)
    other = tmp_path / "other.srt"
    other.write_text(block(0, focal="48.00") + block(1, focal="48.00"), encoding="utf-8")
    with open_source(film, telemetry=other) as source:
        assert source.describe()["telemetry"]["origin"] == "other.srt"
        assert source.camera_prior.camera.matrix[0, 0] == pytest.approx(48.0 / 36.0 * 160, rel=1e-3)
    with open_source(film, telemetry="none") as source:
        assert source.describe()["telemetry"] == {"origin": "none"}
        assert source.camera_prior.origin == "a drone's usual lens"
        assert [frame.telemetry for frame in source] == [None] * 20


@pytest.mark.parametrize("content", [None, "", "Hello"])
def test_a_log_that_is_asked_for_and_cannot_be_used_is_an_error(tmp_path: Path, content: str | None) -> None:
    film, log = _film(tmp_path), tmp_path / "asked.srt"
    if content is not None:
        log.write_text(content, encoding="utf-8")
    with pytest.raises(SourceError, match=r"asked\.srt is not used"):
        open_source(film, telemetry=log).describe()


def test_a_broken_log_beside_a_film_is_one_warning(tmp_path: Path) -> None:
    film = _film(tmp_path)
    (tmp_path / "film.srt").write_text(block(0) + block(1)[:60], encoding="utf-8")
    with open_source(film) as source:
        assert len(source.warnings) == 1
        assert "film.srt is not used: block 1" in source.warnings[0]
        assert [frame.telemetry for frame in source] == [None] * 20


def test_a_log_of_half_the_film_is_told_and_gives_nothing_beyond(tmp_path: Path) -> None:
    film = write_video(tmp_path / "film.mp4", 60, WIDE)
    (tmp_path / "film.srt").write_text(block(0) + block(1) + block(2), encoding="utf-8")
    with open_source(film) as source:
        assert source.warnings == ("film.srt: it covers 0.0 to 3.0 s of a film of 6.0 s",)
        known = [frame.telemetry is not None for frame in source]
    np.testing.assert_array_equal(known, np.arange(60) < 30)


def test_a_turned_film_has_no_angles(tmp_path: Path) -> None:
    film = write_video(tmp_path / "film.mp4", 20, Recipe(size_px=(160, 90), rotation_deg=90))
    (tmp_path / "film.srt").write_text(block(0) + block(1), encoding="utf-8")
    with open_source(film) as source:
        assert "its gimbal angles are not used" in source.warnings[0]
        frames = list(source)
    assert all(frame.telemetry is not None and not frame.telemetry.has_attitude for frame in frames)


def test_a_true_focal_length_in_exif_data_is_put_against_the_sensor(tmp_path: Path) -> None:
    write_photograph(tmp_path / "a.jpg", focal_mm_35=None, photo={ExifTags.Base.FocalLength: 3.61})
    with open_source(tmp_path, fps=1.0) as source:
        assert source.camera_prior.origin == "EXIF"
        assert source.camera_prior.camera.matrix[0, 0] == pytest.approx(3.61 / 6.3 * 96, rel=1e-3)
