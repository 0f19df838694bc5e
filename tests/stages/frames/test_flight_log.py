from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from laws import few

from standoff.stages.frames.flight_log import READINGS, FlightLog, NoFlightLog, log_beside, read_flight_log

LOGS: dict[str, tuple[str, int, float, float, dict[str, float]]] = {
    "m2zoom": (
        "bracketed", 7113, 0.0, 118.668,
        {"latitude_deg": 31.452012, "longitude_deg": 74.398751, "altitude_m": 213.983002, "focal_mm_35": 24.0},
    ),
    "mavic_2_style": ("bracketed", 468, 0.0, 469.002, {"latitude_deg": -20.2533, "longitude_deg": 149.0251}),
    "mavic_2pro_new": (
        "bracketed", 8952, 0.0, 369.88,
        {"latitude_deg": -35.080155, "longitude_deg": -60.286702, "focal_mm_35": 28.0},
    ),
    "mavic_air": ("bracketed", 2, 0.0, 0.079, {}),
    "mavic_mini": (
        "listed", 117, 0.0, 117.0, {"latitude_deg": 48.0771, "longitude_deg": -121.7458, "height_m": 200.7},
    ),
    "mavic_pro": ("home", 468, 1.0, 469.0, {"latitude_deg": -20.2533, "longitude_deg": 149.0251, "height_m": 1.9}),
    "mavic_pro_buggy": ("home", 546, 1.0, 547.0, {"latitude_deg": 42.4668, "longitude_deg": -1.2218, "height_m": 0.0}),
    "old_format": ("home", 468, 1.0, 469.0, {"latitude_deg": -20.2533, "longitude_deg": 149.0251, "height_m": 1.9}),
    "p4_rtk": (
        "listed", 55, 0.0, 55.0,
        {
            "latitude_deg": -34.237922, "longitude_deg": -58.851745, "height_m": 85.8,
            "pitch_deg": 24.4, "roll_deg": 0.0, "heading_deg": 110.4,
        },
    ),
    "p4p_sample": ("listed", 5, 0.0, 5.0, {"latitude_deg": 47.4692, "longitude_deg": 8.209, "height_m": 45.6}),
    "road_site_relalt_excerpt": (
        "bracketed", 3, 0.0, 0.049,
        {
            "latitude_deg": 19.182447, "longitude_deg": 73.26094, "height_m": 16.9, "altitude_m": 102.265,
            "focal_mm_35": 24.0,
        },
    ),
}  # fmt: skip
"""Dialect, blocks, start and end in seconds, and the first block's readings: read by eye."""

BROKEN = {
    "broken_empty": "it is empty",
    "broken_empty2": "no subtitle",
    "broken_incomplete": "block 20 lacks BAROMETER",
    "broken_incomplete2": "block 3: it breaks off",
}

BLOCK = """{number}
00:00:{second:02d},000 --> 00:00:{next:02d},000
<font size="28">FrameCnt: {number}, DiffTime: 1000ms
2024-12-03 16:19:25.296
[iso: 110] [focal_len: {focal}] [latitude: {latitude}] [longitude: 73.260940] [rel_alt: {height} abs_alt: 102.265] \
[gb_yaw: {yaw} gb_pitch: {pitch} gb_roll: 0.5] </font>

"""


def block(number: int, **changed: object) -> str:
    values: dict[str, object] = {
        "number": number, "second": number, "next": number + 1, "focal": "24.00", "latitude": 19.182447, "height": 16.9,
        "yaw": 10.0, "pitch": -60.0,
    }  # fmt: skip
    return BLOCK.format(**{**values, **changed})


def log_of(folder: Path, *blocks: str) -> FlightLog:
    path = folder / "film.srt"
    path.write_text("".join(blocks), encoding="utf-8")
    log = read_flight_log(path)
    assert isinstance(log, FlightLog), str(log)
    return log


def refusal_of(folder: Path, *blocks: str) -> str:
    path = folder / "film.srt"
    path.write_text("".join(blocks), encoding="utf-8")
    log = read_flight_log(path)
    assert isinstance(log, NoFlightLog)
    assert not log
    return str(log)


@pytest.mark.shared
@pytest.mark.parametrize("name", LOGS)
def test_logs_of_real_drones_read_as_they_are_written(shared_data: Path, name: str) -> None:
    dialect, blocks, start_s, end_s, expected = LOGS[name]
    log = read_flight_log(shared_data / "telemetry" / "dji_srt" / f"{name}.SRT")
    assert isinstance(log, FlightLog)
    assert (log.dialect, len(log.time_s), log.time_s[0]) == (dialect, blocks, start_s)
    assert log.end_s == pytest.approx(end_s, abs=1e-3)
    first = log.at(start_s)
    assert first is not None
    known = {reading: getattr(first, reading) for reading in READINGS if math.isfinite(getattr(first, reading))}
    assert known == pytest.approx(expected, abs=1e-9)
    assert log.at(start_s - 0.01) is None
    assert log.at(end_s + 0.01) is None


