"""Marks that machines and people leave on the ground: tyre and crawler prints, scrapes, spills, sprayed lines."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.ground.canvas import Canvas, Picture, fractal
from standoff_sim.ground.terrain_plan import Path, TerrainPlan

_NEUTRAL = 128
_SPILLS = ("#cfc6b2", "#c9c7c0", "#957a68", "#3a3733", "#b59b72", "#d9d4c6")
_SPRAYS = ((222, 220, 210), (206, 84, 60), (70, 120, 190), (214, 190, 70))


def draw_prints(rng: np.random.Generator, canvas: Canvas, plan: TerrainPlan) -> Picture:
    """Return (h, w) uint8, 128 where nothing is: pressed soil darker or paler, treads across it, scrapes, oil."""
    layer = np.full(canvas.shape, _NEUTRAL, np.uint8)
    half = np.array(plan.extent_m) / 2
    for _ in range(int(rng.integers(6, 14))):
        _smear(rng, canvas, layer, rng.uniform(-half, half))
    for road in plan.roads:
        for _ in range(int(rng.integers(5, 9))):
            shift_m = rng.uniform(-0.4, 0.4) * plan.road_width_m
            _roll(rng, canvas, layer, _wander(rng, road, shift_m))
    for path in (*plan.tracks, *plan.ruts):
        _roll(rng, canvas, layer, _wander(rng, path, 0.0))
    for _ in range(int(rng.integers(4, 12))):
        _scrape(rng, canvas, layer, rng.uniform(-half, half))
    for _ in range(int(rng.integers(3, 12))):
        _spot(rng, canvas, layer, rng.uniform(-half, half))
    return layer


def _wander(rng: np.random.Generator, path: Path, shift_m: float) -> FloatArray:
    """Resample a path every half metre, smoothly off its line as drivers steer."""
    points = np.array(path, dtype=np.float64)
    reach = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.linspace(0.0, reach[-1], max(4, int(reach[-1] / 0.5)))
    dense = np.column_stack([np.interp(at, reach, axis) for axis in points.T])
    smooth = cv2.GaussianBlur(dense, (1, 25), 6.0, borderType=cv2.BORDER_REPLICATE)
    along = np.gradient(smooth, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    sway = shift_m + 0.35 * np.sin(at / rng.uniform(6.0, 20.0) + rng.uniform(0.0, 6.0))
    wandered: FloatArray = smooth + sway[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
    return wandered


def _roll(rng: np.random.Generator, canvas: Canvas, layer: Picture, line_m: FloatArray) -> None:
    """Print both wheels or crawlers of one passage, with the bars of the tread across."""
    crawler = rng.random() < 0.4
    gauge_m, width_m = (rng.uniform(2.0, 2.5), 0.6) if crawler else (rng.uniform(1.7, 2.2), rng.uniform(0.35, 0.65))
    pitch_m, slant = (0.21, 0.0) if crawler else (rng.uniform(0.24, 0.32), rng.choice([-0.5, 0.5]))
    pressed = int(rng.integers(14, 44)) * (1 if rng.random() < 0.45 else -1)
    along = np.gradient(line_m, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    left = np.column_stack([-along[:, 1], along[:, 0]])
    sides = [line_m + side * gauge_m / 2 * left for side in (-1.0, 1.0)]
    canvas.draw(layer, sides, _NEUTRAL + pressed // 2, width_m)
    step = pitch_m / max(float(np.median(np.linalg.norm(np.diff(line_m, axis=0), axis=1))), 1e-3)
    at = np.arange(0.0, len(line_m) - 1, step)
    index = np.arange(len(line_m))
    bars = []
    for side in sides:
        middle, across, ahead = (
            np.column_stack([np.interp(at, index, axis) for axis in field.T]) for field in (side, left, along)
        )
        arm = across * width_m / 2 + ahead * slant * width_m / 2
        bars.append(np.stack([middle - arm, middle + arm], axis=1))
    canvas.draw(layer, np.concatenate(bars), _NEUTRAL - int(0.8 * abs(pressed)), 0.11)


def _smear(rng: np.random.Generator, canvas: Canvas, layer: Picture, centre_m: FloatArray) -> None:
    """Draw the curved strips of a machine that turned on the spot or swung round."""
    radius_m, start = rng.uniform(2.5, 12.0), rng.uniform(0.0, 2 * np.pi)
    for _ in range(int(rng.integers(2, 6))):
        angles = start + np.linspace(0.0, rng.uniform(0.8, 4.0), 40)
        ring_m = radius_m + rng.uniform(-1.5, 1.5)
        arc = centre_m + ring_m * np.column_stack([np.cos(angles), np.sin(angles)])
        canvas.draw(layer, [arc], _NEUTRAL + int(rng.integers(-26, 20)), rng.uniform(0.3, 0.7))


def _scrape(rng: np.random.Generator, canvas: Canvas, layer: Picture, centre_m: FloatArray) -> None:
    """Draw neighbouring strokes of a toothed bucket."""
    turn = rng.uniform(0.0, 2 * np.pi)
    ahead, left = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    for stroke in range(int(rng.integers(2, 7))):
        origin = centre_m + left * 1.25 * stroke + ahead * rng.uniform(-0.6, 0.6)
        length_m = rng.uniform(1.5, 4.0)
        canvas.draw(layer, [np.stack([origin, origin + ahead * length_m])], _NEUTRAL + int(rng.integers(4, 18)), 1.2)
        teeth = [np.stack([origin + left * t, origin + left * t + ahead * length_m]) for t in np.linspace(-0.5, 0.5, 5)]
        canvas.draw(layer, teeth, _NEUTRAL - int(rng.integers(10, 30)), 0.08)


def _spot(rng: np.random.Generator, canvas: Canvas, layer: Picture, centre_m: FloatArray) -> None:
    """Draw drops of oil and water, one large and many small."""
    for _ in range(int(rng.integers(2, 9))):
        drop = centre_m + rng.normal(0.0, 0.5, 2)
        angles = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
        radii = rng.gamma(2.0, 0.13) * rng.uniform(0.7, 1.2, 12)
        outline = drop + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        canvas.fill(layer, [outline], _NEUTRAL - int(rng.integers(25, 70)))


def paint_blots(rng: np.random.Generator, canvas: Canvas, levels: Picture, albedo: Picture) -> None:
    """Spill sand, cement, brick dust and bitumen: blots with ragged edges that take the ground's own texture."""
    size = np.array([canvas.width_px, canvas.height_px])
    for _ in range(int(rng.integers(5, 14))):
        side = int(rng.uniform(1.5, 9.0) * canvas.px_per_m)
        column, row = rng.integers(0, np.maximum(size - side, 1))
        window = slice(row, row + side), slice(column, column + side)
        part = albedo[window]
        rows, columns = part.shape[:2]
        away = np.hypot.outer(np.linspace(-1.0, 1.0, rows), np.linspace(-1.0, 1.0, columns))
        edge = 0.55 - away + 0.25 * fractal(rng, (rows, columns), 3, 128, gain=0.85)
        cover = np.clip(edge * 3.0, 0.0, rng.uniform(0.2, 0.7)).astype(np.float32)[..., None]
        code = _SPILLS[int(rng.integers(len(_SPILLS)))]
        colour = np.array([int(code[i : i + 2], 16) for i in (1, 3, 5)], np.float32)
        texture = 0.62 + levels[window].astype(np.float32)[..., None] / 370.0
        part[...] = np.clip(part + cover * (colour * texture - part), 0.0, 255.0).astype(np.uint8)


