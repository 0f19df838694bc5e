from __future__ import annotations

from typing import Any

import pytest

from standoff.core.errors import ConfigError
from standoff_sim.clip.presets import PRESETS, plan_clip


def test_the_papers_tests_have_the_papers_numbers() -> None:
    mobile = PRESETS["mobile"]
    assert (mobile.width_px, mobile.height_px, mobile.frames) == (3840, 2140, 398)
    for distance in (15, 20):
        stationary = PRESETS[f"stationary-{distance}"]
        assert (stationary.width_px, stationary.height_px, stationary.frames) == (1920, 1080, 50)
        assert stationary.shape == "quadrilateral_footing"
    assert PRESETS["board"].frames == 148


def test_changes_replace_the_presets_own_values_and_none_does_not() -> None:
    plan = plan_clip("busy", seed=4, frames=7, altitude_m=None)
    assert (plan.preset.frames, plan.preset.altitude_m) == (7, PRESETS["busy"].altitude_m)
    assert plan.duration_s == 7 / plan.preset.fps


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("nobody", {}, "one of the presets mobile, .*found 'nobody'"),
        ("busy", {"width_px": 1921}, "both even"),
        ("busy", {"width_px": 2}, "found 2x1080"),
        ("busy", {"height_px": 100_000}, "found 1920x100000"),
        ("busy", {"frames": 0}, "number of frames from 1"),
        ("busy", {"altitude_m": 1.0}, "altitude in m from 5"),
        ("busy", {"pitch_deg": 95.0}, "pitch in degrees"),
        ("busy", {"fps": 0.0}, "frames a second"),
    ],
)
def test_a_plan_that_cannot_be_is_refused_in_one_line(name: str, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message) as refused:
        plan_clip(name, **changes)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("seed", [-1, 2**31])
def test_a_seed_out_of_range_is_refused(seed: int) -> None:
    with pytest.raises(ConfigError, match="seed from 0"):
        plan_clip("mobile", seed=seed)
