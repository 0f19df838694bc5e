"""A finished run over HTTP: what its tables and events say, and what people say of its hazards."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from cli.conftest import write_site
from cli.test_cli import make_video
from cli.test_replay import monitor

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")

from fastapi.testclient import TestClient

from standoff.clips.reviews import read_reviews
from standoff.core.errors import ConfigError, DataError, StandoffError
from standoff.service.loopback import OpenPages
from standoff.service.review import open_review, review_app

CONTRACT = Path(__file__).parents[2] / "page" / "review-api.json"
OLD_RUNS = sorted(path.parent for path in (Path(__file__).parents[1] / "golden").glob("*/run.json"))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a worker who walks to an excavator, its film beside it."""
    folder = tmp_path_factory.mktemp("recorded")
    return monitor(make_video(folder / "site.mp4", 34), write_site(folder), folder / "out")


@pytest.fixture
def run(recorded: Path, tmp_path: Path) -> Path:
    shutil.copytree(recorded.parent, tmp_path / "mine")
    return tmp_path / "mine" / recorded.name


def client_of(run: Path, film: Path | None = None) -> TestClient:
    pages = OpenPages()
    return TestClient(review_app(open_review(run, film, pages), pages, None))


@pytest.fixture
def client(run: Path) -> Iterator[TestClient]:
    yield client_of(run)


def frames_of(client: TestClient, from_s: float, to_s: float) -> list[dict[str, Any]]:
    return list(client.get("/api/frames", params={"from_s": from_s, "to_s": to_s}).json()["frames"])


def test_the_page_is_written_for_this_contract(client: TestClient) -> None:
    """Its types are made from the file: `python -m standoff.service.contract page`, then `npm run types`."""
    assert client.get("/api/openapi.json").json() == json.loads(CONTRACT.read_text())


def test_hazards_are_told_from_their_first_event_to_their_last(client: TestClient, run: Path) -> None:
    told = client.get("/api/run").json()
    events = [json.loads(line) for line in (run / "hazards.jsonl").read_text().splitlines()]
    assert [one["hazard_id"] for one in told["hazards"]] == list(dict.fromkeys(one["hazard_id"] for one in events))
    (hazard,) = (one for one in told["hazards"] if one["severity"] == "danger")
    its = [one for one in events if one["hazard_id"] == hazard["hazard_id"]]
    assert (hazard["opened_s"], hazard["closed_s"]) == (its[0]["time_s"], its[-1]["time_s"])
    assert [one["kind"] for one in hazard["parties"]] == ["worker", "excavator"]
    nearest = min((one for one in its if one["gap_m"] is not None), key=lambda one: one["gap_m"])
    assert hazard["gap_text"] == f"{nearest['gap_m']:.1f} m" and hazard["worst_s"] == nearest["time_s"]
    assert (told["status"], told["missing"], told["shows"], told["why_not"]) == ("complete", [], "film", "")


def test_curves_are_the_least_of_the_tables(client: TestClient, run: Path) -> None:
    curves = client.get("/api/curves").json()
    pairs = pq.read_table(run / "proximity.parquet").to_pydict()
    known = [one for one in curves["gap"] if one is not None]
    assert min(known) == pytest.approx(min(one for one in pairs["gap_m"] if one is not None), abs=1e-3)
    for time_s, gap in zip(curves["time_s"], curves["gap"], strict=True):
        now = [g for t, g in zip(pairs["time_s"], pairs["gap_m"], strict=True) if t == time_s and g is not None]
        assert gap == (pytest.approx(min(now), abs=1e-3) if now else None)
    assert curves["time_s"] == pq.read_table(run / "frames.parquet").to_pydict()["time_s"]


def test_frames_say_what_the_tables_say(client: TestClient, run: Path) -> None:
    frames = frames_of(client, 0.0, 10.0)
    tracks = pq.read_table(run / "tracks.parquet").to_pydict()
    assert [one["time_s"] for one in frames] == pq.read_table(run / "frames.parquet").to_pydict()["time_s"]
    told = [(frame["time_s"], one["track_id"]) for frame in frames for one in frame["tracks"]]
    assert told == list(zip(tracks["time_s"], tracks["track_id"], strict=True))
    last = frames[-1]
    worker = next(one for one in last["tracks"] if one["kind"] == "worker")
    # The survey says that twenty pixels are a metre.
    circle_px = np.array(worker["circle_px"])
    np.testing.assert_allclose(np.ptp(circle_px, axis=0), 2 * 20.0 * worker["radius_m"], rtol=0.02)
    (pair,) = last["pairs"]
    distance_m = pq.read_table(run / "proximity.parquet").to_pydict()["distance_m"][-1]
    assert pair["text"].startswith(f"{distance_m:.1f} ±") and pair["severity"] == worker["severity"] == "danger"


def test_severities_are_those_of_the_moment(client: TestClient, run: Path) -> None:
    """A hazard that became danger was a warning before, and nothing before that."""
    events = [json.loads(line) for line in (run / "hazards.jsonl").read_text().splitlines()]
    for frame in frames_of(client, 0.0, 10.0)[:-1]:
        now = None
        for event in events:
            if event["rule"] == "proximity" and event["time_s"] <= frame["time_s"]:
                now = None if event["phase"] == "closed" else event["severity"]
        assert [pair["severity"] for pair in frame["pairs"]] == [now] * len(frame["pairs"])


