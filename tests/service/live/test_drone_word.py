"""What a drone says of itself becomes telemetry in the camera's own signs; what cannot be is left out."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.messages import Unreadable
from standoff.service.live.drone_word import osd_topic, read_osd, telemetry_at

GIMBAL = {"gimbal_pitch": -60.0, "gimbal_roll": 0.5, "gimbal_yaw": 12.0}
DATA: dict[str, Any] = {
    "elevation": 30.5, "height": 140.25, "latitude": 50.1, "longitude": 8.5, "attitude_head": 99.0, "52-0-0": GIMBAL,
}  # fmt: skip
NUMBERS = st.floats(-1e4, 1e4) | st.integers(-400, 400) | st.sampled_from([0, -0.0, 90.0, -90.0, 120.0, 180.0])


def read(**data: Any) -> dict[str, float]:
    return read_osd(json.dumps({"data": data}).encode())


def test_each_reading_is_the_cameras_and_with_its_sign() -> None:
    assert read(**DATA) == {
        "height_m": 30.5, "pitch_deg": 60.0, "roll_deg": 0.5, "heading_deg": 12.0,
        "latitude_deg": 50.1, "longitude_deg": 8.5, "altitude_m": 140.25,
    }  # fmt: skip


@pytest.mark.parametrize(("gimbal_deg", "pitch_deg"), [(-90, 90.0), (0, 0.0), (30.0, -30.0), (-89.5, 89.5)])
def test_a_gimbal_that_looks_down_has_a_negative_pitch(gimbal_deg: float, pitch_deg: float) -> None:
    assert read(**{"53-0-0": {"gimbal_pitch": gimbal_deg}}) == {"pitch_deg": pitch_deg}


def test_where_the_airframe_points_is_not_where_the_camera_does() -> None:
    with pytest.raises(Unreadable):
        read(attitude_head=99.0, attitude_pitch=3.0)


@pytest.mark.parametrize(
    ("left_out", "data"),
    [
        ("pitch_deg", {"52-0-0": {**GIMBAL, "gimbal_pitch": 95.0}}),
        ("pitch_deg", {"52-0-0": {**GIMBAL, "gimbal_pitch": "-60"}}),
        ("roll_deg", {"52-0-0": {**GIMBAL, "gimbal_roll": True}}),
        ("heading_deg", {"52-0-0": {**GIMBAL, "gimbal_yaw": 361.0}}),
        ("height_m", {"elevation": 10_001}),
        ("height_m", {"elevation": None}),
        ("altitude_m", {"height": -501.0}),
        ("latitude_deg", {"latitude": 90.1}),
        ("longitude_deg", {"longitude": 180.5}),
    ],
)
def test_what_cannot_be_is_left_out_and_the_rest_is_not(left_out: str, data: dict[str, Any]) -> None:
    gone = {"latitude_deg", "longitude_deg"} if left_out in ("latitude_deg", "longitude_deg") else {left_out}
    assert read(**DATA).keys() - read(**{**DATA, **data}).keys() == gone


def test_a_drone_without_a_fix_is_not_where_the_equator_meets_greenwich() -> None:
    assert {"latitude_deg", "longitude_deg"}.isdisjoint(read(**{**DATA, "latitude": 0.0, "longitude": 0}))
    assert read(latitude=0.0, longitude=8.5) == {"latitude_deg": 0.0, "longitude_deg": 8.5}
    with pytest.raises(Unreadable, match="none that can be"):
        read(latitude=0.0, longitude=0.0)


@pytest.mark.parametrize(
    "payload", [b"", b"5", b"[]", b"{}", b'{"data": []}', b'{"data": {}}', b'{"data": {"52-0-0": 5}}']
)
def test_what_is_no_word_of_a_drone_is_refused(payload: bytes) -> None:
    with pytest.raises(Unreadable):
        read_osd(payload)


def test_a_word_that_is_too_long_is_refused() -> None:
    with pytest.raises(Unreadable, match="at most 65536 bytes"):
        read_osd(json.dumps({"data": {**DATA, "more": "x" * 65_536}}).encode())


@given(
    st.fixed_dictionaries(
        {},
        optional=dict.fromkeys(("elevation", "height", "latitude", "longitude"), NUMBERS)
        | {"52-0-0": st.fixed_dictionaries({}, optional=dict.fromkeys(GIMBAL, NUMBERS))},
    ),
    st.floats(0.0, 1e6),
)
def test_whatever_is_read_is_telemetry(data: dict[str, Any], time_s: float) -> None:
    try:
        readings = read(**data)
    except Unreadable:
        return
    told = telemetry_at({"readings": readings, "at_s": 100.0}, time_s, 100.2)
    assert told is not None and told.time_s == time_s
    for name, value in readings.items():
        assert getattr(told, name) == value
    assert math.isfinite(told.latitude_deg) == math.isfinite(told.longitude_deg)


@pytest.mark.parametrize(
    ("arrived_s", "holds"), [(98.4, False), (98.6, True), (100.0, True), (101.4, True), (101.6, False)]
)
def test_a_word_holds_for_pictures_of_about_its_time(arrived_s: float, holds: bool) -> None:
    word = {"readings": {"height_m": 30.0}, "at_s": 100.0}
    assert (telemetry_at(word, 7.0, arrived_s) is not None) == holds
    assert telemetry_at(None, 7.0, arrived_s) is None


def test_each_drone_has_its_topic() -> None:
    assert osd_topic("1ZNBJ") == "thing/product/1ZNBJ/osd"
