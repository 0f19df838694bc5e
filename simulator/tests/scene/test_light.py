from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from standoff_sim.clip.presets import Condition
from standoff_sim.scene.light import level_luminance, random_light

CONDITIONS: tuple[Condition, ...] = get_args(Condition)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("condition", CONDITIONS)
def test_light_is_physical_and_repeatable(condition: Condition) -> None:
    for seed in range(20):
        light, again = (random_light(np.random.default_rng(seed), condition) for _ in range(2))
        assert np.linalg.norm(light.to_sun) == pytest.approx(1.0)
        assert light.to_sun[2] > 0.0
        assert min(*light.sun, *light.sky, *light.bounce, *light.haze) >= 0.0
        assert light.haze_per_m >= 0.0
        assert max(light.bounce) < level_luminance(light)
        assert (light.sun, light.sky, light.haze) == (again.sun, again.sky, again.haze)
        np.testing.assert_array_equal(light.to_sun, again.to_sun)


@pytest.mark.parametrize("condition", ["noon", "afternoon"])
def test_clear_sun_outshines_a_bluer_sky_several_times(condition: Condition) -> None:
    for seed in range(20):
        light = random_light(np.random.default_rng(seed), condition)
        assert 4.9 < np.array(light.sun) @ LUMINANCE / (np.array(light.sky) @ LUMINANCE) < 8.1
        assert light.sky[2] / light.sky[0] > 1.3 > light.sun[2] / light.sun[0]
        assert 0.85 < np.array(light.sun) @ LUMINANCE + np.array(light.sky) @ LUMINANCE < 1.1


@pytest.mark.parametrize("condition", ["overcast", "dusk"])
def test_a_closed_sky_hides_the_sun(condition: Condition) -> None:
    light = random_light(np.random.default_rng(1), condition)
    assert light.sun == (0.0, 0.0, 0.0)
    assert level_luminance(light) > 0.0


def test_a_low_sun_is_lower_and_redder_than_at_noon_and_dusk_is_dark() -> None:
    low, noon, dusk = (random_light(np.random.default_rng(2), name) for name in ("low_sun", "noon", "dusk"))
    assert low.to_sun[2] < 0.4 < 0.7 < noon.to_sun[2]
    assert low.sun[0] / low.sun[2] > 1.15 * noon.sun[0] / noon.sun[2]
    assert level_luminance(dusk) < 0.25 * level_luminance(noon)
