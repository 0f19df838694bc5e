from __future__ import annotations

import json
from pathlib import Path

from cli.calling import Call
from evaluation.watched.test_watched import drawn_run

from standoff.core.watched_ground import REASONS, TOO_SMALL


def test_workers_on_watched_ground_are_counted_over_several_clips(tmp_path: Path, call: Call) -> None:
    folders = [*drawn_run(0)[0].write(tmp_path / "a"), *drawn_run(1)[0].write(tmp_path / "b")]
    code, said, _ = call("evaluate", "watched", *folders)
    assert code == 0
    for words in ("on watched ground", REASONS[TOO_SMALL], "2 clips", "hidden by something"):
        assert words in said
    code, said, _ = call("evaluate", "watched", *folders, "--json", "-")
    found = json.loads(said)
    assert code == 0 and found["on_watched"]["missed"] == 0 and found["missed_share"] == 0.0


def test_a_run_without_its_clip_is_refused(tmp_path: Path, call: Call) -> None:
    run, _ = drawn_run(0)[0].write(tmp_path)
    code, _, error = call("evaluate", "watched", run)
    assert (code, error.count("\n")) == (2, 1) and "RUN CLIP" in error
