"""What people carry and work with, and where their hands are then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.people.gait import ease
from standoff_sim.solids.mesh import (
    Colour,
    Mesh,
    Surface,
    ball,
    box,
    crossed,
    cylinder,
    join,
    lathe,
    profile,
    rotation,
    slab,
    srgb,
    translation,
    tube,
)  # fmt: skip

_WOOD = srgb("#b08d57")
_STEEL = srgb("#75716b")
_RUST = srgb("#6e4630")
_SHAFT_M = 1.45
_BARROW_AXLE_M = 1.28
_BUCKET_M = 0.34
_FIST_M = 0.08
_LAID_M = 0.16


@dataclass(frozen=True, slots=True, eq=False)
class Bearer:
    """The upper body that carries.

    Attributes:
        chest: (4, 4) unscaled frame at the waist, leaning and turned with the trunk.
        heading: (3, 3) upright axes that share the chest's turn.
        stature_m: Of the person.
        shoulders_m: (2, 3), left first.
        beat_m: (3,) how far the hands are off their rest in a cyclic movement, chest axes.
    """

    chest: FloatArray
    heading: FloatArray
    stature_m: float
    shoulders_m: FloatArray
    beat_m: FloatArray

    def at_chest(self, x: float, y: float, z: float) -> FloatArray:
        """Return the (3,) place of a point given in the chest's axes, as shares of the stature."""
        local_m = np.array([x, y, z]) * self.stature_m
        return self.chest[:3, :3] @ local_m + self.chest[:3, 3]

    def upright(self, origin_m: FloatArray) -> FloatArray:
        """Return the (4, 4) upright frame at a point."""
        frame = np.eye(4)
        frame[:3, :3] = self.heading
        frame[:3, 3] = origin_m
        return frame


Grip = tuple[FloatArray | None, FloatArray]
"""Pose (4, 4) of the thing, None without one, and the wrists (2, 3); NaN where the arm stays free."""


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """Something to carry or to work with.

    Attributes:
        name: Of the kind.
        mesh: Its look, frame as the hold has it; None for bare hands.
        hold: Where it and the wrists are.
        tints: Colours to choose from.
        share: How often it is met.
    """

    name: str
    mesh: Callable[[], Mesh] | None
    hold: Callable[[Bearer], Grip]
    tints: tuple[Colour, ...]
    share: float


def hold_low(bearer: Bearer) -> Grip:
    """Work with bare hands in front of the belly."""
    left, right = bearer.at_chest(0.19, 0.07, 0.03), bearer.at_chest(0.20, -0.07, 0.05)
    beat_m = bearer.chest[:3, :3] @ bearer.beat_m
    return None, np.array([left - 0.4 * beat_m, right + beat_m])


def hold_shouldered(bearer: Bearer) -> Grip:
    """Carry on the right shoulder, a hand at its front; lower it across the feet with both hands when bending."""
    over_m = bearer.shoulders_m[1] + bearer.heading @ np.array([0.02, 0.045, 0.0]) + [0.0, 0.0, 0.07]
    low_m = bearer.at_chest(0.20, 0.0, 0.02)
    low_m[2] = max(low_m[2], _LAID_M)
    lowered = ease((_lean_deg(bearer) - 14.0) / 12.0)
    middle_m = over_m + lowered * (low_m - over_m)
    pose = bearer.upright(middle_m) @ rotation("z", -4.0 + 94.0 * lowered) @ rotation("y", -5.0 * (1.0 - lowered))
    aside_m = bearer.heading @ np.array([-0.06, 0.22, 0.06])
    left_m = middle_m + aside_m if lowered > 0.5 else np.full(3, np.nan)
    right_m = middle_m + bearer.heading @ np.array([0.22, 0.0, -0.02]) * (1.0 - lowered)
    right_m = right_m + lowered * bearer.heading @ np.array([-0.06, -0.22, 0.06])
    return pose, np.array([left_m, right_m])


def _lean_deg(bearer: Bearer) -> float:
    return float(np.rad2deg(np.arccos(np.clip(bearer.chest[2, 2], -1.0, 1.0))))


def hold_hanging(bearer: Bearer) -> Grip:
    """Carry by a handle in the hanging right hand, or have it stand on the ground when bending down."""
    wrist_m = bearer.shoulders_m[1] + bearer.heading @ np.array([0.03, -0.06, 0.0]) * bearer.stature_m / 1.75
    wrist_m[2] = max(wrist_m[2] - 0.315 * bearer.stature_m, _BUCKET_M + _FIST_M)
    return bearer.upright(wrist_m - [0.0, 0.0, _FIST_M]), np.array([np.full(3, np.nan), wrist_m])


def hold_trailing(bearer: Bearer) -> Grip:
    """Carry a long thing level in the hanging right hand."""
    pose, wrists_m = hold_hanging(bearer)
    return pose @ rotation("y", 8.0) if pose is not None else None, wrists_m


