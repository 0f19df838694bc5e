from __future__ import annotations

import math
from typing import Any

import pytest

from standoff.core.telemetry import Telemetry


def test_what_is_not_said_is_nan() -> None:
    telemetry = Telemetry(1.5, "a log")
    assert not telemetry.has_attitude
    assert not telemetry.has_position
    assert math.isnan(telemetry.height_m)
    assert math.isnan(telemetry.focal_mm_35)


def test_attitude_needs_all_three_angles() -> None:
    angles: dict[str, float] = {
        "pitch_deg": 45.0, "pitch_sigma_deg": 0.5, "roll_deg": 0.0, "roll_sigma_deg": 0.5,
        "heading_deg": 10.0, "heading_sigma_deg": 4.0,
    }  # fmt: skip
    assert Telemetry(0.0, "", **angles).has_attitude
    assert not Telemetry(0.0, "", **{**angles, "roll_deg": math.nan}).has_attitude


@pytest.mark.parametrize(
    "readings",
    [
        {"height_m": 30.0},
        {"height_m": 30.0, "height_sigma_m": 0.0},
        {"height_m": math.inf, "height_sigma_m": 1.0},
        {"latitude_deg": 45.0, "position_sigma_m": 1.5},
        {"latitude_deg": 95.0, "longitude_deg": 0.0, "position_sigma_m": 1.5},
        {"focal_mm_35": 0.0},
        {"time_s": math.nan},
    ],
)
def test_readings_without_errors_or_out_of_range_are_refused(readings: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="Telemetry"):
        Telemetry(**{"time_s": 0.0, "origin": "", **readings})
