"""The meshes of an excavator's undercarriage and of what swings on it, for one size."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff_sim.machines.excavator_sizes import ExcavatorSize
from standoff_sim.machines.machine_parts import (
    Crawler,
    beacon,
    beam,
    cab,
    exhaust,
    grille,
    handrail,
    hull,
    ladder,
    lamp,
    mirror,
    moulded,
    wheel,
)
from standoff_sim.machines.paint import BLACK, DARK_GREY, RED_LAMP
from standoff_sim.solids.mesh import Mesh, Surface, box, cylinder, join, profile, rotation, toned, tube

Rectangle = tuple[float, float, float, float]
"""x from, x to, y from, y to."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyMeshes:
    """What is rigid from the swing bearing up, each mesh with a tint of its own, origin on the ground under it."""

    panels: Mesh
    counterweight: Mesh
    cab: Mesh
    deck: Mesh


def _corners(rectangle: Rectangle) -> list[tuple[float, float]]:
    x0_m, x1_m, y0_m, y1_m = rectangle
    return [(x0_m, y0_m), (x1_m, y0_m), (x1_m, y1_m), (x0_m, y1_m)]


def _block(rectangle: Rectangle, bottom_m: float, top_m: float, chamfer_m: float) -> Mesh:
    return moulded(_corners(rectangle), bottom_m, top_m, chamfer_m, None)


def _plate(rectangle: Rectangle, z_m: float, colour: tuple[float, float, float]) -> Mesh:
    x0_m, x1_m, y0_m, y1_m = rectangle
    flat = box((x1_m - x0_m, y1_m - y0_m, 0.02), colour)
    return flat.at((x0_m + x1_m) / 2, (y0_m + y1_m) / 2, z_m)


def foot_of(size: ExcavatorSize) -> tuple[float, float, float]:
    """Return the boom foot in the upper structure's frame: beside the cab, ahead of the swing axis."""
    cab_side_m = size.half_m - cab_width_m(size)
    y_m = min(0.0, cab_side_m - 0.06 - size.boom_width_m / 2)
    return 0.04 * size.base_m, y_m, size.deck_m + 0.36 * (size.hood_m - size.deck_m) + 0.35


def cab_width_m(size: ExcavatorSize) -> float:
    """Return the cab's width."""
    return 0.98 if size.half_m > 1.15 else 0.92


@lru_cache(maxsize=32)
def body_meshes(size: ExcavatorSize) -> BodyMeshes:
    """Build the upper structure of a size."""
    cab_front_m, width_m = size.cab_front_m, cab_width_m(size)
    floor_m = size.deck_m + 0.2
    shell = cab(
        size.cab_length_m, width_m, size.cab_m - floor_m + 0.08, slant_m=0.28 if size.rounded else 0.16, sill=0.3
    )
    centre = (cab_front_m - size.cab_length_m / 2, size.half_m - width_m / 2 - 0.01, floor_m - 0.08)
    lamps = [lamp().at(cab_front_m - 0.28, centre[1] + y_m, size.cab_m + 0.05) for y_m in (-0.3, 0.3)]
    flash = beacon().at(centre[0] - 0.5, centre[1] + 0.25, size.cab_m - 0.01)
    wing = mirror(0.22, left=True).at(cab_front_m - 0.1, size.half_m, size.cab_m - 0.5)
    return BodyMeshes(
        panels=join([*_hood(size), *_right_side(size), *_boom_bracket(size)]),
        counterweight=_counterweight(size),
        cab=join([shell.at(*centre), *lamps, flash, wing]),
        deck=join(_deck(size)),
    )


