"""Plans carried out by Ray: on this machine, or on a cluster whose machines see the same files."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from standoff.core.errors import ConfigError, OutputError
from standoff.files.in_use import in_use
from standoff.scale.connection import Connection, connected, one_line
from standoff.scale.film import FilmPlan
from standoff.scale.part import FilmPart, parts_of
from standoff.scale.result import FilmResult

PART_S: Final = 600.0
"""Films longer than one and a half of it are looked at in parts; a process takes seconds to start."""
_TRIES_AGAIN: Final = 3
"""So often a film begins again whose process was killed; one that kills every process is bad itself."""
_RAY_DIES: Final = 6
"""So often Ray itself may die while a film is watched or waits, which is not the film's fault."""
_RESTS_S: Final = 16.0
"""Before Ray is begun anew, at the most: what it died of may pass, and each time we wait twice as long for that."""
_AHEAD: Final = 2
"""So many films wait for each that is watched: a list of ten thousand is not held by anybody."""
_LETS_GO_WITHIN_S: Final = 30.0
"""A process that Ray has given up, because its machine is gone, may write to its folder for so long."""
_LOOKS_EVERY_S: Final = 5.0
_NO_MACHINE_S: Final = 60.0
"""A cluster without a machine that could do the work for so long has lost the films that wait."""

Work = FilmPlan | FilmPart
CarryOut = Callable[[Any, int], Any]


def watch_films(
    plans: Iterable[FilmPlan],
    address: str | None = None,
    *,
    cores_per_film: int = 2,
    part_s: float = PART_S,
    on_part: Callable[[FilmPart], None] = lambda _: None,
) -> Iterator[FilmResult]:
    """Watch films side by side, and yield each one's result when it is done, whatever the order.

    Args:
        plans: Taken as there is room for them.
        address: Of a Ray cluster, `ray://HOST[:PORT]`; None: this machine alone.
        cores_per_film: How many cores one film may keep busy.
        part_s: Length of the parts of long films; inf: each film in one piece.
        on_part: Is told of each part that was looked at.

    Raises:
        ConfigError: Ray is not installed, nobody answers at the address, or the cluster has no machine with a core.
        OutputError: The cluster is gone, or Ray does not start here.
    """
    with connected(address) as connection:
        yield from Machines(connection, cores_per_film, part_s=part_s, on_part=on_part).watch(plans)


@dataclass(frozen=True, slots=True)
class _Handed:
    """A film or a part of one that a process has; how many were lost with it before, and how often Ray died."""

    work: Work
    lost: int = 0
    ray_died: int = 0