def test_a_span_is_a_part_of_the_run(client: TestClient) -> None:
    times_s = [one["time_s"] for one in frames_of(client, 1.0, 2.0)]
    assert times_s[0] == 1.0 and times_s[-1] == 2.0 and len(times_s) == 11
    assert frames_of(client, 1000.0, 1001.0) == []
    for span in ((0.0, 11.0), (2.0, 1.0)):
        refused = client.get("/api/frames", params={"from_s": span[0], "to_s": span[1]})
        assert refused.status_code == 422 and "a span" in refused.json()["expected"]


def test_what_people_say_is_kept_beside_the_run_and_the_last_word_counts(client: TestClient, run: Path) -> None:
    hazard = client.get("/api/run").json()["hazards"][0]
    for verdict, comment in (("false_alarm", "a sign"), ("right", " no, Ärger\n")):
        said = {"hazard_id": hazard["hazard_id"], "verdict": verdict, "comment": comment}
        assert client.put("/api/review", json=said).json()["verdict"] == verdict
    assert len((run / "review.jsonl").read_text().splitlines()) == 2
    kept = read_reviews(run)[hazard["hazard_id"]]
    assert (kept.verdict, kept.comment, kept.time_s) == ("right", "no, Ärger", hazard["worst_s"])
    assert kept.reviewed_at is not None and kept.reviewed_at.utcoffset() is not None
    again = client_of(run).get("/api/run").json()["hazards"][0]
    assert (again["verdict"], again["comment"]) == ("right", "no, Ärger")


def test_of_a_hazard_that_is_not_there_nobody_can_say_anything(client: TestClient, run: Path) -> None:
    answer = client.put("/api/review", json={"hazard_id": "none", "verdict": "right"})
    assert answer.status_code == 422 and not (run / "review.jsonl").exists()
    assert client.put("/api/review", json={"hazard_id": "none", "verdict": "perhaps"}).status_code == 422


def test_the_film_is_looked_for_and_another_one_is_refused(run: Path, tmp_path: Path) -> None:
    moved = (run.parent / "site.mp4").rename(tmp_path / "elsewhere.mp4")
    without = client_of(run)
    told = without.get("/api/run").json()
    assert told["shows"] == "none" and "--film" in told["why_not"]
    assert without.get("/api/film").status_code == without.get("/api/picture?time_s=1").status_code == 404
    assert client_of(run, moved).get("/api/run").json()["shows"] == "film"
    other = make_video(run.parent / "site.mp4", 12)
    assert client_of(run).get("/api/run").json()["shows"] == "none"
    with pytest.raises(ConfigError, match="another one"):
        open_review(run, other, OpenPages())


def test_pictures_and_parts_of_the_film_are_shown(client: TestClient) -> None:
    picture = client.get("/api/picture", params={"time_s": 1.0})
    assert picture.content[:2] == b"\xff\xd8" and float(picture.headers["x-time-s"]) == 1.0
    part = client.get("/api/film", headers={"Range": "bytes=4-7"})
    assert (part.status_code, part.content) == (206, b"ftyp")


@pytest.mark.parametrize("name", ["tracks", "proximity", "hazards"])
def test_a_run_that_kept_less_shows_what_there_is(run: Path, name: str) -> None:
    file = run / ("hazards.jsonl" if name == "hazards" else f"{name}.parquet")
    file.unlink()
    client = client_of(run)
    told = client.get("/api/run").json()
    assert told["missing"] == [name]
    assert client.get("/api/curves").status_code == 200
    frames = frames_of(client, 0.0, 10.0)
    assert len(frames) == 34 and all(bool(one["tracks"]) == (name != "tracks") for one in frames)


@pytest.mark.parametrize("old", OLD_RUNS, ids=lambda path: path.name)
def test_runs_of_older_versions_are_shown(old: Path, tmp_path: Path) -> None:
    shutil.copytree(old, tmp_path / "old")
    client = client_of(tmp_path / "old")
    assert client.get("/api/run").json()["hazards"]
    assert any(one is not None for one in client.get("/api/curves").json()["gap"])
    frames = frames_of(client, 0.0, 10.0)
    assert all(one["tracks"] for one in frames[5:])


def test_what_is_no_run_is_refused_in_one_line(run: Path, tmp_path: Path) -> None:
    (run / "review.jsonl").write_text('{"hazard_id": "x", "verdict": "perhaps", "time_s": 1}\n')
    with pytest.raises(DataError, match=r"review.jsonl, line 1") as caught:
        open_review(run, None, OpenPages())
    assert "\n" not in str(caught.value)
    (run / "run.json").write_text("{")
    for folder in (run, tmp_path / "none", tmp_path):
        with pytest.raises(StandoffError) as refused:
            open_review(folder, None, OpenPages())
        assert "\n" not in str(refused.value)


def test_places_that_are_counted_anew_are_said_to_be_so(run: Path) -> None:
    """Where another map takes over nobody's velocity is known: what lies before is no way that somebody went."""
    path = run / "tracks.parquet"
    tracks = pq.read_table(path)
    velocity = [
        None if 1.95 < time_s < 2.15 else one if one is not None and not math.isnan(one) else 0.0
        for time_s, one in zip(tracks["time_s"].to_pylist(), tracks["vx_mps"].to_pylist(), strict=True)
    ]
    at = tracks.column_names.index("vx_mps")
    pq.write_table(tracks.set_column(at, tracks.schema.field(at), [velocity]), path)
    assert [one["time_s"] for one in frames_of(client_of(run), 0.0, 10.0) if one["is_moved"]] == [2.0]
