from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from laws import few, seeds
from tolerances import GEOMETRY_REL

from standoff.core.classes import CLASS_BY_NAME, CLASSES
from standoff_sim.behaviour import idle
from standoff_sim.movement.motion import Place, sample
from standoff_sim.people.worker import make_worker
from standoff_sim.scene.cast import Cast, FilmedArea, is_person, swept
from standoff_sim.scene.casting import CASTS, crowd
from standoff_sim.scene.scene import Actor

_LASTING_S = 4.0
_STAGE = FilmedArea(30.0, 1.0, _LASTING_S, None, (-3.0, -2.0))


def _cast(name: str, seed: int, area: FilmedArea = _STAGE) -> Cast:
    return CASTS[name](np.random.default_rng(seed), area)


def _placed(actor: Actor, time_s: float) -> tuple[float, ...]:
    placement = sample(actor.motion, time_s)
    return (*placement.xy_m, placement.heading_rad, *placement.velocity_mps)


@pytest.mark.parametrize("name", sorted(CASTS))
@pytest.mark.parametrize("seed", [0, 1])
def test_actors_are_numbered_from_one(name: str, seed: int) -> None:
    actors = _cast(name, seed).actors
    assert [actor.entity_id for actor in actors] == list(range(1, len(actors) + 1))


@pytest.mark.parametrize("name", few(["busy", "random", "mobile"]))
def test_the_same_seed_gives_the_same_cast(name: str) -> None:
    first, second = _cast(name, 7).actors, _cast(name, 7).actors
    assert [type(actor.model) for actor in first] == [type(actor.model) for actor in second]
    for one, other in zip(first, second, strict=True):
        for time_s in (0.0, 1.3, _LASTING_S):
            assert _placed(one, time_s) == _placed(other, time_s)
    assert [_placed(a, 0.0) for a in first] != [_placed(a, 0.0) for a in _cast(name, 8).actors]


@pytest.mark.parametrize(("workers", "machines", "seed"), [(8, 5, 0), (3, 1, 1), (5, 0, 2), (0, 2, 3)])
def test_a_crowd_has_the_workers_and_machines_that_are_wanted(workers: int, machines: int, seed: int) -> None:
    cast = crowd(np.random.default_rng(seed), _STAGE, workers=workers, machines=machines)
    people = sum(is_person(actor.model) for actor in cast.actors)
    assert len(cast.actors) - people == machines == len(cast.machines_way)
    # an activity of two may bring a worker with its machine
    assert people == len(cast.peoples_way) and people >= workers - 1
    assert people <= workers + machines


@pytest.mark.parametrize("seed", seeds(3))
def test_sites_packed_with_machines_have_several_of_the_wanted_kinds(seed: int) -> None:
    excavator = CLASS_BY_NAME["excavator"].id
    for name in ("excavators", "machines"):
        cast = _cast(name, seed)
        machines = [actor.model for actor in cast.actors if not is_person(actor.model)]
        assert all((model.class_id == excavator) == (name == "excavators") for model in machines)
        assert len(machines) >= 2


@pytest.mark.parametrize("name", ["excavators", "machines"])
def test_people_work_between_packed_machines_where_there_is_room(name: str) -> None:
    casts = [_cast(name, seed) for seed in range(4)]
    assert sum(is_person(actor.model) for cast in casts for actor in cast.actors) >= len(casts)


@pytest.mark.parametrize("seed", seeds(3))
def test_nobody_who_is_added_alone_comes_into_the_way_of_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cast, added = Cast(), []
    for _ in range(40):
        worker = make_worker(rng)
        x_m, y_m = rng.uniform(-2.5, 2.5, 2)
        added.append(cast.add([worker], [idle(rng, worker, Place(float(x_m), float(y_m), 0.0), _LASTING_S)]))
    assert True in added and False in added
    ways = cast.peoples_way
    assert sum(added) == len(ways) == len(cast.actors)
    for number, way in enumerate(ways):
        assert not any(way.intersects(other) for other in ways[:number])


@pytest.mark.parametrize("seed", seeds(3))
def test_only_those_who_act_together_share_ground(seed: int) -> None:
    cast = crowd(np.random.default_rng(seed), _STAGE, workers=6, machines=4)
    ways = [swept(actor.model, actor.motion) for actor in cast.actors]
    met = [
        (i, k)
        for i, way in enumerate(ways)
        for k, other in enumerate(ways)
        if i < k and way.intersection(other).area > GEOMETRY_REL
    ]
    # those who act together are added one after the other
    assert all(k == i + 1 for i, k in met)
    assert not any(pair[1] == following[0] for pair, following in pairwise(met)), "a group has two at most"


@pytest.mark.parametrize("seed", seeds(3))
def test_the_reference_object_is_never_driven_over(seed: int) -> None:
    bed = shapely.Point(_STAGE.place(-3.0, -2.0).xy_m).buffer(1.5)
    assert not any(way.intersects(bed) for way in _cast("busy", seed).machines_way)


@pytest.mark.parametrize("seed", seeds(2))
def test_an_actor_is_inside_its_way_at_any_time(seed: int) -> None:
    for actor in _cast("mobile", seed).actors:
        way = swept(actor.model, actor.motion)
        for time_s in np.linspace(0.0, _LASTING_S, 23):
            assert way.covers(shapely.Point(sample(actor.motion, float(time_s)).xy_m))


@pytest.mark.parametrize("distance_m", [15, 20])
@pytest.mark.parametrize("seed", seeds(3))
def test_the_stationary_cast_keeps_its_distance(distance_m: int, seed: int) -> None:
    excavator, worker = _cast(f"stationary-{distance_m}", seed).actors
    assert excavator.model.class_id == CLASS_BY_NAME["excavator"].id and is_person(worker.model)
    for time_s in (0.0, 1.7, _LASTING_S):
        apart_m = np.linalg.norm(sample(excavator.motion, time_s).xy_m - sample(worker.motion, time_s).xy_m)
        assert apart_m == pytest.approx(distance_m, rel=GEOMETRY_REL)


def test_a_stage_turns_with_the_camera() -> None:
    east = FilmedArea(90.0, 1.0, 1.0, None, None).place(2.0, 5.0)
    np.testing.assert_allclose(east.xy_m, [5.0, -2.0], atol=1e-12)


@pytest.mark.parametrize("seed", seeds(6))
def test_the_demo_has_one_near_miss_and_one_breach_whatever_the_seed(seed: int) -> None:
    actors = _cast("demo", seed, FilmedArea(60.0 * seed, 1.0, 14.0, None, None)).actors
    workers = [actor for actor in actors if is_person(actor.model)]
    gaps_m = []
    for worker in workers:
        for machine in (actor for actor in actors if not is_person(actor.model)):
            reach_m = sum(CLASSES[actor.model.class_id].action_radius_m for actor in (worker, machine))
            apart_m = [
                np.linalg.norm(sample(worker.motion, t).xy_m - sample(machine.motion, t).xy_m)
                for t in np.arange(0.0, 10.0, 0.04).tolist()
            ]
            gaps_m.append(float(min(apart_m)) - reach_m)
    breach_m, near_miss_m, *others_m = sorted(gaps_m)
    assert (breach_m, near_miss_m) == pytest.approx((-2.2, 0.6), abs=0.01)
    assert len(others_m) == 4 and min(others_m) > 2.0