def _deck(size: ExcavatorSize) -> list[Mesh]:
    front_m, half_m, z_m = size.cab_front_m, size.half_m, size.deck_m
    plate = box((front_m + 0.75 * size.tail_m, 2 * half_m - 0.06, 0.2), None)
    side_m = half_m - cab_width_m(size)
    valves = box((0.55, 0.4, 0.3), BLACK, Surface.STEEL)
    hoses = [
        tube([(0.0, y_m, z_m + 0.4), (0.45 * front_m, y_m, z_m + 0.55), (0.8 * front_m, y_m, z_m + 0.25)], 0.035, BLACK,
             Surface.RUBBER, sections=5)
        for y_m in (side_m - 0.08, side_m - 0.2)
    ]  # fmt: skip
    bearing = cylinder(0.42 * size.half_m + 0.1, 0.12, None, sections=20)
    return [
        plate.at((front_m - 0.75 * size.tail_m) / 2, 0.0, z_m),
        valves.at(-0.25, side_m - 0.3, z_m + 0.2),
        bearing.at(0.0, 0.0, z_m - 0.04),
        *hoses,
    ]


def _hood(size: ExcavatorSize) -> list[Mesh]:
    half_m, hood_m, floor_m = size.half_m, size.hood_m, size.deck_m + 0.18
    rear_m, front_m = -0.7 * size.tail_m, size.cab_front_m - size.cab_length_m - 0.04
    chamfer_m = 0.16 if size.rounded else 0.05
    main = _block((rear_m, front_m, -half_m, half_m), floor_m, hood_m, chamfer_m)
    inner = (rear_m + 0.1, front_m - 0.08, -0.62 * half_m, 0.5 * half_m)
    bonnet = toned(_block(inner, hood_m - 0.02, hood_m + 0.13, 0.09 if size.rounded else 0.04), 0.93)
    length_m, middle_m = front_m - rear_m, (front_m + rear_m) / 2
    vent = _plate((middle_m - 0.2 * length_m, middle_m + 0.25 * length_m, -0.1 * half_m, 0.36 * half_m), hood_m + 0.12,
                  DARK_GREY)  # fmt: skip
    height_m = hood_m - floor_m
    left = grille(0.55 * length_m, 0.55 * height_m).at(middle_m, half_m, floor_m + 0.5 * height_m)
    right = grille(0.4 * length_m, 0.4 * height_m).moved(rotation("z", 180.0))
    gap = _plate((rear_m - 0.02, rear_m + 0.03, -0.97 * half_m, 0.97 * half_m), hood_m - 0.005, BLACK)
    parts = [main, bonnet, vent, left, right.at(middle_m, -half_m, floor_m + 0.55 * height_m), gap]
    parts.append(exhaust(0.42).at(rear_m + 0.2, -0.45 * half_m, hood_m + 0.05))
    if size.railed:
        z_m = hood_m + 0.5
        for y_m in (-half_m + 0.06, half_m - 0.06):
            path = [(rear_m + 0.05, y_m, z_m), (middle_m, y_m, z_m), (front_m - 0.05, y_m, z_m)]
            parts.append(handrail(path, None, floor_m=hood_m - 0.03))
    return parts


def _right_side(size: ExcavatorSize) -> list[Mesh]:
    half_m, hood_m, floor_m = size.half_m, size.hood_m, size.deck_m + 0.18
    back_m, front_m = size.cab_front_m - size.cab_length_m - 0.02, size.cab_front_m
    inner_m = -half_m + min(0.85, 0.62 * half_m)
    chamfer_m = 0.1 if size.rounded else 0.04
    step_m, box_m = 0.3 * front_m, floor_m + 0.5 * (hood_m - floor_m)
    tank = toned(_block((back_m, step_m, -half_m, inner_m), floor_m, hood_m - 0.06, chamfer_m), 1.04)
    tools = _block((step_m + 0.02, front_m - 0.12, -half_m, inner_m - 0.06), floor_m, box_m, chamfer_m)
    grip = _plate((back_m + 0.08, step_m - 0.1, -half_m + 0.14, inner_m - 0.1), hood_m - 0.07, DARK_GREY)
    tread = _plate((step_m + 0.1, front_m - 0.25, -half_m + 0.12, inner_m - 0.16), box_m - 0.01, DARK_GREY)
    y_m, top_m = -half_m + 0.05, hood_m + 0.45
    path = [(front_m - 0.2, y_m, box_m + 0.5), (step_m - 0.05, y_m, top_m), (back_m + 0.1, y_m, top_m)]
    rail = handrail(path, None, floor_m=box_m - 0.05)
    cap = cylinder(0.09, 0.08, BLACK, Surface.PLASTIC, sections=10).at(back_m + 0.25, -half_m + 0.22, hood_m - 0.03)
    wing = mirror(0.14, left=False).at(front_m - 0.2, -half_m + 0.05, box_m + 0.55)
    light = lamp(0.14).at(front_m - 0.1, -half_m + 0.3, floor_m + 0.2)
    return [tank, tools, grip, tread, rail, cap, wing, light]


