"""What colour machines are: makers' paints, faded and dusty, with a second tone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Colour, Mesh, srgb

GLASS = srgb("#1b2328")
RUBBER = srgb("#2a2927")
BLACK = srgb("#232322")
DARK_GREY = srgb("#3f4143")
STEEL = srgb("#7d7a74")
CHROME = srgb("#c9ccce")
LAMP = srgb("#e6e4d8")
AMBER = srgb("#e07a10")
RED_LAMP = srgb("#8f1712")

SOILS = ("#6f5a41", "#8a7350", "#5a4a38", "#7d6a55", "#94764a")
"""What buckets and beds are loaded with."""

_PAINTS = (
    ("#e0a010", 0.27),
    ("#e8b820", 0.15),
    ("#d98c14", 0.08),
    ("#d9601a", 0.14),
    ("#c8461c", 0.05),
    ("#d8d8d2", 0.09),
    ("#8d9094", 0.04),
    ("#2f8f86", 0.05),
    ("#4c8f3c", 0.03),
    ("#2a5f9e", 0.05),
    ("#a8241c", 0.05),
)
_SECOND_TONES = ("#2c2d2e", "#55585a", "#d6d5cf", "#6d6a63")


@dataclass(frozen=True, slots=True)
class Livery:
    """The colours of one machine, all linear and weathered.

    Attributes:
        body: Hood, cab and panels.
        accent: Counterweight, or whatever has the second tone.
        boom: Boom and arm, or lift arms; nearly the body's.
        frame: Undercarriage, crawler shoes, chassis.
        tool: Bucket or blade: worn paint or bare steel.
        dust: How dusty, 0..1.
    """

    body: Colour
    accent: Colour
    boom: Colour
    frame: Colour
    tool: Colour
    dust: float


@dataclass(frozen=True, slots=True, eq=False)
class Painted:
    """A mesh with its tint and dust, still to be placed."""

    mesh: Mesh
    tint: Colour
    dust: float

    def at(self, poses: FloatArray) -> Batch:
        """Place it at one (4, 4) or many (N, 4, 4) poses."""
        return place(self.mesh, poses, tint=self.tint, dust=self.dust)


def weather(rng: np.random.Generator, colour: Colour, strength: float = 1.0) -> Colour:
    """Fade a clean paint as sun, dust and years do, and shift its hue a little.

    Args:
        rng: Source of randomness.
        colour: Clean, linear.
        strength: 0 leaves the colour, 1 is a working machine of some years.
    """
    clean = np.array(colour)
    grey = clean @ [0.3, 0.6, 0.1]
    chalk = np.array([0.42, 0.38, 0.31])
    faded = clean + strength * rng.uniform(0.0, 0.12) * (grey - clean)
    faded = faded + strength * rng.uniform(0.0, 0.14) * (chalk - faded)
    varied = faded * (1.0 + strength * (rng.uniform(-0.15, 0.10) + rng.uniform(-0.04, 0.04, 3)))
    red, green, blue = np.clip(varied, 0.012, 0.8)
    return float(red), float(green), float(blue)


def draw_paint(rng: np.random.Generator) -> Colour:
    """Draw a maker's colour as often as sites show it, weathered."""
    weights = np.array([weight for _, weight in _PAINTS])
    code, _ = _PAINTS[rng.choice(len(_PAINTS), p=weights / weights.sum())]
    return weather(rng, srgb(code))


def draw_livery(rng: np.random.Generator) -> Livery:
    """Draw the colours of one machine."""
    body = draw_paint(rng)
    second = srgb(_SECOND_TONES[rng.integers(len(_SECOND_TONES))])
    tool = weather(rng, body, 2.0) if rng.random() < 0.3 else weather(rng, srgb("#5b554d"))
    return Livery(
        body=body,
        accent=weather(rng, second) if rng.random() < 0.6 else weather(rng, body, 0.4),
        boom=weather(rng, body, 0.4),
        frame=weather(rng, srgb("#4a443c")),
        tool=tool,
        dust=float(rng.beta(2.0, 3.5)),
    )
