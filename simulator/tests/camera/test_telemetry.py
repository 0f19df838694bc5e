from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from laws import seeds

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.camera.flight import ShakenFlight, drone_camera, make_flight
from standoff_sim.camera.telemetry import (
    Origin,
    gimbal_angles_deg,
    write_telemetry,
)
from standoff_sim.clip.presets import FlightStyle

TIMES_S = np.cumsum(np.random.default_rng(0).uniform(0.03, 0.05, 200)) - 0.03
BLOCK = re.compile(
    r"(?P<count>\d+)\n(?P<start>[\d:,]+) --> (?P<end>[\d:,]+)\n"
    r'<font size="28">FrameCnt: (?P<frame>\d+), DiffTime: (?P<gap>\d+)ms\n'
    r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3}\n"
    r"\[iso: \d+\] \[shutter: 1/[\d.]+\] \[fnum: [\d.]+\] \[ev: 0\] \[color_md: \w+\] \[focal_len: [\d.]+\] "
    r"\[latitude: (?P<latitude>-?[\d.]+)\] \[longitude: (?P<longitude>-?[\d.]+)\] "
    r"\[rel_alt: (?P<height>-?[\d.]+) abs_alt: (?P<altitude>-?[\d.]+)\] \[ct: \d+\] "
    r"\[gb_yaw: (?P<yaw>-?[\d.]+) gb_pitch: (?P<pitch>-?[\d.]+) gb_roll: (?P<roll>-?[\d.]+)\] </font>\n\n"
)

POSITION_ERROR_M = 2.2
"""Largest horizontal error of a written position, quantisation included."""
ALTITUDE_ERROR_M = 1.1
"""Largest error of a written relative altitude."""
GIMBAL_ERROR_DEG = 0.3
"""Largest error of a written pitch or roll."""
HEADING_ERROR_DEG = 3.3
"""Largest error of a written yaw."""


def _flight(style: FlightStyle, seed: int) -> ShakenFlight:
    rng = np.random.default_rng(seed)
    return make_flight(
        rng, style, drone_camera(1280, 720, 70.0, rng), target_xy_m=np.zeros(2), altitude_m=30.0, pitch_deg=60.0,
        heading_deg=float(rng.uniform(0, 360)), duration_s=8.0,
    )  # fmt: skip


def _written(path: Path, flight: ShakenFlight, seed: int) -> tuple[dict[str, FloatArray], str]:
    write_telemetry(path, flight, TIMES_S, np.random.default_rng(seed))
    text = path.read_text(encoding="utf-8")
    blocks = [match.groupdict() for match in BLOCK.finditer(text)]
    numbers = ("count", "frame", "gap", "latitude", "longitude", "height", "altitude", "yaw", "pitch", "roll")
    return {name: np.array([float(block[name]) for block in blocks]) for name in numbers}, text


