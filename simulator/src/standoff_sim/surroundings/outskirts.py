"""Flat things beyond the fence: the land out to the haze, streets with kerbs and markings, plain parked cars."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.solids.mesh import Mesh, Surface, box, join, profile, srgb
from standoff_sim.solids.panels import level, panels

STREET_VARIANTS = 3
CAR_VARIANTS = 3
_KERB_M = 0.25
_LAND_M = 0.04
"""Above the plane that a renderer may draw beyond the terrain."""


def lay_land(
    rng: np.random.Generator, size_m: tuple[float, float], reach_m: float, tones: tuple[str, ...], surface: Surface
) -> Mesh:
    """Return the ground around a site of some size, level, in blotches and strips of several tones."""
    x_m, y_m = (_lines(side / 2, reach_m) for side in size_m)
    column, row = (grid.ravel() for grid in np.meshgrid(np.arange(len(x_m) - 1), np.arange(len(y_m) - 1)))
    middle = np.column_stack([(x_m[:-1] + x_m[1:])[column] / 2, (y_m[:-1] + y_m[1:])[row] / 2])
    outside = np.any(np.abs(middle) > np.array(size_m) / 2, axis=1)
    column, row = column[outside], row[outside]
    corners = np.stack(
        [
            np.column_stack([x_m[column + i], y_m[row + j], np.full(len(row), _LAND_M)])
            for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
        ],
        axis=1,
    )
    palette = np.array([srgb(tone) for tone in tones])
    blotches = rng.integers(len(palette), size=(24, 24)).astype(np.float32)
    plots = cv2.resize(blotches, (400, 400), interpolation=cv2.INTER_NEAREST)
    plots = np.clip(plots + cv2.resize(rng.normal(0.0, 0.8, (60, 60)), (400, 400)), 0, len(palette) - 1)
    place_px = np.clip((corners[..., :2] / (2 * reach_m) + 0.5) * 399, 0, 399).astype(int)
    share = plots[place_px[..., 1], place_px[..., 0]]
    low = np.floor(share).astype(int)
    high = np.minimum(low + 1, len(palette) - 1)
    colours = palette[low] + (share - low)[..., None] * (palette[high] - palette[low])
    colours *= rng.uniform(0.85, 1.15, (*share.shape, 1))
    land = panels(corners, (0.2, 0.2, 0.2), surface)
    land.albedo[:] = colours.reshape(-1, 3)
    return land


def _lines(half_m: float, reach_m: float) -> FloatArray:
    """Return grid lines that include both borders of the site, closer together near it."""
    beyond = half_m + np.concatenate([np.arange(0.0, 60.0, 6.0), np.arange(60.0, reach_m - half_m, 18.0)])
    within = np.linspace(-half_m, half_m, 14)
    lines: FloatArray = np.concatenate([-beyond[::-1], within[1:-1], beyond])
    return lines


@lru_cache
def lay_street(length_m: float, width_m: float, variant: int) -> Mesh:
    """Return a street along local x: asphalt with patches, pavements behind kerbs, worn markings.

    Args:
        length_m: Of all of it.
        width_m: Between the kerbs.
        variant: 0 to STREET_VARIANTS - 1.
    """
    rng = np.random.default_rng([91, variant])
    half = width_m / 2
    pieces = np.arange(-length_m / 2, length_m / 2, 20.0)
    asphalt = np.concatenate([level(x, -half, x + 20.0, half, 0.1) for x in pieces])
    tone = np.array(srgb(("#6d6c6b", "#7c7a77", "#5c5b5b")[variant])) * rng.uniform(0.9, 1.1, (len(pieces), 1))
    parts = [panels(asphalt, tone, Surface.CONCRETE)]
    for side in (-1.0, 1.0):
        pavement = box((length_m, 2.4, _KERB_M), srgb("#98948c"), Surface.CONCRETE)
        kerb = box((length_m, 0.16, _KERB_M + 0.01), srgb("#b5b2ab"), Surface.CONCRETE)
        parts += [pavement.at(0.0, side * (half + 1.3), 0.0), kerb.at(0.0, side * (half + 0.08), 0.0)]
    dashes = np.arange(-length_m / 2, length_m / 2, (9.0, 6.0, 12.0)[variant])
    white = np.concatenate([level(x, -0.07, x + 3.0, 0.07, 0.14) for x in dashes])
    worn = 0.5 * rng.uniform(0.5, 1.0, (len(dashes), 1)) * np.ones(3)
    patch_x, patch_y = rng.uniform(-length_m / 2, length_m / 2, 24), rng.uniform(-half, half - 2.0, 24)
    patches = np.concatenate(
        [
            level(x, y, x + rng.uniform(1.5, 9.0), y + rng.uniform(0.6, 2.0), 0.12)
            for x, y in zip(patch_x, patch_y, strict=True)
        ]
    )
    parts += [panels(white, worn), panels(patches, srgb("#4b4a4a"), Surface.CONCRETE)]
    return join(parts)


_BODIES = (
    ((-2.2, 0.3), (2.2, 0.3), (2.2, 0.7), (0.9, 0.92), (-1.6, 0.95), (-2.2, 0.9)),
    ((-1.9, 0.3), (1.9, 0.3), (1.9, 0.75), (0.9, 0.95), (-1.9, 0.98)),
    ((-2.6, 0.35), (2.5, 0.35), (2.5, 1.0), (1.9, 1.2), (-2.6, 1.2)),
)
_CABINS = (
    ((-1.6, 0.93), (1.0, 0.9), (0.3, 1.4), (-1.1, 1.42)),
    ((-1.85, 0.95), (1.0, 0.93), (0.35, 1.52), (-1.5, 1.52)),
    ((-2.6, 1.15), (1.95, 1.15), (1.3, 2.15), (-2.55, 2.2)),
)


@lru_cache
def parked_car(variant: int) -> Mesh:
    """Return a plain car, paint tintable; variants 0 to CAR_VARIANTS - 1: saloon, hatchback, van."""
    cabin = _CABINS[variant]
    back, front = cabin[-1], cabin[-2]
    roof = box((front[0] - back[0] + 0.05, 1.5, 0.06), None).at((front[0] + back[0]) / 2, 0.0, back[1] - 0.03)
    parts = [profile(_BODIES[variant], 1.78, None), profile(cabin, 1.6, (0.035, 0.04, 0.045), Surface.GLASS), roof]
    if variant == 2:
        parts.append(box((2.6, 1.66, 0.9), None).at(-1.2, 0.0, 1.2))
    wheels = [
        box((0.62, 0.2, 0.62), (0.025, 0.025, 0.026), Surface.RUBBER).at(x, y, 0.0)
        for x in (-1.3, 1.3) for y in (-0.8, 0.8)
    ]  # fmt: skip
    return join([*parts, *wheels])
