"""Sun, sky and haze of common kinds of weather and hours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.clip.presets import Condition
from standoff_sim.scene.scene import Light
from standoff_sim.solids.mesh import Colour

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_GROUND_ALBEDO: Colour = (0.26, 0.21, 0.15)


@dataclass(frozen=True, slots=True)
class _Weather:
    """Ranges to draw from; strengths are luminances on a surface that faces the light.

    Attributes:
        elevation_deg: Of the sun.
        sun_to_sky: Illuminance by the sun on a surface facing it over that by the sky on level ground; 0 hides the sun.
        total: What a white card in both shows.
        sky_colour: Of skylight, normalised later: blue when clear, grey under clouds.
        haze_per_m: Extinction.
        softness: Width of the penumbra, m per m.
    """

    elevation_deg: tuple[float, float]
    sun_to_sky: tuple[float, float]
    total: tuple[float, float]
    sky_colour: Colour
    haze_per_m: tuple[float, float]
    softness: tuple[float, float]


_WEATHERS: Mapping[Condition, _Weather] = MappingProxyType(
    {
        "noon": _Weather((50.0, 68.0), (5.5, 8.0), (0.95, 1.05), (0.70, 0.88, 1.25), (0.0001, 0.0006), (0.009, 0.013)),
        "afternoon": _Weather(
            (28.0, 50.0), (5.0, 7.5), (0.9, 1.05), (0.70, 0.88, 1.25), (0.0002, 0.0012), (0.009, 0.015)
        ),
        "low_sun": _Weather((8.0, 22.0), (3.0, 6.0), (0.7, 0.95), (0.72, 0.88, 1.2), (0.0005, 0.002), (0.010, 0.018)),
        "hazy": _Weather((30.0, 60.0), (1.0, 3.0), (0.8, 1.0), (0.92, 0.98, 1.08), (0.002, 0.006), (0.015, 0.04)),
        "overcast": _Weather((25.0, 60.0), (0.0, 0.0), (0.6, 0.95), (0.94, 0.99, 1.07), (0.0003, 0.003), (0.5, 0.8)),
        "dusk": _Weather((4.0, 10.0), (0.0, 0.0), (0.07, 0.14), (0.78, 0.92, 1.18), (0.0005, 0.002), (0.5, 0.8)),
    }
)  # fmt: skip


def random_light(rng: np.random.Generator, condition: Condition) -> Light:
    """Draw the light of a kind of weather and hour; the sun stands where it does north of the tropics, in the south.

    Args:
        rng: Decides within the kind.
        condition: Of which kind.
    """
    weather = _WEATHERS[condition]
    elevation_deg = rng.uniform(*weather.elevation_deg)
    low = 1.0 - np.clip(elevation_deg / 50.0, 0.0, 1.0)
    azimuth_rad = np.deg2rad(180.0 + rng.choice([-1.0, 1.0]) * rng.uniform(10.0, 40.0 + 65.0 * low))
    ratio, total = rng.uniform(*weather.sun_to_sky), rng.uniform(*weather.total)
    sky = _of_luminance(np.array(weather.sky_colour) * rng.normal(1.0, 0.02, 3), total / (1.0 + ratio))
    sun = _of_luminance(_sun_colour(elevation_deg) * rng.normal(1.0, 0.01, 3), total * ratio / (1.0 + ratio))
    level = np.array(sky) + np.array(sun) * np.sin(np.deg2rad(elevation_deg))
    bounce = level * np.array(_GROUND_ALBEDO) * rng.uniform(0.7, 1.1)
    # what scatters towards the camera is sunlight and skylight mixed, paler than the sky
    haze = _of_luminance(0.6 * np.array(sky) / max(sky) + 0.4, float(level @ _LUMINANCE) * rng.uniform(0.75, 0.95))
    return Light(
        _direction(elevation_deg, float(azimuth_rad)),
        sun,
        sky,
        _colour(bounce),
        rng.uniform(*weather.softness),
        rng.uniform(*weather.haze_per_m),
        haze,
    )


def level_luminance(light: Light) -> float:
    """Return what a white card lying in the open shows: the meter reading that automatic exposure goes by."""
    return float((np.array(light.sky) + np.array(light.sun) * max(light.to_sun[2], 0.0)) @ _LUMINANCE)


def _sun_colour(elevation_deg: float) -> FloatArray:
    """Return the sun's linear colour through the air's mass at its elevation (Rayleigh and dust, green at 1)."""
    # Kasten and Young (1989), Eq. 3
    air_mass = 1.0 / (np.sin(np.deg2rad(elevation_deg)) + 0.50572 * (elevation_deg + 6.07995) ** -1.6364)
    # optical depths at 610, 550 and 465 nm: Rayleigh 0.0088 um^4.05, dust 0.08 um^1.3
    wavelength_um = np.array([0.610, 0.550, 0.465])
    depth = 0.0088 * wavelength_um**-4.05 + 0.08 * wavelength_um**-1.3
    passed = np.exp(-depth * air_mass)
    # white is the sun at noon, as cameras' daylight balance has it
    colour: FloatArray = passed / np.exp(-depth * 1.15)
    return colour


def _direction(elevation_deg: float, azimuth_rad: float) -> FloatArray:
    elevation_rad = np.deg2rad(elevation_deg)
    level = np.cos(elevation_rad)
    return np.array([level * np.sin(azimuth_rad), level * np.cos(azimuth_rad), np.sin(elevation_rad)])


def _of_luminance(colour: FloatArray, luminance: float) -> Colour:
    return _colour(colour * (luminance / float(colour @ _LUMINANCE)))


def _colour(colour: FloatArray) -> Colour:
    red, green, blue = colour.tolist()
    return red, green, blue
