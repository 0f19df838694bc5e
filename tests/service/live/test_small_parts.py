"""Alarms that are set aside, what Home Assistant is told, what no log line says, and what always fits into a word."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from known_settings import know_settings
from service.live.made_news import hazard

from standoff.config import SiteSettings, load_site
from standoff.core.errors import ConfigError
from standoff.messages import Topics
from standoff.service.live.capture import Capture, CapturePlan
from standoff.service.live.home_assistant import discovery
from standoff.service.live.log import _masking
from standoff.service.live.outbox import Outbox
from standoff.service.live.service_clock import ServiceClock
from standoff.service.live.shelving import set_aside, take_back_shelf
from standoff.service.live.workplace import Workplace
from standoff.stages.frames import LiveAddress

SITE = {
    "site": "yard",
    "streams": {"gate": {"address": "rtsp://10.0.0.5/live"}, "crane": {"address": "rtsp://10.0.0.6/live"}},
    "receivers": {"wrist": {"wearer": "worker"}},
}


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    know_settings(monkeypatch)


@pytest.fixture
def site(tmp_path: Path) -> SiteSettings:
    (tmp_path / "site.yaml").write_text(yaml.safe_dump(SITE))
    return load_site(tmp_path / "site.yaml")


def test_what_is_set_aside_holds_at_once_and_until_it_is_taken_back(site: SiteSettings) -> None:
    shelf = set_aside(site, " anna ", "the crane is away", 60.0, stream="gate")
    outbox = Outbox(site.live.state)
    now = ServiceClock.of_machine()()
    assert outbox.shelves(now) == [shelf]
    assert (shelf.author, shelf.holds(hazard()), shelf.holds(hazard(stream="crane"))) == ("anna", True, False)
    assert 0.0 < shelf.until_unix_s - now.unix_s <= 60.0
    take_back_shelf(site.live.state, shelf.id)
    assert outbox.shelves(now) == []
    outbox.close()
    with pytest.raises(ConfigError, match="the id of something set aside"):
        take_back_shelf(site.live.state, shelf.id)


@pytest.mark.parametrize(
    ("author", "reason", "what", "told"),
    [
        ("", "why", {"stream": "gate"}, "an author and a reason"),
        ("anna", " ", {"stream": "gate"}, "an author and a reason"),
        ("anna", "why", {}, "a whole site is not set aside"),
        ("anna", "why", {"stream": "mast"}, "found mast. There are: crane, gate"),
        ("anna", "why", {"zone": "pit"}, "found pit. There are: none"),
    ],
)
def test_nothing_is_set_aside_for_which_nobody_answers(
    site: SiteSettings, author: str, reason: str, what: dict[str, str], told: str
) -> None:
    with pytest.raises(ConfigError, match=told):
        set_aside(site, author, reason, 60.0, **what)
    assert not site.live.state.exists()


def test_home_assistant_finds_every_stream_and_every_receiver_where_they_speak(site: SiteSettings) -> None:
    topics = Topics("standoff/yard")
    found: dict[str, dict[str, Any]] = {topic: json.loads(payload) for topic, payload in discovery(site, topics)}
    assert len(found) == 3 and all(topic.startswith("homeassistant/binary_sensor/") for topic in found)
    assert {one["state_topic"] for one in found.values()} == {
        topics.health("gate"), topics.health("crane"), topics.device("wrist").supervision,
    }  # fmt: skip
    assert len({one["unique_id"] for one in found.values()}) == 3
    assert {one["availability_topic"] for one in found.values()} == {topics.service}


@pytest.mark.parametrize("letter", ["x", "ü", "🚧", '"', "\n"])
def test_whatever_libav_says_a_capture_can_pass_it_on(tmp_path: Path, letter: str) -> None:
    workplace = Workplace(tmp_path)
    capture = Capture(CapturePlan("gate", LiveAddress.read("rtsp://10.0.0.5/live")), workplace)
    capture._say("refused", letter * 5000)
    said = workplace.capture_record("gate").read()
    assert said is not None and said["phase"] == "refused" and set(said["reason"]) == {letter}


def test_what_a_large_site_has_to_say_fits_into_a_record(tmp_path: Path) -> None:
    workplace = Workplace(tmp_path)
    device = {"supervised": False, "reason": "x" * 500, "streams": [f"stream-{k}" for k in range(10)]}
    hazard_id = {"hazard_id": "01J" + "X" * 23, "rule": "proximity", "track_ids": [123456, 123457], "reason": "x" * 200}
    track = {"id": 123456, "class": "roller_or_dozer", "xyxy_px": [1234.5] * 4}
    workplace.record("messenger").write({"devices": {f"device-{k:060}": device for k in range(300)}})
    workplace.stream_record("gate").write({"open": [hazard_id] * 300, "tracks": [track] * 500})
    assert len((workplace.record("messenger").read() or {})["devices"]) == 300


@given(st.text(min_size=4, max_size=20), st.text(max_size=20), st.text(max_size=20))
def test_no_line_of_a_log_says_a_secret(secret: str, before: str, after: str) -> None:
    line: dict[str, Any] = {"event": f"{before}{secret}{after}", "exception": f"x{secret}", "count": 5, "none": None}
    told = _masking((secret,))(None, "info", line)
    assert isinstance(told, dict)
    assert (told["count"], told["none"]) == (5, None)
    for words in (told["event"], told["exception"]):
        assert secret not in words.replace("***", "\0")