def hold_before_belly(bearer: Bearer) -> Grip:
    """Carry a box in both hands."""
    wrists_m = np.array([bearer.at_chest(0.16, side * 0.12, 0.015) for side in (1.0, -1.0)])
    middle_m = wrists_m.mean(axis=0) + bearer.heading @ np.array([0.12, 0.0, 0.0])
    middle_m[2] = max(middle_m[2] - 0.10, 0.0)
    return bearer.upright(middle_m), wrists_m


def hold_to_read(bearer: Bearer) -> Grip:
    """Hold a plan or tablet before the chest."""
    wrists_m = np.array([bearer.at_chest(0.15, side * 0.09, 0.07) for side in (1.0, -1.0)])
    middle_m = wrists_m.mean(axis=0) + bearer.heading @ np.array([0.13, 0.0, 0.03])
    return bearer.upright(middle_m) @ rotation("y", -35.0), wrists_m


def _hold_shaft(bearer: Bearer, top_m: FloatArray, share: float) -> Grip:
    """Hold a long-handled tool whose end rests on the ground ahead: one hand on top, one `share` of the way down."""
    length_m = min(_SHAFT_M, max(top_m[2] * 1.4, 0.6))
    ahead_m = np.sqrt(max(length_m**2 - top_m[2] ** 2, 0.0))
    ahead = bearer.heading @ np.array([0.97, 0.243, 0.0])
    down = ahead * ahead_m - [0.0, 0.0, top_m[2] - 0.02]
    down /= np.linalg.norm(down)
    tail_m = top_m - down * (_SHAFT_M - length_m)
    side = np.array([-ahead[1], ahead[0], 0.0])
    side /= np.linalg.norm(side)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([crossed(side, -down), side, -down])
    pose[:3, 3] = tail_m
    return pose, np.array([top_m + down * share * length_m, top_m])


def hold_to_dig(bearer: Bearer) -> Grip:
    """Dig, rake or sweep."""
    beat_m = bearer.chest[:3, :3] @ bearer.beat_m
    return _hold_shaft(bearer, bearer.at_chest(0.14, -0.08, 0.06) + beat_m, 0.38)


def hold_to_lean(bearer: Bearer) -> Grip:
    """Stand leaning on a tool, both hands on its end."""
    return _hold_shaft(bearer, bearer.at_chest(0.17, -0.01, 0.11), 0.05)


def hold_barrow(bearer: Bearer) -> Grip:
    """Push a wheelbarrow: it stands on the ground however the body leans."""
    ground_m = bearer.chest[:3, 3] * [1.0, 1.0, 0.0]
    pose = bearer.upright(ground_m)
    wrists_m = np.array([(pose @ [0.16, side * 0.27, 0.70, 1.0])[:3] for side in (1.0, -1.0)])
    return pose, wrists_m


@lru_cache(maxsize=4)
def plank(length_m: float) -> Mesh:
    """Return a board along x."""
    return box((length_m, 0.2, 0.04), None, Surface.WOOD)


@lru_cache(maxsize=4)
def timber(length_m: float) -> Mesh:
    """Return two squared timbers along x."""
    beam = box((length_m, 0.08, 0.08), None, Surface.WOOD)
    return join([beam.at(0.0, 0.045, 0.0), beam.at(0.06, -0.045, 0.0)])


@lru_cache(maxsize=4)
def bars(length_m: float) -> Mesh:
    """Return a few reinforcing bars along x that sag at their ends."""
    along = np.linspace(-0.5, 0.5, 5) * length_m
    offsets_m = ((0.0, 0.0), (0.022, 0.006), (-0.02, 0.008), (0.008, 0.024), (-0.012, 0.026), (0.03, 0.02))
    paths_m = [np.column_stack([along + 20.0 * y, y + 0.004 * along, z - 0.05 * along**2]) for y, z in offsets_m]
    return join([tube(path_m, 0.009, None, Surface.RUST, sections=5) for path_m in paths_m])


@lru_cache(maxsize=2)
def pipe(length_m: float) -> Mesh:
    """Return a scaffold tube or drain pipe along x."""
    return cylinder(0.045, length_m, None, Surface.PLASTIC, axis="x", sections=10)


@lru_cache(maxsize=1)
def sack() -> Mesh:
    """Return a bag of cement, lying along x."""
    return ball((0.31, 0.20, 0.09), None, Surface.FABRIC, detail=1).at(-0.05, 0.0, 0.05)


@lru_cache(maxsize=1)
def bucket() -> Mesh:
    """Return a builder's bucket that hangs from the origin."""
    pail = lathe(
        ((0.0, -0.30), (0.115, -0.30), (0.15, -0.02), (0.14, -0.02), (0.13, -0.06), (0.0, -0.06)), None, sections=12
    )
    bail = tube(
        [[0.0, 0.15, -0.03], [0.0, 0.07, 0.06], [0.0, -0.07, 0.06], [0.0, -0.15, -0.03]], 0.006, _STEEL, sections=4
    )
    return join([pail.at(0.0, 0.0, -0.04), bail.at(0.0, 0.0, -0.04)])


