"""The whole site: how it is exposed, and what stands on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from standoff_sim.clip.presets import Condition, plan_clip
from standoff_sim.clip.studio import Studio
from standoff_sim.scene.site import Site, build_site


def _site(name: str, seed: int, condition: Condition | None = None) -> Site:
    plan = plan_clip(name, seed=seed, width_px=320, height_px=180, furnished_m=6.0)
    preset = plan.preset if condition is None else replace(plan.preset, condition=condition)
    return build_site(replace(plan, preset=preset))


def _is_under_a_crane(site: Site) -> bool:
    return any(float(batch.poses[:, 2, 3].max()) > 24.0 for batch in site.scene.props if len(batch.poses) == 1)


@pytest.mark.parametrize(
    ("condition", "seed"),
    [
        ("noon", 1),
        pytest.param("afternoon", 5, marks=pytest.mark.live),
        pytest.param("hazy", 7, marks=pytest.mark.live),
        pytest.param("overcast", 9, marks=pytest.mark.live),
    ],
)
def test_daylight_is_exposed_to_the_middle_of_the_scale(condition: Condition, seed: int) -> None:
    site = _site("mobile", seed, condition)
    with Studio(site) as studio:
        image = studio.shoot(0, 1.0).image
    assert 85 < np.median(image) < 175
    assert np.mean(image == 255) < 0.03


@pytest.mark.live
def test_some_sites_have_a_tower_crane_and_bare_ones_and_the_checkerboard_have_none() -> None:
    cranes = [_is_under_a_crane(_site("lost-reference", seed)) for seed in range(8)]
    assert 1 <= sum(cranes) <= 7
    assert not any(_is_under_a_crane(_site(name, 1)) for name in ("virtual", "board"))
