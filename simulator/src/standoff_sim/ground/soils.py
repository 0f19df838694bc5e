"""Soil as it looks from above: tones and wetness that follow the relief, several soils, grass, all as one picture."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from standoff.core.homography import FloatArray
from standoff_sim.ground.canvas import Canvas, Picture, fractal
from standoff_sim.ground.ground_marks import draw_prints, paint_blots, paint_lines
from standoff_sim.ground.relief import surface_size_m
from standoff_sim.ground.slabs import paint_slabs
from standoff_sim.ground.soil_colours import PALETTES, palette_of
from standoff_sim.ground.terrain_plan import Soil, TerrainPlan
from standoff_sim.solids.mesh import Float32Array

_LONGEST_PX = 2048
_GRASS_M = 22.0
_BLINDED_M2 = 40.0
"""Lean concrete is poured into footings, not into whole excavations."""
_SOILS = tuple(soil for soil in Soil if soil not in (Soil.MIXED, Soil.CONCRETE))


def paint_ground(
    rng: np.random.Generator, plan: TerrainPlan, height_m: Float32Array
) -> tuple[Picture, npt.NDArray[np.uint8]]:
    """Return albedo (h, w, 3) uint8 sRGB, red first, and wetness (h, w) uint8 of a shaped ground; row 0 is south."""
    canvas = Canvas.of(surface_size_m(plan), _LONGEST_PX)
    coarse = Canvas.of(surface_size_m(plan), _LONGEST_PX // 2)
    lows = _lows(plan, height_m, coarse)
    wet = _wetness(rng, plan, lows)
    prints = draw_prints(rng, canvas, plan)
    tone = _tone(rng, plan, lows, wet, canvas)
    grain = fractal(rng, canvas.shape, 512, 2048, gain=0.9)
    lively = cv2.resize(6.0 + 5.5 * np.clip(fractal(rng, coarse.shape, 6, 96), -1.0, 1.5), canvas.shape[::-1])
    tone += grain * lively
    tone += _pebbles(rng, canvas, plan)
    faded = cv2.resize(np.clip(0.85 + 0.6 * fractal(rng, coarse.shape, 8, 64), 0.0, 1.5), canvas.shape[::-1])
    tone += cv2.subtract(prints, 128.0, dtype=cv2.CV_32F) * faded
    levels = cv2.convertScaleAbs(np.maximum(tone, 0.0))
    albedo = _soils(rng, plan, coarse, levels, grain)
    albedo = _grow(rng, plan, coarse, levels, grain, albedo)
    _drift(rng, albedo)
    paint_blots(rng, canvas, levels, albedo)
    paint_slabs(rng, canvas, plan.slabs, albedo)
    paint_lines(rng, canvas, albedo)
    wetness = cv2.resize(cv2.convertScaleAbs(wet, alpha=255.0), canvas.shape[::-1], interpolation=cv2.INTER_CUBIC)
    return albedo, np.asarray(wetness, np.uint8)


def _lows(plan: TerrainPlan, height_m: Float32Array, canvas: Canvas) -> Float32Array:
    """Return how far hollows narrower than some metres lie below their rims, less what crests rise, metres."""
    across = 2 * round(1.2 / plan.cell_m) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (across, across))
    filled, planed = (cv2.morphologyEx(height_m, kind, disc) for kind in (cv2.MORPH_CLOSE, cv2.MORPH_OPEN))
    low_m = cv2.GaussianBlur(np.clip(filled - height_m, 0.0, 0.15) - np.clip(height_m - planed, 0.0, 0.15), None, 1.2)
    step = 1.0 / (canvas.px_per_m * plan.cell_m)
    to_grid = np.array([[step, 0.0, 0.5 * step], [0.0, step, 0.5 * step]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    resampled = cv2.warpAffine(low_m, to_grid, canvas.shape[::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(resampled, np.float32)


def _wetness(rng: np.random.Generator, plan: TerrainPlan, lows: Float32Array) -> Float32Array:
    """Return 0 dry .. 1 under water: water gathers in the lows, dampness spreads around it."""
    gathers = np.clip(lows, -0.1, 0.1) / 0.03
    gathers += fractal(rng, (lows.shape[0], lows.shape[1]), 4, 256, gain=0.6)
    sample = gathers[::8, ::8]
    damp_from, damp_full = np.quantile(sample, [0.95 - 0.75 * plan.moisture, 0.999])
    damp = np.clip((gathers - damp_from) / max(float(damp_full - damp_from), 1e-3), 0.0, 1.0)
    wet = (0.1 + 0.45 * plan.moisture) * damp
    if plan.puddles > 0.0:
        # mud around the shore, half as wet as the water is
        shore = np.quantile(sample, 1.0 - plan.puddles)
        wet = np.maximum(wet, np.clip(0.75 + (gathers - shore) / 0.9, 0.0, 1.0))
    return np.asarray(wet, np.float32)


def _tone(
    rng: np.random.Generator, plan: TerrainPlan, lows: Float32Array, wet: Float32Array, canvas: Canvas
) -> Float32Array:
    """Return brightness, about 0..255: dry highs pale, lows and wet ground dark, roads pale and even."""
    shape = (lows.shape[0], lows.shape[1])
    tone = (165.0 - 35.0 * plan.moisture) + 13.0 * fractal(rng, shape, 3, 48, gain=0.75)
    tone += 6.5 * fractal(rng, shape, 64, 512, gain=0.8)
    for _ in range(2):
        graded = np.clip(0.4 + fractal(rng, shape, 4, 32), 0.0, 1.3)
        tone += 12.0 * graded * _streaks(rng, shape)
    if plan.roads:
        lane = np.zeros(shape, np.uint8)
        half = Canvas(shape[1], shape[0], canvas.px_per_m / 2)
        half.draw(lane, [np.array(road) for road in plan.roads], 255, plan.road_width_m)
        share = cv2.blur(lane, (31, 31)).astype(np.float32) / 255.0
        share *= np.clip(1.0 + 0.35 * fractal(rng, shape, 12, 192), 0.0, 1.0)
        tone += share * (20.0 - 0.45 * (tone - 150.0))
    tone -= 130.0 * lows
    # The renderer darkens wet ground; only its mud, washed free of pale dust, is darker by itself.
    tone -= 14.0 * wet
    return np.asarray(cv2.resize(tone, canvas.shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32)


def _streaks(rng: np.random.Generator, shape: tuple[int, int]) -> Float32Array:
    """Return noise drawn out in one direction, as blades and rollers leave it."""
    across = max(shape)
    drawn = cv2.resize(fractal(rng, (across, across // 24), 96, across, gain=0.8), (3 * across // 2,) * 2)
    centre = 3 * across / 4
    turn = cv2.getRotationMatrix2D((centre, centre), float(rng.uniform(0.0, 180.0)), 1.0)
    turn[:, 2] -= centre - np.array(shape[::-1]) / 2
    return np.asarray(cv2.warpAffine(drawn, turn, shape[::-1]), np.float32)


def _pebbles(rng: np.random.Generator, canvas: Canvas, plan: TerrainPlan) -> Float32Array:
    """Return bright and dark specks, a texel or two wide: stones, clods and their shadows."""
    heavy = np.clip((np.arange(256) - 127.5) / 127.5, -1.0, 1.0)
    gravelly = 0.6 if plan.soil is Soil.GREY_GRAVEL else 0.45
    spread = (128.0 + gravelly * 95.0 * np.sign(heavy) * np.abs(heavy) ** 9).astype(np.uint8)
    white = np.frombuffer(rng.bytes(canvas.width_px * canvas.height_px), np.uint8).reshape(canvas.shape)
    return np.asarray(cv2.subtract(cv2.LUT(white, spread), 128.0, dtype=cv2.CV_32F), np.float32)


def _soils(
    rng: np.random.Generator, plan: TerrainPlan, coarse: Canvas, levels: Picture, grain: Float32Array
) -> Picture:
    """Colour the tones: the main soil, patches of a second one, heaps and pit floors of their own."""
    main = plan.soil if plan.soil is not Soil.MIXED else _SOILS[int(rng.integers(len(_SOILS)))]
    other = _SOILS[int(rng.integers(len(_SOILS)))]
    share = rng.uniform(0.35, 0.8) if plan.soil is Soil.MIXED else rng.uniform(0.1, 0.35)
    blended = np.round((1.0 - share) * palette_of(main) + share * palette_of(other)).astype(np.uint8)
    albedo = cv2.applyColorMap(levels, palette_of(main))
    patchy = cv2.resize(fractal(rng, coarse.shape, 3, 256, gain=0.7), levels.shape[::-1])
    mask = cv2.compare(cv2.scaleAdd(grain, 0.3, patchy), float(rng.uniform(0.2, 1.0)), cv2.CMP_GT)
    cv2.copyTo(cv2.applyColorMap(levels, blended), mask, albedo)
    canvas = Canvas(levels.shape[1], levels.shape[0], 2 * coarse.px_per_m)
    for heap in plan.heaps:
        if heap.soil is not None:
            angles = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
            rim = heap.radius_m * rng.uniform(0.8, 1.0, (24, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
            _lay(albedo, levels, palette_of(heap.soil), *_cover(canvas, np.array(heap.centre_m) + rim, grain))
    subsoil = _SOILS[int(rng.integers(len(_SOILS)))]
    blinded = rng.random() < 0.4
    deeper = np.round(0.5 * palette_of(main) + 0.5 * palette_of(subsoil)).astype(np.uint8)
    for pit in plan.pits:
        _lay(albedo, levels, deeper, *_cover(canvas, np.array(pit.outline_m), grain))
        floor = shapely.Polygon(pit.outline_m).buffer(-0.4)
        if blinded and floor.geom_type == "Polygon" and 0.0 < floor.area < _BLINDED_M2 and rng.random() < 0.8:
            blinding = _cover(canvas, np.array(floor.exterior.coords), grain, crumble=8.0)
            _lay(albedo, levels, palette_of(Soil.CONCRETE), *blinding)
    return np.asarray(albedo, np.uint8)


def _cover(
    canvas: Canvas, outline_m: FloatArray, grain: Float32Array, crumble: float = 40.0
) -> tuple[Picture, tuple[slice, slice]]:
    """Return a mask of a polygon whose edge crumbles by the grain, and the window that it is for."""
    window = canvas.window(outline_m, 1.5)
    mask = canvas.inside(outline_m, window)
    soft = cv2.blur(mask, (9, 9)).astype(np.float32)
    return np.asarray(cv2.compare(cv2.scaleAdd(grain[window], crumble, soft), 127.0, cv2.CMP_GT), np.uint8), window


def _lay(albedo: Picture, levels: Picture, palette: Picture, mask: Picture, window: tuple[slice, slice]) -> None:
    part = np.ascontiguousarray(levels[window])
    coloured = cv2.applyColorMap(part, palette)
    albedo[window] = cv2.copyTo(coloured, mask, np.ascontiguousarray(albedo[window]))


def _grow(
    rng: np.random.Generator, plan: TerrainPlan, coarse: Canvas, levels: Picture, grain: Float32Array, albedo: Picture
) -> Picture:
    """Let grass in from the borders, and weeds into a few places inside; never on roads, tracks, slabs or pits."""
    if plan.grass <= 0.0:
        return albedo
    inwards_m = (
        np.minimum.outer(*(np.minimum(np.arange(n), np.arange(n)[::-1]) for n in coarse.shape)) / coarse.px_per_m
    )
    rich = 1.0 - inwards_m / (_GRASS_M * plan.grass) + 0.9 * fractal(rng, coarse.shape, 4, 64)
    rich = np.maximum(rich, fractal(rng, coarse.shape, 16, 128) - 3.2 + plan.grass) + 0.5 * fractal(
        rng, coarse.shape, 256, 1024, gain=0.9
    )
    worn = np.zeros(coarse.shape, np.uint8)
    lines = [np.array(path) for path in (*plan.roads, *plan.tracks, *plan.ruts)]
    coarse.draw(worn, lines, 255, 3.2)
    coarse.fill(worn, [*(pit.outline_m for pit in plan.pits), *(slab.outline_m for slab in plan.slabs)], 255)
    rich -= cv2.blur(worn, (9, 9)) * np.float32(2.5 / 255.0)
    # Tufts are thick in the middle of a patch and thin out into single ones, with soil showing between them.
    thick = cv2.resize(np.asarray(rich, np.float32), levels.shape[::-1], interpolation=cv2.INTER_CUBIC)
    thick = np.clip(cv2.scaleAdd(grain, 0.4, thick) * 0.6 - 0.05, 0.0, 0.85)
    health = fractal(rng, coarse.shape, 6, 512, gain=0.75)
    height = cv2.resize(cv2.convertScaleAbs(health * 16.0 + 122.0), levels.shape[::-1])
    blades = cv2.convertScaleAbs(cv2.scaleAdd(grain, 20.0, cv2.addWeighted(levels, 0.35, height, 0.7, 0.0, dtype=5)))
    green = cv2.applyColorMap(blades, PALETTES["grass" if rng.random() < 0.6 else "dead grass"])
    return np.asarray(cv2.blendLinear(green, albedo, thick, 1.0 - thick), np.uint8)


def _drift(rng: np.random.Generator, albedo: Picture) -> None:
    """Let the hue wander by a few per cent over tens of metres."""
    gain = 128.0 + 4.0 * rng.standard_normal((7, 7, 1)) + 1.3 * rng.standard_normal((7, 7, 3))
    field = cv2.convertScaleAbs(cv2.resize(gain.astype(np.float32), (128, 128), interpolation=cv2.INTER_CUBIC))
    cv2.multiply(albedo, cv2.resize(field, albedo.shape[1::-1][:2]), albedo, scale=1.0 / 128.0)
