"""What people on sites wear: which garments in which colours, how faded, how dusty.

Shares are of what photographs of sites from cranes, roofs and drones show: as many people without a vest as with one,
two helmets in three white or yellow, trousers mostly dark.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff_sim.solids.mesh import Colour, srgb

HAT_SHARES: Mapping[str, float] = {
    "hard_hat": 0.66, "hard_hat_brim": 0.06, "cap": 0.09, "sun_hat": 0.04, "beanie": 0.03, "none": 0.12,
}  # fmt: skip
HARD_HAT_COLOURS: Mapping[str, float] = {
    "#e8e6de": 0.32, "#e2b015": 0.30, "#d9661c": 0.11, "#a8241d": 0.10, "#23589a": 0.11, "#2e7a45": 0.06,
}  # fmt: skip
HI_VIS_SHARE = 0.52
HI_VIS_COLOURS: Mapping[str, float] = {"#c9dd2a": 0.45, "#ea641e": 0.44, "#c92f27": 0.11}
DARK_TOPS: Mapping[str, float] = {
    "#1d2433": 0.30, "#1b1b1c": 0.22, "#3a3c3f": 0.18, "#33291f": 0.10, "#2b3a2c": 0.08, "#25354e": 0.12,
}  # fmt: skip
PALE_TOPS: Mapping[str, float] = {
    "#dedbd2": 0.30, "#b9b7b0": 0.22, "#c9b998": 0.18, "#a9bccb": 0.18, "#d3c7b2": 0.12,
}  # fmt: skip
BRIGHT_TOPS: Mapping[str, float] = {
    "#8c2a26": 0.22, "#2f63a8": 0.26, "#3f7a4b": 0.15, "#8a8f3a": 0.10, "#b9742f": 0.12,
    "#7b5a86": 0.05, "#6f8296": 0.10,
}  # fmt: skip
TOP_SHARES: tuple[tuple[Mapping[str, float], float], ...] = ((DARK_TOPS, 0.47), (PALE_TOPS, 0.33), (BRIGHT_TOPS, 0.20))
TROUSER_COLOURS: Mapping[str, float] = {
    "#23252b": 0.24, "#27324a": 0.24, "#3f5474": 0.12, "#9a8765": 0.15, "#6c685f": 0.12, "#4b4a45": 0.08,
    "#c9c4b8": 0.03, "#d2641f": 0.02,
}  # fmt: skip
SKINS: Mapping[str, float] = {
    "#e3b99b": 0.18, "#d3a17e": 0.22, "#bb8761": 0.20, "#96653f": 0.17, "#6f4629": 0.13, "#4a2e1d": 0.10,
}  # fmt: skip
HAIRS: Mapping[str, float] = {"#17130f": 0.50, "#33241a": 0.26, "#5c4630": 0.12, "#8d8a85": 0.12}
BOOTS: Mapping[str, float] = {"#2a211a": 0.40, "#5b4630": 0.30, "#1a1a1a": 0.22, "#8d7d35": 0.08}
GLOVES: Mapping[str, float] = {"#3a3a3c": 0.4, "#b7b1a4": 0.25, "#c8651f": 0.2, "#3c6a8c": 0.15}
HATS_OF_CLOTH: Mapping[str, float] = {"#1c2230": 0.35, "#5d5a52": 0.2, "#b9a878": 0.25, "#d6d2c6": 0.2}
_DUST = np.array(srgb("#a08f74"))


@dataclass(frozen=True, slots=True)
class Outfit:
    """One person's clothes; colours are linear.

    Attributes:
        hat: Kind of headgear, "none" for bare hair.
        hat_colour: Of the headgear.
        top: Of shirt or jacket.
        hi_vis: "none", "vest" over the top, or "whole" when sleeves and all are of its colour.
        hi_vis_colour: Of vest, hi-vis shirt or jacket.
        bands: Tape on the hi-vis.
        open_front: Whether the vest hangs open.
        jacket: Whether the top is a jacket and not a shirt.
        sleeves: "long", "short" or "none".
        trousers: Colour.
        trouser_width: Of the legs, 1 is narrow.
        shorts: Whether the shins are bare.
        skin: Of the face.
        hair: Colour, None without any.
        boots: Colour.
        rubber_boots: Whether they are of rubber and knee-high.
        gloves: Colour, None for bare hands.
        belt: Whether a tool belt is worn.
        backpack: Colour, None without one.
        dust: 0 clean .. 1 caked.
    """

    hat: str
    hat_colour: Colour
    top: Colour
    hi_vis: str
    hi_vis_colour: Colour
    bands: str
    open_front: bool
    jacket: bool
    sleeves: str
    trousers: Colour
    trouser_width: float
    shorts: bool
    skin: Colour
    hair: Colour | None
    boots: Colour
    rubber_boots: bool
    gloves: Colour | None
    belt: bool
    backpack: Colour | None
    dust: float


def _one_of(rng: np.random.Generator, shares: Mapping[str, float]) -> str:
    weights = np.array(list(shares.values()))
    return list(shares)[int(rng.choice(len(weights), p=weights / weights.sum()))]


def _worn(rng: np.random.Generator, code: str, wear: float) -> Colour:
    """Return a colour as it looks after use: never twice the same, bleached and dusty."""
    clean = np.array(srgb(code)) * rng.uniform(0.78, 1.12) * rng.uniform(0.94, 1.06, 3)
    faded = clean + wear * (0.6 * clean.mean() + 0.4 * _DUST - clean)
    red, green, blue = np.clip(faded, 0.012, 0.80)
    return float(red), float(green), float(blue)


def choose_outfit(rng: np.random.Generator) -> Outfit:
    """Dress a person."""
    hat = _one_of(rng, HAT_SHARES)
    hats = HARD_HAT_COLOURS if hat.startswith("hard_hat") else HATS_OF_CLOTH
    hi_vis = "none" if rng.random() >= HI_VIS_SHARE else str(rng.choice(["vest", "whole"], p=[0.75, 0.25]))
    tops, weights = zip(*TOP_SHARES, strict=True)
    tops_code = _one_of(rng, tops[int(rng.choice(len(tops), p=weights))])
    jacket = bool(rng.random() < (0.5 if hi_vis == "whole" else 0.32))
    sleeves = "long" if jacket else str(rng.choice(["long", "short", "none"], p=[0.52, 0.43, 0.05]))
    wear = float(rng.beta(1.6, 3.0))
    return Outfit(
        hat=hat,
        hat_colour=_worn(rng, _one_of(rng, hats), 0.35 * wear),
        top=_worn(rng, tops_code, 0.5 * wear),
        hi_vis=hi_vis,
        hi_vis_colour=_worn(rng, _one_of(rng, HI_VIS_COLOURS), 0.7 * wear),
        bands=str(rng.choice(["braces", "two", "one", "none"], p=[0.50, 0.28, 0.12, 0.10])),
        open_front=bool(rng.random() < 0.3),
        jacket=jacket,
        sleeves=sleeves,
        trousers=_worn(rng, _one_of(rng, TROUSER_COLOURS), 0.6 * wear),
        trouser_width=float(rng.uniform(0.94, 1.22)),
        shorts=bool(rng.random() < 0.05),
        skin=_worn(rng, _one_of(rng, SKINS), 0.05),
        hair=None if rng.random() < 0.08 else _worn(rng, _one_of(rng, HAIRS), 0.05),
        boots=_worn(rng, _one_of(rng, BOOTS), wear),
        rubber_boots=bool(rng.random() < 0.08),
        gloves=_worn(rng, _one_of(rng, GLOVES), 0.5 * wear) if rng.random() < 0.4 else None,
        belt=bool(rng.random() < 0.15),
        backpack=_worn(rng, "#2b2d33", 0.3) if rng.random() < 0.06 else None,
        dust=float(rng.uniform(0.03, 0.12) + 0.4 * wear),
    )
