"""Who is on the site and what they do, for each kind of clip.

Casts are written in the area's own directions, as the camera sees them: x to the right, y away from it, metres from
the middle of the picture; turns in degrees, counter-clockwise from x.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim import behaviour
from standoff_sim.machines.dozer import make_dozer
from standoff_sim.machines.dump_truck import make_dump_truck
from standoff_sim.machines.roller import make_roller
from standoff_sim.machines.vehicle import make_vehicle
from standoff_sim.machines.wheel_loader import make_wheel_loader
from standoff_sim.movement.motion import Place, sample
from standoff_sim.scene.cast import Cast, FilmedArea, is_person
from standoff_sim.scene.ordinary import ordinary_site
from standoff_sim.scene.scene import Model, Motion

_TRIES = 12
_PACKING_TRIES = 14
_BUSY_WORKERS, _BUSY_MACHINES = 8, 5
_BREACH_M, _NEAR_MISS_M = 5.6, 8.4
"""Distances of worker and wheel loader, whose circles touch at 7.8 m."""


def bend_over(rng: np.random.Generator, cast: Cast, share: float) -> None:
    """Let a share of the workers, whoever they are, do what they do stooping; ways and times stay as they are."""
    people = [k for k, actor in enumerate(cast.actors) if is_person(actor.model)]
    for k in rng.permutation(people)[: round(share * len(people))].tolist():
        actor = cast.actors[k]
        cast.actors[k] = replace(actor, motion=behaviour.stooping(rng, actor.motion))


def _mobile(rng: np.random.Generator, area: FilmedArea) -> Cast:
    """The paper's mobile test: one worker, one wheel loader, one excavator."""
    cast = Cast()
    excavator, loader, worker = area.excavator(rng), make_wheel_loader(rng), area.worker(rng)
    digs = behaviour.digging(rng, excavator, area.place(9.0, 6.5, float(rng.uniform(200.0, 240.0))), area.duration_s)
    cast.add([excavator], [digs], force=True)
    spreads = behaviour.spreading(rng, loader, area.place(-14.0, 8.0, -4.0), 15.0, area.duration_s)
    cast.add([loader], [spreads], force=True)
    points = [area.place(x, y) for x, y in ((6.0, -5.0), (2.0, -0.5), (-3.0, 1.8), (-9.0, 1.5), (-13.0, -2.0))]
    walks = behaviour.walking_past(rng, worker, [(p.x_m, p.y_m) for p in points], area.duration_s)
    cast.add([worker], [walks], force=True)
    return cast


def _demo(rng: np.random.Generator, area: FilmedArea) -> Cast:
    """One near miss and one breach: a reversing loader passes one worker, and another crosses behind it.

    The excavator and the worker at the footing keep away from everybody.
    """
    cast = Cast()
    excavator, loader = area.excavator(rng), make_wheel_loader(rng)
    beside, behind, apart = area.worker(rng), area.worker(rng), area.worker(rng)
    digs = behaviour.digging(rng, excavator, area.place(13.0, 8.0, 70.0), area.duration_s)
    cast.add([excavator], [digs], force=True)
    start = area.place(-10.0, 14.0, 97.0)
    crossing = behaviour.crossing_behind(rng, loader, behind, start, area.duration_s, closest_m=_BREACH_M, to_left=True)
    cast.add([loader, behind], crossing, force=True)
    works = behaviour.standing_working(rng, beside, start.moved(-4.0, _NEAR_MISS_M), area.duration_s)
    cast.add([beside], [works], force=True)
    measures = behaviour.standing_working(rng, apart, area.place(3.0, -6.5), area.duration_s)
    cast.add([apart], [measures], force=True)
    return cast


def _stationary(rng: np.random.Generator, area: FilmedArea, *, distance_m: float) -> Cast:
    """The paper's stationary test: worker and excavator at exactly a distance."""
    cast = Cast()
    models = (area.excavator(rng), area.worker(rng))
    tilt_deg = float(rng.uniform(-8.0, 8.0))
    place = area.place(distance_m / 2, 2.5, tilt_deg + float(rng.uniform(-60.0, 60.0)))
    bearing_rad = float(np.deg2rad(180.0 + tilt_deg - area.heading_deg))
    motions = behaviour.keep_distance(
        rng, *models, place, area.duration_s, distance_m=distance_m, bearing_rad=bearing_rad
    )
    cast.add(models, motions, force=True)
    return cast


def _nobody(rng: np.random.Generator, area: FilmedArea) -> Cast:
    return Cast()