def _boom_bracket(size: ExcavatorSize) -> list[Mesh]:
    x_m, y_m, z_m = foot_of(size)
    low_m = size.deck_m + 0.15
    outline = [(x_m - 0.5, low_m), (x_m + 0.75, low_m), (x_m + 0.6, low_m + 0.2), (x_m + 0.18, z_m + 0.12)]
    outline += [(x_m, z_m + 0.19), (x_m - 0.18, z_m + 0.1)]
    plates = [
        profile(outline, 0.07, None).at(0.0, y_m + side * (size.boom_width_m / 2 + 0.05), 0.0) for side in (-1, 1)
    ]
    return [*plates, cylinder(0.09, size.boom_width_m + 0.22, None, axis="y", sections=10).at(x_m, y_m, z_m)]


def _counterweight(size: ExcavatorSize) -> Mesh:
    tail_m, half_m = size.tail_m, size.half_m
    front_m = -0.7 * tail_m - 0.02
    if size.rounded:
        widest = np.arcsin(min(half_m / tail_m, 0.96))
        angles = np.linspace(-widest, widest, 11)
        arc = [(float(-tail_m * np.cos(a)), float(half_m * np.sin(a) / np.sin(widest))) for a in angles]
    else:
        arc = [(-0.84 * tail_m, -half_m), (-0.95 * tail_m, -0.8 * half_m), (-tail_m, -0.4 * half_m)]
        arc += [(x_m, -y_m) for x_m, y_m in reversed(arc)]
    arc = [(min(x_m, front_m - 0.02), y_m) for x_m, y_m in arc]
    outline = [(front_m, half_m), (front_m, -half_m), *arc]
    bottom_m, top_m = size.deck_m + 0.02, size.hood_m - (0.02 if size.rounded else 0.1)
    chamfer_m = 0.2 if size.rounded else 0.07
    body = moulded(outline, bottom_m + 0.12, top_m, chamfer_m, None)
    belly = moulded([(0.96 * x_m, 0.95 * y_m) for x_m, y_m in outline], bottom_m, bottom_m + 0.2, 0.02, None)
    extras = [box((0.16, 0.05, 0.12), None).at(-0.82 * tail_m, side * 0.5 * half_m, top_m - 0.03) for side in (-1, 1)]
    if not size.rounded:
        red = box((0.04, 0.22, 0.1), RED_LAMP, Surface.GLASS)
        extras += [red.at(-0.965 * tail_m, side * 0.7 * half_m, bottom_m + 0.3) for side in (-1, 1)]
    return join([body, toned(belly, 0.6), *extras])


def crawler_of(size: ExcavatorSize) -> Crawler:
    """Return the crawler of a size."""
    return Crawler(size.base_m, size.gear_m, size.shoe_m, round(size.base_m * 10.2))


@lru_cache(maxsize=32)
def crawler_meshes(size: ExcavatorSize) -> tuple[Mesh, Mesh]:
    """Build one shoe and one crawler frame."""
    crawler = crawler_of(size)
    return crawler.shoe(), crawler.frame()


