"""Concrete on the ground as it looks from above: blotches, joints, tyre marks, rust, soil carried onto it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.ground.canvas import Canvas, Picture, fractal
from standoff_sim.ground.soil_colours import palette_of
from standoff_sim.ground.terrain_plan import Slab, Soil
from standoff_sim.solids.mesh import Float32Array


def paint_slabs(rng: np.random.Generator, canvas: Canvas, slabs: Sequence[Slab], albedo: Picture) -> None:
    """Paint concrete areas into the picture of the ground."""
    for slab in slabs:
        window = canvas.window(slab.outline_m, 0.5)
        part = albedo[window]
        rows, columns = part.shape[:2]
        cover = canvas.inside(slab.outline_m, window).astype(np.float32) / 255.0
        surface = _concrete(rng, canvas, slab, (rows, columns), window)
        soiled = _soiled(rng, slab, cover)
        cover *= 1.0 - soiled
        colour = cv2.applyColorMap(cv2.convertScaleAbs(np.maximum(surface, 0.0)), palette_of(Soil.CONCRETE))
        part[...] = cv2.blendLinear(colour, np.ascontiguousarray(part), cover, 1.0 - cover)


def _soiled(rng: np.random.Generator, slab: Slab, cover: Float32Array) -> Float32Array:
    """Return where soil hides the concrete: from its edges inwards, in blotches."""
    shape = (cover.shape[0], cover.shape[1])
    edge = 1.0 - cv2.blur(cover, (61, 61))
    level = 1.6 * edge + 0.5 * fractal(rng, shape, 4, 512, gain=0.85)
    return np.asarray(np.clip(level - 0.8 + 1.1 * slab.dirt, 0.0, 0.3 + 0.65 * slab.dirt), np.float32)


def _concrete(
    rng: np.random.Generator, canvas: Canvas, slab: Slab, shape: tuple[int, int], window: tuple[slice, slice]
) -> Float32Array:  # fmt: skip
    """Return tones 0..255 of clean concrete with joints, tyre marks and drips."""
    tone = rng.uniform(140.0, 185.0) + 13.0 * fractal(rng, shape, 3, 64, gain=0.7) + 5.0 * fractal(rng, shape, 256, 512)
    lines = np.zeros(canvas.shape, np.uint8)
    corners = np.array(slab.outline_m)
    if slab.joint_m > 0.0:
        side = corners[1] - corners[0]
        canvas.draw(lines, _grid(corners, side / np.linalg.norm(side), slab.joint_m), 150, 0.05)
    centre, spread = corners.mean(axis=0), np.ptp(corners, axis=0).max()
    for _ in range(int(rng.integers(2, 7))):
        bend, start = rng.uniform(0.05, 1.2), rng.uniform(0.0, 2 * np.pi)
        angles = start + np.linspace(0.0, bend, 30)
        radius_m = rng.uniform(4.0, 2.0 * spread)
        hub = centre + rng.normal(0.0, 0.3 * spread, 2) - radius_m * np.array([np.cos(start), np.sin(start)])
        arcs = [hub + (radius_m + gauge) * np.column_stack([np.cos(angles), np.sin(angles)]) for gauge in (-0.9, 0.9)]
        canvas.draw(lines, arcs, int(rng.integers(18, 60)), 0.3)
    tone -= 0.6 * cv2.blur(lines, (2, 2))[window]
    return np.asarray(tone, np.float32)


def _grid(corners_m: FloatArray, along: FloatArray, pitch_m: float) -> list[FloatArray]:
    """Return lines at a pitch in both directions across a polygon, the first side giving the direction."""
    lines = []
    for ahead in (along, np.array([-along[1], along[0]])):
        across = np.array([-ahead[1], ahead[0]])
        offsets = (corners_m - corners_m[0]) @ across
        ends = (corners_m - corners_m[0]) @ ahead
        for offset in np.arange(np.ceil(offsets.min() / pitch_m), offsets.max() / pitch_m) * pitch_m:
            start = corners_m[0] + across * offset
            lines.append(np.stack([start + ahead * ends.min(), start + ahead * ends.max()]))
    return lines
