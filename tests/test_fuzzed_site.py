"""A site's settings as a bad copy or a tired hand leaves them: loaded, or refused in one line without a secret."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from known_settings import know_settings
from laws import seeds
from mutations import damaged

from standoff.config import load_site
from standoff.core.errors import StandoffError

SITE = b"""site: yard
state: ./state
defaults: {hazard: {release_s: 1.0}, detect_every: 2}
broker: {address: 'mqtt://127.0.0.1:1883', user: standoff, password: 'file:door', prefix: 'standoff/{site}'}
receivers:
  wrist-7: {wearer: worker, streams: [gate]}
  foreman: {wearer: nobody, everything: true}
alerts: {valid_s: 5.0, cooldown_s: 5, escalate_after_s: 15.0, escalate_to: [foreman]}
notify: [{webhook: 'https://h.example/x', secret: 'file:door', severities: [danger]}]
shift: {begin: '07:00', end: '17:00', timezone: Europe/Berlin}
page: {port: 0}
streams:
  gate: {address: 'rtsp://10.0.0.5/live', user: anna, password: 'file:door', delay_bound_s: 1.0}
  crane-2: {address: 'replay://film.mp4', enabled: false, watch: {stale_after_s: 0.6}, dji_serial: ABCD1234}
"""
LINES = [line + b"\n" for line in SITE.splitlines()]
HIDDEN = "sesame-open"
FUZZED = int(os.environ.get("SOAK_FUZZED", "100"))
"""`make soak` asks for 100,000."""


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    know_settings(monkeypatch)


def refusal(path: Path, content: bytes) -> str:
    path.write_bytes(content)
    try:
        site = load_site(path)
    except StandoffError as refused:
        said = str(refused)
        assert said.startswith("expected ") and "\n" not in said and HIDDEN not in said
        return said
    assert HIDDEN not in repr(site)
    return ""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "door").write_text(HIDDEN)
    return tmp_path / "site.yaml"


def test_the_settings_are_right_before_somebody_damages_them(path: Path) -> None:
    assert refusal(path, SITE) == ""


@pytest.mark.parametrize("seed", seeds(20, quick=1))
def test_hundreds_of_damaged_settings_are_loaded_or_refused(path: Path, seed: int) -> None:
    rng = random.Random(seed)
    words = (b"!!int ", b"<<: ", b"null", b"1: ", b'"\\0"', b'"\\ud800"', b"? ", b"'", b"#", b"- ", b"true", b"x" * 300)
    refused = 0
    for _ in range(FUZZED):
        # A few lines at a time, so that most damage gets past the YAML.
        chosen = [damaged(rng, line, *words) if rng.random() < 0.15 else line for line in LINES]
        refused += refusal(path, b"".join(chosen)) != ""
    assert refused > FUZZED // 2


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00",
        b"\xff\xfe",
        b"streams:\n",
        b"- a\n",
        b"5\n",
        b"streams: {1: {address: 'rtsp://h/l'}, '1': {address: 'rtsp://h/l'}}\n",
        b"streams: {gate: {address: 'rtsp://h/l', 1: 2}}\n",
        b"defaults: {1: 2}\nstreams: {gate: {address: 'rtsp://h/l'}}\n",
        b"defaults: {detect: {1: 2}}\nstreams: {gate: {address: 'rtsp://h/l'}}\n",
        b'defaults: {model: "a\\0b"}\nstreams: {gate: {address: "rtsp://h/l"}}\n',
        b'defaults: {ground: {survey: "a\\0b"}}\nstreams: {gate: {address: "rtsp://h/l"}}\n',
        b'state: "a\\0b"\nstreams: {gate: {address: "rtsp://h/l"}}\n',
        b"streams: {gate: {address: 'replay://'}}\n",
        b'streams: {gate: {address: "replay://\\ud800"}}\n',
        b'streams: {gate: {address: "replay://a\\0b"}}\n',
        b'streams: {gate: {address: "rtsp://h/\\ud800"}}\n',
        b'streams: {"\\ud800": {address: "rtsp://h/l"}}\n',
        b"streams: {gate: {address: 'rtsp://h/l', ca_file: " + b"x" * 300 + b"}}\n",
        b"streams: {gate: {address: 'rtsp://h/l', zones: " + b"x" * 300 + b"}}\n",
        b"streams: {gate: {address: 'rtsp://h/l', user: a, password: 'file:" + b"x" * 300 + b"'}}\n",
        b"streams: {gate: {address: 'rtsp://h/l', user: a, password: \"file:\\0\"}}\n",
        b"streams: {gate: {address: 'rtsp://h/l', user: a, password: \"env:\\0\"}}\n",
        b"shift: {timezone: Nowhere/At_All}\nstreams: {gate: {address: 'rtsp://h/l'}}\n",
        b"broker: {address: 'mqtt://h:1e5'}\nstreams: {gate: {address: 'rtsp://h/l'}}\n",
    ],
)
def test_what_no_settings_file_should_hold_is_refused(path: Path, content: bytes) -> None:
    assert refusal(path, content) != ""
