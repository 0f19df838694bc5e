"""An ordinary site: machines work on ground of their own, and people mostly elsewhere.

An excavator loads a truck that comes and goes, a loader carries from a pile to a heap, a roller compacts a lane,
machines stand parked, and now and then somebody drives off. Gangs work at formwork, others walk about on ways that keep
off machines. On about every twentieth of their errands they do not: they take a short cut through a machine's circle,
or go up to a machine that works, or stand where it comes back to. A labourer keeps beside the excavator and steps in at
times.

How often is set so that there are about ten breaches an hour, which nobody has counted on real sites.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from standoff.core.homography import FloatArray
from standoff_sim import behaviour
from standoff_sim.movement.footpaths import Footpaths, rounded
from standoff_sim.movement.motion import Place, chained, end_place, fitted, shifted
from standoff_sim.scene.cast import Cast, FilmedArea
from standoff_sim.scene.scene import Model, Motion
from standoff_sim.scene.work_grounds import BODY_M, HALF_M, Acting, WorkGround, WorkSite, set_machines_to_work

_KEEP_OFF_M = (1.5, 4.0)
"""By so much ways keep off the circles of machines, on one site or another."""
_RISKS = 0.05
"""Share of errands on which somebody does not keep off machines."""
_STEPS_IN = 0.12
"""The same of the labourer at the excavator."""
_TRIES = 40
_ERRAND_TRIES = 8
_WAITS_S = 3.0
_GANGS, _PLACES, _WALKERS = 2, 6, 3
_ELBOW_ROOM_M, _TURN = 0.8, 2.4


def ordinary_site(rng: np.random.Generator, area: FilmedArea) -> Cast:
    """Cast an ordinary site.

    Args:
        rng: Decides everything.
        area: Where, and for how long.
    """
    site = set_machines_to_work(rng, area)
    keep_off_m = float(rng.uniform(*_KEEP_OFF_M))
    avoided = [one.ground.buffer(keep_off_m) for one in site.machines] + [body.buffer(BODY_M) for body in site.bodies]
    paths = Footpaths(shapely.union_all(avoided))
    gangs_m = [_free(site, paths, 3.5) for _ in range(_GANGS)]
    places_m = [*gangs_m, *(_free(site, paths, 1.0) for _ in range(_PLACES))]
    people = [one for place_m in gangs_m for one in _gang(site, place_m)]
    people += _unloader(site)
    people += [_walker(_Day.begun(site, paths, _beside_others(places_m, number))) for number in range(_WALKERS)]
    people.append(_labourer(_Day.begun(site, paths, _beside_others(places_m, _WALKERS)), site.machines[0]))
    cast = Cast()
    at_work = [(one.model, one.motion) for one in site.machines]
    for model, motion in [*at_work, *site.parked, *people, *site.riders]:
        cast.add([model], [motion], force=True)
    return cast


@dataclass(slots=True)
class _Day:
    """One worker's day so far: errand after errand.

    Attributes:
        site: With its machines, whose motions are known.
        paths: That keep off machines.
        places_m: Where there is something to do, (2,) each.
        worker: Who.
        motion: So far.
    """

    site: WorkSite
    paths: Footpaths
    places_m: list[FloatArray]
    worker: Model
    motion: Motion

    @classmethod
    def begun(cls, site: WorkSite, paths: Footpaths, places_m: list[FloatArray]) -> _Day:
        """Let somebody stand at one of the places."""
        rng, worker = site.rng, site.area.worker(site.rng)
        x_m, y_m = places_m[int(rng.integers(len(places_m)))].tolist()
        place = Place(x_m, y_m, float(rng.uniform(0.0, 2 * np.pi)))
        return cls(site, paths, places_m, worker, behaviour.staying(rng, worker, place, float(rng.uniform(1.0, 60.0))))

    @property
    def is_over(self) -> bool:
        """Whether nothing more is needed."""
        return bool(self.motion.time_s[-1] >= self.site.area.duration_s)

    def run(self, goal_m: FloatArray, stays_s: float) -> bool:
        """Go somewhere on ways that keep off machines, if that can be."""
        way_m = self.paths.way(end_place(self.motion).xy_m, goal_m)
        return way_m is not None and self._go(way_m, stays_s)

    def visit(self, stays_s: float) -> bool:
        """Go to another of the places."""
        here_m = self.motion.xy_m[-1]
        others = [place_m for place_m in self.places_m if np.linalg.norm(place_m - here_m) > 3.0]
        goal_m = others[int(self.site.rng.integers(len(others)))] + self.site.rng.normal(0.0, 0.3, 2)
        return self.run(goal_m, stays_s)

    def cut_short(self) -> bool:
        """Go straight to another of the places, if that leads through a machine's circle."""
        rng, here_m = self.site.rng, self.motion.xy_m[-1]
        goal_m = self.places_m[int(rng.integers(len(self.places_m)))]
        straight = shapely.LineString([here_m, goal_m])
        if not any(straight.intersects(one.ground) for one in self.site.machines):
            return False
        return self._go(rounded(np.array([here_m, goal_m])), float(rng.uniform(10.0, 60.0)))

    def step_up(self, machine: WorkGround, most_m: float) -> bool:
        """Go to some place within a machine's circle where no machine comes by, and stay there for a while."""
        rng = self.site.rng
        along_m = machine.places_m[int(rng.integers(len(machine.places_m)))]
        away_m, turn_rad = float(rng.uniform(machine.body_m, most_m)), float(rng.uniform(0.0, 2 * np.pi))
        goal_m = along_m + away_m * np.array([np.cos(turn_rad), np.sin(turn_rad)])
        goal = shapely.Point(goal_m)
        if any(one.track.distance(goal) < one.body_m for one in self.site.machines):
            return False
        return self.run(goal_m, float(rng.uniform(10.0, 45.0)))

    def wait(self) -> None:
        """Stay for a moment."""
        stays = behaviour.staying(self.site.rng, self.worker, end_place(self.motion), _WAITS_S)
        self.motion = chained([self.motion, stays])

    def _go(self, way_m: FloatArray, stays_s: float) -> bool:
        """Go a way and stay at its end, if nothing is or comes in the way."""
        if shapely.LineString(way_m).intersects(shapely.union_all(self.site.bodies)):
            return False
        errand = behaviour.errand(self.site.rng, self.worker, end_place(self.motion), way_m, stays_s)
        errand = shifted(errand, float(self.motion.time_s[-1]))
        if any(one.least_distance_m(errand) < one.body_m for one in self.site.machines):
            return False
        self.motion = chained([self.motion, errand])
        return True


