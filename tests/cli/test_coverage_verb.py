from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from cli.calling import Call
from evaluation.coverage.drawn_run import FRAMES, draw
from pages import PageReader, without_pictures

from standoff.evaluation.resampling import LEAST_GROUPS


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Runs and clips in turn; never changed by a test."""
    root = tmp_path_factory.mktemp("runs")
    return [folder for seed in range(LEAST_GROUPS) for folder in draw(seed, frames=FRAMES).write(root / f"{seed}")]


def test_one_run_is_scored_and_says_that_it_is_one(folders: list[Path], call: Call) -> None:
    code, said, _ = call("evaluate", "coverage", *folders[:2])
    assert code == 0
    for words in ("worker and", "excavator", "25+ m", "whole", "Single positions", "no intervals"):
        assert words in said


def test_several_runs_are_pooled_with_intervals(folders: list[Path], call: Call) -> None:
    code, said, _ = call("evaluate", "coverage", *folders, "--json", "-")
    found = json.loads(said)
    whole = next(row for row in found["pairs"] if row["pair"] == "all" and row["by"] == "all")
    assert (code, found["clips"], whole["frames"]) == (0, LEAST_GROUPS, LEAST_GROUPS * FRAMES * 4)
    for name in ("inside_68", "inside_95", "made_m"):
        low, high = whole["intervals"][name]
        assert low <= whole[name] <= high
    assert len(whole["observed"]) == len(found["probabilities"])
    code, said, _ = call("evaluate", "coverage", *folders, "--markdown")
    assert code == 0 and "| excavator | " in said and "bootstrap over the clips" in said


def test_one_page_shows_it_all(folders: list[Path], tmp_path: Path, call: Call) -> None:
    assert call("evaluate", "coverage", *folders, "--report", tmp_path / "sub" / "page.html")[0] == 0
    page = (tmp_path / "sub" / "page.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 1 and not re.search(r"(src|href)=\"(?!data:|#)", page)
    text = PageReader.of(page).text
    assert f"{LEAST_GROUPS} simulated clips" in text and "inside 95 %" in text and "worker-wheel loader" in text
    assert "nan" not in without_pictures(page).lower()


def test_a_run_without_its_clip_is_refused(folders: list[Path], call: Call) -> None:
    code, _, error = call("evaluate", "coverage", *folders[:3])
    assert (code, error.count("\n")) == (2, 1)
    assert "RUN CLIP" in error
    code, _, error = call("evaluate", "coverage", folders[1], folders[0])
    assert (code, error.count("\n")) == (2, 1)
    assert "frames.parquet" in error
