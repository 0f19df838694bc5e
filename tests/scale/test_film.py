"""What is finished is known again by film, settings, files and version; what is not is done."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cli.test_cli import make_video

from standoff.config import load_settings
from standoff.scale import FilmPlan, plan_films

OUTPUTS = ("hazards", "tracks")


@pytest.fixture
def film(tmp_path: Path) -> Path:
    return make_video(tmp_path / "site.mp4", 20)


def plan(film: Path, site: Path, **more: Any) -> FilmPlan:
    settings = load_settings(site, {"outputs": OUTPUTS, **more})
    (one,) = plan_films([film], film.parent / "out", settings, overwrites=True)
    return one


def lengthen(film: Path, site: Path) -> FilmPlan:
    make_video(film, 21)
    return plan(film, site)


def fly(film: Path, site: Path, height_m: float = 30.0) -> FilmPlan:
    readings = f"HOME(9.0,45.0)\nGPS(9.0,45.0,9) BAROMETER:{height_m}\n\n"
    blocks = (f"{k}\n00:00:0{k},000 --> 00:00:0{k + 1},000\n{readings}" for k in (0, 1))
    film.with_suffix(".srt").write_text("".join(blocks), encoding="utf-8")
    return plan(film, site)


def survey_again(film: Path, site: Path) -> FilmPlan:
    survey = site.with_name("survey.yaml")
    survey.write_text(survey.read_text() + "# measured again\n")
    return plan(film, site)


CHANGES: dict[str, Callable[[Path, Path], FilmPlan]] = {
    "film of this name": lengthen,
    "flight log": fly,
    "`hazard`": lambda film, site: plan(film, site, hazard={"buffer_m": 1.5}),
    "`ground.survey`": survey_again,
    "version of standoff": lambda film, site: replace(plan(film, site), version="0.0.1"),
}


def test_a_plan_goes_to_another_process_as_it_is(film: Path, site: Path) -> None:
    one = plan(film, site)
    sent = pickle.dumps(one)
    assert pickle.loads(sent) == one
    assert len(sent) < 20_000


@pytest.mark.parametrize("cores", [0, 1])
def test_a_finished_film_is_not_watched_again(film: Path, site: Path, cores: int) -> None:
    first = plan(film, site).watch()
    before = (first.folder / "run.json").read_bytes()
    again = replace(plan(film, site), overwrites=False).watch(cores)
    assert (first.status, first.is_new, first.message) == ("complete", True, "")
    assert again == replace(first, is_new=False)
    assert (first.folder / "run.json").read_bytes() == before


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_a_film_is_watched_again_only_when_asked_where_anything_is_another(
    film: Path, site: Path, change: Callable[[Path, Path], FilmPlan], request: pytest.FixtureRequest
) -> None:
    telling = request.node.callspec.id
    done = plan(film, site).watch()
    before = (done.folder / "run.json").read_bytes()
    changed = change(film, site)
    refused = replace(changed, overwrites=False).watch()
    assert (refused.status, refused.found) == ("failed", None)
    assert telling in refused.message or "standoff 0.0.1" in refused.message
    assert (done.folder / "run.json").read_bytes() == before
    if telling != "version of standoff":
        assert (changed.watch().is_new, replace(changed, overwrites=False).watch().is_new) == (True, False)


def test_another_flight_log_beside_the_film_is_another_film(film: Path, site: Path) -> None:
    fly(film, site).watch()
    assert fly(film, site).watch().is_new is False
    assert fly(film, site, 31.0).watch().is_new is True


@pytest.mark.parametrize("status", ["running", "failed", "interrupted"])
def test_what_was_begun_and_not_completed_is_done_again(film: Path, site: Path, status: str) -> None:
    folder = plan(film, site).watch().folder
    record = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**record, "status": status}))
    again = replace(plan(film, site), overwrites=False).watch()
    assert (again.status, again.is_new) == ("complete", True)


def test_a_film_whose_output_is_gone_is_watched_again(film: Path, site: Path) -> None:
    folder = plan(film, site).watch().folder
    (folder / "tracks.parquet").unlink()
    again = replace(plan(film, site), overwrites=False).watch()
    assert (again.status, again.is_new) == ("complete", True)
    assert (folder / "tracks.parquet").is_file()


def test_a_machine_with_another_standoff_or_other_files_says_so(film: Path, site: Path) -> None:
    one = plan(film, site)
    older = replace(one, version="0.0.1").watch()
    survey_again(film, site)
    elsewhere = one.watch()
    assert (older.status, elsewhere.status) == ("failed", "failed")
    assert "expected standoff 0.0.1 and the same files on every machine" in older.message
    assert "found other files" in elsewhere.message
    assert not one.out.exists()


def test_what_is_found_is_what_the_run_wrote(film: Path, site: Path) -> None:
    make_video(film, 34)
    result = plan(film, site, source={"start_s": 0.2, "stop_s": 3.3}).watch()
    events = [json.loads(line) for line in (result.folder / "hazards.jsonl").read_text().splitlines()]
    danger = [event for event in events if event["severity"] == "danger"]
    assert danger, "a law about nothing"
    nearest = min(danger, key=lambda event: float(event["gap_m"]))
    assert result.found is not None
    assert result.found.watched_s == pytest.approx(3.1)
    assert (result.found.mapped_share, result.found.alarms) == (1.0, 1)
    assert result.found.hazards == {"danger": 1}
    (worst,) = result.found.worst
    assert (worst.time_s, worst.gap_m, worst.severity) == (nearest["time_s"], nearest["gap_m"], "danger")
    assert worst.between == "worker and excavator"