@lru_cache(maxsize=1)
def crate() -> Mesh:
    """Return a box, its origin at the bottom."""
    return box((0.32, 0.42, 0.27), None, Surface.PLASTIC)


@lru_cache(maxsize=1)
def plan() -> Mesh:
    """Return an opened drawing or a clipboard, flat."""
    return box((0.34, 0.46, 0.012), None, Surface.FABRIC)


@lru_cache(maxsize=1)
def shovel() -> Mesh:
    """Return a shovel hanging down -z from its handle."""
    shaft = cylinder(0.017, _SHAFT_M - 0.25, _WOOD, Surface.WOOD, sections=6).at(0.0, 0.0, -(_SHAFT_M - 0.25) / 2)
    blade = slab([(-0.12, 0.0), (0.12, 0.0), (0.125, 0.2), (0.0, 0.31), (-0.125, 0.2)], 0.008, None, Surface.STEEL)
    turned = blade.moved(translation(0.0, 0.0, -_SHAFT_M + 0.31) @ rotation("z", 90.0) @ rotation("x", -90.0))
    return join([shaft, turned])


@lru_cache(maxsize=1)
def rake() -> Mesh:
    """Return a broad rake or screed hanging down -z from its handle."""
    shaft = cylinder(0.016, _SHAFT_M, _WOOD, Surface.WOOD, sections=6).at(0.0, 0.0, -_SHAFT_M / 2)
    return join([shaft, box((0.06, 0.62, 0.05), None, Surface.STEEL).at(0.0, 0.0, -_SHAFT_M)])


@lru_cache(maxsize=1)
def barrow() -> Mesh:
    """Return a loaded wheelbarrow ahead of its pusher."""
    tray = profile([(0.50, 0.62), (0.62, 0.38), (1.12, 0.34), (1.42, 0.60)], 0.62, None, Surface.PAINT)
    load = ball((0.40, 0.27, 0.13), srgb("#8d7a60"), Surface.SOIL, detail=1).at(0.95, 0.0, 0.60)
    wheel = cylinder(0.19, 0.09, srgb("#1c1b1a"), Surface.RUBBER, axis="y", sections=12).at(_BARROW_AXLE_M, 0.0, 0.19)
    handles_m = [
        [[0.12, side * 0.29, 0.68], [0.70, side * 0.24, 0.40], [_BARROW_AXLE_M, side * 0.07, 0.19]]
        for side in (1.0, -1.0)
    ]
    rails = [tube(path_m, 0.018, _STEEL, sections=5) for path_m in handles_m]
    legs = [
        tube([[0.62, side * 0.25, 0.40], [0.58, side * 0.26, 0.14]], 0.015, _STEEL, sections=4) for side in (1.0, -1.0)
    ]
    return join([tray, load, wheel, *rails, *legs])


_BOARDS = tuple(srgb(code) for code in ("#c9a56b", "#a98a5e", "#8b7a62", "#d2b98a", "#b5651d"))
_BRIGHT = tuple(srgb(code) for code in ("#c98a1a", "#7a2a20", "#2c4f7c", "#6d7f78", "#1f1f1f", "#d8d4c8"))
_METALS = (_RUST, _STEEL, srgb("#8a8781"))

LOADS: tuple[Load, ...] = (
    Load("bare hands", None, hold_low, _BRIGHT, 0.22),
    Load("plank", lambda: plank(2.4), hold_shouldered, _BOARDS, 0.06),
    Load("timber", lambda: timber(2.0), hold_shouldered, _BOARDS, 0.06),
    Load("bars", lambda: bars(2.8), hold_shouldered, (_RUST,), 0.06),
    Load("pipe", lambda: pipe(2.2), hold_trailing, (*_METALS, srgb("#c8641e"), srgb("#9a9a96")), 0.05),
    Load("sack", sack, hold_shouldered, (srgb("#cfc8b8"), srgb("#b9a98a"), srgb("#e2ddd0")), 0.06),
    Load("bucket", bucket, hold_hanging, _BRIGHT, 0.08),
    Load("box", crate, hold_before_belly, (*_BRIGHT, srgb("#a27c4d")), 0.09),
    Load("plan", plan, hold_to_read, (srgb("#e6e4dc"), srgb("#26282b")), 0.06),
    Load("shovel", shovel, hold_to_dig, _METALS, 0.11),
    Load("rake", rake, hold_to_dig, _METALS, 0.06),
    Load("leaning on a shovel", shovel, hold_to_lean, _METALS, 0.05),
    Load("wheelbarrow", barrow, hold_barrow, _BRIGHT, 0.04),
)
