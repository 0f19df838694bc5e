"""What becomes of films whose processes die, told by a Ray that follows a script."""

from __future__ import annotations

import socket
import time
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import ray.exceptions

from standoff.config import Settings
from standoff.core.errors import ConfigError
from standoff.scale import FilmPart, FilmPlan, FilmResult, connection, pool, watch_films
from standoff.scale.connection import Connection

Act = Callable[[FilmPlan], FilmResult]
ERRORS: Any = ray.exceptions


def complete(plan: FilmPlan) -> FilmResult:
    return FilmResult(plan.film, plan.out, "complete")


@dataclass
class ScriptedRay:
    """A Ray in which each film ends as a script says; films are done in the order in which they were begun.

    Args:
        script: By the film's name; the others are complete.
        cores: Of each machine.
    """

    script: dict[str, Act] = field(default_factory=dict)
    cores: Sequence[int] = (2,)
    most_waiting: int = 0
    options_given: dict[str, Any] = field(default_factory=dict)
    exceptions = ERRORS

    def remote(self, *words: Any) -> Any:
        """Both a function made remote, as Ray does it, and the call of one."""
        return words[0] if len(words) == 2 else self

    def options(self, **options: Any) -> ScriptedRay:
        self.options_given = options
        return self

    def nodes(self) -> list[dict[str, Any]]:
        return [{"Alive": True, "Resources": {"CPU": float(cores)}} for cores in self.cores]

    def wait(self, waiting: list[FilmPlan], num_returns: int, timeout: float) -> tuple[list[FilmPlan], list[FilmPlan]]:
        self.most_waiting = max(self.most_waiting, len(waiting))
        return (waiting[:num_returns], waiting[num_returns:]) if self.cores else ([], waiting)

    def get(self, plan: FilmPlan) -> FilmResult:
        return self.script.get(plan.film.stem, complete)(plan)


def plans(count: int) -> Iterator[FilmPlan]:
    for number in range(count):
        yield Plan(Path(f"{number}.mp4"), Path(f"out/{number}"), Settings(), {})


class Plan(FilmPlan):
    """A plan that can be a key, as Ray's references are."""

    def __hash__(self) -> int:
        return hash(self.film)


def watched(scripted: ScriptedRay, count: int, cores_per_film: int = 2) -> dict[str, FilmResult]:
    results = pool.Machines(Connection(scripted), cores_per_film).watch(plans(count))
    return {one.film.stem: one for one in results}


def lost(plan: FilmPlan) -> FilmResult:
    raise ERRORS.WorkerCrashedError


def faulty(plan: FilmPlan) -> FilmResult:
    raise ERRORS.RayTaskError("watch", "many\nlines", ZeroDivisionError("in a stage\nof mine"))


def test_a_film_that_kills_its_process_or_meets_a_fault_is_named_and_the_others_go_on() -> None:
    results = watched(ScriptedRay({"1": lost, "3": faulty}), 5)
    assert {name: one.status for name, one in results.items()} == {
        "0": "complete", "1": "failed", "2": "complete", "3": "failed", "4": "complete",
    }  # fmt: skip
    assert results["1"].message.startswith("its process was lost 4 times: ")
    assert results["3"].message == "ZeroDivisionError: in a stage of mine"


def ray_dies(plan: FilmPlan) -> FilmResult:
    raise ERRORS.LocalRayletDiedError


@pytest.mark.parametrize("deaths", [1, 6, 9])
def test_a_ray_of_our_own_that_dies_is_begun_anew_after_longer_and_longer_rests(
    deaths: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scripted, restarts = ScriptedRay({"1": ray_dies}), list[int]()
    rests = list[float]()
    monkeypatch.setattr(time, "sleep", rests.append)

    def restart() -> None:
        restarts.append(1)
        if len(restarts) == deaths:
            del scripted.script["1"]

    results = {one.film.stem: one for one in pool.Machines(Connection(scripted, restart), 2).watch(plans(5))}
    assert {name: one.status for name, one in results.items()} == {
        "0": "complete", "1": "complete" if deaths < 7 else "failed", "2": "complete", "3": "complete", "4": "complete",
    }  # fmt: skip
    assert rests == [1.0, 2.0, 4.0, 8.0, 16.0, 16.0][:deaths]
    assert len(restarts) == len(rests)
    if deaths == 9:
        assert results["1"].message.startswith("Ray died 7 times: ")


def test_what_a_process_returned_is_let_go_before_ray_is_begun_anew() -> None:
    # References of two Rays have the same names: one that outlives its own lets go what is not its own.
    class Reference:
        """As Ray's, one of which another Ray must not find alive."""

    class Refers(ScriptedRay):
        def remote(self, *words: Any) -> Any:
            if len(words) != 2:
                return self
            reference: Any = Reference()
            alive.add(reference)
            named[id(reference)] = words[0]
            return reference

        def get(self, plan: Any) -> FilmResult:
            return super().get(named[id(plan)])

    def restart() -> None:
        assert not alive
        scripted.script.clear()

    alive, named = weakref.WeakSet[Any](), dict[int, FilmPlan]()
    scripted = Refers({"0": ray_dies})
    results = list(pool.Machines(Connection(scripted, restart), 2).watch(plans(2)))
    assert [one.status for one in results] == ["complete", "complete"]


def test_a_cluster_is_not_begun_anew() -> None:
    assert watched(ScriptedRay({"1": ray_dies}), 3)["1"].message.startswith("its process was lost 4 times: ")


@pytest.mark.parametrize(
    ("cores", "per_film", "places"), [((2,), 2, 1), ((8, 4), 2, 6), ((1, 1), 4, 2), ((5, 0), 3, 1)]
)
def test_only_a_few_films_wait_for_each_that_is_watched(cores: tuple[int, ...], per_film: int, places: int) -> None:
    scripted = ScriptedRay(cores=cores)
    assert len(watched(scripted, 50, per_film)) == 50
    assert scripted.most_waiting == 2 * places
    assert scripted.options_given["num_cpus"] == min(per_film, max(cores))


def test_films_left_without_a_machine_fail_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "_NO_MACHINE_S", 0.0)
    monkeypatch.setattr(pool, "_LOOKS_EVERY_S", 0.0)
    scripted = ScriptedRay(cores=(2,))
    machines = pool.Machines(Connection(scripted), 2)
    results = machines.watch(plans(3))
    assert next(results).status == "complete"
    scripted.cores = ()
    assert [(one.status, one.message) for one in results] == [
        ("failed", "no machine of the cluster has 2 cores any more")
    ] * 2