@lru_cache(maxsize=32)
def wheel_mesh(size: ExcavatorSize) -> Mesh:
    """Build a pair of tyres of a wheeled excavator."""
    single = wheel(size.gear_m / 2, 0.46 * size.shoe_m, None, sections=16)
    return join([single.at(0.0, side * 0.26 * size.shoe_m, 0.0) for side in (-1.0, 1.0)])


@lru_cache(maxsize=32)
def undercarriage_mesh(size: ExcavatorSize) -> Mesh:
    """Build what joins crawlers or axles to the swing bearing."""
    gauge_m, gear_m = size.width_m - size.shoe_m, size.gear_m
    top_m = size.deck_m - 0.1
    hub = cylinder(0.42 * size.half_m + 0.18, 0.14, None, sections=20).at(0.0, 0.0, top_m)
    parts = [hub]
    if size.wheeled:
        parts += _wheeled_chassis(size)
    else:
        middle = hull(
            [(x, y, z) for z, k in ((0.42 * gear_m, 0.5), (top_m, 0.34)) for x in (-k * gauge_m, k * gauge_m)
             for y in (-0.36 * gauge_m, 0.36 * gauge_m)],
            None,
        )  # fmt: skip
        legs = [
            beam((sx * 0.15 * size.base_m, sy * 0.2 * gauge_m, top_m - 0.16),
                 (sx * 0.27 * size.base_m, sy * 0.46 * gauge_m, 0.62 * gear_m), (0.3, 0.22), None)
            for sx in (-1, 1) for sy in (-1, 1)
        ]  # fmt: skip
        parts += [middle, *legs]
    if size.bladed:
        parts += _blade(size)
    return join(parts)


def _wheeled_chassis(size: ExcavatorSize) -> list[Mesh]:
    radius_m, top_m = size.gear_m / 2, size.deck_m - 0.1
    reach_m = size.base_m / 2 - radius_m
    frame = box((size.base_m - 0.1, 0.85, top_m - radius_m - 0.02), None).at(0.0, 0.0, radius_m + 0.02)
    axles = [cylinder(0.16, size.width_m - 0.5, None, axis="y", sections=10).at(x_m, 0.0, radius_m)
             for x_m in (-reach_m, reach_m)]  # fmt: skip
    chests = []
    for side in (-1.0, 1.0):
        length_m = 2 * reach_m - size.gear_m - 0.2
        chest = box((length_m, 0.62, 0.45), None).at(0.0, side * (size.width_m / 2 - 0.34), 0.5)
        chests += [chest, ladder((0.0, side * (size.width_m / 2 - 0.06), 0.4), 0.55, 0.5, BLACK, steps=3)]
    return [frame, *axles, *chests]


def _blade(size: ExcavatorSize) -> list[Mesh]:
    x_m, low_m = size.base_m / 2 + 0.18, 0.32
    curve = [(x_m + 0.1, low_m), (x_m + 0.16, low_m), (x_m + 0.08, low_m + 0.25), (x_m + 0.14, low_m + 0.52)]
    curve += [(x_m + 0.08, low_m + 0.52), (x_m, low_m + 0.25)]
    plate = profile(curve, size.width_m - 0.02, None)
    arms = [beam((0.2 * size.base_m, y_m, 0.55), (x_m + 0.05, y_m, low_m + 0.25), (0.14, 0.16), None)
            for y_m in (-0.42, 0.42)]  # fmt: skip
    return [plate, *arms]


def wheel_places(size: ExcavatorSize) -> list[tuple[float, float, float]]:
    """Return the centres of the four pairs of tyres."""
    x_m, y_m = (size.base_m - size.gear_m) / 2, (size.width_m - size.shoe_m) / 2
    return [(sx * x_m, sy * y_m, size.gear_m / 2) for sx in (-1, 1) for sy in (-1, 1)]