def _metres(origin: Origin, latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
    """Invert the projection by differences of degrees over a kilometre."""
    east, north = origin.degrees(np.array([1000.0, 0.0])), origin.degrees(np.array([0.0, 1000.0]))
    x_m = (longitude_deg - origin.longitude_deg) / (east[1] - origin.longitude_deg) * 1000.0
    y_m = (latitude_deg - origin.latitude_deg) / (north[0] - origin.latitude_deg) * 1000.0
    return np.column_stack([x_m, y_m])


@pytest.mark.parametrize("style", ["hover", "pass", "orbit"])
@pytest.mark.parametrize("seed", seeds(4))
def test_readings_are_wrong_by_as_much_as_stated_and_no_more(tmp_path: Path, style: FlightStyle, seed: int) -> None:
    flight = _flight(style, seed)
    read, _ = _written(tmp_path / "telemetry.srt", flight, seed)
    assert len(read["count"]) == len(TIMES_S)
    views = [flight.view(time_s) for time_s in TIMES_S.tolist()]
    true_m = np.array([view.position_m for view in views])
    origin = Origin.draw(np.random.default_rng(seed))
    error_m = np.linalg.norm(_metres(origin, read["latitude"], read["longitude"]) - true_m[:, :2], axis=1)
    assert error_m.mean() > 0.1
    assert error_m.max() < POSITION_ERROR_M
    height_error_m = np.abs(read["height"] - true_m[:, 2])
    assert height_error_m.mean() > 0.1
    assert height_error_m.max() < ALTITUDE_ERROR_M
    yaw, pitch, roll = np.array([gimbal_angles_deg(view) for view in views]).T
    yaw_error_deg = np.abs((read["yaw"] - yaw + 180.0) % 360.0 - 180.0)
    assert yaw_error_deg.mean() > 0.9
    assert yaw_error_deg.max() < HEADING_ERROR_DEG
    assert np.abs(read["pitch"] - pitch).max() < GIMBAL_ERROR_DEG
    assert np.abs(read["roll"] - roll).max() < GIMBAL_ERROR_DEG


def test_blocks_count_and_last_as_the_frames_do(tmp_path: Path) -> None:
    read, text = _written(tmp_path / "telemetry.srt", _flight("hover", 1), 1)
    np.testing.assert_array_equal(read["count"], np.arange(len(TIMES_S)) + 1)
    np.testing.assert_array_equal(read["count"], read["frame"])
    np.testing.assert_allclose(read["gap"][:-1], 1000 * np.diff(TIMES_S), atol=1.0)
    spans = re.findall(r"00:00:(\d\d),(\d{3}) --> 00:00:(\d\d),(\d{3})", text)
    starts_s = np.array([int(span[0]) + int(span[1]) / 1000 for span in spans])
    np.testing.assert_allclose(starts_s, TIMES_S, atol=5.1e-4)
    ends_s = np.array([int(span[2]) + int(span[3]) / 1000 for span in spans])
    np.testing.assert_array_equal(ends_s[:-1], starts_s[1:])


def test_the_same_generator_writes_the_same_file(tmp_path: Path) -> None:
    flight = _flight("orbit", 2)
    first, second, other = (_written(tmp_path / f"{k}.srt", flight, seed)[1] for k, seed in enumerate((5, 5, 6)))
    assert first == second
    assert first != other


@pytest.mark.parametrize("pitch_deg", [5.0, 45.0, 89.0, 91.0])
@pytest.mark.parametrize("roll_deg", [-4.0, 0.0, 3.0])
@pytest.mark.parametrize("heading_deg", [10.0, 200.0])
def test_gimbal_angles_are_those_the_camera_was_aimed_by(pitch_deg: float, roll_deg: float, heading_deg: float) -> None:
    camera = drone_camera(640, 360, 70.0, np.random.default_rng(0))
    view = View.aimed(camera, np.zeros(3), heading_deg=heading_deg, pitch_deg=pitch_deg, roll_deg=roll_deg)
    yaw, pitch, roll = gimbal_angles_deg(view)
    assert (yaw - heading_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-6)
    assert pitch == pytest.approx(-pitch_deg, abs=1e-6)
    assert roll == pytest.approx(roll_deg, abs=1e-6)


def test_straight_down_all_turning_is_yaw() -> None:
    camera = drone_camera(640, 360, 70.0, np.random.default_rng(0))
    view = View.aimed(camera, np.zeros(3), heading_deg=37.0, pitch_deg=90.0)
    np.testing.assert_allclose(gimbal_angles_deg(view), (37.0, -90.0, 0.0), atol=1e-6)


def test_degrees_agree_with_the_length_of_the_meridian_and_of_parallels() -> None:
    # a degree of latitude and of longitude at 45 degrees north, from tables of WGS84
    origin = Origin(45.0, 9.0, 100.0, Origin.draw(np.random.default_rng(0)).start)
    north, _ = origin.degrees(np.array([0.0, 1000.0]))
    _, east = origin.degrees(np.array([1000.0, 0.0]))
    assert 1000.0 / (north - 45.0) == pytest.approx(111_132.0, rel=1e-4)
    assert 1000.0 / (east - 9.0) == pytest.approx(78_847.0, rel=1e-4)


@pytest.mark.shared
def test_a_block_looks_like_one_of_a_real_drone(tmp_path: Path, shared_data: Path) -> None:
    sample = shared_data / "telemetry" / "dji_srt" / "road_site_relalt_excerpt.SRT"
    real = sample.read_text(encoding="utf-8-sig").split("\n\n")[0]
    ours = _written(tmp_path / "telemetry.srt", _flight("hover", 3), 3)[1].split("\n\n")[0]
    shape = re.compile(r"-?\d+(\.\d+)?|dlog_m|default")
    ours_without_gimbal = re.sub(r" \[gb_yaw[^]]*\]", "", ours)
    assert shape.sub("#", ours_without_gimbal.strip()) == shape.sub("#", real.strip())
