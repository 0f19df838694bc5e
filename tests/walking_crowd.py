"""People who walk about on level ground before a camera, as boxes: capsules with arms, drawn as clouds of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import View

WIDTH_PX, HEIGHT_PX = 1280, 720


@dataclass(frozen=True, slots=True)
class Crowd:
    """What a camera saw of some people for ten seconds, every 2.5 s: (time_s, (N, 4) boxes)."""

    view: View
    pictures: list[tuple[float, FloatArray]]


def drone_camera(field_deg: float = 72.0) -> Camera:
    focal_px = WIDTH_PX / 2.0 / np.tan(np.deg2rad(field_deg / 2.0))
    centre_px = (WIDTH_PX - 1) / 2.0, (HEIGHT_PX - 1) / 2.0
    matrix = np.array([[focal_px, 0.0, centre_px[0]], [0.0, focal_px, centre_px[1]], [0.0, 0.0, 1.0]])
    return Camera(WIDTH_PX, HEIGHT_PX, matrix, np.zeros(5))


def body_points(stature_m: float, breadth: float = 1.0, heading: float = 0.0, tall: float = 1.0) -> FloatArray:
    """Return (P, 3) points of somebody at the origin, in shoes and hat; `tall` is below 1 for who stoops."""
    up, around = np.meshgrid(np.linspace(-np.pi / 2.0, np.pi / 2.0, 13), np.linspace(0.0, 2.0 * np.pi, 25))
    ball = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1).reshape(-1, 3)
    scale = stature_m / 1.75
    height_m, radius_m = (1.75 * tall + 0.05) * scale, 0.215 * scale
    lift = np.array([0.0, 0.0, radius_m])
    points = np.concatenate([radius_m * ball + lift, radius_m * ball + [0.0, 0.0, height_m - radius_m]])
    points[:, 0] *= breadth
    cos, sin = np.cos(heading), np.sin(heading)
    turned: FloatArray = points @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return turned


def box_of(view: View, points_m: FloatArray) -> FloatArray | None:
    """Return (4,) the box of points, None where it is not wholly in the picture."""
    seen_px = view.project(points_m)
    box = np.concatenate([seen_px.min(axis=0), seen_px.max(axis=0)])
    limits = np.array([WIDTH_PX, HEIGHT_PX]) - 1.0
    return box if np.isfinite(box).all() and (box[:2] > 0).all() and (box[2:] < limits).all() else None


def random_crowd(seed: int, *, clean: bool = False, people: int | None = None) -> Crowd:
    """Return another camera and another crowd for each seed; a clean one has no noise and nobody who stoops."""
    rng = np.random.default_rng(seed)
    view = View.aimed(
        drone_camera(float(rng.uniform(60.0, 84.0)) if not clean else 72.0),
        np.array([0.0, 0.0, np.exp(rng.uniform(np.log(8.0), np.log(45.0)))]),
        heading_deg=0.0,
        pitch_deg=float(rng.uniform(25.0, 75.0)),
        roll_deg=0.0 if clean else float(rng.normal()),
    )
    count = people or int(rng.integers(5, 13))
    place_m = view.to_plane(_visible_px(rng, view, count))
    stature_m = 1.75 if clean else float(rng.choice([1.62, 1.75, 1.75, 1.85]))
    statures_m = np.full(count, stature_m) if clean else rng.normal(stature_m, 0.06, count)
    way = rng.uniform(0.0, 2.0 * np.pi, count)
    velocity_mps = rng.choice([0.0, 1.2], count)[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    stoops = np.zeros(count) if clean else (rng.random(count) < 0.2)
    pictures = []
    for time_s in np.arange(0.0, 10.1, 2.5):
        boxes = []
        for who in range(count):
            tall = 0.65 if stoops[who] and (time_s + who) % 10.0 < 6.0 else 1.0
            breadth = 1.35 if clean else rng.uniform(1.0, 1.9)
            points_m = body_points(float(statures_m[who]), breadth, rng.uniform(0.0, np.pi) if not clean else 0.0, tall)
            points_m[:, :2] += place_m[who] + velocity_mps[who] * time_s
            box = box_of(view, points_m)
            if box is not None and (clean or rng.random() > 0.15):
                boxes.append(box if clean else _detected(rng, box))
        pictures.append((float(time_s), np.array(boxes).reshape(-1, 4)))
    return Crowd(view, pictures)


def _visible_px(rng: np.random.Generator, view: View, count: int) -> FloatArray:
    """Return (count, 2) pixels of ground within 60 m."""
    pixels = rng.uniform([80.0, 80.0], [WIDTH_PX - 80.0, HEIGHT_PX - 60.0], (400 * count, 2))
    chosen: FloatArray = pixels[np.linalg.norm(view.to_plane(pixels), axis=1) < max(60.0, 2.0 * view.position_m[2])]
    return chosen[:count]


def _detected(rng: np.random.Generator, box: FloatArray) -> FloatArray:
    size = box[2:] - box[:2]
    middle = (box[:2] + box[2:]) / 2.0 + (0.03 * size + 0.5) * rng.normal(size=2)
    size = np.maximum(size * (1.0 + 0.06 * rng.normal(size=2)) + rng.normal(size=2), 2.0)
    return np.concatenate([middle - size / 2.0, middle + size / 2.0])
