"""An ordinary site keeps the laws of one: bodies are solid, people walk like people, breaches are rare and happen."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import shapely
from laws import seeds

from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff_sim import behaviour
from standoff_sim.movement.motion import Place, sample
from standoff_sim.scene.cast import Cast, FilmedArea, is_person
from standoff_sim.scene.casting import CASTS
from standoff_sim.scene.scene import Actor

_LASTING_S, _STEP_S = 300.0, 0.2
_TIMES_S = np.arange(0.0, _LASTING_S, _STEP_S)
_ABOARD_M = 1.5


@cache
def _site(seed: int) -> Cast:
    return CASTS["ordinary"](np.random.default_rng(seed), FilmedArea(20.0 * seed, 1.0, _LASTING_S, None, (-3.0, -2.0)))


def _places(actor: Actor) -> FloatArray:
    motion = actor.motion
    return np.column_stack([np.interp(_TIMES_S, motion.time_s, motion.xy_m[:, k]) for k in (0, 1)])


def _sides(cast: Cast) -> tuple[list[Actor], list[Actor]]:
    people = [actor for actor in cast.actors if is_person(actor.model)]
    return people, [actor for actor in cast.actors if not is_person(actor.model)]


@pytest.mark.parametrize("seed", seeds(4))
def test_nobody_on_foot_goes_through_a_machine(seed: int) -> None:
    people, machines = _sides(_site(seed))
    for machine in machines:
        near_m = float(np.linalg.norm(machine.model.footprint_m, axis=1).max()) + 1.0
        for person in people:
            apart_m = np.linalg.norm(_places(machine) - _places(person), axis=1)
            # Who gets in is on foot no longer once the middle is within reach, and until then beside the door.
            aboard = apart_m < _ABOARD_M + 1.0
            for k in np.flatnonzero((apart_m < near_m) & ~aboard).tolist():
                placement = sample(machine.motion, float(_TIMES_S[k]))
                body = shapely.Polygon(placement.to_site(machine.model.footprint_m))
                assert body.distance(shapely.Point(_places(person)[k])) > 0.1


@pytest.mark.parametrize("seed", seeds(4))
def test_who_walks_does_so_at_a_walkers_pace_and_who_rides_stays_on_the_machine(seed: int) -> None:
    people, machines = _sides(_site(seed))
    riders = 0
    for person in people:
        places_m = _places(person)
        speed_mps = np.linalg.norm(np.diff(places_m, axis=0), axis=1) / _STEP_S
        aboard = np.any([np.linalg.norm(places_m - _places(one), axis=1) < _ABOARD_M for one in machines], axis=0)
        riders += int(aboard.any())
        assert speed_mps[~aboard[1:]].max(initial=0.0) <= 1.6
    assert riders <= 2


@pytest.mark.live
@pytest.mark.parametrize("seed", seeds(2))
def test_breaches_happen_and_are_rare(seed: int) -> None:
    breaches, hours = 0, 0.0
    for site in range(10):
        people, machines = _sides(_site(1000 * seed + site))
        hours += _LASTING_S / 3600.0
        for machine in machines:
            works = np.ptp(_places(machine), axis=0).max() > 1.0 or CLASSES[machine.model.class_id].name == "excavator"
            for person in people:
                apart_m = np.linalg.norm(_places(machine) - _places(person), axis=1)
                inside = apart_m < sum(CLASSES[one.model.class_id].action_radius_m for one in (machine, person))
                if works and apart_m.min() > _ABOARD_M:
                    breaches += int(np.count_nonzero(inside[1:] & ~inside[:-1]))
    assert 2.0 <= breaches / hours <= 40.0


def test_another_seed_gives_another_site() -> None:
    sites = [_site(seed) for seed in range(3)]
    assert not np.allclose(_places(sites[0].actors[0])[0], _places(sites[1].actors[0])[0])
    assert len({len(site.actors) for site in sites}) > 1


@pytest.mark.parametrize("seed", seeds(3))
def test_a_truck_stands_where_it_is_loaded_whenever_a_bucket_is_emptied_and_goes_in_between(seed: int) -> None:
    cast = _site(seed)
    excavator, truck = cast.actors[0], cast.actors[1]
    load, time_s = excavator.motion.joints["load"], excavator.motion.time_s
    # The motion goes on for a little longer than the duration.
    emptied_s = time_s[1:][(load[:-1] > 0.5) & (load[1:] <= 0.5)]
    emptied_s = emptied_s[emptied_s < min(_LASTING_S, truck.motion.time_s[-1])]
    spots_m = np.array([sample(truck.motion, float(at_s)).xy_m for at_s in emptied_s])
    assert len(spots_m) > 3
    np.testing.assert_allclose(spots_m, np.tile(spots_m[0], (len(spots_m), 1)), atol=1e-6)
    assert np.linalg.norm(_places(truck) - spots_m[0], axis=1).max() > 40.0


@pytest.mark.parametrize("seed", seeds(3))
def test_what_a_loader_carries_goes_from_the_pile_to_the_heap(seed: int) -> None:
    cast = _site(seed)
    loaders = [one for one in cast.actors if CLASSES[one.model.class_id].name == "wheel_loader"]
    working = [one for one in loaders if np.ptp(_places(one), axis=0).max() > 5.0]
    for one in working:
        load = one.motion.joints["load"]
        filled = one.motion.xy_m[1:][(load[1:] > 0.5) & (load[:-1] <= 0.5)]
        emptied = one.motion.xy_m[1:][(load[1:] <= 0.5) & (load[:-1] > 0.5)]
        assert np.linalg.norm(filled[0] - emptied[0]) > 8.0


def test_a_driver_who_comes_late_is_refused() -> None:
    rng = np.random.default_rng(0)
    actor = _site(0).actors[-1]
    walks = behaviour.errand(rng, actor.model, Place(0.0, 0.0), np.array([[0.0, 0.0], [9.0, 0.0]]), 1.0)
    with pytest.raises(ValueError, match="late"):
        behaviour.driving_off(rng, actor.motion, walks, 0.3, 0.4)
