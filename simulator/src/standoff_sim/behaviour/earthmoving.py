"""Machines that drive while they work: load with a wheel loader, spread, push, roll, drive past, or wait."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from standoff_sim.behaviour.digging import BED_M
from standoff_sim.behaviour.stances import LoaderArms, random_stance
from standoff_sim.movement.driving import drive
from standoff_sim.movement.motion import (
    STEP_S,
    Key,
    Place,
    chained,
    end_place,
    fitted,
    held,
    shifted,
    shortest_s,
    with_joints,
    wrapped,
)
from standoff_sim.scene.scene import Model, Motion

_LIFT_DPS, _BUCKET_DPS, _BED_DPS, _BLADE_MPS = 36.0, 95.0, 9.0, 0.5
"""Peak rates. Brochures: 15-20 t loaders raise in 5.5-6 s, lower in 3.5-4 s (some 80 deg) and dump in 1.2-1.5 s (some
70 deg); beds rise in 10-12 s (50-70 deg); dozer blades move 0.3-0.5 m/s."""

_BACK_OFFS_M = (4.0, 5.5, 7.0, 9.0, 11.0, 14.0)  # of a loader from pile and truck, more than half its length
_BUCKETS_A_TRUCK = 4

Round = Callable[[Place], Motion]


def loader_loading(
    rng: np.random.Generator, loader: Model, truck: Model, pile: Place, truck_place: Place, duration_s: float
) -> tuple[Motion, Motion]:
    """Load a truck from a pile on a V-shaped way: into the pile, back, to the truck's side, back.

    Args:
        rng: Decides on speeds and the moment to begin with.
        loader: With a bucket.
        truck: With joint `load` or without.
        pile: Loader's middle and heading with its bucket in the pile.
        truck_place: 8-15 m from `pile`, its side roughly in view of it.
        duration_s: Of the motion.

    Returns:
        Motions of loader and truck.
    """
    motion = _between(rng, loader, pile, _dump_place(loader, truck, pile, truck_place), duration_s)
    load = motion.joints["load"]
    emptied_s = motion.time_s[np.flatnonzero((load[:-1] > 0.5) & (load[1:] <= 0.5))].tolist()
    levels = np.linspace(rng.integers(0, 2) / _BUCKETS_A_TRUCK, 1.0, _BUCKETS_A_TRUCK + 1)
    level = [float(levels[min(i, _BUCKETS_A_TRUCK)]) for i in range(len(emptied_s) + 1)]
    keys: list[Key] = [(float(motion.time_s[0]) - 2.0, level[0])]
    for index, at_s in enumerate(emptied_s):
        keys += [(at_s - 0.7, level[index]), (at_s + 0.7, level[index + 1])]
    waiting = with_joints(held(truck_place, duration_s + STEP_S), {"load": keys})
    return fitted(motion, loader), fitted(waiting, truck)


def heaping(rng: np.random.Generator, loader: Model, pile: Place, heap: Place, duration_s: float) -> Motion:
    """Carry from a pile to a heap on a V-shaped way.

    Args:
        rng: Decides on speeds and the moment to begin with.
        loader: With a bucket.
        pile: Loader's middle and heading with its bucket in the pile.
        heap: The same where it empties the bucket; some 15 m from `pile`, at about a right angle to it.
        duration_s: Of the motion.
    """
    return fitted(_between(rng, loader, pile, heap, duration_s), loader)


def _between(rng: np.random.Generator, loader: Model, pile: Place, dump: Place, duration_s: float) -> Motion:
    """Go to and fro between two places, backwards out of each."""
    arms = LoaderArms.of(loader)
    apex = _apex(loader, pile, dump)

    def turn_round(_: Place) -> Motion:
        speed_mps = rng.uniform(2.2, 3.2)
        to_pile = drive(loader, apex, pile, speed_mps=speed_mps)
        from_pile = drive(loader, pile, apex, reverse=True, speed_mps=speed_mps)
        to_dump = drive(loader, apex, dump, speed_mps=speed_mps * 0.8)
        from_dump = drive(loader, dump, apex, reverse=True, speed_mps=speed_mps)
        dig_s, dump_s = rng.uniform(3.5, 5.0), rng.uniform(2.5, 3.5)
        pieces = [to_pile, held(pile, dig_s), from_pile, to_dump, held(dump, dump_s), from_dump]
        ends_s = np.cumsum([piece.time_s[-1] for piece in pieces[:-1]])
        whole = chained(pieces)
        return with_joints(whole, _loading_keys(arms, ends_s.tolist(), float(whole.time_s[-1])))

    return _repeated(rng, held(apex), turn_round, duration_s)


def _dump_place(loader: Model, truck: Model, pile: Place, truck_place: Place) -> Place:
    """Return where the loader's middle is when its bucket is over the truck, on the pile's side of it."""
    side = 1.0 if np.sin(truck_place.bearing_to(pile.xy_m)) > 0 else -1.0
    away_m = float(np.ptp(truck.footprint_m[:, 1]) / 2 + np.ptp(loader.footprint_m[:, 0]) / 2 + 0.9)
    return truck_place.moved(BED_M, side * away_m, -side * np.pi / 2)


def _apex(loader: Model, pile: Place, dump: Place) -> Place:
    """Return where the loader changes direction: the nearest place from which it can steer to both."""
    between_rad = pile.heading_rad + wrapped(dump.heading_rad - pile.heading_rad) / 2
    lock_deg = loader.joints["steer_deg"][1]
    half_m = float(np.ptp(loader.footprint_m[:, 0])) / 2
    sharpest: list[tuple[float, Place]] = []
    for back_m in _BACK_OFFS_M:
        behind_m = [place.moved(-back_m - half_m).xy_m for place in (pile, dump)]
        x_m, y_m = ((behind_m[0] + behind_m[1]) / 2).tolist()
        apex = Place(x_m, y_m, between_rad)
        turns = [drive(loader, apex, goal).joints["steer_deg"] for goal in (pile, dump)]
        sharpest.append((max(float(np.abs(turn).max()) for turn in turns), apex))
        if sharpest[-1][0] < lock_deg:
            return apex
    return min(sharpest, key=lambda pair: pair[0])[1]


def _loading_keys(arms: LoaderArms, ends_s: Sequence[float], whole_s: float) -> dict[str, list[Key]]:
    """Return the keys of one round; `ends_s` are the ends of its first five pieces."""
    at_pile, dug, _, at_truck, dumped = ends_s
    raised_s = at_truck - max(5.5, shortest_s(arms.high_deg - arms.low_deg, _LIFT_DPS))
    carried = arms.lift_deg(0.12)
    return {
        "lift_deg": [
            (0.0, carried), (at_pile - 1.0, arms.low_deg), (at_pile, arms.low_deg), (dug, carried), (raised_s, carried),
            (at_truck, arms.high_deg), (min(dumped + 1.5, whole_s - 3.0), arms.high_deg), (whole_s, carried),
        ],
        "bucket_deg": [
            (0.0, arms.level_deg), (at_pile + 0.8, arms.level_deg), (dug, arms.curled_deg),
            (at_truck + 0.2, arms.curled_deg), (dumped - 0.3, arms.dumped_deg), (dumped, arms.dumped_deg),
            (whole_s, arms.level_deg),
        ],
        "load": [(at_pile - 0.5, 0.0), (dug, 1.0), (at_truck + 0.5, 1.0), (dumped - 0.2, 0.0)],
    }  # fmt: skip


def spreading(rng: np.random.Generator, model: Model, place: Place, length_m: float, duration_s: float) -> Motion:
    """Spread a load along a strip: a loader tips it out slowly as it goes, a truck lets it slide off a raised bed.

    Args:
        rng: Decides on speed and the moment to begin with.
        model: Wheel loader or dump truck.
        place: Beginning of the strip and its direction.
        length_m: Of the strip.
        duration_s: Of the motion.
    """
    keys_of = _tipping_keys if "bed_deg" in model.joints else _shaking_keys
    loads = iter([1.0])

    def strip(start: Place) -> Motion:
        end = place.moved(length_m, rng.uniform(-0.4, 0.4))
        out = drive(model, start, end, speed_mps=rng.uniform(0.8, 1.3))
        back = drive(model, end, place.moved(0.0, rng.uniform(-0.4, 0.4)), reverse=True)
        out_s, back_s = float(out.time_s[-1]), float(back.time_s[-1])
        keys = keys_of(model, out_s, next(loads, 0.0))
        settled_s = max(at_s for track in keys.values() for at_s, _ in track)
        whole = chained([out, held(end, 1.2), back, held(end_place(back), max(1.0, settled_s - out_s - 1.2 - back_s))])
        return with_joints(whole, keys)

    return fitted(_repeated(rng, held(place), strip, duration_s), model)


def _shaking_keys(model: Model, out_s: float, load: float) -> dict[str, list[Key]]:
    arms = LoaderArms.of(model)
    carried, tipped = arms.lift_deg(0.15), 0.5 * (arms.level_deg + arms.dumped_deg)
    return {
        "lift_deg": [(0.0, carried), (out_s, arms.lift_deg(0.3)), (out_s + 4.0, carried)],
        "bucket_deg": [(0.0, arms.curled_deg), (out_s, tipped), (out_s + 1.0, tipped), (out_s + 4.0, arms.curled_deg)],
        "load": [(0.0, load), (out_s, 0.0)],
    }


def _tipping_keys(model: Model, out_s: float, load: float) -> dict[str, list[Key]]:
    high_deg = min(0.9 * model.joints["bed_deg"][1], _BED_DPS * out_s / 1.875)
    down_s = out_s + shortest_s(high_deg, _BED_DPS)
    return {"bed_deg": [(0.0, 0.0), (out_s, high_deg), (down_s, 0.0)], "load": [(0.0, load), (out_s, 0.0)]}


def dozing(rng: np.random.Generator, dozer: Model, place: Place, length_m: float, duration_s: float) -> Motion:
    """Push ahead with the blade down, return with it up."""
    low_m, high_m = dozer.joints["blade_m"]
    down_m, up_m = max(low_m, -0.05), min(high_m, 0.6)

    def push(start: Place) -> Motion:
        end = place.moved(length_m * rng.uniform(0.85, 1.0), rng.uniform(-0.5, 0.5))
        out = drive(dozer, start, end, speed_mps=rng.uniform(0.8, 1.1))
        back = drive(dozer, end, place.moved(0.0, rng.uniform(-0.8, 0.8)), reverse=True)
        pauses_s = rng.uniform(0.6, 1.2, 2) + shortest_s(up_m - down_m, _BLADE_MPS)
        whole = chained([out, held(end, pauses_s[0]), back, held(end_place(back), pauses_s[1])])
        raised_s = float(out.time_s[-1])
        lowered_s = float(whole.time_s[-1])
        keys = [
            (0.0, down_m), (raised_s, down_m), (raised_s + pauses_s[0], up_m), (lowered_s - pauses_s[1], up_m),
            (lowered_s, down_m),
        ]  # fmt: skip
        return with_joints(whole, {"blade_m": keys})

    return fitted(_repeated(rng, held(place), push, duration_s), dozer)


def rolling(rng: np.random.Generator, roller: Model, place: Place, length_m: float, duration_s: float) -> Motion:
    """Roll to and fro, moving over by part of the drum's width after each pair of passes."""
    speed_mps = rng.uniform(1.1, 1.6)
    lanes_m = iter(np.tile([0.0, 0.8, 1.6, 0.8], 1000).tolist())

    def passes(start: Place) -> Motion:
        far = place.moved(length_m, next(lanes_m))
        out = drive(roller, start, far, speed_mps=speed_mps)
        back = drive(roller, far, place.moved(0.0, next(lanes_m)), reverse=True, speed_mps=speed_mps)
        return chained([out, held(far, rng.uniform(0.5, 1.2)), back, held(end_place(back), rng.uniform(0.5, 1.2))])

    return fitted(_repeated(rng, held(place), passes, duration_s), roller)


