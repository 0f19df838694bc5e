"""Plans carried out by Ray: on this machine, or on a cluster whose machines see the same files."""

from __future__ import annotations

import math
import os
import shutil
import socket
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from standoff.core.errors import ConfigError, OutputError
from standoff.files.in_use import in_use
from standoff.scale.film import FilmPlan
from standoff.scale.part import FilmPart, parts_of
from standoff.scale.result import FilmResult

ANSWERS_WITHIN_S: Final = 10.0
"""A cluster's head that has said nothing for so long is taken not to be there."""
_JOINS: Final = 3
"""So often somebody joins who is not let in."""
_PORT: Final = 10001
"""Of a cluster's head, for those who are not part of it, unless the address says another."""
PART_S: Final = 600.0
"""Films longer than one and a half of it are looked at in parts; a process takes seconds to start."""
_TRIES_AGAIN: Final = 3
"""So often a film begins again whose process was killed; one that kills every process is bad itself."""
_AHEAD: Final = 2
"""So many films wait for each that is watched: a list of ten thousand is not held by anybody."""
_LETS_GO_WITHIN_S: Final = 30.0
"""A process that Ray has given up, because its machine is gone, may write to its folder for so long."""
_LOOKS_EVERY_S: Final = 5.0
_NO_MACHINE_S: Final = 60.0
"""A cluster without a machine that could do the work for so long has lost the films that wait."""
_SILENT: Final = {"log_to_driver": False, "logging_level": "ERROR"}
"""Ray's own words are for who develops on it; what goes wrong with a film we say."""
_STORE_BYTES: Final = 100 * 2**20
"""What passes between films and us are words; Ray would set aside a third of the memory."""
_ENVIRONMENT: Final = {
    # Ray tells its makers what it is used for, unless it is told not to.
    "RAY_USAGE_STATS_ENABLED": "0",
    # Without it Ray says that nobody collects its metrics.
    "RAY_BACKEND_LOG_LEVEL": "fatal",
    # Without it Ray hides the graphics cards from whoever does not ask for one.
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
}


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
        OutputError: The cluster is gone.
    """
    with connected(address) as ray:
        yield from Machines(ray, cores_per_film, part_s=part_s, on_part=on_part).watch(plans)


@dataclass(frozen=True, slots=True)
class _Handed:
    """A film or a part of one that a process has, and how many processes were lost with it before."""

    work: Work
    lost: int = 0


class Machines:
    """What Ray has to watch films with.

    Args:
        ray: Connected.
        cores_per_film: How many cores one film may keep busy.
        carry_out: What a process does with a film or a part, and that number of cores.
        part_s: As of `watch_films`.
        on_part: Likewise.

    Raises:
        ConfigError: No machine has a core.
    """

    def __init__(
        self,
        ray: Any,  # noqa: ANN401
        cores_per_film: int,
        carry_out: CarryOut | None = None,
        *,
        part_s: float = math.inf,
        on_part: Callable[[FilmPart], None] = lambda _: None,
    ) -> None:
        self._ray = ray
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
        self._begin = ray.remote(carry_out or _carry_out).options(
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
            done, _ = self._ray.wait(list(waiting), num_returns=1, timeout=_LOOKS_EVERY_S)
            if done:
                handed = waiting.pop(done[0])
                if isinstance(handed.work, FilmPart):
                    self._take_part(waiting, done[0], handed.work, handed.lost)
                    return
                result = self._result(done[0], handed.work, handed.lost)
                if result is not None:
                    yield result
                    return
                self._hand(waiting, _Handed(handed.work, handed.lost + 1))
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

    def _take_part(self, waiting: dict[Any, _Handed], done: Any, part: FilmPart, lost: int) -> None:  # noqa: ANN401
        """Begin a part again whose process was lost; otherwise it has come to its end, one way or the other."""
        errors = self._ray.exceptions
        try:
            self._ray.get(done)
        except errors.RayTaskError:
            pass  # Whoever watches the film meets the same fault, and says so.
        except errors.RayError:
            if lost < _TRIES_AGAIN:
                self._hand(waiting, _Handed(part, lost + 1))
                return
        self._end_part(waiting, part)

    def _end_part(self, waiting: dict[Any, _Handed], part: FilmPart) -> None:
        """Hand a film out to be watched when nobody looks at a part of it any more."""
        self._on_part(part)
        self._parts_left[part.plan.out] -= 1
        if not self._parts_left[part.plan.out]:
            self._hand(waiting, _Handed(part.plan))

    def _result(self, done: Any, plan: FilmPlan, lost: int) -> FilmResult | None:  # noqa: ANN401
        """Return the result of a film; None: its process was lost, and another is to watch it."""
        errors = self._ray.exceptions
        try:
            result: FilmResult = self._ray.get(done)
        except errors.RayTaskError as error:
            # A fault of ours in one film, or of a stage of somebody's own: the others go on.
            return FilmResult(plan.film, plan.out, "failed", _one_line(f"{type(error.cause).__name__}: {error.cause}"))
        except errors.RayError as error:
            if lost < _TRIES_AGAIN:
                return None
            message = _one_line(f"its process was lost {_TRIES_AGAIN + 1} times: {error}")
            return FilmResult(plan.film, plan.out, "failed", message)
        return result

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


def _one_line(text: str) -> str:
    return " ".join(text.split())[:300]


@contextmanager
def connected(address: str | None, cores: int | None = None) -> Generator[Any, None, None]:
    """Give Ray, connected to a cluster or to a new one on this machine alone; leave no trace of that one.

    Args:
        address: Of the cluster; None: this machine alone.
        cores: So many does this machine have, for whoever measures; None: as it has.

    Raises:
        ConfigError: Ray is not installed, or nobody answers at the address.
        OutputError: The cluster is gone.
    """
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    ray = _imported("ray")
    with _hushed(ray), _on_this_machine(ray, cores) if address is None else _joined(ray, address):
        yield ray


@contextmanager
def _on_this_machine(ray: Any, cores: int | None) -> Generator[None, None, None]:  # noqa: ANN401
    # Ray makes sockets there, whose names must be short.
    folder = Path(tempfile.mkdtemp(prefix=f"ray-{os.getpid()}-", dir="/tmp" if os.name == "posix" else None))
    try:
        with _deaf():
            ray.init(
                "local",
                num_cpus=cores,
                include_dashboard=False,
                object_store_memory=_STORE_BYTES,
                _temp_dir=str(folder),
                **_SILENT,
            )
        yield
    finally:
        ray.shutdown()
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _joined(ray: Any, address: str) -> Generator[None, None, None]:  # noqa: ANN401
    _join(ray, address)
    try:
        yield
    except (ConnectionError, _imported("grpc").RpcError) as error:
        raise OutputError(
            expected=f"the Ray cluster at {address} to stay",
            found=f"that it is gone ({_one_line(str(error))})",
            fix="start it again and repeat the command: films that are finished are skipped",
        ) from error
    finally:
        ray.shutdown()


def _join(ray: Any, address: str) -> None:  # noqa: ANN401
    """Become part of a cluster; one whose head answers but now and then fails to let us in is asked again.

    The head makes a process for each who joins, by a fork beside threads of gRPC: one of twenty dies at once.
    """
    for left in reversed(range(_JOINS)):
        _reach(address)
        try:
            ray.init(address, **_SILENT)
        except (ConnectionError, RuntimeError, ValueError) as error:
            if not left:
                raise _nobody(address, _one_line(str(error))) from error
            ray.shutdown()
        else:
            return


@contextmanager
def _deaf() -> Generator[None, None, None]:
    """Let nobody hear what a library of C++ says on standard error: of Ray, that it was told to say nothing."""
    kept = os.dup(2)
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


@contextmanager
def _hushed(ray: Any) -> Generator[None, None, None]:  # noqa: ANN401
    """Keep Ray from printing which process died to standard output, where our JSON goes; no option of Ray's does."""
    worker = ray._private.worker
    prints = worker.print_to_stdstream
    worker.print_to_stdstream = lambda *_words, **_more: None
    try:
        yield
    finally:
        worker.print_to_stdstream = prints