def crowd(rng: np.random.Generator, area: FilmedArea, *, workers: int, machines: int, parked: int = 0) -> Cast:
    """Draw activities until there are so many workers and machines, or no room is left.

    Args:
        rng: Decides everything.
        area: Where.
        workers: Wanted.
        machines: Wanted.
        parked: Vehicles that stand on the site besides, at most.
    """
    cast = Cast()
    cast.reserved += area.reserved()
    for _ in range(_TRIES * machines):
        left = machines - sum(not is_person(actor.model) for actor in cast.actors)
        if left <= 0:
            break
        cast.add(*_machine_activity(rng, area, left, workers))
    for _ in range(parked):
        vehicle = make_vehicle(rng)
        cast.add([vehicle], [behaviour.idle(rng, vehicle, _spot(rng, area), area.duration_s)])
    for _ in range(_TRIES * workers):
        left = workers - sum(is_person(actor.model) for actor in cast.actors)
        if left <= 0:
            break
        cast.add(*_people_activity(rng, area, left, cast))
    return cast


_Activity = tuple[Sequence[Model], Sequence[Motion]]


def _spot(rng: np.random.Generator, area: FilmedArea) -> Place:
    """Draw a place in the picture: fewer towards the edges, more far away than near, where there is more ground."""
    x_m, y_m = rng.normal([0.0, 3.0], [9.0, 8.0]) * area.scale
    return area.place(float(x_m), float(y_m), float(rng.uniform(0.0, 360.0)))


def _machine_activity(rng: np.random.Generator, area: FilmedArea, left: int, workers: int) -> _Activity:
    place, lasting_s = _spot(rng, area), area.duration_s
    kinds = ["dig", "grade", "spread", "roll", "doze", "drive", "idle"] + ["load", "shovel"] * (left > 1)
    if workers > 1:
        kinds += ["behind", "miss"]
    kind = str(rng.choice(kinds))
    if kind in ("dig", "grade"):
        excavator = area.excavator(rng)
        script = behaviour.digging if kind == "dig" else behaviour.grading
        return [excavator], [script(rng, excavator, place, lasting_s)]
    if kind == "load":
        pair = area.excavator(rng), make_dump_truck(rng)
        beside = place.moved(0.0, float(rng.choice([-1, 1]) * rng.uniform(7.0, 8.5)), float(rng.normal(0.0, 0.4)))
        return pair, behaviour.truck_loading(rng, *pair, place, beside, lasting_s)
    if kind == "shovel":
        pair = make_wheel_loader(rng), make_dump_truck(rng)
        beside = place.moved(-9.0, float(rng.choice([-1, 1]) * 8.0), float(rng.normal(0.0, 0.3)))
        return pair, behaviour.loader_loading(rng, *pair, place, beside, lasting_s)
    if kind in ("behind", "miss"):
        machine, worker = _driving_machine(rng), area.worker(rng)
        if kind == "behind":
            return (machine, worker), behaviour.crossing_behind(rng, machine, worker, place, lasting_s)
        return (machine, worker), behaviour.near_miss(rng, machine, worker, place, lasting_s)
    return _lone_machine(rng, area, kind, place)


def _lone_machine(rng: np.random.Generator, area: FilmedArea, kind: str, place: Place) -> _Activity:
    lasting_s, length_m = area.duration_s, float(rng.uniform(10.0, 18.0))
    machine: Model
    if kind == "spread":
        machine = make_wheel_loader(rng) if rng.random() < 0.5 else make_dump_truck(rng)
        motion = behaviour.spreading(rng, machine, place, length_m, lasting_s)
    elif kind == "roll":
        machine = make_roller(rng)
        motion = behaviour.rolling(rng, machine, place, length_m, lasting_s)
    elif kind == "doze":
        machine = make_dozer(rng)
        motion = behaviour.dozing(rng, machine, place, length_m, lasting_s)
    elif kind == "drive":
        machine = make_vehicle(rng) if rng.random() < 0.6 else make_dump_truck(rng)
        end = place.moved(float(rng.uniform(25.0, 40.0)), float(rng.normal(0.0, 4.0)), float(rng.normal(0.0, 0.3)))
        motion = behaviour.driving_through(rng, machine, place, end, lasting_s)
    else:
        machine = _any_machine(rng, area)
        motion = behaviour.idle(rng, machine, place, lasting_s)
    return [machine], [motion]


def _any_machine(rng: np.random.Generator, area: FilmedArea) -> Model:
    makers: tuple[Callable[[np.random.Generator], Model], ...] = (
        area.excavator, make_wheel_loader, make_dump_truck, make_roller, make_dozer, make_vehicle, make_vehicle
    )  # fmt: skip
    return makers[int(rng.integers(len(makers)))](rng)