def driving_through(
    rng: np.random.Generator, model: Model, start: Place, end: Place, duration_s: float, *,
    via: Sequence[tuple[float, float]] = (), reverse: bool = False,
) -> Motion:  # fmt: skip
    """Drive from one place to another, being somewhere in between at the middle of the duration."""
    motion = drive(model, start, end, via=via, reverse=reverse)
    loaded = float(rng.random() < 0.5)
    middle_s = motion.time_s[-1] * rng.uniform(0.35, 0.65)
    ready = with_joints(motion, _carrying_keys(rng, model, loaded))
    return fitted(shifted(ready, duration_s / 2 - middle_s), model)


def _carrying_keys(rng: np.random.Generator, model: Model, loaded: float) -> dict[str, list[Key]]:
    """Return how tools are held on the way."""
    if "lift_deg" in model.joints:
        arms = LoaderArms.of(model)
        held_at = {"lift_deg": arms.lift_deg(0.12), "bucket_deg": arms.curled_deg, "load": loaded}
    elif "boom_deg" in model.joints:
        held_at = {**random_stance(rng, model), "swing_deg": 0.0, "load": 0.0}
    else:
        held_at = {"load": loaded, "blade_m": 0.4, "bed_deg": 0.0}
    return {name: [(0.0, value)] for name, value in held_at.items() if name not in ("travel_m", "track_m", "steer_deg")}


def idle(rng: np.random.Generator, model: Model, place: Place, duration_s: float) -> Motion:
    """Stand still as machines and people do between tasks."""
    keys = {name: [(0.0, value)] for name, value in random_stance(rng, model).items()}
    if "speed_mps" in keys:
        keys |= {"speed_mps": [(0.0, 0.0)], "stride_m": [(0.0, 0.0)]}
    return fitted(with_joints(held(place, duration_s + STEP_S), keys), model)


def _repeated(rng: np.random.Generator, first: Motion, once: Round, duration_s: float) -> Motion:
    """Repeat a round, each from where the one before ended, over the duration; begin in the midst of the first."""
    motion = once(end_place(first))
    begin_s = rng.uniform(0.0, 0.8) * motion.time_s[-1]
    while motion.time_s[-1] < begin_s + duration_s:
        motion = chained([motion, once(end_place(motion))])
    return shifted(motion, -begin_s)
