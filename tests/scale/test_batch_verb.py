"""`standoff batch` without Ray: films one after another in this process."""

from __future__ import annotations

import csv
import errno
import json
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from cli.calling import Call
from pages import PageReader
from scale.conftest import FILMS
from tolerances import TOLD_IN_DEGREES_M

from standoff.core.geographic import GeographicOrigin
from standoff.scale import FilmPlan, FilmResult

NUMBERS = ("watched_s", "mapped_share", "ground_share", "worker_hours", "alarms", "danger", "warning", "unknown")


@pytest.fixture
def one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def watch(plans: Sequence[FilmPlan], address: str | None, *, cores_per_film: int, **_: Any) -> Iterator[FilmResult]:
        yield from (plan.watch(cores_per_film) for plan in plans)

    monkeypatch.setattr("standoff.scale.watch_films", watch)


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.usefixtures("one_by_one")
def test_films_are_watched_and_what_is_finished_is_skipped(call: Call, films: Path, site: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, printed, err = call("batch", films, "--config", site, "--out", out)
    assert (code, [name for name in FILMS if f"{name}.mp4" in printed]) == (0, [*FILMS])
    assert {path.name for path in out.iterdir()} == {*FILMS, "batch.parquet", "batch.csv", "overview.html"}
    runs = {name: files_in(out / name) for name in FILMS}
    code, printed, err = call("batch", films, "--config", site, "--out", out, "--json", "--quiet")
    assert (code, err) == (0, "")
    assert [one["is_new"] for one in json.loads(printed)] == [False] * len(FILMS)
    assert {name: files_in(out / name) for name in FILMS} == runs


@pytest.mark.usefixtures("one_by_one")
def test_table_and_page_say_of_each_film_what_its_run_says(call: Call, films: Path, site: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    site.write_text(site.read_text().replace("- hazards", "- hazards\n- report"))
    assert call("batch", films, "--config", site, "--out", out, "--quiet")[0] == 0
    rows = pq.read_table(out / "batch.parquet").to_pylist()
    for row, frames in zip(rows, FILMS.values(), strict=True):
        record = json.loads((Path(row["folder"]) / "run.json").read_text())
        assert (row["status"], row["message"], row["is_new"]) == ("complete", "", True)
        assert row["watched_s"] == pytest.approx(frames / 10)
        assert row["mapped_share"] == record["counts"]["frames_with_map"] / record["counts"]["frames"] == 1.0
        assert row["ground_share"] == record["watched_ground"]["share"]
        assert row["alarms"] == record["alarms"]["alarms"]
        assert {name: row[name] for name in ("danger", "warning", "unknown") if row[name]} == record["counts"][
            "hazards"
        ]
    fields = pq.read_schema(out / "batch.parquet")
    assert all(field.metadata[b"description"] for field in fields)
    with (out / "batch.csv").open(newline="") as file:
        assert [one["alarms"] for one in csv.DictReader(file)] == [str(row["alarms"]) for row in rows]
    page = PageReader.of((out / "overview.html").read_text(encoding="utf-8"))
    assert set(page.fetched) == {f"{name}/report.html" for name in FILMS}
    assert "danger hazards" in page.text


@pytest.mark.usefixtures("one_by_one")
def test_of_a_site_with_a_place_on_the_earth_the_worst_moments_are_told_in_degrees(
    call: Call, films: Path, site: Path, tmp_path: Path
) -> None:
    site.write_text(site.read_text().replace("- hazards", "- hazards\n- tracks"))
    survey = yaml.safe_load((tmp_path / "survey.yaml").read_text())
    corners_m = np.array([point.pop("m") for point in survey["points"]])
    # Of the survey, the first point is where the site frame begins.
    origin = GeographicOrigin(8.5, 50.1, 50.1)
    for point, lonlat_deg in zip(survey["points"], origin.to_lonlat(corners_m - corners_m[0]), strict=True):
        point["lonlat"] = lonlat_deg.tolist()
    (tmp_path / "survey.yaml").write_text(yaml.safe_dump(survey))
    out = tmp_path / "out"
    assert call("batch", films, "--config", site, "--out", out, "--quiet")[0] == 0
    features = json.loads((out / "moments.geojson").read_text())["features"]
    assert {feature["properties"]["film"] for feature in features} == {f"{name}.mp4" for name in FILMS}
    for feature in features:
        about = feature["properties"]
        tracks = pq.read_table(out / Path(about["film"]).stem / "tracks.parquet").to_pylist()
        then = [(row["x_m"], row["y_m"]) for row in tracks if row["time_s"] == about["time_s"]]
        assert len(then) == 2, "a worker and an excavator"
        place_m = origin.to_metres(np.array([feature["geometry"]["coordinates"]]))
        assert place_m == pytest.approx(np.mean(then, axis=0, keepdims=True), abs=TOLD_IN_DEGREES_M)


@pytest.mark.usefixtures("one_by_one")
def test_a_film_that_fails_is_named_and_loses_nothing_else(call: Call, films: Path, site: Path, tmp_path: Path) -> None:
    (films / "a <broken> one.mp4").write_text("no film")
    out = tmp_path / "out"
    code, _, err = call("batch", films, "--config", site, "--out", out, "--quiet")
    assert (code, err.count("\n")) == (1, 1)
    assert err.startswith("standoff: a <broken> one.mp4: expected a video file")
    rows = {Path(row["film"]).stem: row for row in pq.read_table(out / "batch.parquet").to_pylist()}
    assert {name: row["status"] for name, row in rows.items()} == {
        "a <broken> one": "failed",
        **dict.fromkeys(FILMS, "complete"),
    }
    assert {rows["a <broken> one"][name] for name in NUMBERS} == {None}
    assert "a <broken> one.mp4 failed: expected a video file" in PageReader.of((out / "overview.html").read_text()).text


@pytest.mark.usefixtures("one_by_one")
def test_a_disk_that_is_full_for_one_film_is_told_and_the_others_finish(
    call: Call, films: Path, site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sync = os.fsync

    def full_for_the_second(descriptor: int) -> None:
        if "/second/" in str(Path(f"/proc/self/fd/{descriptor}").readlink()):
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(descriptor)

    monkeypatch.setattr("standoff.files.place.os.fsync", full_for_the_second)
    out = tmp_path / "out"
    code, printed, err = call("batch", films, "--config", site, "--out", out, "--json", "--quiet")
    assert (code, err.count("\n")) == (1, 1)
    assert err.startswith("standoff: second.mp4: ") and "No space left on device" in err
    assert {Path(one["film"]).stem: one["status"] for one in json.loads(printed)} == {
        "first": "complete", "second": "failed", "third": "complete",
    }  # fmt: skip


@pytest.mark.usefixtures("one_by_one")
def test_resumed_with_other_settings_is_one_line_and_nothing_is_touched(
    call: Call, films: Path, site: Path, tmp_path: Path
) -> None:
    words = ("batch", films, "--config", site, "--out", tmp_path / "out", "--quiet")
    assert call(*words)[0] == 0
    before = files_in(tmp_path / "out")
    site.write_text(site.read_text() + "hazard: {buffer_m: 2.0}\n")
    code, _, err = call(*words)
    assert (code, err.count("\n")) == (2, 1)
    assert "another setting `hazard`" in err and "--overwrite" in err
    assert files_in(tmp_path / "out") == before
    code, printed, _ = call(*words, "--overwrite", "--json")
    assert (code, {one["is_new"] for one in json.loads(printed)}) == (0, {True})


def a_folder_without_films(films: Path) -> list[Any]:
    (films / "empty").mkdir()
    (films / "empty" / "notes.txt").touch()
    return [films / "empty"]


def two_films_of_one_name(films: Path) -> list[Any]:
    (films / "more").mkdir()
    shutil.copy(films / "first.mp4", films / "more" / "first.mov")
    return [films, films / "more"]


def a_missing_detector(films: Path) -> list[Any]:
    return [films, "--model", films / "none.onnx", "--config", os.devnull]


BAD = {
    "expected films in": a_folder_without_films,
    "expected films with names of their own": two_films_of_one_name,
    "expected a film at": lambda films: [films / "none.mp4"],
    "expected the file of the setting `model`": a_missing_detector,
    "expected an address like ray://HOST:10001": lambda films: [films, "--address", "localhost:6379"],
    "expected a Ray cluster at ray://127.0.0.1:1": lambda films: [films, "--address", "ray://127.0.0.1:1"],
}


@pytest.mark.parametrize("words", BAD.values(), ids=BAD.keys())
def test_what_cannot_be_begun_is_one_line_and_exit_2(
    call: Call, films: Path, site: Path, tmp_path: Path, words: Any, request: pytest.FixtureRequest
) -> None:
    code, printed, err = call("batch", "--config", site, "--out", tmp_path / "out", "--quiet", *words(films))
    assert (code, printed, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"standoff: {request.node.callspec.id}")
