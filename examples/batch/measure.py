"""What a batch costs: films that sleep, a long list, the same films in 1 process and in 2, a film in parts.

    python examples/batch/measure.py overhead
    python examples/batch/measure.py list
    python examples/batch/measure.py films FOLDER --config site.yaml
    python examples/batch/measure.py parts FOLDER --config site.yaml

Times are those of this machine, with all else that runs on it.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from standoff.config import Settings, load_settings
from standoff.scale import (
    FilmPlan,
    FilmResult,
    Findings,
    Moment,
    find_films,
    plan_films,
    write_overview,
    write_tables,
)
from standoff.scale.connection import connected
from standoff.scale.pool import Machines

SLEEP_S = 1.0
FILMS_A_PROCESS = 6
PROCESSES = (1, 8, 64)
LONG_LIST = 10_000
SAID_EVERY = 1000
PART_S = 2.5
"""The demo's film has ten seconds."""


def sleeping(plan: Any, cores: int) -> Any:  # noqa: ANN401
    """Take the time of a process and none of its cores; of standoff nothing is loaded. Return which process it was."""
    import os
    import time

    time.sleep(SLEEP_S)
    return os.getpid()


def overhead() -> None:
    """Print what Ray adds to films that sleep, by the number of processes."""
    print("processes   films   until all processes run, s   the films, s   of it sleep, s   added to each film, ms")
    for processes in PROCESSES:
        with connected(None, cores=processes) as connection:
            machines = Machines(connection, 1, sleeping)
            begun_s, running = time.monotonic(), set[int]()
            # A process that starts early takes what was meant for a late one.
            while len(running) < processes:
                ids: Iterable[Any] = machines.watch(_numbers(2 * processes))
                running.update(ids)
            started_s = time.monotonic() - begun_s
            took_s = _took_s(machines.watch(_numbers(FILMS_A_PROCESS * processes)))
        slept_s = FILMS_A_PROCESS * SLEEP_S
        added_ms = 1000.0 * (took_s - slept_s) / FILMS_A_PROCESS
        films = FILMS_A_PROCESS * processes
        print(
            f"{processes:7d} {films:7d} {started_s:26.1f} {took_s:14.2f} {slept_s:16.1f} {added_ms:25.0f}", flush=True
        )


def _numbers(count: int) -> Iterator[Any]:
    yield from range(count)


def _took_s(results: Iterable[Any]) -> float:
    begun_s = time.monotonic()
    for _ in results:
        pass
    return time.monotonic() - begun_s


def found_at_once(plan: FilmPlan, cores: int) -> FilmResult:
    """Find in no time as much as there may be in a film."""
    moments = tuple(Moment(60.0 * k, "danger", "worker and wheel loader", -0.5 * k) for k in range(3))
    hazards = {"danger": 3, "warning": 5, "unknown": 1}
    return FilmResult(plan.film, plan.out, "complete", found=Findings(600.0, 0.9, 0.5, 0.4, 8, hazards, moments))


def long_list() -> None:
    """Print the memory of the process that holds a list of many films, from the list to the overview."""
    with tempfile.TemporaryDirectory() as folder:
        films, out = Path(folder) / "films", Path(folder) / "out"
        for made in (films, out):
            made.mkdir()
        for number in range(LONG_LIST):
            (films / f"{number:05d}.mp4").touch()
        _say("before")
        begun_s = time.monotonic()
        plans = plan_films(find_films([films]), out, load_settings())
        _say(f"{len(plans)} films planned in {time.monotonic() - begun_s:.1f} s")
        with connected(None) as connection:
            _say("Ray connected")
            begun_s = time.monotonic()
            results = []
            for result in Machines(connection, 1, found_at_once).watch(plans):
                results.append(result)
                if len(results) % SAID_EVERY == 0:
                    _say(f"{len(results)} results after {time.monotonic() - begun_s:.1f} s")
        write_tables(results, out)
        write_overview(results, out / "overview.html")
        size = (out / "overview.html").stat().st_size
        _say(f"tables and an overview of {size / 1e6:.1f} MB")


def _say(what: str) -> None:
    peak_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"{what:50s} peak {peak_kb / 1024:6.0f} MB", flush=True)


def same_films(folder: Path, config: Path) -> None:
    """Print how long the same films take one at a time and two at a time, one core each."""
    for processes in (1, 2):
        with tempfile.TemporaryDirectory() as out, connected(None, cores=processes) as connection:
            machines = Machines(connection, 1)
            plans = plan_films(find_films([folder]), Path(out), load_settings(config))
            # Processes start, and load what they need, with the first films.
            started_s = _took_s(machines.watch(plans[:processes]))
            took_s = _took_s(machines.watch(plans[processes:]))
            count = len(plans) - processes
            print(
                f"{processes} processes: start and first {started_s:.1f} s, then {count} films in {took_s:.1f} s",
                flush=True,
            )


def in_parts(film: Path, settings: Settings) -> None:
    """Print how long a film takes as a whole, and looked at in parts by two processes."""
    first_second = settings.model_copy(update={"source": replace(settings.source, stop_s=1.0)})
    looked_s: list[float] = []
    with tempfile.TemporaryDirectory() as out, connected(None, cores=2) as connection:
        start, whole, divided = (
            plan_films([film], Path(out) / name, own)
            for name, own in (("start", first_second), ("whole", settings), ("parts", settings))
        )
        # Processes start, and load what they need, with the first parts.
        _took_s(Machines(connection, 1, part_s=0.5).watch(start))
        whole_s = _took_s(Machines(connection, 1).watch(whole))
        begun_s = time.monotonic()
        machines = Machines(connection, 1, part_s=PART_S, on_part=lambda _: looked_s.append(time.monotonic()))
        in_parts_s = _took_s(machines.watch(divided))
    print(
        f"{film.name}: as a whole {whole_s:.1f} s; in {len(looked_s)} parts {in_parts_s:.1f} s, of which "
        f"{looked_s[-1] - begun_s:.1f} s until all were looked at",
        flush=True,
    )


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("overhead", "list", "films", "parts"))
    parser.add_argument("folder", type=Path, nargs="?", help="of films")
    parser.add_argument("--config", type=Path, help="settings, YAML")
    given = parser.parse_args()
    if given.what == "overhead":
        overhead()
    elif given.what == "list":
        long_list()
    elif given.folder is None:
        sys.exit(f"{given.what}: name the folder of the films")
    elif given.what == "films":
        same_films(given.folder, given.config)
    else:
        for film in find_films([given.folder]):
            in_parts(film, load_settings(given.config))


if __name__ == "__main__":
    main()
