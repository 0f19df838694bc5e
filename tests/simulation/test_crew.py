from __future__ import annotations

import os
import signal
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial

import pytest

from standoff.core.errors import DataError, SimulationError
from standoff.simulation.crew import work_through


@contextmanager
def _squares(stop_at: int = -1, kill_at: int = -1) -> Generator[Callable[[int], int], None, None]:
    def square(job: int) -> int:
        if job == stop_at:
            raise DataError(expected="a job", found=f"job {job}", fix="skip it")
        if job == kill_at:
            os.kill(os.getpid(), signal.SIGKILL)
        return job * job

    yield square


@pytest.mark.parametrize("processes", [1, 2, 3])
def test_results_come_in_the_order_of_the_jobs(processes: int) -> None:
    assert list(work_through(_squares, range(11), processes=processes)) == [job * job for job in range(11)]


@pytest.mark.parametrize("processes", [1, 2])
def test_an_error_in_a_worker_reaches_the_caller_as_it_was(processes: int) -> None:
    with pytest.raises(DataError, match=r"found job 4\. Skip it"):
        list(work_through(partial(_squares, stop_at=4), range(9), processes=processes))


def test_a_killed_process_is_an_error_and_not_a_wait_for_ever() -> None:
    with pytest.raises(SimulationError, match="killed"):
        list(work_through(partial(_squares, kill_at=5), range(9), processes=2))