def _walker(day: _Day) -> Acting:
    """Let somebody go from place to place, and now and then not keep off machines."""
    rng, machines = day.site.rng, day.site.machines
    while not day.is_over:
        if rng.random() < _RISKS:
            machine = machines[int(rng.integers(len(machines)))]
            short = rng.random() < 0.5
            for _ in range(_ERRAND_TRIES):
                if day.cut_short() if short else day.step_up(machine, 0.92 * machine.reach_m):
                    break
        if not any(day.visit(float(rng.uniform(8.0, 75.0))) for _ in range(_ERRAND_TRIES)):
            day.wait()
    return day.worker, fitted(day.motion, day.worker)


def _labourer(day: _Day, excavator: WorkGround) -> Acting:
    """Let somebody keep beside the excavator for part of the time, and step up to it at times."""
    rng = day.site.rng
    while not day.is_over:
        if rng.random() < _STEPS_IN:
            any(day.step_up(excavator, 11.0) for _ in range(_ERRAND_TRIES))
        stays_s = float(rng.uniform(30.0, 120.0))
        beside = rng.random() < 0.6 and any(
            day.run(spot_m, stays_s) for spot_m in _beside(day.site, excavator, _ERRAND_TRIES)
        )
        if not beside and not day.visit(stays_s):
            day.wait()
    return day.worker, fitted(day.motion, day.worker)


def _beside(site: WorkSite, machine: WorkGround, count: int) -> list[FloatArray]:
    """Draw places a little outside of the circle of a machine that stands, and of all others."""
    turns_rad = site.rng.uniform(0.0, 2 * np.pi, count)
    away_m = machine.reach_m + site.rng.uniform(1.0, 5.0, count)
    spots_m = machine.motion.xy_m[0] + away_m[:, None] * np.column_stack([np.cos(turns_rad), np.sin(turns_rad)])
    taken = shapely.union_all([*(one.ground.buffer(0.8) for one in site.machines), *site.bodies])
    return list(spots_m[~shapely.intersects(taken, shapely.points(spots_m))])


def _beside_others(places_m: list[FloatArray], number: int) -> list[FloatArray]:
    """Return where the person of this number stands at each place: nobody where another one may stand."""
    angle = _TURN * number
    return [place_m + _ELBOW_ROOM_M * np.array([np.cos(angle), np.sin(angle)]) for place_m in places_m]


def _free(site: WorkSite, paths: Footpaths, room_m: float) -> FloatArray:
    """Draw a place where people may be, with room around."""
    ring_m = room_m * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    for _ in range(10 * _TRIES):
        spot_m = site.spot(2.0).xy_m
        if paths.are_free(spot_m + ring_m).all():
            return spot_m
    # A site without room has its people in front of it.
    return site.area.place(float(site.rng.uniform(-10.0, 10.0)), -HALF_M[1] - 8.0).xy_m


def _gang(site: WorkSite, middle_m: FloatArray) -> list[Acting]:
    """Let two or three work together."""
    rng, lasting_s = site.rng, site.area.duration_s
    middle = Place(float(middle_m[0]), float(middle_m[1]), float(rng.uniform(0.0, 2 * np.pi)))
    first, second, third = (site.area.worker(rng) for _ in range(3))
    people = [(first, behaviour.standing_working(rng, first, middle.moved(0.0, 1.8), lasting_s))]
    if rng.random() < 0.3:
        pair = second, third
        motions = behaviour.pair_talking(rng, pair, middle.moved(2.0, -1.5), lasting_s)
        return people + list(zip(pair, motions, strict=True))
    people.append((second, behaviour.standing_working(rng, second, middle.moved(-1.6, -0.6), lasting_s)))
    if rng.random() < 0.7:
        ends = middle.moved(-3.2, -2.2), middle.moved(3.2, -1.4)
        people.append((third, behaviour.carrying_between(rng, third, *ends, lasting_s)))
    return people


def _unloader(site: WorkSite) -> list[Acting]:
    """On some sites let somebody work at a machine that is parked."""
    if not site.parked or site.rng.random() < 0.5:
        return []
    model, motion = site.parked[0]
    side_m = float(np.abs(model.footprint_m[:, 1]).max()) + 0.9
    place = end_place(motion).moved(float(site.rng.uniform(-1.5, 1.5)), side_m)
    if any(one.ground.distance(shapely.Point(place.xy_m)) < 1.0 for one in site.machines):
        return []
    worker = site.area.worker(site.rng)
    return [(worker, behaviour.standing_working(site.rng, worker, place, site.area.duration_s))]
