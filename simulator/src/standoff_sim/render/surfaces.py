"""What each surface looks like to the shaders."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from standoff_sim.solids.mesh import Float32Array, Surface


@dataclass(frozen=True, slots=True)
class Finish:
    """The numbers of one surface; contrasts are of noise whose deviation is 0.17 around its mean.

    Attributes:
        roughness: 0 mirror .. 1 chalk.
        metal: 0 or 1, in between for worn coatings.
        bump: How much the grain tilts the surface.
        dusty: How well dust sticks.
        grain: Contrast of the fine pattern.
        stain: Contrast of the coarse pattern.
        dirt: How dark the worst stains are.
        hue: How much its colour drifts between warm and cold.
        along_per_m: Tiles of grain per metre along the surface.
        across_per_m: Across it; another number than along gives fibres or streaks.
        stain_per_m: Tiles of stains per metre.
        glow: Share of light that tape sends back to where it came from.
    """

    roughness: float
    metal: float
    bump: float
    dusty: float
    grain: float
    stain: float
    dirt: float
    hue: float
    along_per_m: float
    across_per_m: float
    stain_per_m: float
    glow: float = 0.0


FINISHES: dict[Surface, Finish] = {
    Surface.PAINT: Finish(0.45, 0.0, 0.1, 1.0, 0.35, 0.35, 0.35, 0.1, 0.5, 0.5, 0.21),
    Surface.STEEL: Finish(0.42, 0.8, 0.2, 0.9, 0.5, 0.5, 0.3, 0.1, 0.2, 1.2, 0.3),
    Surface.RUST: Finish(0.85, 0.1, 0.5, 0.6, 0.8, 0.9, 0.5, 0.5, 0.7, 0.7, 0.3),
    Surface.RUBBER: Finish(0.8, 0.0, 0.3, 1.3, 0.5, 0.5, 0.2, 0.1, 0.8, 0.8, 0.3),
    Surface.GLASS: Finish(0.08, 0.0, 0.0, 0.2, 0.1, 0.1, 0.0, 0.0, 0.4, 0.4, 0.2),
    Surface.CONCRETE: Finish(0.9, 0.0, 0.3, 0.6, 0.45, 0.7, 0.35, 0.12, 0.4, 0.4, 0.09),
    Surface.WOOD: Finish(0.8, 0.0, 0.3, 0.7, 0.9, 0.5, 0.35, 0.25, 0.15, 2.2, 0.17),
    Surface.FABRIC: Finish(0.9, 0.0, 0.9, 0.5, 0.5, 0.6, 0.25, 0.08, 1.3, 1.3, 0.55),
    Surface.SKIN: Finish(0.6, 0.0, 0.1, 0.3, 0.2, 0.2, 0.1, 0.1, 1.0, 1.0, 0.5),
    Surface.PLASTIC: Finish(0.4, 0.0, 0.1, 0.8, 0.25, 0.3, 0.25, 0.08, 0.5, 0.5, 0.25),
    Surface.FOLIAGE: Finish(0.7, 0.0, 1.6, 0.25, 1.9, 1.0, 0.4, 0.5, 0.7, 0.7, 0.19),
    Surface.SOIL: Finish(0.95, 0.0, 1.2, 0.5, 1.1, 0.8, 0.2, 0.15, 0.35, 0.35, 0.08),
    Surface.REFLECTIVE: Finish(0.35, 0.2, 0.1, 0.3, 0.15, 0.2, 0.1, 0.0, 1.0, 1.0, 0.5, 0.35),
}


def surface_table() -> Float32Array:
    """Return (3 × surfaces, 4), three rows each, in the order of `Finish`."""
    return np.array([astuple(FINISHES[surface]) for surface in Surface], dtype=np.float32).reshape(-1, 4)