@pytest.mark.shared
@pytest.mark.parametrize("name", BROKEN)
def test_broken_logs_give_one_reason_and_no_readings(shared_data: Path, name: str) -> None:
    log = read_flight_log(shared_data / "telemetry" / "dji_srt" / f"{name}.SRT")
    assert isinstance(log, NoFlightLog)
    assert str(log).startswith(f"{name}.SRT is not used: ")
    assert BROKEN[name] in str(log)


@pytest.mark.shared
def test_oddities_of_real_logs_are_told(shared_data: Path) -> None:
    folder = shared_data / "telemetry" / "dji_srt"
    told = {}
    for name in ("m2zoom", "mavic_2pro_new", "mavic_2_style"):
        log = read_flight_log(folder / f"{name}.SRT")
        assert isinstance(log, FlightLog)
        told[name] = " ".join(log.disagreements(None, None))
    assert "changes from 24 to 48 mm" in told["m2zoom"]
    assert "log of several films" in told["mavic_2pro_new"]
    assert "no times of the film" in told["mavic_2_style"]


@pytest.mark.shared
def test_a_place_that_gps_has_not_found_is_unknown_and_its_height_is_not(shared_data: Path) -> None:
    log = read_flight_log(shared_data / "telemetry" / "dji_srt" / "mavic_pro_buggy.SRT")
    assert isinstance(log, FlightLog)
    lost = log.at(18.0)
    assert lost is not None
    assert not lost.has_position
    assert lost.height_m == 0.0


@pytest.mark.shared
def test_places_of_four_digits_are_as_uncertain_as_that(shared_data: Path) -> None:
    sigma_m = {}
    for name in ("mavic_pro", "p4_rtk"):
        log = read_flight_log(shared_data / "telemetry" / "dji_srt" / f"{name}.SRT")
        assert isinstance(log, FlightLog)
        first = log.at(float(log.time_s[0]))
        assert first is not None
        sigma_m[name] = first.position_sigma_m
    assert sigma_m["mavic_pro"] == pytest.approx(math.hypot(1.5, 11.12 / math.sqrt(12.0)), rel=1e-3)
    assert sigma_m["p4_rtk"] == pytest.approx(1.5, abs=0.01)


def test_gimbal_angles_become_those_of_a_view(tmp_path: Path) -> None:
    telemetry = log_of(tmp_path, block(0)).at(0.0)
    assert telemetry is not None
    assert (telemetry.pitch_deg, telemetry.roll_deg, telemetry.heading_deg) == (60.0, 0.5, 10.0)
    assert telemetry.has_attitude
    assert telemetry.origin == "film.srt"


def test_readings_are_interpolated_and_headings_go_the_short_way_round(tmp_path: Path) -> None:
    log = log_of(tmp_path, block(0, yaw=170.0, height=10.0), block(1, yaw=-170.0, height=20.0))
    middle = log.at(0.5)
    assert middle is not None
    assert middle.height_m == pytest.approx(15.0)
    assert abs(middle.heading_deg) == pytest.approx(180.0)
    last = log.at(1.9)
    assert last is not None
    assert last.height_m == 20.0


@given(st.floats(0.0, 1.0), st.floats(-180.0, 180.0), st.floats(-179.0, 179.0))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25, deadline=None)
def test_a_heading_between_two_blocks_lies_between_them(tmp_path: Path, share: float, yaw: float, turn: float) -> None:
    after = (yaw + turn + 180.0) % 360.0 - 180.0
    telemetry = log_of(tmp_path, block(0, yaw=f"{yaw:.6f}"), block(1, yaw=f"{after:.6f}")).at(share)
    assert telemetry is not None
    turned = (telemetry.heading_deg - yaw + 180.0) % 360.0 - 180.0
    assert turned == pytest.approx(share * turn, abs=1e-4)


def test_nothing_is_interpolated_across_a_gap_or_from_what_is_unknown(tmp_path: Path) -> None:
    gap = log_of(tmp_path, block(0), block(1), block(9))
    assert gap.at(4.0) is None
    assert gap.at(9.5) is not None
    lost = log_of(tmp_path, block(0), block(1, latitude="n/a")).at(0.5)
    assert lost is not None
    assert not lost.has_position
    assert lost.height_m == 16.9


def test_zeros_are_no_place(tmp_path: Path) -> None:
    text = block(0, latitude="0.000000").replace("73.260940", "0.000000")
    telemetry = log_of(tmp_path, text).at(0.0)
    assert telemetry is not None
    assert not telemetry.has_position


