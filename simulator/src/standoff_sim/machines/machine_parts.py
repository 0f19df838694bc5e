"""What machines are assembled from: tyres, crawlers, cabs, rails, hydraulic cylinders, lamps, scoops.

Every function returns a fresh mesh: cache whole machines, since meshes are compared by identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
import trimesh

from standoff.core.homography import FloatArray
from standoff_sim.machines.paint import AMBER, BLACK, CHROME, DARK_GREY, GLASS, LAMP, RUBBER
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import (
    Colour,
    Mesh,
    Surface,
    box,
    crossed,
    cylinder,
    join,
    lathe,
    profile,
    rotation,
    translation,
    tube,
)

Point = tuple[float, float, float]


def strut_pose(start_m: FloatArray | Point, end_m: FloatArray | Point) -> FloatArray:
    """Return the (4, 4) pose at `start_m` whose x axis points at `end_m`; y is level and never to the right."""
    start, end = np.asarray(start_m, dtype=np.float64), np.asarray(end_m, dtype=np.float64)
    ahead = (end - start) / np.linalg.norm(end - start)
    left = np.array([-ahead[1], ahead[0], 0.0]) if np.hypot(ahead[0], ahead[1]) > 1e-6 else np.array([0.0, 1.0, 0.0])
    left /= np.linalg.norm(left) if left[1] >= 0.0 else -np.linalg.norm(left)
    pose = np.eye(4)
    pose[:3] = np.column_stack([ahead, left, crossed(ahead, left), start])
    return pose


def hull(points_m: FloatArray | Sequence[Point], colour: Colour | None, surface: Surface = Surface.PAINT) -> Mesh:
    """Return the convex hull of (N, 3) points: castings, hoods, roofs."""
    return Mesh.of(trimesh.convex.convex_hull(np.asarray(points_m, dtype=np.float64)), colour, surface)


def moulded(
    outline_xy_m: Sequence[tuple[float, float]], bottom_m: float, top_m: float, chamfer_m: float, colour: Colour | None
) -> Mesh:
    """Return a convex body seen from above, its upper edge broken by a chamfer: engine hoods, counterweights."""
    inner = shapely.Polygon(outline_xy_m).buffer(-chamfer_m, join_style="mitre")
    outer_xy, inner_xy = np.array(outline_xy_m), np.array(inner.exterior.coords)
    layers = ((outer_xy, bottom_m), (outer_xy, top_m - chamfer_m), (inner_xy, top_m))
    return hull(np.concatenate([np.column_stack([xy, np.full(len(xy), z_m)]) for xy, z_m in layers]), colour)


def beam(
    start_m: Point, end_m: Point, size_m: tuple[float, float], colour: Colour | None, surface: Surface = Surface.PAINT
) -> Mesh:
    """Return a square bar between two points.

    Args:
        start_m: Middle of one end.
        end_m: Middle of the other end.
        size_m: Width and height of its section.
        colour: Or None for the tint.
        surface: Of the bar.
    """
    length_m = float(np.linalg.norm(np.subtract(end_m, start_m)))
    bar = box((length_m, size_m[0], size_m[1]), colour, surface).at(length_m / 2, 0.0, -size_m[1] / 2)
    return bar.moved(strut_pose(start_m, end_m))


def wheel(
    radius_m: float, width_m: float, hub: Colour | None, *, lugs: int = 0, sections: int = 24, rim: float = 0.55
) -> Mesh:
    """Return a wheel that rolls about y, centred at the origin.

    Args:
        radius_m: Of the tread, lugs included.
        width_m: Of the tyre.
        hub: Colour of rim and hub; None for the tint.
        lugs: Tread bars on each shoulder; 0 for a road tyre.
        sections: Of its roundness.
        rim: Radius of the rim as a share of the tyre's.
    """
    crown = 0.95 if lugs else 1.0
    tyre_rz = [(rim, -0.42), (0.78 * crown, -0.5), (0.94 * crown, -0.47), (crown, -0.36)]
    tyre_rz += [(radius, -z) for radius, z in reversed(tyre_rz)] + [tyre_rz[0]]
    hub_rz = [(0.0, -0.32), (0.2, -0.32), (0.24, -0.18), (0.48, -0.22), (rim, -0.44)]
    hub_rz += [(radius, -z) for radius, z in reversed(hub_rz)]
    tyre = lathe([(r * radius_m, z * width_m) for r, z in tyre_rz], RUBBER, Surface.RUBBER, sections=sections)
    disc = lathe([(r * radius_m, z * width_m) for r, z in hub_rz], hub, Surface.PAINT, sections=sections // 2)
    turn = rotation("x", 90.0)
    return join([tyre.moved(turn), disc.moved(turn), *_lugs(radius_m, width_m, lugs)])


def _lugs(radius_m: float, width_m: float, count: int) -> list[Mesh]:
    if not count:
        return []
    depth_m, length_m = 0.07 * radius_m, 0.54 * width_m
    bar = box((2.6 * radius_m / count, length_m, depth_m), RUBBER, Surface.RUBBER)
    placed = []
    for side in (-1.0, 1.0):
        slanted = rotation("z", -side * 22.0)
        seat = translation(0.0, side * 0.25 * width_m, radius_m - depth_m)
        for turn_deg in np.arange(count) * 360.0 / count + (180.0 / count if side > 0 else 0.0):
            placed.append(bar.moved(rotation("y", float(turn_deg)) @ seat @ slanted))
    return placed


@dataclass(frozen=True, slots=True)
class Crawler:
    """One crawler: it runs along x, stands on z = 0 and is centred on y = 0.

    Attributes:
        length_m: Over all.
        height_m: Over all.
        width_m: Of the shoes.
        shoes: How many.
    """

    length_m: float
    height_m: float
    width_m: float
    shoes: int

    @property
    def _radius_m(self) -> float:
        return self.height_m / 2 - 0.05

    @property
    def _straight_m(self) -> float:
        return self.length_m - self.height_m

    @property
    def pitch_m(self) -> float:
        """Distance from shoe to shoe."""
        return 2.0 * (self._straight_m + np.pi * self._radius_m) / self.shoes

    def shoe(self) -> Mesh:
        """Return one shoe in the tint's colour, its outside up, centred at the chain."""
        half_m = 0.47 * self.pitch_m
        section = [(-half_m, -0.02), (half_m, -0.02), (half_m, 0.02), (0.02, 0.02), (0.0, 0.05), (-half_m, 0.02)]
        return profile(section, self.width_m, None, Surface.STEEL)

    def shoe_poses(self, travel_m: float = 0.0) -> FloatArray:
        """Return (shoes, 4, 4) poses of all shoes when the machine has gone `travel_m` forwards."""
        straight_m, radius_m = self._straight_m, self._radius_m
        bend_m = np.pi * radius_m
        along_m = (np.arange(self.shoes) * self.pitch_m + travel_m) % (self.shoes * self.pitch_m)
        lap_m = straight_m + bend_m
        # The chain is point-symmetric: the upper run forwards and the front bend, then the same turned by 180 degrees.
        lower, along_m = along_m >= lap_m, along_m % lap_m
        angle = np.maximum(along_m - straight_m, 0.0) / radius_m
        x_m = -straight_m / 2 + np.minimum(along_m, straight_m) + radius_m * np.sin(angle)
        z_m = radius_m * np.cos(angle)
        sign = np.where(lower, -1.0, 1.0)
        cosine, sine = sign * np.cos(angle), sign * np.sin(angle)
        poses = np.tile(np.eye(4), (self.shoes, 1, 1))
        poses[:, 0, 0], poses[:, 0, 2], poses[:, 0, 3] = cosine, sine, sign * x_m
        poses[:, 2, 0], poses[:, 2, 2], poses[:, 2, 3] = -sine, cosine, sign * z_m + self.height_m / 2
        return poses

    def frame(self) -> Mesh:
        """Return what the shoes run around: side frame, sprocket behind, idler in front, rollers below and above."""
        middle_m, radius_m, straight_m = self.height_m / 2, self._radius_m, self._straight_m
        half_m = 0.42 * self.width_m
        beam_outline = [
            (-straight_m / 2 - 0.1, middle_m - 0.16),
            (straight_m / 2 + 0.1, middle_m - 0.16),
            (straight_m / 2, middle_m + 0.12),
            (straight_m / 2 - 0.3, middle_m + 0.2),
            (-straight_m / 2, middle_m + 0.2),
        ]
        wheels = [
            cylinder(radius_m - 0.06, half_m, None, Surface.STEEL, axis="y", sections=16).at(x_m, 0.0, middle_m)
            for x_m in (-straight_m / 2, straight_m / 2)
        ]
        hub = cylinder(0.5 * radius_m, 2.1 * half_m, None, Surface.STEEL, axis="y", sections=10)
        low = np.linspace(-straight_m / 2 + 0.45, straight_m / 2 - 0.45, 6)
        rollers = [
            cylinder(0.11, 1.5 * half_m, None, Surface.STEEL, axis="y", sections=8).at(float(x_m), 0.0, 0.19)
            for x_m in low
        ]
        side = profile(beam_outline, 1.3 * half_m, None, Surface.PAINT)
        return join([side, *wheels, hub.at(-straight_m / 2, 0.0, middle_m), *rollers])