def test_a_cluster_without_cores_is_refused() -> None:
    with pytest.raises(ConfigError, match="machines that have cores"):
        pool.Machines(Connection(ScriptedRay(cores=(0,))), 2)


def test_a_port_at_which_nobody_speaks_rays_language_is_given_up_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "ANSWERS_WITHIN_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        begun_s = time.monotonic()
        with pytest.raises(ConfigError, match="expected a Ray cluster at ray"):
            next(iter(watch_films([], f"ray://127.0.0.1:{silent.getsockname()[1]}")))
        assert time.monotonic() - begun_s < 3.0


def in_parts(plan: FilmPlan, part_s: float) -> list[FilmPart]:
    count = {"1": 5, "3": 2}.get(plan.film.stem, 0)
    return [Part(plan, number * part_s, None, 0, count) for number in range(count)]


class Part(FilmPart):
    """A part that can be a key."""

    def __hash__(self) -> int:
        return hash((self.plan.film, self.start_s))


@dataclass
class ScriptedParts(ScriptedRay):
    """A Ray that writes down what is done in which order; the parts of one film kill their processes.

    Args:
        deadly: Its name.
    """

    deadly: str = ""
    done: list[tuple[str, float | None]] = field(default_factory=list)

    def get(self, work: Any) -> Any:
        if isinstance(work, FilmPlan):
            self.done.append((work.film.stem, None))
            return super().get(work)
        self.done.append((work.plan.film.stem, work.start_s))
        if work.plan.film.stem == self.deadly:
            raise ERRORS.WorkerCrashedError
        return ""


@pytest.mark.parametrize("deadly", ["", "1", "3"])
def test_a_long_film_is_watched_once_all_its_parts_were_looked_at_or_given_up(
    monkeypatch: pytest.MonkeyPatch, deadly: str
) -> None:
    monkeypatch.setattr(pool, "parts_of", in_parts)
    told: list[FilmPart] = []
    scripted = ScriptedParts(cores=(2, 2), deadly=deadly)
    results = pool.Machines(Connection(scripted), 2, part_s=10.0, on_part=told.append).watch(plans(5))
    assert sorted(one.film.stem for one in results if one.status == "complete") == ["0", "1", "2", "3", "4"]
    for film, count in (("1", 5), ("3", 2)):
        order = [start_s for name, start_s in scripted.done if name == film]
        assert order[-1] is None and order.count(None) == 1
        tries = 4 if film == deadly else 1
        assert {order.count(10.0 * number) for number in range(count)} == {tries}
        assert sum(part.plan.film.stem == film for part in told) == count
    assert scripted.most_waiting == 4


def test_one_place_looks_at_no_film_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "parts_of", in_parts)
    scripted = ScriptedParts(cores=(2,))
    assert len(list(pool.Machines(Connection(scripted), 2, part_s=10.0).watch(plans(5)))) == 5
    assert all(start_s is None for _, start_s in scripted.done)


def test_parts_left_without_a_machine_end_as_failed_films(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "parts_of", in_parts)
    monkeypatch.setattr(pool, "_NO_MACHINE_S", 0.0)
    monkeypatch.setattr(pool, "_LOOKS_EVERY_S", 0.0)
    scripted = ScriptedParts(cores=(2, 2))
    results = pool.Machines(Connection(scripted), 2, part_s=10.0).watch(plans(5))
    assert next(results).status == "complete"
    scripted.cores = ()
    assert sorted((one.film.stem, one.status) for one in results) == [(str(k), "failed") for k in (1, 2, 3, 4)]
