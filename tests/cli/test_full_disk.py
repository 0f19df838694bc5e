"""A disk that is full, or gets full, ends in one line and a record that tells; never in a stack of calls."""

from __future__ import annotations

import errno
import json
from pathlib import Path
from typing import Any

import pytest
from cli.calling import Call
from cli.test_cli import make_video

from standoff.files.in_use import in_use
from standoff.stages.sinks import record as record_sink

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

    monkeypatch.setattr("standoff.files.json_text.os.fsync", sync)


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
    call: Call, video: Path, site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, as_json: bool
) -> None:
    fill_the_disk(monkeypatch, after=1)
    words = ["--json"] if as_json else []
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out", "--outputs", "hazards", *words)
    assert code == 1
    assert err.count("could not be written whole") == 1 and "No space left on device" in err
    written = json.loads((tmp_path / "out" / "run.json").read_text())
    assert written["status"] == "failed"
    assert "No space left on device" in written["message"]
    if as_json:
        printed: dict[str, Any] = json.loads(out)
        assert printed["counts"]["frames"] == 5
        assert printed["status"] == "complete"


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
    record_sink._write_over(path, {"status": "failed"})
    assert json.loads(path.read_text()) == {"status": "failed"}