def cab(
    length_m: float, width_m: float, height_m: float, *, paint: Colour | None = None, slant_m: float = 0.2,
    roof: Colour | None = None, sill: float = 0.32,
) -> Mesh:  # fmt: skip
    """Return a cab with pillars, dark glass and roof, standing on z = 0, centred in x and y, windscreen at +x.

    Args:
        length_m: At the floor.
        width_m: Over all.
        height_m: Roof included.
        paint: Of panels and pillars; None for the tint.
        slant_m: How far the windscreen leans back.
        roof: Colour of the roof; None for the tint.
        sill: Height of the lower panel as a share of the cab's.
    """
    front_m, back_m, half_m = length_m / 2, -length_m / 2, width_m / 2
    waist_m, eaves_m = sill * height_m, height_m - 0.1
    top_front_m = front_m - slant_m
    inset_m = 0.025
    glass = profile(
        [(back_m + inset_m, waist_m), (front_m - inset_m, waist_m), (top_front_m - inset_m, eaves_m),
         (back_m + inset_m, eaves_m)],
        width_m - 2 * inset_m, GLASS, Surface.GLASS,
    )  # fmt: skip
    panel = profile([(back_m, 0.0), (front_m, 0.0), (front_m, waist_m), (back_m, waist_m)], width_m, paint)
    pillars = []
    for y_m in (-half_m + 0.035, half_m - 0.035):
        for low_x_m, high_x_m, size_m in (
            (front_m - 0.04, top_front_m - 0.04, 0.075),
            (0.1 * length_m, 0.1 * length_m - slant_m / 2, 0.06),
            (back_m + 0.06, back_m + 0.06, 0.13),
        ):
            pillars.append(beam((low_x_m, y_m, waist_m), (high_x_m, y_m, eaves_m), (0.08, size_m), paint))
    roof_outline = [(back_m - 0.03, -half_m), (top_front_m + 0.1, -half_m), (top_front_m + 0.1, half_m)]
    roof_outline.append((back_m - 0.03, half_m))
    lid = moulded(roof_outline, eaves_m - 0.02, height_m, 0.07, roof)
    hatch = box((0.32 * length_m, 0.55 * width_m, 0.02), DARK_GREY, Surface.GLASS)
    return join([panel, glass, *pillars, lid, hatch.at(0.12 * length_m, 0.0, height_m - 0.005)])


