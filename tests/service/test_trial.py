"""Trials of the set-up page: what they leave."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")

from standoff.config import Settings
from standoff.service.setup import trial


class SlowRun:
    """A run that writes its files only when it is over, and takes a while for that."""

    def __init__(self, out: Path) -> None:
        self.out, self.source, self.is_begun = out, SimpleNamespace(frame_count=10**6), threading.Event()

    def __iter__(self) -> Iterator[object]:
        try:
            while True:
                yield object()
                self.is_begun.set()
                time.sleep(0.01)
        finally:
            time.sleep(0.3)
            self.out.mkdir(parents=True)
            (self.out / "annotated.mp4").write_bytes(b"film")


def test_trials_that_still_write_are_waited_for_before_their_files_go(monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[SlowRun] = []

    def opened(_film: Path, out: Path, _settings: Any) -> SlowRun:
        runs.append(SlowRun(out))
        return runs[-1]

    monkeypatch.setattr(trial, "open_run", opened)
    tried = trial.Trial(Path("site.mp4"), lambda: None)
    for number in (1, 2):
        assert tried.begin(Settings()).number == number
        while len(runs) < number or not runs[-1].is_begun.wait(1.0):
            time.sleep(0.01)
    tried.close()
    assert tried.answer.state == "stopped"
    time.sleep(0.5)
    assert [run.out.exists() for run in runs] == [False, False]
    assert not runs[0].out.parent.exists()
