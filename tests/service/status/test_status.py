"""The status says what every process says of itself, and of whoever says nothing that it says nothing."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from fastapi.testclient import TestClient
from known_settings import know_settings
from prometheus_client.parser import text_string_to_metric_families
from service.status.made_service import QUANTILES, MadeService, hazard

from standoff.service.access import Access
from standoff.service.status import _token, status_app
from standoff.service.status.app import OPEN_PATHS

TOKEN = "a-token-of-this-test"
HERE = "http://127.0.0.1:8765"
CONTRACT = Path(__file__).parents[3] / "page" / "status-api.json"


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MadeService:
    know_settings(monkeypatch)
    return MadeService(tmp_path)


def client(made: MadeService, token: str = TOKEN) -> TestClient:
    guarded = Access(status_app(made.overview, None), token, opens_once=False, open_paths=OPEN_PATHS)
    return TestClient(guarded, base_url=HERE, follow_redirects=False)


def opened(made: MadeService) -> TestClient:
    browser = client(made)
    assert browser.get(f"/?token={TOKEN}").status_code == 303
    return browser


def samples(made: MadeService) -> dict[tuple[str, ...], float]:
    """Return what Prometheus reads: by name and labels."""
    families = text_string_to_metric_families(client(made).get("/metrics").text)
    return {(one.name, *sorted(one.labels.values())): one.value for family in families for one in family.samples}


def test_the_page_is_written_for_this_contract(made: MadeService) -> None:
    """Its types are made from the file: `python -m standoff.service.contract page`, then `npm run types`."""
    assert opened(made).get("/api/openapi.json").json() == json.loads(CONTRACT.read_text())


def test_a_service_that_works_is_ok(made: MadeService) -> None:
    made.say_all()
    made.show("gate", 0.4)
    status = made.overview.status()
    assert (status.overall, status.problems, status.site, status.broker_connected) == ("ok", [], "yard", True)
    assert [(one.name, one.is_answering, one.starts) for one in status.processes] == [
        (name, True, 1) for name in ("messenger", "analysis", "page", "capture-gate", "capture-crane")
    ]
    gate, crane = status.streams
    assert (gate.name, gate.state, gate.is_watched, gate.frames, gate.not_looked_at) == ("gate", "live", True, 250, 3)
    assert gate.picture_age_ms == pytest.approx(400.0, abs=200.0) and crane.picture_age_ms is None
    assert gate.captured_age_ms == pytest.approx(200.0, abs=300.0)
    assert (gate.watched_share, gate.unwatched, gate.delay, gate.map) == (0.875, {"blurred": 0.125}, "told", "surveyed")
    assert [(one.id, one.kind, one.xyxy_px) for one in gate.tracks] == [(1, "worker", (1.0, 2.0, 3.5, 4.0))]
    assert [(one.name, one.supervised, one.reason) for one in status.devices] == [
        ("wrist", True, ""),
        ("foreman", False, "crane: late"),
    ]
    assert status.letters == {"delivered": 12, "waiting": 1, "expired": 2}
    assert status.to_wrist_ms is not None and status.to_wrist_ms.model_dump() == QUANTILES


def test_before_anybody_has_spoken_nothing_is_claimed(made: MadeService) -> None:
    status = made.overview.status()
    assert (status.overall, status.broker_connected, status.processes) == ("failing", False, [])
    assert not any(one.is_watched for one in status.streams) and not any(one.supervised for one in status.devices)
    assert {one.state for one in status.streams} == {"lost"}


@pytest.mark.parametrize("silent", ["messenger", "analysis", "page", "capture_gate"])
def test_a_process_that_says_nothing_for_two_seconds_makes_it_fail(made: MadeService, silent: str) -> None:
    made.say_all(**{silent: 2.5})
    status = made.overview.status()
    assert status.overall == "failing"
    assert f"{silent.replace('_', '-')} does not answer" in status.problems
    made.say_all(**{silent: 1.0})
    assert made.overview.status().overall == "ok"


def test_without_its_analysis_no_stream_is_watched_whatever_it_said_last(made: MadeService) -> None:
    made.say_all(analysis=2.5)
    for one in made.overview.status().streams:
        assert (one.state, one.reason, one.is_watched) == ("lost", "its analysis does not answer", False)


def test_without_the_messenger_nobody_is_supervised(made: MadeService) -> None:
    made.say_all(messenger=2.5)
    status = made.overview.status()
    assert [(one.supervised, one.reason) for one in status.devices] == [(False, "the messenger does not answer")] * 2
    assert (status.broker_connected, status.letters, status.to_wrist_ms) == (False, {}, None)


def test_a_broker_that_is_away_is_a_failure_and_a_stream_that_is_away_is_less(made: MadeService) -> None:
    made.say_all()
    made.say_stream("crane", state="frozen", reason="the picture stands still")
    status = made.overview.status()
    assert (status.overall, status.problems) == ("degraded", ["crane: the picture stands still"])
    made.say_messenger(is_connected=False)
    status = made.overview.status()
    assert status.overall == "failing"
    assert "the broker mqtt://127.0.0.1:1883 is not connected" in status.problems
    assert made.overview.health().problems == status.problems


def test_health_is_a_code_that_programs_understand(made: MadeService) -> None:
    browser = client(made)
    assert browser.get("/healthz").status_code == 503
    made.say_all()
    answer = browser.get("/healthz")
    assert (answer.status_code, answer.json()) == (200, {"overall": "ok", "problems": []})
    made.say_stream("gate", state="late", reason="its pictures are too old when they come")
    assert (browser.get("/healthz").status_code, browser.get("/healthz").json()["overall"]) == (200, "degraded")
    made.say_messenger(3.0)
    assert browser.get("/healthz").status_code == 503


def test_open_hazards_and_what_is_set_aside_are_told(made: MadeService) -> None:
    made.say_all()
    made.say_stream("gate", open=[hazard(), hazard("unknown", hazard_id="h-2", distance_m=None)])
    shelf = {"id": "s", "stream": "gate", "zone": "", "hazard_id": "", "author": "anna", "reason": "why",
             "until_unix_s": 1.0}  # fmt: skip
    made.say_messenger(shelves=[shelf])
    status = opened(made).get("/api/status").json()
    assert [one["hazard_id"] for one in status["streams"][0]["hazards"]] == ["h-1", "h-2"]
    assert status["shelves"] == [shelf]


def test_what_prometheus_reads_is_what_the_page_shows(made: MadeService) -> None:
    made.say_all(messenger=0.0)
    made.show("gate", 0.5)
    made.say_stream("gate", open=[hazard(), hazard(hazard_id="h-2"), hazard("unknown", hazard_id="h-3")])
    made.say_stream("crane", state="lost", reason="no picture comes", watched_share=None)
    found = samples(made)
    assert found["standoff_stream_state", "gate", "live"] == found["standoff_stream_state", "crane", "lost"] == 1.0
    assert sum(value for name, value in found.items() if name[0] == "standoff_stream_state") == 2.0
    assert (found["standoff_stream_watched", "gate"], found["standoff_stream_watched", "crane"]) == (1.0, 0.0)
    assert found["standoff_picture_age_seconds", "gate"] == pytest.approx(0.5, abs=0.3)
    assert ("standoff_picture_age_seconds", "crane") not in found
    assert (found["standoff_watched_share", "gate"], ("standoff_watched_share", "crane") in found) == (0.875, False)
    assert found["standoff_open_hazards", "danger", "gate"] == 2.0
    assert (found["standoff_frames_total", "gate"], found["standoff_letters", "expired"]) == (250.0, 2.0)
    assert found["standoff_arrival_to_result_milliseconds", "0.95", "gate"] == QUANTILES["p95"]
    assert (found["standoff_device_supervised", "wrist"], found["standoff_device_supervised", "foreman"]) == (1.0, 0.0)
    assert (found["standoff_broker_connected",], found["standoff_process_starts_total", "analysis"]) == (1.0, 1.0)
    assert found["standoff_to_wrist_milliseconds", "0.99"] == QUANTILES["p99"]


def test_a_service_that_has_just_begun_has_metrics_already(made: MadeService) -> None:
    found = samples(made)
    assert found["standoff_broker_connected",] == 0.0
    assert found["standoff_stream_watched", "gate"] == 0.0


def test_a_picture_comes_with_its_age_and_not_larger_than_a_screen(made: MadeService) -> None:
    made.show("gate", 1.5, (1280, 720), level=200)
    answer = opened(made).get("/api/streams/gate/picture")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/jpeg")
    assert float(answer.headers["x-age-ms"]) == pytest.approx(1500.0, abs=400.0)
    assert answer.headers["cache-control"] == "no-store"
    shown = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    assert shown is not None and shown.shape == (540, 960, 3)
    assert abs(float(shown.mean()) - (200 - 16) * 255 / 219) < 6.0


def test_a_small_picture_stays_as_it_is(made: MadeService) -> None:
    made.show("gate", size_px=(320, 180))
    found = made.overview.picture("gate")
    assert found is not None
    shown = cv2.imdecode(np.frombuffer(found[0], np.uint8), cv2.IMREAD_COLOR)
    assert shown is not None and shown.shape == (180, 320, 3)


@pytest.mark.parametrize("stream", ["crane", "nobodys", "..%2fsupervisor", "a" * 65])
def test_a_picture_that_is_not_there_is_not_found(made: MadeService, stream: str) -> None:
    assert opened(made).get(f"/api/streams/{stream}/picture").status_code in (404, 422)
    assert not list(made.workplace.folder.glob("*nobodys*"))


def test_without_the_token_there_is_neither_page_nor_picture(made: MadeService) -> None:
    made.say_all()
    made.show("gate")
    browser = client(made)
    for path in ("/", "/api/status", "/api/streams/gate/picture", "/api/openapi.json", "/?token=a-guess", "/metrics/"):
        assert browser.get(path).status_code == 403, path
    for path in OPEN_PATHS:
        assert browser.get(path).status_code == 200, path
        assert browser.get(path, headers={"Host": "evil.example"}).status_code == 403
        assert browser.post(path, headers={"Origin": "http://evil.example"}).status_code == 403
    told = browser.get("/metrics").text + browser.get("/healthz").text
    assert TOKEN not in told


def test_a_cookie_outlives_a_restart_and_another_token_ends_it(made: MadeService) -> None:
    made.say_all()
    browser = opened(made)
    cookie = browser.cookies["standoff"]
    assert TOKEN not in cookie
    assert browser.get(f"/?token={TOKEN}").status_code == 303
    again, other = client(made), client(made, "another-token")
    for one, code in ((again, 200), (other, 403)):
        one.cookies.set("standoff", cookie)
        assert one.get("/api/status").status_code == code


def test_a_token_is_kept_for_this_user_only(tmp_path: Path) -> None:
    token = _token(tmp_path)
    path = tmp_path / "page-token"
    assert len(token) >= 32 and path.stat().st_mode & 0o777 == 0o600
    assert _token(tmp_path) == token
    for damage in (b"", b"short", b"\xff" * 40):
        path.write_bytes(damage)
        path.chmod(0o644)
        assert len(_token(tmp_path)) >= 32 and _token(tmp_path) != token
        assert path.stat().st_mode & 0o777 == 0o600
