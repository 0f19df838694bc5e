"""The page's questions over HTTP: one contract, and problems in words."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")

from fastapi.testclient import TestClient
from service.demo_film import DEMO, HEIGHT_M, SIDE_M

from standoff.core.homography import FloatArray
from standoff.service.loopback import OpenPages
from standoff.service.setup import open_setup, setup_app

CONTRACT = Path(__file__).parents[2] / "page" / "setup-api.json"


@pytest.fixture
def client(site_file: Path) -> Iterator[TestClient]:
    pages = OpenPages()
    page = open_setup(DEMO / "video.mp4", site_file, pages)
    yield TestClient(setup_app(page, pages, None), raise_server_exceptions=True)
    page.close()


@pytest.fixture
def draft(corners_px: FloatArray) -> dict[str, Any]:
    reference = {"lengths_m": [SIDE_M], "height_m": HEIGHT_M, "corners_px": corners_px.tolist()}
    return {"ground": "reference", "reference": reference}


def test_the_page_is_written_for_this_contract(client: TestClient) -> None:
    """Its types are made from the file: `python -m standoff.service.contract page`, then `npm run types`."""
    assert client.get("/api/openapi.json").json() == json.loads(CONTRACT.read_text())


def test_a_draft_is_kept_and_a_second_page_is_told_that_it_is_late(client: TestClient, draft: dict[str, Any]) -> None:
    before = client.get("/api/draft").json()
    kept = client.put("/api/draft", json={"revision": before["revision"], "draft": draft})
    assert kept.json()["revision"] == before["revision"] + 1
    late = client.put("/api/draft", json={"revision": before["revision"], "draft": {}})
    assert (late.status_code, late.json()) == (409, kept.json())
    assert client.get("/api/draft").json()["draft"]["reference"]["corners_px"] == draft["reference"]["corners_px"]


def test_pictures_have_their_times(client: TestClient, truth: dict[str, Any]) -> None:
    for time_s in (0.0, 2.0, 1e6):
        answer = client.get("/api/picture", params={"time_s": time_s})
        assert answer.headers["content-type"] == "image/jpeg" and answer.content[:2] == b"\xff\xd8"
        nearest = min(truth["time_s"], key=lambda one: abs(one - min(time_s, truth["time_s"][-1])))
        assert float(answer.headers["x-time-s"]) == pytest.approx(nearest, abs=0.05)


def test_what_is_saved_is_what_the_command_that_is_told_reads(
    client: TestClient, draft: dict[str, Any], site_file: Path
) -> None:
    client.put("/api/draft", json={"revision": 0, "draft": draft})
    saved = client.post("/api/save", json={"draft": draft}).json()
    assert saved["files"] == [str(site_file)] and site_file.is_file()
    assert saved["command"].split()[:2] == ["standoff", "run"] and str(site_file) in saved["command"]
    assert [path.name for path in site_file.parent.iterdir()] == ["site.yaml"]  # no draft any more


@pytest.mark.parametrize(
    ("path", "question"),
    [
        ("/api/plan", {"time_s": 0.0, "draft": {"ground": "auto"}}),
        ("/api/length", {"unit": "metres", "text": "much"}),
        ("/api/save", {"draft": {"ground": "reference", "reference": {"corners_px": [[0, 0]] * 4, "lengths_m": [1]}}}),
    ],
)
def test_what_cannot_be_is_told_as_the_command_line_tells_it(
    client: TestClient, path: str, question: dict[str, Any]
) -> None:
    answer = client.post(path, json=question)
    assert answer.status_code == 422 and set(answer.json()) == {"expected", "found", "fix"}


@pytest.mark.parametrize(
    "question", [{}, {"time_s": "noon", "draft": {}}, {"time_s": 0, "draft": {"reference": {"corners_px": [[1]]}}}]
)
def test_a_question_that_is_none_is_refused(client: TestClient, question: dict[str, Any]) -> None:
    for path in ("/api/ground", "/api/tape", "/api/places", "/api/trial"):
        assert client.post(path, json=question).status_code == 422


@pytest.mark.live
def test_a_trial_runs_as_a_run_would_and_shows_its_film(client: TestClient, draft: dict[str, Any]) -> None:
    begun = client.post("/api/trial", json={"time_s": 0.3, "lasts_s": 0.2, "draft": draft}).json()
    assert begun["state"] == "running"
    given_up_s = time.monotonic() + 240
    while (answer := client.get("/api/trial").json())["state"] == "running" and time.monotonic() < given_up_s:
        time.sleep(0.2)
    assert answer["state"] == "done", answer["message"]
    summary = answer["summary"]
    assert summary["frames"] == summary["frames_with_map"] == 13 and summary["measured_distances"] > 0
    film = client.get(f"/api/trial/{begun['number']}/film")
    assert film.content[4:8] == b"ftyp"
    assert client.get(f"/api/trial/{begun['number']}/../site.yaml").status_code == 404
    assert client.delete("/api/trial").json()["state"] == "stopped"
    assert client.get(f"/api/trial/{begun['number']}/film").status_code == 404