@pytest.mark.parametrize(("zoom", "known"), [("10000, delta:0", True), ("1.00", True), ("20000, delta:0", False)])
def test_a_digital_zoom_hides_the_focal_length(tmp_path: Path, zoom: str, known: bool) -> None:
    text = block(0, focal="240").replace("[focal_len", f"[dzoom_ratio: {zoom}] [focal_len")
    log = log_of(tmp_path, text)
    telemetry = log.at(0.0)
    assert telemetry is not None
    assert (telemetry.focal_mm_35 == 24.0) is known
    assert log.is_zoomed_digitally is not known
    assert any("zoomed digitally" in warning for warning in log.disagreements(None, None)) is not known


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"latitude": 119.2}, "block 1: latitude_deg is 119.2"),
        ({"height": 99999}, "block 1: height_m is 99999"),
        ({"pitch": "-6o"}, "block 1: gb_pitch is '-6o', which is no number"),
        ({"focal": "1.00"}, "block 1: focal_mm_35 is 1"),
        ({"second": 0}, "block 1 is not later"),
    ],
)
def test_absurd_values_are_refused_by_name(tmp_path: Path, changed: dict[str, object], reason: str) -> None:
    assert reason in refusal_of(tmp_path, block(0), block(1, **changed))


@given(st.integers(1, len(block(1)) - 12))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40, deadline=None)
def test_a_log_cut_off_anywhere_never_gives_other_numbers(tmp_path: Path, kept: int) -> None:
    path = tmp_path / "film.srt"
    path.write_text(block(0) + block(1)[:kept], encoding="utf-8")
    log = read_flight_log(path)
    if isinstance(log, FlightLog):
        whole = log_of(tmp_path, block(0), block(1))
        np.testing.assert_array_equal(log.values, whole.values[: len(log.values)])


@pytest.mark.shared
@pytest.mark.parametrize("name", few(LOGS, quick=3))
def test_a_real_log_cut_off_anywhere_in_its_first_blocks_gives_no_other_numbers(
    shared_data: Path, tmp_path: Path, name: str
) -> None:
    text = (shared_data / "telemetry" / "dji_srt" / f"{name}.SRT").read_text(encoding="utf-8-sig")[:480]
    logs = []
    for kept in range(0, len(text), 3):
        (tmp_path / "cut.srt").write_text(text[:kept], encoding="utf-8")
        log = read_flight_log(tmp_path / "cut.srt")
        logs += [log] if isinstance(log, FlightLog) else []
    longest = max(logs, key=lambda log: len(log.values), default=None)
    for log in logs:
        assert longest is not None
        np.testing.assert_array_equal(log.values, longest.values[: len(log.values)])


@pytest.mark.parametrize("content", [b"\x00\xff\xfe\x12" * 50, b"1\n00:00:00,000 --> 00:00:02,000\nHello, site.\n"])
def test_what_is_no_log_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "film.srt"
    path.write_bytes(content)
    assert isinstance(read_flight_log(path), NoFlightLog)
    assert isinstance(read_flight_log(tmp_path / "absent.srt"), NoFlightLog)


def test_a_log_that_does_not_fit_its_film_is_told(tmp_path: Path) -> None:
    log = log_of(tmp_path, *(block(k) for k in range(10)))
    assert log.disagreements(10.0, 300) == ()
    assert log.disagreements(20.0, 600) == ("film.srt: it covers 0.0 to 10.0 s of a film of 20.0 s",)
    assert log.disagreements(5.0, 150) == ("film.srt: it goes on to 10.0 s, but the film ends at 5.0 s",)
    assert log.disagreements(10.0, 17) == ()
    assert log.disagreements(10.0, 13) == ("film.srt: it has 10 blocks, but the film 13 frames",)


def test_the_log_beside_a_film_is_found_by_its_name_or_the_simulators(tmp_path: Path) -> None:
    film = tmp_path / "DJI_0001.MP4"
    film.write_bytes(b"film")
    assert log_beside(film).log is None
    (tmp_path / "telemetry.srt").write_text(block(0), encoding="utf-8")
    found = log_beside(film).log
    assert found is not None
    assert found.name == "telemetry.srt"
    (tmp_path / "DJI_0001.SRT").write_text(block(0), encoding="utf-8")
    found = log_beside(film).log
    assert found is not None
    assert found.name == "DJI_0001.SRT"


def test_a_log_beside_two_films_belongs_to_neither(tmp_path: Path) -> None:
    for name in ("a.mp4", "b.mp4"):
        (tmp_path / name).write_bytes(b"film")
    (tmp_path / "telemetry.srt").write_text(block(0), encoding="utf-8")
    found = log_beside(tmp_path / "a.mp4")
    assert found.log is None
    assert found.warnings == ("telemetry.srt is not used: it lies beside 2 films",)
