"""Ground on which machines work, each on its own, and what stands between."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff_sim import behaviour
from standoff_sim.machines.dozer import make_dozer
from standoff_sim.machines.dump_truck import make_dump_truck
from standoff_sim.machines.roller import make_roller
from standoff_sim.machines.vehicle import make_vehicle
from standoff_sim.machines.wheel_loader import make_wheel_loader
from standoff_sim.movement.footpaths import rounded
from standoff_sim.movement.motion import STEP_S, Place, chained, fitted, held, shifted
from standoff_sim.scene.cast import FilmedArea
from standoff_sim.scene.scene import Model, Motion

HALF_M = (36.0, 28.0)
"""Half the site's width and depth."""
BODY_M = 0.6
"""Nobody comes nearer to a machine than so, beyond the corners of its footprint."""

_APART_M = 4.0
"""Between the ground of two machines: room for a way."""
_DIGGING_BODY_M = 5.5
"""Nobody comes so near to the middle of an excavator that works: its tail swings."""
_TRIES = 40
_CHECK_STEP_S = 0.2
_GRID_M = 0.5
_SEAT = {"vehicle": (0.3, 0.4), "roller_or_dozer": (-0.6, 0.0)}
_REACH_M = {site_class.name: site_class.action_radius_m + CLASSES[0].action_radius_m for site_class in CLASSES}

Acting = tuple[Model, Motion]


@dataclass(frozen=True, slots=True, eq=False)
class WorkGround:
    """A machine at work, and the ground of its circle.

    Attributes:
        model: Which.
        motion: All of it.
        places_m: (N, 2) where its middle goes, to half a metre.
        track: The same.
        ground: All that its circle passes over.
    """

    model: Model
    motion: Motion
    places_m: FloatArray
    track: shapely.MultiPoint
    ground: shapely.Geometry

    @classmethod
    def of(cls, model: Model, motion: Motion) -> WorkGround:
        """Follow a machine's motion."""
        # To and fro on the same lane for an hour is one lane.
        places_m = np.unique(np.round(motion.xy_m[::10] / _GRID_M), axis=0) * _GRID_M
        track = shapely.MultiPoint(places_m)
        reach_m = _REACH_M[CLASSES[model.class_id].name]
        return cls(model, motion, places_m, track, track.buffer(reach_m + _GRID_M / 2.0))

    @property
    def reach_m(self) -> float:
        """At which distance its circle and a worker's touch."""
        return _REACH_M[CLASSES[self.model.class_id].name]

    @property
    def body_m(self) -> float:
        """How near to its middle nobody comes."""
        if "boom_deg" in self.model.joints:
            return _DIGGING_BODY_M
        return float(np.linalg.norm(self.model.footprint_m, axis=1).max()) + BODY_M

    def least_distance_m(self, motion: Motion) -> float:
        """Return how near somebody comes to its middle."""
        time_s = np.arange(motion.time_s[0], motion.time_s[-1] + _CHECK_STEP_S, _CHECK_STEP_S)
        return float(np.linalg.norm(_places(self.motion, time_s) - _places(motion, time_s), axis=1).min())


def _places(motion: Motion, time_s: FloatArray) -> FloatArray:
    """Return (T, 2) where somebody is."""
    return np.column_stack([np.interp(time_s, motion.time_s, motion.xy_m[:, k]) for k in (0, 1)])


@dataclass(slots=True)
class WorkSite:
    """Who works where.

    Attributes:
        rng: Decides everything.
        area: Where it lies.
        machines: At work.
        parked: Machines that stand all the time.
        bodies: What stands there all the time, machines and others.
        riders: Who sits on a machine, or gets on one to drive off.
    """

    rng: np.random.Generator
    area: FilmedArea
    machines: list[WorkGround] = field(default_factory=list)
    parked: list[Acting] = field(default_factory=list)
    bodies: list[shapely.Geometry] = field(default_factory=list)
    riders: list[Acting] = field(default_factory=list)

    def spot(self, inset_m: float = 0.0) -> Place:
        """Draw a place and a heading."""
        x_m, y_m = self.rng.uniform(-1.0, 1.0, 2) * (np.array(HALF_M) - inset_m)
        return self.area.place(float(x_m), float(y_m), float(self.rng.uniform(0.0, 360.0)))

    def is_clear(self, ground: shapely.Geometry) -> bool:
        """Return whether nothing else is there."""
        taken = shapely.union_all([*(one.ground for one in self.machines), *self.bodies])
        return not ground.intersects(taken)

    def is_within(self, ground: shapely.Geometry) -> bool:
        """Return whether it lies on the site."""
        wide_m, deep_m = HALF_M
        corners = ((-wide_m, -deep_m), (wide_m, -deep_m), (wide_m, deep_m), (-wide_m, deep_m))
        return bool(shapely.Polygon([self.area.place(x, y).xy_m for x, y in corners]).covers(ground))

    def add(self, model: Model, motion: Motion) -> None:
        """Give a machine its ground."""
        self.machines.append(WorkGround.of(model, motion))


def set_machines_to_work(rng: np.random.Generator, area: FilmedArea) -> WorkSite:
    """Let an excavator load a truck, a loader carry to a heap and a roller compact a lane, as far as there is room.

    Some machines stand parked. On every second site somebody gets into a car and drives off. The first machine is the
    excavator.

    Args:
        rng: Decides everything.
        area: Where, and for how long.
    """
    site = WorkSite(rng, area)
    site.bodies += area.reserved()
    _haul(site)
    _heap(site)
    _roll(site)
    _drive_off(site)
    _park(site)
    return site


