"""Which paint makes a footing stand out: from the soil beside it, and its top from its own sides.

Luma as a camera codes it, of flat faces in sun and sky light: the top lies in the sun, a soil beside it too; the sides
are lit by the sun or lie in their own shade. The light and the soils are those of the simulator.
"""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.clip.presets import Condition
from standoff_sim.ground.soil_colours import PALETTES
from standoff_sim.scene.light import level_luminance, random_light
from standoff_sim.scene.scene import Light

PAINTS = {
    "bare concrete": "#d2cec4",
    "white": "#f2f2ee",
    "light grey": "#a8a8a4",
    "yellow": "#e8b400",
    "orange": "#e8621c",
    "red": "#b3261e",
    "magenta": "#c2188c",
    "green": "#2f8f3f",
    "blue": "#1f4fa8",
    "black": "#1c1c1c",
    "white top, black sides": "#f2f2ee/#1c1c1c",
    "white top, blue sides": "#f2f2ee/#1f4fa8",
    "yellow top, black sides": "#e8b400/#1c1c1c",
}
CONDITIONS: tuple[Condition, ...] = ("noon", "afternoon", "low_sun", "overcast")
DRAWS = 60
LUMA = np.array([0.299, 0.587, 0.114])
ON_WHITE = 0.85
"""What automatic exposure makes of white paper lying in the open."""


def linear(code: str) -> FloatArray:
    """Return the linear colour (3,) of an sRGB code, red first."""
    coded = np.array([int(code[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def luma(albedo: FloatArray, light: Light, normal: FloatArray) -> float:
    """Return the luma, 0..255, of a face."""
    facing = max(float(normal @ light.to_sun), 0.0)
    # A wall sees half of the sky, and the ground in place of the other half.
    sky_share = 0.5 + 0.5 * normal[2]
    arriving = facing * np.array(light.sun) + sky_share * np.array(light.sky) + (1 - sky_share) * np.array(light.bounce)
    shown = np.clip(albedo * arriving * ON_WHITE / level_luminance(light), 0.0, 1.0)
    coded = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
    return float(255.0 * coded @ LUMA)


def contrasts(paint: str, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return absolute differences of luma: top from soils, top from sunlit sides, top from shaded sides."""
    top_code, _, side_code = paint.partition("/")
    top, side = linear(top_code), linear(side_code or top_code)
    level = np.array([0.0, 0.0, 1.0])
    soils: list[float] = []
    sunlit: list[float] = []
    shaded: list[float] = []
    for condition in CONDITIONS:
        for _ in range(DRAWS):
            light = random_light(rng, condition)
            above = luma(top, light, level)
            for palette in PALETTES.values():
                red, green, blue = palette[int(rng.integers(90, 210)), 0].tolist()
                ground = linear(f"#{red:02x}{green:02x}{blue:02x}")
                soils.append(abs(above - luma(ground, light, level)))
            turn = rng.uniform(0.0, 2.0 * np.pi)
            walls = [np.array([np.cos(a), np.sin(a), 0.0]) for a in turn + np.arange(4) * np.pi / 2]
            for wall in walls:
                (sunlit if wall @ light.to_sun > 0.05 and max(light.sun) > 0 else shaded).append(
                    abs(above - luma(side, light, wall))
                )
    return np.array(soils), np.array(sunlit), np.array(shaded)


def main() -> None:
    """Print the table: of each contrast the median and the worst tenth."""
    print("| paint | top against soil | top against sunlit side | top against shaded side | least of the three |")
    print("|---|---|---|---|---|")
    for name, paint in PAINTS.items():
        measured = contrasts(paint, np.random.default_rng(7))
        worst = [float(np.quantile(one, 0.1)) for one in measured]
        cells = [f"{np.median(one):.0f} ({low:.0f})" for one, low in zip(measured, worst, strict=True)]
        print(f"| {name} | " + " | ".join(cells) + f" | {min(worst):.0f} |")


if __name__ == "__main__":
    main()