def handrail(
    path_m: Sequence[Point], colour: Colour | None, *, floor_m: float | None = None, radius_m: float = 0.022
) -> Mesh:
    """Return a rail along a path, with a post from each corner down to `floor_m` if given."""
    bars = [tube(path_m, radius_m, colour, Surface.PAINT, sections=5)]
    if floor_m is not None:
        bars += [tube([(x, y, floor_m), (x, y, z)], radius_m, colour, Surface.PAINT, sections=5) for x, y, z in path_m]
    return join(bars)


def ladder(foot_m: Point, height_m: float, width_m: float, colour: Colour | None, *, steps: int = 3) -> Mesh:
    """Return steps up a machine's side: rungs along x, seen from y."""
    x_m, y_m, z_m = foot_m
    rises_m = z_m + height_m * np.arange(steps) / max(steps - 1, 1)
    rungs = [box((width_m, 0.16, 0.03), colour, Surface.STEEL).at(x_m, y_m, float(rise_m)) for rise_m in rises_m]
    sides = [
        beam((x_m + side_m, y_m, z_m), (x_m + side_m, y_m, z_m + height_m), (0.04, 0.04), colour)
        for side_m in (-width_m / 2, width_m / 2)
    ]
    return join([*rungs, *sides])


def grille(length_m: float, height_m: float, *, slats: int = 6) -> Mesh:
    """Return a ventilation grille in the xz plane, facing +y, centred at the origin, 3 cm deep."""
    back = box((length_m, 0.015, height_m), BLACK).at(0.0, 0.0, -height_m / 2)
    gap_m = height_m / slats
    bars = [
        box((length_m, 0.03, 0.4 * gap_m), DARK_GREY).at(0.0, 0.008, -height_m / 2 + (i + 0.3) * gap_m)
        for i in range(slats)
    ]
    return join([back, *bars])


def exhaust(height_m: float, radius_m: float = 0.06) -> Mesh:
    """Return a stack standing on z = 0, its mouth bent back."""
    path = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.8 * height_m), (-0.5 * height_m * 0.4, 0.0, height_m)]
    return tube(path, radius_m, BLACK, Surface.STEEL, sections=8)


def lamp(size_m: float = 0.12, colour: Colour = LAMP) -> Mesh:
    """Return a work lamp that shines along +x, centred at the origin."""
    housing = box((0.08, size_m, size_m), BLACK, Surface.PLASTIC).at(-0.04, 0.0, -size_m / 2)
    face = box((0.01, 0.8 * size_m, 0.8 * size_m), colour, Surface.GLASS).at(0.005, 0.0, -0.4 * size_m)
    return join([housing, face])