class Machines:
    """What Ray has to watch films with.

    Args:
        connection: Ray.
        cores_per_film: How many cores one film may keep busy.
        carry_out: What a process does with a film or a part, and that number of cores.
        part_s: As of `watch_films`.
        on_part: Likewise.

    Raises:
        ConfigError: No machine has a core.
    """

    def __init__(
        self,
        connection: Connection,
        cores_per_film: int,
        carry_out: CarryOut | None = None,
        *,
        part_s: float = math.inf,
        on_part: Callable[[FilmPart], None] = lambda _: None,
    ) -> None:
        self._ray, self._restart = connection.ray, connection.restart
        self._part_s, self._on_part = part_s, on_part
        self._parts_left = Counter[Path]()
        self._looked_s, self._seen_s = -math.inf, time.monotonic()
        self._known: list[int] = []
        cores = self._cores()
        if not cores:
            raise ConfigError(
                expected="a Ray cluster with machines that have cores",
                found="none",
                fix="join some to it with `ray start --address HOST:PORT`",
            )
        self._needs = min(cores_per_film, max(cores))
        # Each film's libraries would otherwise take all cores of the machine.
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), str(self._needs))
        self._begin = self._ray.remote(carry_out or _carry_out).options(
            # We begin again ourselves: what was handed to a machine that is just dying, Ray takes for lost at once.
            num_cpus=self._needs,
            max_retries=0,
            runtime_env={"env_vars": threads},
        )

    def watch(self, plans: Iterable[FilmPlan]) -> Iterator[FilmResult]:
        """Yield the result of each plan when it is done."""
        waiting: dict[Any, _Handed] = {}
        for work in self._in_parts(plans):
            self._hand(waiting, _Handed(work))
            while len(waiting) >= _AHEAD * max(1, self._places()):
                yield from self._next(waiting)
        while waiting:
            yield from self._next(waiting)

    def _in_parts(self, plans: Iterable[FilmPlan]) -> Iterator[Work]:
        """Yield short films, and of long ones the parts, where there is more than one place for them."""
        for plan in plans:
            divides = math.isfinite(self._part_s) and self._places() > 1
            parts = parts_of(plan, self._part_s) if divides else []
            self._parts_left.update(part.plan.out for part in parts)
            yield from parts or (plan,)

    def _hand(self, waiting: dict[Any, _Handed], handed: _Handed) -> None:
        waiting[self._begin.remote(handed.work, self._needs)] = handed

    def _next(self, waiting: dict[Any, _Handed]) -> Iterator[FilmResult]:
        """Wait for one film or part, and forget it; yield what became of a film.

        What was lost with its process begins again; a film whose parts are all looked at is handed out to be watched.
        """
        while True:
            done = self._ray.wait(list(waiting), num_returns=1, timeout=_LOOKS_EVERY_S)[0]
            if done:
                handed = waiting.pop(done[0])
                came = self._got(done.pop())
                if isinstance(came, self._ray.exceptions.RayError) and self._begins_again(waiting, handed, came):
                    continue
                if isinstance(handed.work, FilmPart):
                    # What went wrong with it, whoever watches the film meets again and says so.
                    self._end_part(waiting, handed.work)
                else:
                    yield self._result(handed, handed.work, came)
                return
            if self._places():
                self._seen_s = time.monotonic()
            elif time.monotonic() - self._seen_s > _NO_MACHINE_S:
                work = waiting.pop(next(iter(waiting))).work
                if isinstance(work, FilmPart):
                    self._end_part(waiting, work)
                    return
                message = f"no machine of the cluster has {self._needs} cores any more"
                yield FilmResult(work.film, work.out, "failed", message)
                return

    def _end_part(self, waiting: dict[Any, _Handed], part: FilmPart) -> None:
        """Hand a film out to be watched when nobody looks at a part of it any more."""
        self._on_part(part)
        self._parts_left[part.plan.out] -= 1
        if not self._parts_left[part.plan.out]:
            self._hand(waiting, _Handed(part.plan))

    def _got(self, reference: Any) -> Any:  # noqa: ANN401
        """Return what came of what was handed out, or Ray's error."""
        try:
            return self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            # Its traceback would keep the reference alive, which the next Ray takes for one of its own and lets go.
            return error.with_traceback(None)

    def _result(self, handed: _Handed, plan: FilmPlan, came: Any) -> FilmResult:  # noqa: ANN401
        """Return the result of a film that is not begun again."""
        errors = self._ray.exceptions
        if isinstance(came, errors.RayTaskError):
            # A fault of ours in one film, or of a stage of somebody's own: the others go on.
            message = f"{type(came.cause).__name__}: {came.cause}"
        elif self._restart_after(came):
            message = f"Ray died {handed.ray_died + 1} times: {came}"
        elif isinstance(came, errors.RayError):
            message = f"its process was lost {handed.lost + 1} times: {came}"
        else:
            result: FilmResult = came
            return result
        return FilmResult(plan.film, plan.out, "failed", one_line(message))

    def _restart_after(self, came: Any) -> Callable[[], None] | None:  # noqa: ANN401
        """Return what begins Ray anew where it died and is our own."""
        return self._restart if isinstance(came, self._ray.exceptions.LocalRayletDiedError) else None

    def _begins_again(self, waiting: dict[Any, _Handed], handed: _Handed, error: Exception) -> bool:
        """Hand out again what was lost with its process; False: its fault is its own, or that happened too often.

        On a busy machine Ray itself may die; then it is begun anew, and so is all that waits.
        """
        if isinstance(error, self._ray.exceptions.RayTaskError):
            return False
        if restart := self._restart_after(error):
            if handed.ray_died == _RAY_DIES:
                return False
            again = [replace(one, ray_died=one.ray_died + 1) for one in (handed, *waiting.values())]
            waiting.clear()
            time.sleep(min(2.0**handed.ray_died, _RESTS_S))
            restart()
        elif handed.lost == _TRIES_AGAIN:
            return False
        else:
            again = [replace(handed, lost=handed.lost + 1)]
        for one in again:
            self._hand(waiting, one)
        return True

    def _places(self) -> int:
        """Return how many films can be watched at once now: machines come and go."""
        return sum(cores // self._needs for cores in self._cores())

    def _cores(self) -> list[int]:
        """Return how many cores each machine has; asking Ray takes longer than handing a film to it."""
        if time.monotonic() - self._looked_s >= _LOOKS_EVERY_S:
            nodes = self._ray.nodes()
            cores = (int(node["Resources"].get("CPU", 0)) for node in nodes if node["Alive"])
            self._known = [one for one in cores if one > 0]
            self._looked_s = time.monotonic()
        return self._known


def _carry_out(work: Work, cores: int) -> FilmResult | str:
    """Watch a film, or look at a part of one, in a process of Ray's."""
    import cv2

    cv2.setNumThreads(cores)
    if isinstance(work, FilmPart):
        return work.look(cores)
    _wait_until_free(work.out)
    return work.watch(cores)


def _wait_until_free(folder: Path) -> None:
    """Wait until whoever was given up while it wrote to a folder is gone; who stays is the film's own failure."""
    given_up_s = time.monotonic() + _LETS_GO_WITHIN_S
    while folder.is_dir() and time.monotonic() < given_up_s:
        try:
            with in_use(folder):
                return
        except OutputError:
            time.sleep(0.2)