def paint_lines(rng: np.random.Generator, canvas: Canvas, albedo: Picture) -> None:
    """Spray survey lines, crosses and numbers' strokes, half worn away."""
    mask = np.zeros(canvas.shape, np.uint8)
    half = np.array([canvas.width_px, canvas.height_px]) / (2 * canvas.px_per_m)
    for _ in range(int(rng.integers(2, 9))):
        start = rng.uniform(-half, half)
        turn = rng.choice([0.0, np.pi / 2]) + rng.normal(0.0, 0.05)
        ahead = np.array([np.cos(turn), np.sin(turn)])
        ends = np.arange(0.0, rng.uniform(3.0, 25.0), 1.1)
        dashes = [np.stack([start + ahead * at, start + ahead * (at + rng.uniform(0.4, 1.1))]) for at in ends]
        canvas.draw(mask, dashes, int(rng.integers(70, 190)), 0.06)
        cross = start + 0.35 * np.array([[-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [1.0, -1.0]])
        canvas.draw(mask, [cross[:2], cross[2:]], 200, 0.06)
    colour = np.array(_SPRAYS[int(rng.choice(len(_SPRAYS), p=[0.55, 0.2, 0.15, 0.1]))], np.float32)
    rows, columns = np.nonzero(mask)
    share = mask[rows, columns, None].astype(np.float32) / 255.0 * rng.uniform(0.3, 1.0, (len(rows), 1))
    under = albedo[rows, columns].astype(np.float32)
    albedo[rows, columns] = (under + share * (colour - under)).astype(np.uint8)