def _haul(site: WorkSite) -> None:
    rng, area = site.rng, site.area
    excavator, truck = area.excavator(rng), make_dump_truck(rng)
    for _ in range(_TRIES):
        outward_rad = float(rng.uniform(0.0, 2 * np.pi))
        middle = np.array([np.cos(outward_rad), np.sin(outward_rad)]) * (np.array(HALF_M) - 12.0)
        out = area.place(float(middle[0]), float(middle[1]), float(np.rad2deg(outward_rad) + rng.normal(0.0, 10.0)))
        side = float(rng.choice([-1.0, 1.0]))
        spot = out.moved(float(rng.normal(1.0, 0.6)), side * float(rng.uniform(7.3, 8.3)), float(rng.normal(0.0, 0.1)))
        digs = out.moved(0.0, 0.0, np.pi + side * float(rng.uniform(0.0, 0.6)))
        if site.is_clear(shapely.Point(digs.xy_m).buffer(_REACH_M["excavator"])) or not site.bodies:
            break
    for model, motion in zip(
        (excavator, truck), behaviour.hauling(rng, excavator, truck, digs, spot, area.duration_s), strict=True
    ):
        site.add(model, motion)


def _heap(site: WorkSite) -> None:
    """Let a loader carry between two heaps, where there is room for its ways."""
    rng = site.rng
    loader = make_wheel_loader(rng)
    for _ in range(_TRIES):
        pile, side = site.spot(6.0), float(rng.choice([-1.0, 1.0]))
        heap = pile.moved(-11.0, side * 11.0, -side * np.pi / 2 + float(rng.normal(0.0, 0.1)))
        rough = shapely.LineString([pile.xy_m, pile.moved(-14.0, -side * 5.0).xy_m, heap.xy_m])
        if site.is_clear(rough.buffer(_REACH_M["wheel_loader"] + _APART_M)):
            site.add(loader, behaviour.heaping(rng, loader, pile, heap, site.area.duration_s))
            return


def _roll(site: WorkSite) -> None:
    """Let a roller work, whose driver sits in the open."""
    rng = site.rng
    roller = make_roller(rng)
    for _ in range(_TRIES):
        start, length_m = site.spot(), float(rng.uniform(12.0, 22.0))
        lane = shapely.LineString([start.xy_m, start.moved(length_m, 0.8).xy_m])
        if site.is_clear(lane.buffer(_REACH_M["roller_or_dozer"] + _APART_M)) and site.is_within(lane):
            motion = behaviour.rolling(rng, roller, start, length_m, site.area.duration_s)
            site.add(roller, motion)
            driver = site.area.worker(rng)
            site.riders.append((driver, fitted(behaviour.riding(motion, *_SEAT["roller_or_dozer"]), driver)))
            return


_GETTING_IN_S = 30.0
"""Somebody walks some metres to a car, waits and gets in: in a shorter clip nobody does."""


def _drive_off(site: WorkSite) -> None:
    """On some sites let a car stand until somebody walks up to it, gets in and drives off."""
    rng = site.rng
    leaves_s = STEP_S * round(float(rng.uniform(0.2, 0.9)) * site.area.duration_s / STEP_S)
    if rng.random() < 0.5 or leaves_s < _GETTING_IN_S:
        return
    car, driver = make_vehicle(rng), site.area.worker(rng)
    for _ in range(_TRIES):
        start = site.spot()
        lane = shapely.LineString([start.xy_m, start.moved(30.0).xy_m])
        if not site.is_clear(lane.buffer(_REACH_M["vehicle"] + _APART_M)) or site.is_within(lane):
            continue
        drives = behaviour.driving_through(rng, car, start, start.moved(30.0), 0.0)
        drives = shifted(drives, leaves_s - float(drives.time_s[0]))
        site.add(car, fitted(chained([held(start, leaves_s), drives]), car))
        driver_motion = _getting_in(rng, driver, start, drives)
        site.riders.append((driver, fitted(driver_motion, driver)))
        return


def _getting_in(rng: np.random.Generator, driver: Model, start: Place, drives: Motion) -> Motion:
    """Stand some metres beside a car, then walk up to it and get in before it drives."""
    ahead_m, left_m = _SEAT["vehicle"]
    door = start.moved(ahead_m, left_m + 1.4)
    begins = door.moved(0.0, float(rng.uniform(3.0, 6.0)))
    walks = behaviour.errand(rng, driver, begins, rounded(np.array([begins.xy_m, door.xy_m])), 0.5)
    waits_s = float(drives.time_s[0] - walks.time_s[-1]) - float(rng.uniform(4.0, 9.0))
    if waits_s > 0.0:
        walks = chained([behaviour.staying(rng, driver, begins, waits_s), walks])
    return behaviour.driving_off(rng, drives, walks, ahead_m, left_m)


def _park(site: WorkSite) -> None:
    """Park machines where no machine works."""
    rng = site.rng
    makers = (make_vehicle, make_vehicle, make_dump_truck, make_dozer, make_wheel_loader)
    for _ in range(int(rng.integers(1, 4))):
        model: Model = makers[int(rng.integers(len(makers)))](rng)
        for _ in range(_TRIES):
            place = site.spot()
            motion = behaviour.idle(rng, model, place, site.area.duration_s)
            body = shapely.MultiPoint([place.moved(x, y).xy_m for x, y in model.footprint_m.tolist()]).convex_hull
            if site.is_clear(body.buffer(_APART_M)):
                site.bodies.append(body)
                site.parked.append((model, motion))
                break