def beacon() -> Mesh:
    """Return the amber flashing light that stands on a roof."""
    return cylinder(0.055, 0.14, AMBER, Surface.PLASTIC, sections=8).at(0.0, 0.0, 0.07)


def mirror(arm_m: float, *, left: bool) -> Mesh:
    """Return a mirror on its arm, mounted at the origin and reaching `arm_m` out to the side."""
    side = 1.0 if left else -1.0
    arm = tube([(0.0, 0.0, 0.0), (0.05, side * arm_m, 0.0)], 0.014, BLACK, Surface.PLASTIC, sections=5)
    glass = box((0.04, 0.2, 0.3), BLACK, Surface.PLASTIC).at(0.05, side * arm_m, -0.2)
    return join([arm, glass])


@dataclass(frozen=True, slots=True, eq=False)
class Ram:
    """A hydraulic cylinder: barrel and rod, each starting at its own pivot and running along +x towards the other.

    Attributes:
        barrel: Mesh in the tint's colour.
        rod: Mesh of bright steel.
    """

    barrel: Mesh
    rod: Mesh

    @classmethod
    def spanning(cls, shortest_m: float, longest_m: float, radius_m: float) -> Ram:
        """Build one whose pivots come as near as `shortest_m` and part as far as `longest_m`, less than twice that."""
        if longest_m > 1.94 * shortest_m:
            raise ValueError(f"no cylinder spans {shortest_m:.2f} to {longest_m:.2f} m")
        barrel_m = min(0.6 * longest_m, 0.97 * shortest_m)
        rod_m = min(longest_m - barrel_m + 0.05, 0.97 * shortest_m)
        eye = cylinder(1.1 * radius_m, 2.4 * radius_m, None, axis="y", sections=8)
        barrel = cylinder(radius_m, barrel_m, None, Surface.PAINT, axis="x", sections=10)
        rod = cylinder(0.55 * radius_m, rod_m, CHROME, Surface.STEEL, axis="x", sections=8)
        return cls(join([barrel.at(barrel_m / 2, 0.0, 0.0), eye]), join([rod.at(rod_m / 2, 0.0, 0.0), eye]))


def ram_poses(barrel_m: FloatArray, rod_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the poses of barrel and rod of a `Ram` between its two pivots, (3,) each."""
    return strut_pose(barrel_m, rod_m), strut_pose(rod_m, barrel_m)


def scoop(
    shell_xz_m: Sequence[tuple[float, float]], width_m: float, colour: Colour | None, *, teeth: int = 0,
    tooth_m: float = 0.22, plate_m: float = 0.04,
) -> Mesh:  # fmt: skip
    """Return a bucket seen from its left side; the mouth is the straight line from the path's end to its start.

    Args:
        shell_xz_m: The shell from the cutting edge around the bottom to the upper rear edge.
        width_m: Over all, along y.
        colour: Of the plates; None for the tint.
        teeth: Along the cutting edge, pointing on from it; 0 for a smooth edge.
        tooth_m: Their length, added in front of the path's first point.
        plate_m: Thickness.
    """
    path = np.array(shell_xz_m)
    shell = shapely.LineString(path).buffer(plate_m / 2, cap_style="flat", join_style="mitre")
    cheek = shapely.Polygon(path)
    plates = [profile(list(shell.exterior.coords), width_m, colour, Surface.STEEL)]
    for side in (-1.0, 1.0):
        plate = profile(list(cheek.exterior.coords), plate_m, colour, Surface.STEEL)
        plates.append(plate.at(0.0, side * (width_m - plate_m) / 2, 0.0))
    ahead = (path[0] - path[1]) / np.linalg.norm(path[0] - path[1])
    across = np.array([-ahead[1], ahead[0]])
    root = path[0] - 0.06 * ahead
    wedge = [root + 0.045 * across, root - 0.045 * across, path[0] + tooth_m * ahead]
    for y_m in np.linspace(-0.5, 0.5, teeth) * (width_m - 0.14) if teeth else ():
        outline = [(float(x_m), float(z_m)) for x_m, z_m in wedge]
        plates.append(profile(outline, 0.1, colour, Surface.STEEL).at(0.0, float(y_m), 0.0))
    return join(plates)


def rectangle(length_m: float, width_m: float) -> FloatArray:
    """Return the (4, 2) corners of a rectangle about the origin, counter-clockwise.

    >>> rectangle(4.0, 2.0).tolist()
    [[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]]
    """
    return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * [length_m / 2, width_m / 2]


def highest_m(batches: Sequence[Batch]) -> float:
    """Return z of the highest vertex of all batches."""
    return max(
        float((batch.mesh.vertices_m @ pose[2, :3] + pose[2, 3]).max()) for batch in batches for pose in batch.poses
    )
