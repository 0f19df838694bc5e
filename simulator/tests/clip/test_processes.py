from __future__ import annotations

import os
import signal
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial

import pytest

from standoff.core.errors import DataError, SimulationError
from standoff_sim.clip.processes import _Hand, work_through


@contextmanager
def _squares(stop_at: int = -1, kill_at: int = -1, divide_at: int = -1) -> Generator[Callable[[int], int], None, None]:
    def square(job: int) -> int:
        if job == stop_at:
            raise DataError(expected="a job", found=f"job {job}", fix="skip it")
        if job == kill_at:
            os.kill(os.getpid(), signal.SIGKILL)
        return job * job // (job != divide_at)

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


def test_a_job_for_a_process_that_has_failed_does_not_hide_why_it_failed() -> None:
    with _Hand(partial(_squares, stop_at=4), 2) as hand:
        for job in (3, 4):
            hand.give(job)
        hand._process.join()
        hand.give(5)
        assert hand.take() == 9
        with pytest.raises(DataError, match="found job 4"):
            hand.take()


def test_a_job_for_a_process_that_was_killed_does_not_hide_that_it_was() -> None:
    with _Hand(partial(_squares, kill_at=4), 2) as hand:
        for job in (3, 4):
            hand.give(job)
        hand._process.join()
        hand.give(5)
        assert hand.take() == 9
        with pytest.raises(SimulationError, match="killed"):
            hand.take()


def test_an_error_that_is_not_ours_is_told_as_what_it_is() -> None:
    with pytest.raises(SimulationError, match="ZeroDivisionError: "):
        list(work_through(partial(_squares, divide_at=1), [0, 1, 2], processes=2))