def _imported(name: str) -> Any:  # noqa: ANN401
    try:
        return import_module(name)
    except ImportError as error:
        raise ConfigError(
            expected="Ray, which shares films out", found=f"no {name}", fix="pip install 'standoff[scale]'"
        ) from error


def _reach(address: str) -> None:
    """Refuse an address at which no Ray answers: Ray itself would try for minutes.

    Raises:
        ConfigError: It is no address of Ray's, or nobody answers within ten seconds.
    """
    parts = urlsplit(address)
    try:
        port = parts.port or _PORT
    except ValueError:
        port = 0
    if parts.scheme != "ray" or not parts.hostname or not port:
        raise ConfigError(expected="an address like ray://HOST:10001", found=address, fix="name the cluster's head")
    given_up_s = time.monotonic() + ANSWERS_WITHIN_S
    try:
        # Who is not there at all is told at once.
        socket.create_connection((parts.hostname, port), timeout=ANSWERS_WITHIN_S).close()
    except OSError as error:
        raise _nobody(address, error.strerror or str(error)) from error
    grpc = _imported("grpc")
    with grpc.insecure_channel(f"{parts.hostname}:{port}") as channel:
        try:
            grpc.channel_ready_future(channel).result(timeout=max(0.5, given_up_s - time.monotonic()))
        except grpc.FutureTimeoutError as error:
            raise _nobody(address, f"no answer within {ANSWERS_WITHIN_S:.0f} s, or another program's") from error


def _nobody(address: str, found: str) -> ConfigError:
    return ConfigError(
        expected=f"a Ray cluster at {address}",
        found=f"none ({found})",
        fix="start its head with `ray start --head`, or leave --address out to use this machine",
    )