def _driving_machine(rng: np.random.Generator) -> Model:
    makers: tuple[Callable[[np.random.Generator], Model], ...]
    makers = (make_wheel_loader, make_dump_truck, make_roller, make_dozer)
    return makers[int(rng.integers(len(makers)))](rng)


def _people_activity(rng: np.random.Generator, area: FilmedArea, left: int, cast: Cast) -> _Activity:
    place, lasting_s = _near_somebody(rng, area, cast), area.duration_s
    kind = str(rng.choice(["work", "carry", "walk"] + ["talk"] * (left > 1)))
    if kind == "talk":
        pair = area.worker(rng), area.worker(rng)
        return pair, behaviour.pair_talking(rng, pair, place, lasting_s)
    worker = area.worker(rng)
    if kind == "work":
        return [worker], [behaviour.standing_working(rng, worker, place, lasting_s)]
    reach_m = float(rng.uniform(5.0, 12.0))
    if kind == "carry":
        return [worker], [behaviour.carrying_between(rng, worker, place, place.moved(reach_m), lasting_s)]
    bend = place.moved(reach_m / 2, float(rng.normal(0.0, 2.0)))
    end = place.moved(reach_m)
    points = [(p.x_m, p.y_m) for p in (place, bend, end)]
    return [worker], [behaviour.walking_past(rng, worker, points, lasting_s)]


def _near_somebody(rng: np.random.Generator, area: FilmedArea, cast: Cast) -> Place:
    """Draw a place for people: half of them keep near a machine or near each other."""
    if not cast.actors or rng.random() < 0.5:
        return _spot(rng, area)
    other = cast.actors[int(rng.integers(len(cast.actors)))]
    away_m, turn_rad = float(rng.uniform(1.5, 7.0)), float(rng.uniform(0.0, 2 * np.pi))
    beside: FloatArray = sample(other.motion, 0.0).xy_m + away_m * np.array([np.cos(turn_rad), np.sin(turn_rad)])
    return Place(float(beside[0]), float(beside[1]), float(rng.uniform(0.0, 2 * np.pi)))


def _any_number(rng: np.random.Generator, area: FilmedArea) -> Cast:
    """Few or many: now and then an empty site, so that a picture without people is nothing unusual."""
    if rng.random() < 0.05:
        return Cast()
    return crowd(
        rng, area, workers=int(rng.integers(1, 13)), machines=int(rng.integers(0, 7)), parked=int(rng.integers(0, 4))
    )


def _excavators(rng: np.random.Generator, area: FilmedArea) -> Cast:
    """Excavators in every stance, with some people: what a network of ground points is to learn most."""
    scripts = behaviour.digging, behaviour.grading, behaviour.idle

    def draw() -> _Activity:
        excavator, script = area.excavator(rng), scripts[int(rng.integers(len(scripts)))]
        return [excavator], [script(rng, excavator, _spot(rng, area), area.duration_s)]

    return _packed(rng, area, draw)


def _machines(rng: np.random.Generator, area: FilmedArea) -> Cast:
    """Machines of every kind but excavators, with some people: half of them where they are, which takes less room."""
    moving = "spread", "roll", "doze", "drive"

    def draw() -> _Activity:
        if rng.random() < 0.5:
            return _lone_machine(rng, area, moving[int(rng.integers(len(moving)))], _spot(rng, area))
        machine = _driving_machine(rng)
        return [machine], [behaviour.idle(rng, machine, _spot(rng, area), area.duration_s)]

    return _packed(rng, area, draw)


def _packed(rng: np.random.Generator, area: FilmedArea, draw: Callable[[], _Activity]) -> Cast:
    """Fill the picture with as many machines as find room, and let some people work between them."""
    cast = Cast()
    cast.reserved += area.reserved()
    for _ in range(_PACKING_TRIES):
        cast.add(*draw())
    for _ in range(int(rng.integers(1, 9))):
        cast.add(*_people_activity(rng, area, 2, cast))
    return cast


CASTS: Mapping[str, Callable[[np.random.Generator, FilmedArea], Cast]] = MappingProxyType(
    {
        "mobile": _mobile,
        "demo": _demo,
        "stationary-15": partial(_stationary, distance_m=15.0),
        "stationary-20": partial(_stationary, distance_m=20.0),
        "board": _nobody,
        "random": _any_number,
        "excavators": _excavators,
        "machines": _machines,
        "ordinary": ordinary_site,
        "busy": partial(crowd, workers=_BUSY_WORKERS, machines=_BUSY_MACHINES),
    }
)
"""By `Preset.cast`."""
