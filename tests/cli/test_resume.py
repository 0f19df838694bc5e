"""`standoff run --resume`: after a kill the run goes on, and says what one says that was never killed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from cli.calling import Call
from cli.conftest import write_site
from cli.test_cli import make_video
from cli.test_replay import TABLES, assert_same
from scale.noted_detectors import looks
from scale.test_batch_verb import files_in
from scale.test_part import noted

PROJECT = Path(__file__).resolve().parents[2]
FRAMES = 36
IN_THE_AIR = 4
"""So many frames may have been looked at and not written down: one is read ahead, one in hand, one written."""


@pytest.fixture
def film(tmp_path: Path) -> Path:
    return make_video(tmp_path / "site.mp4", FRAMES)


def site(folder: Path, words: Path, **more: Any) -> Path:
    return write_site(
        folder,
        outputs=[*TABLES, "hazards", "report"],
        replace=noted(words, **more),
        # Each frame is on the disk before the next.
        tables={"flush_rows": 1},
    )


def killed(film: Path, config: Path, out: Path, *words: str) -> None:
    command = [sys.executable, "-m", "standoff", "run", str(film), "--config", str(config), "--out", str(out), *words]
    paths = os.pathsep.join(str(PROJECT / part) for part in ("src", "simulator/src", "tests"))
    done = subprocess.run([*command, "--quiet"], env={**os.environ, "PYTHONPATH": paths}, check=False)
    assert done.returncode == -signal.SIGKILL


@pytest.mark.parametrize("dies_at", [(1,), (17,), (35,), (8, 22)])
def test_a_killed_run_goes_on_and_is_the_run_that_was_never_killed(
    call: Call, film: Path, tmp_path: Path, dies_at: tuple[int, ...]
) -> None:
    words = tmp_path / "words"
    config = site(tmp_path, words, dies_at=dies_at)
    out, whole = tmp_path / "out", tmp_path / "whole"
    for number in range(len(dies_at)):
        killed(film, config, out, *(["--resume"] if number else []))
        assert looks(words)[-1] == dies_at[number]
    before = looks(words)
    assert call("run", film, "--config", config, "--out", out, "--resume", "--quiet") == (0, "", "")
    anew = looks(words)[len(before) :]
    assert anew == [*range(anew[0], FRAMES)]
    assert anew[0] >= dies_at[-1] - IN_THE_AIR
    record = json.loads((out / "run.json").read_text())
    assert (record["status"], record["model"].get("remembered_frames", 0)) == ("complete", FRAMES - len(anew))
    assert call("run", film, "--config", config, "--out", whole, "--quiet") == (0, "", "")
    assert_same(out, whole)
    assert {one.name for one in out.iterdir()} == {one.name for one in whole.iterdir()}


@pytest.fixture
def stopped(film: Path, tmp_path: Path) -> tuple[Path, Path]:
    """Settings, and the folder of a run that was killed."""
    config = site(tmp_path, tmp_path / "words", dies_at=[9])
    killed(film, config, tmp_path / "out")
    return config, tmp_path / "out"


def other_settings(film: Path, config: Path, out: Path) -> str:
    settings = yaml.safe_load(config.read_text())
    config.write_text(yaml.safe_dump({**settings, "hazard": {"buffer_m": 2.0}}))
    return "another setting `hazard`"


def other_film(film: Path, config: Path, out: Path) -> str:
    make_video(film, FRAMES + 1)
    return "another film of this name, or flight log"


def other_survey(film: Path, config: Path, out: Path) -> str:
    survey = config.with_name("survey.yaml")
    survey.write_text(survey.read_text() + "# measured again\n")
    return "another content of the file that `ground.survey` names"


def other_version(film: Path, config: Path, out: Path) -> str:
    record = json.loads((out / "run.json").read_text())
    record["versions"]["standoff"] = "0.0.1"
    (out / "run.json").write_text(json.dumps(record))
    return "another version of standoff"


def nothing_there(film: Path, config: Path, out: Path) -> str:
    shutil.rmtree(out)
    return "found none"


def complete(film: Path, config: Path, out: Path) -> str:
    record = json.loads((out / "run.json").read_text())
    (out / "run.json").write_text(json.dumps({**record, "status": "complete"}))
    return "found one that is complete"


@pytest.mark.parametrize("change", [other_settings, other_film, other_survey, other_version, nothing_there, complete])
def test_what_is_not_the_run_that_was_cut_short_is_one_line_and_loses_nothing(
    call: Call,
    film: Path,
    stopped: tuple[Path, Path],
    change: Callable[[Path, Path, Path], str],
) -> None:
    config, out = stopped
    said = change(film, config, out)
    before = files_in(out)
    code, printed, err = call("run", film, "--config", config, "--out", out, "--resume")
    assert (code, printed, err.count("\n")) == (2, "", 1)
    assert said in err
    assert files_in(out) == before


def test_whoever_forgets_to_say_resume_is_told_of_it_and_whoever_begins_again_looks_at_all(
    call: Call, film: Path, stopped: tuple[Path, Path], tmp_path: Path
) -> None:
    config, out = stopped
    code, _, err = call("run", film, "--config", config, "--out", out)
    assert (code, err.count("\n")) == (2, 1)
    assert "--resume" in err
    (tmp_path / "words").unlink()
    config = site(tmp_path, tmp_path / "words")
    assert call("run", film, "--config", config, "--out", out, "--overwrite", "--quiet")[0] == 0
    assert looks(tmp_path / "words") == [*range(FRAMES)]
