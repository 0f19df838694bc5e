"""Who is near and no hazard, and who must never be excused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stages.locate.test_ground_filter import wobbling
from stages.proximity.test_meter import positions_of

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.types import PARKED
from standoff.stages.proximity.excuses import IN_CAB, TOGETHER, Excuses
from standoff.stages.proximity.params import ProximityParams

WORKER, LOADER, EXCAVATOR = (CLASS_BY_NAME[name].id for name in ("worker", "wheel_loader", "excavator"))
A, B = np.array([0]), np.array([1])


def excuse_of(
    excuses: Excuses, worker_m: tuple[float, float], machine_m: tuple[float, float], *, standing_s: float = 0.0,
    machine: int = LOADER,
) -> str:  # fmt: skip
    rows = positions_of([worker_m, machine_m], [WORKER, machine])
    rows = replace(rows, standing_s=np.array([0.0, standing_s]))
    distance_m = np.linalg.norm(rows.xy_m[B] - rows.xy_m[A], axis=1)
    return str(excuses.update(rows, A, B, distance_m)[0])


def test_a_machine_is_parked_after_its_time_and_not_any_more_once_it_moves() -> None:
    excuses = Excuses(ProximityParams(parked_after_s=60.0))
    told = [excuse_of(excuses, (0.0, 0.0), (5.0, 0.0), standing_s=s) for s in (0.0, 59.9, 60.0, 900.0, 0.0)]
    assert told == ["", "", PARKED, PARKED, ""]


def test_a_machine_that_is_placed_with_its_error_is_parked_while_it_stands_and_a_hazard_once_it_has_moved_off() -> None:
    """Seen with errors that last, it moves off at 200 s with a metre a second more in each second."""
    shares = []
    for told in wobbling(3.0, 200.0, 206.0).T[:8]:
        excuses = Excuses(ProximityParams(parked_after_s=60.0))
        said = [excuse_of(excuses, (0.0, 0.0), (5.0, 0.0), standing_s=standing_s) for standing_s in told.tolist()]
        parked = said[round(60.0 / 0.2) : round(200.0 / 0.2)]
        shares.append(parked.count(PARKED) / len(parked))
        # 2.5 m from where it stood, and for ever after.
        assert set(said[round((200.0 + np.sqrt(5.0)) / 0.2) + 1 :]) == {""}
    assert np.mean(shares) > 0.9


def test_an_excavator_is_never_parked_and_no_machine_where_the_rule_is_off() -> None:
    assert excuse_of(Excuses(ProximityParams()), (0, 0), (5, 0), standing_s=1e4, machine=EXCAVATOR) == ""
    assert excuse_of(Excuses(ProximityParams(parked_after_s=None)), (0, 0), (5, 0), standing_s=1e4) == ""


def test_a_worker_who_stands_does_not_park_a_machine() -> None:
    rows = replace(positions_of([(0.0, 0.0), (5.0, 0.0)], [WORKER, LOADER]), standing_s=np.array([900.0, 0.0]))
    assert Excuses(ProximityParams()).update(rows, A, B, np.array([5.0])).tolist() == [""]


def ride(beside_m: float, params: ProximityParams, steps: int = 60) -> list[str]:
    """Return what is said while a machine drives 0.2 m a frame with somebody so far from its middle."""
    excuses = Excuses(params)
    return [excuse_of(excuses, (0.2 * k, beside_m), (0.2 * k, 0.0)) for k in range(steps)]


def test_a_driver_is_told_once_the_machine_drove_and_a_walker_beside_it_never() -> None:
    told = ride(0.8, ProximityParams())
    assert told[0] == "" and told[-1] == IN_CAB
    assert 20 <= told.index(IN_CAB) <= 25  # 4 m
    assert set(ride(3.0, ProximityParams())) == {""}
    assert set(ride(0.8, ProximityParams(cabs=False))) == {""}


def test_somebody_at_a_machine_that_stands_is_not_in_its_cab_whatever_the_noise() -> None:
    rng, excuses = np.random.default_rng(6), Excuses(ProximityParams())
    for _ in range(2000):
        noise_m = rng.normal(0.0, 0.1, 4)
        place = excuse_of(excuses, (1.0 + noise_m[0], noise_m[1]), (noise_m[2], noise_m[3]))
        assert place == ""


def test_who_gets_off_is_a_person_again() -> None:
    excuses = Excuses(ProximityParams())
    for k in range(40):
        inside = excuse_of(excuses, (0.2 * k, 0.5), (0.2 * k, 0.0))
    assert inside == IN_CAB
    assert excuse_of(excuses, (8.0, 4.0), (8.0, 0.0)) == ""
    assert excuse_of(excuses, (8.0, 1.0), (8.0, 0.0)) == ""


@pytest.mark.parametrize("pair", [(1, 2), (2, 1)])
def test_who_works_together_is_said_by_whoever_knows(pair: tuple[int, int]) -> None:
    assert excuse_of(Excuses(ProximityParams(together=(pair,))), (0, 0), (5, 0)) == TOGETHER
    assert excuse_of(Excuses(ProximityParams(together=((1, 3),))), (0, 0), (5, 0)) == ""


def test_what_is_not_measured_is_never_excused() -> None:
    excuses = Excuses(ProximityParams(together=((1, 2),)))
    rows = positions_of([(np.nan, np.nan), (5.0, 0.0)], [WORKER, LOADER])
    assert excuses.update(rows, A, B, np.array([np.nan])).tolist() == [""]
