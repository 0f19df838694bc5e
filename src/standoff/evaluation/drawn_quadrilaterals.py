"""Quadrilaterals drawn so that their corners are known exactly: the reference test's pictures.

Each pixel's grey is the area-weighted mean of what it covers, blurred by a small lens. Three classes:
"clean"; "sand", blobs of sand lying over edges and corners; "hard", low contrast, noise, and straight
distractor edges (planks, shadows, bars) crossing the box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray

Difficulty = Literal["clean", "sand", "hard"]
DIFFICULTIES: tuple[Difficulty, ...] = get_args(Difficulty)

SIZE_PX = 320
_SUPERSAMPLING = 16
_LENS_SIGMA_PX = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class DrawnQuadrilateral:
    """One drawn picture.

    Attributes:
        gray: (320, 320) uint8.
        corners_px: (4, 2) the truth, counter-clockwise as seen.
        box_xyxy_px: (4,) a detector's box around it, a few pixels too large.
    """

    gray: ImageArray
    corners_px: FloatArray
    box_xyxy_px: FloatArray


def draw_quadrilateral(
    difficulty: Difficulty, seed: int, index: int = 0, *, corners_px: FloatArray | None = None
) -> DrawnQuadrilateral:
    """Draw one quadrilateral; the same class, seed and index give the same picture.

    Args:
        difficulty: Class.
        seed: Of everything random.
        index: Of the picture.
        corners_px: (4, 2) counter-clockwise as seen; None: random ones.
    """
    rng = np.random.default_rng([DIFFICULTIES.index(difficulty), seed, index])
    corners = _random_corners(rng) if corners_px is None else corners_px
    contrast = rng.uniform(*((20.0, 45.0) if difficulty == "hard" else (55.0, 110.0)))
    ground = rng.uniform(70.0, 110.0)
    picture = ground + _texture(rng, coarse_px=12.0, amplitude=3.0)
    if difficulty == "hard":
        picture = _with_distractors(rng, picture, corners, under=True)
    inside = area_coverage(corners)
    picture += inside * (ground + contrast + _texture(rng, coarse_px=20.0, amplitude=2.0) - picture)
    if difficulty == "hard":
        picture = _with_distractors(rng, picture, corners, under=False)
    if difficulty == "sand":
        picture = _with_sand(rng, picture, corners, ground)
    picture = cv2.GaussianBlur(picture, (0, 0), _LENS_SIGMA_PX)
    noise = rng.uniform(*((4.0, 7.0) if difficulty == "hard" else (1.0, 3.0)))
    picture = picture + rng.normal(0.0, noise, picture.shape)
    low, high = corners.min(axis=0), corners.max(axis=0)
    box = np.concatenate([low - rng.uniform(3.0, 12.0, 2), high + rng.uniform(3.0, 12.0, 2)])
    return DrawnQuadrilateral(np.clip(np.rint(picture), 0, 255).astype(np.uint8), corners, box)


def _random_corners(rng: np.random.Generator) -> FloatArray:
    """Return a convex quadrilateral with angles between 40 and 140 degrees and sides of 50 px or more."""
    while True:
        angles = rng.uniform(0.0, 2.0 * np.pi) - np.arange(4) * np.pi / 2.0 + rng.uniform(-0.45, 0.45, 4)
        radii = rng.uniform(60.0, 125.0, 4)
        corners = np.column_stack([np.cos(angles), np.sin(angles)]) * radii[:, None] + SIZE_PX / 2.0
        corners += rng.uniform(-10.0, 10.0, 2)
        sides = np.roll(corners, -1, axis=0) - corners
        lengths = np.linalg.norm(sides, axis=1)
        before = np.roll(sides, 1, axis=0)
        sines = (before[:, 0] * sides[:, 1] - before[:, 1] * sides[:, 0]) / lengths / np.roll(lengths, 1)
        if lengths.min() > 50.0 and (sines < -np.sin(np.radians(40.0))).all():
            return corners


def area_coverage(polygon: FloatArray) -> FloatArray:
    """Return the share of each pixel of a scene that lies in a convex polygon.

    Args:
        polygon: (V, 2) px, counter-clockwise as seen.

    Returns:
        (320, 320), 0 to 1, to 1/256 of a pixel along the edges.
    """
    sides = np.roll(polygon, -1, axis=0) - polygon
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.linalg.norm(sides, axis=1)[:, None]
    offsets = -(normals * polygon).sum(axis=1)
    y, x = np.mgrid[:SIZE_PX, :SIZE_PX].astype(np.float64)
    depth = (normals[:, 0, None, None] * x + normals[:, 1, None, None] * y + offsets[:, None, None]).min(axis=0)
    inside: FloatArray = (depth > 0).astype(np.float64)
    rows, columns = np.nonzero(np.abs(depth) < 1.5)
    steps = (np.arange(_SUPERSAMPLING) + 0.5) / _SUPERSAMPLING - 0.5
    sub_y, sub_x = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    at_x, at_y = columns[:, None] + sub_x, rows[:, None] + sub_y
    within = np.ones(at_x.shape, dtype=bool)
    for (a, b), c in zip(normals, offsets, strict=True):
        within &= a * at_x + b * at_y + c > 0
    inside[rows, columns] = within.mean(axis=1)
    return inside


def _texture(rng: np.random.Generator, coarse_px: float, amplitude: float) -> FloatArray:
    """Return smooth random shading with a standard deviation of `amplitude`."""
    field = cv2.GaussianBlur(rng.normal(0.0, 1.0, (SIZE_PX, SIZE_PX)), (0, 0), coarse_px)
    shading: FloatArray = field * (amplitude / field.std())
    return shading


def _with_sand(rng: np.random.Generator, picture: FloatArray, corners: FloatArray, ground: float) -> FloatArray:
    """Lay 4 to 7 ragged blobs of sand over the outline, one of them over a corner."""
    sides = np.roll(corners, -1, axis=0) - corners
    blobs = int(rng.integers(4, 8))
    side = rng.integers(0, 4, blobs)
    centres = corners[side] + rng.uniform(0.05, 0.95, (blobs, 1)) * sides[side]
    centres[0] = corners[rng.integers(0, 4)]
    y, x = np.mgrid[:SIZE_PX, :SIZE_PX].astype(np.float64)
    ragged = _texture(rng, coarse_px=2.5, amplitude=0.35)
    cover = np.zeros_like(picture)
    for centre in centres + rng.normal(0.0, 3.0, centres.shape):
        radius = rng.uniform(4.0, 12.0)
        depth = (1.0 - np.hypot(x - centre[0], y - centre[1]) / radius + ragged) * radius
        cover = np.maximum(cover, np.clip(depth + 0.5, 0.0, 1.0))
    sand = ground + rng.uniform(-10.0, 40.0) + rng.normal(0.0, 5.0, picture.shape)
    return picture + cover * (sand - picture)


def _with_distractors(rng: np.random.Generator, picture: FloatArray, corners: FloatArray, *, under: bool) -> FloatArray:
    """Lay straight bars through the box: four under the reference, one or two over it."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    for _ in range(4 if under else int(rng.integers(1, 3))):
        centre, angle = rng.uniform(low, high), rng.uniform(0.0, np.pi)
        along = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([along[1], -along[0]]) * rng.uniform(1.0, 8.0)
        along = along * rng.uniform(40.0, 150.0)
        bar = centre + np.array([across - along, -across - along, along - across, across + along])
        shade = rng.uniform(10.0, 32.0) * rng.choice([-1.0, 1.0])
        picture = picture + area_coverage(bar) * shade
    return picture
