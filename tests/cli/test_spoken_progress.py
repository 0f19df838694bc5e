from __future__ import annotations

import pytest

from standoff.cli import spoken_progress
from standoff.cli.console import progress, progress_bar


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(spoken_progress, "monotonic", lambda: now[0])
    return now


def test_where_there_is_no_terminal_a_line_a_minute_tells_how_far_it_is(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with progress_bar(quiet=False, unit="steps") as bar:
        task = bar.add_task("training", total=1000, rate=0.0)
        for step in range(1, 251):
            clock[0] += 0.5
            bar.update(task, completed=step, rate=2.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "training: 120 of 1000 steps, 2 a second, 0 h 7 min left",
        "training: 240 of 1000 steps, 2 a second, 0 h 6 min left",
    ]


def test_nothing_is_foretold_from_the_first_steps(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar(quiet=False, unit="frames") as bar:
        task = bar.add_task("monitoring", total=250, rate=0.0)
        clock[0] += 70.0
        bar.update(task, completed=1, rate=0.014)
    assert capsys.readouterr().err == "monitoring: 1 of 250 frames\n"


def test_quiet_is_quiet(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with progress("looking", 10, quiet=True) as step:
        for _ in range(10):
            clock[0] += 100.0
            step()
    assert not capsys.readouterr().err


def test_a_task_of_unknown_length_tells_no_end(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    with progress("looking", None) as step:
        clock[0] += 100.0
        step()
    line = capsys.readouterr().err
    assert line.startswith("looking: 1 frames, ") and "left" not in line
