"""Share jobs among processes and get the results back in order.

OpenGL in software draws with all cores but does its geometry on one, and so does numpy: two processes with a frame
each are faster than one process with both cores.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from multiprocessing.connection import Connection
from typing import Generic, TypeVar

from standoff.core.errors import SimulationError, StandoffError

Job = TypeVar("Job")
Result = TypeVar("Result")
Factory = Callable[[], AbstractContextManager[Callable[[Job], Result]]]

_AHEAD = 2
"""Jobs that each process has at hand, so that it never waits for the others; few, to bound the memory."""


def work_through(
    factory: Factory[Job, Result], jobs: Sequence[Job], *, processes: int
) -> Generator[Result, None, None]:
    """Yield each job's result, in the jobs' order.

    Args:
        factory: Makes a worker; picklable; called once in each process.
        jobs: Pickled one by one to the processes in turn.
        processes: 1 works in this process.

    Raises:
        StandoffError: Whatever a worker raised.
        SimulationError: A process was killed.
    """
    if processes == 1:
        with factory() as worker:
            yield from map(worker, jobs)
        return
    with ExitStack() as stack:
        crew = [stack.enter_context(_Hand(factory, processes)) for _ in range(processes)]
        for index, job in enumerate(jobs[: processes * _AHEAD]):
            crew[index % processes].give(job)
        for index in range(len(jobs)):
            hand = crew[index % processes]
            result = hand.take()
            if index + processes * _AHEAD < len(jobs):
                hand.give(jobs[index + processes * _AHEAD])
            yield result


class _Hand(Generic[Job, Result]):
    """One process and the line to it."""

    def __init__(self, factory: Factory[Job, Result], processes: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._line, far_end = context.Pipe()
        threads = max(1, (os.cpu_count() or 1) // processes)
        self._process = context.Process(target=_work, args=(factory, far_end, threads), daemon=True)
        self._process.start()
        far_end.close()

    def __enter__(self) -> _Hand[Job, Result]:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.join()
        self._line.close()

    def give(self, job: Job) -> None:
        # A process that has ended takes no more jobs; why it ended is in the line, and `take` finds it there.
        with suppress(OSError):
            self._line.send(job)

    def take(self) -> Result:
        try:
            result = self._line.recv()
        except (EOFError, OSError) as error:
            raise _lost() from error
        if isinstance(result, Exception):
            raise result
        return result  # type: ignore[no-any-return]


def _lost() -> SimulationError:
    return SimulationError(
        expected="a rendering process that works to the end",
        found="that it was killed",
        fix="free memory or render with --processes 1",
    )


def _work(factory: Factory[Job, Result], line: Connection, threads: int) -> None:
    # llvmpipe reads this when its driver is loaded; each process draws with its share of the cores
    os.environ["LP_NUM_THREADS"] = str(threads)
    try:
        with factory() as worker:
            while True:
                job = line.recv()
                try:
                    result = worker(job)
                except Exception as error:
                    raise _failed(error) from error
                line.send(result)
    except StandoffError as error:
        line.send(error)
    except (EOFError, BrokenPipeError, KeyboardInterrupt):
        return


def _failed(error: Exception) -> StandoffError:
    """Return the error to send: one that is ours as it is, another in words, because not every exception can travel."""
    if isinstance(error, StandoffError):
        return error
    return SimulationError(
        expected="a rendering process without an error",
        found=f"{type(error).__name__}: {error}",
        fix="run again with --processes 1 to see where it comes from",
    )
