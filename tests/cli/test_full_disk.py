"""A disk that is full, or gets full, ends in one line and a record that tells; never in a stack of calls."""

from __future__ import annotations

import errno
import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from cli.calling import Call
from cli.test_cli import make_video

from standoff.files.in_use import in_use
from standoff.monitor import record

ROOM_FOR_THE_RECORD = 16_000
"""Bytes a file: no film or report is so short."""

FULL = OSError(errno.ENOSPC, "No space left on device")


@pytest.fixture
def video(tmp_path: Path) -> Path:
    return make_video(tmp_path / "site.mp4", 5)


def fill_the_disk(monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Let writing a JSON file fail as on a full disk, from some call on."""
    calls = 0

    def sync(descriptor: int) -> None:
        nonlocal calls
        calls += 1
        if calls > after:
            raise FULL

    monkeypatch.setattr("standoff.files.place.os.fsync", sync)


def test_a_disk_that_is_full_from_the_start_is_one_line(
    call: Call, video: Path, site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill_the_disk(monkeypatch, after=0)
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out", "--quiet")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "No space left on device" in err
    assert [path.name for path in (tmp_path / "out").iterdir()] == []


@pytest.mark.parametrize("as_json", [False, True])
def test_a_disk_that_gets_full_is_told_by_the_record_and_by_the_exit_status(
    call: Call,
    video: Path,
    site: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    as_json: bool,
) -> None:
    fill_the_disk(monkeypatch, after=1)
    words = ["--json"] if as_json else []
    code, out, _ = call("run", video, "--config", site, "--out", tmp_path / "out", "--outputs", "hazards", *words)
    assert code == 1
    assert [record.getMessage().split(": ")[0] for record in caplog.records] == ["output record stopped"]
    assert "No space left on device" in caplog.text
    written = json.loads((tmp_path / "out" / "run.json").read_text())
    assert written["status"] == "failed"
    assert "No space left on device" in written["message"]
    if as_json:
        printed: dict[str, Any] = json.loads(out)
        assert printed["counts"]["frames"] == 5
        assert {name: printed[name] for name in written} == written


@pytest.mark.parametrize("size", [ROOM_FOR_THE_RECORD, 0])
def test_a_film_without_room_ends_in_a_line_and_never_in_the_death_of_the_process(tmp_path: Path, size: int) -> None:
    # libav dies of a second attempt at a header: in a process of its own, which may write no longer files.
    code = f"""
import resource, signal
import numpy as np
from pathlib import Path
from standoff.drawing.encoder import VideoFile
film = VideoFile(Path({str(tmp_path / "film.mp4")!r}), (640, 360), preset="ultrafast")
resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))
noise, failed = np.random.default_rng(0), 0
for index in range(90):
    try:
        film.write(noise.integers(0, 255, (360, 640, 3), np.uint8), index / 30)
    except OSError:
        failed += 1
film.close()
print(failed > 0)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "True\n", "")
    assert list(tmp_path.iterdir()) == []


def test_outputs_without_room_make_a_failed_run(call: Call, site: Path, tmp_path: Path) -> None:
    video, usual = make_video(tmp_path / "site.mp4", 40), resource.getrlimit(resource.RLIMIT_FSIZE)
    words = ["--outputs", "hazards,video,report", "--json"]
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM_FOR_THE_RECORD, usual[1]))
    try:
        code, out, _ = call("run", video, "--config", site, "--out", tmp_path / "out", *words)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    written = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (code, written["status"], list(written["sink_errors"])) == (1, "failed", ["video", "report"])
    assert json.loads(out) == written
    assert {path.name for path in (tmp_path / "out").iterdir()} <= {"run.json", "hazards.jsonl", "annotated.mp4"}


def test_an_output_that_cannot_be_begun_is_a_failed_run(
    call: Call, video: Path, site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_words: object) -> None:
        raise FULL

    monkeypatch.setattr("standoff.monitor.opening.make_sink", full)
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out", "--quiet")
    assert (code, out, err.count("\n"), "No space left on device" in err) == (2, "", 1, True)
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "failed"


def test_a_run_that_is_going_on_is_not_overwritten(call: Call, video: Path, site: Path, tmp_path: Path) -> None:
    assert call("run", video, "--config", site, "--out", tmp_path / "out", "--quiet", "--outputs", "")[0] == 0
    before = (tmp_path / "out" / "run.json").read_bytes()
    with in_use(tmp_path / "out"):
        code, _, err = call("run", video, "--config", site, "--out", tmp_path / "out", "--overwrite", "--quiet")
    assert (code, err.count("\n"), "still going on" in err) == (2, 1, True)
    assert (tmp_path / "out" / "run.json").read_bytes() == before
    assert call("run", video, "--config", site, "--out", tmp_path / "out", "--overwrite", "--quiet")[0] == 0


def test_what_is_written_in_the_place_of_a_longer_record_takes_its_whole_place(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    path.write_text(json.dumps({"status": "running", "long": "x" * 500}))
    record._write_over(path, {"status": "failed"})
    assert json.loads(path.read_text()) == {"status": "failed"}
