"""What the supervisor decides without a process: what a change of the settings needs, and what a killed one left."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
import yaml
from known_settings import know_settings

from standoff.config import SiteSettings, load_site
from standoff.core.errors import ConfigError
from standoff.service.live.supervisor import _differences, _remove_left, running_service
from standoff.service.live.workplace import Workplace

SITE: dict[str, Any] = {
    "site": "yard",
    "streams": {"gate": {"address": "rtsp://10.0.0.5/live"}, "crane": {"address": "rtsp://10.0.0.6/live"}},
    "receivers": {"wrist": {"wearer": "worker"}},
}


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    know_settings(monkeypatch)


def site(folder: Path, **changes: Any) -> SiteSettings:
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump({**SITE, **changes}))
    return load_site(path)


def streams(**changes: Any) -> dict[str, Any]:
    merged = {name: {**SITE["streams"].get(name, {}), **(more or {})} for name, more in changes.items()}
    return {"streams": {**SITE["streams"], **merged}}


def test_settings_that_are_as_before_change_nothing(tmp_path: Path) -> None:
    assert _differences(site(tmp_path), site(tmp_path)) == ([], [])


@pytest.mark.parametrize(
    ("changes", "applied"),
    [
        (streams(gate={"address": "rtsp://10.0.0.9/live"}), ["streams.gate"]),
        (streams(gate={"hazard": {"release_s": 3.0}}), ["streams.gate"]),
        (streams(gate={"enabled": False}), ["streams.gate"]),
        (streams(gate={"watch": {"stale_after_s": 0.9}}), ["streams.gate"]),
        (streams(mast={"address": "rtsp://10.0.0.7/live"}), ["streams.mast (new)"]),
        ({"streams": {"gate": SITE["streams"]["gate"]}}, ["streams.crane (gone)"]),
        ({"defaults": {"detect_every": 2}}, ["streams.gate", "streams.crane"]),
        ({"receivers": {"wrist": {"wearer": "machine"}}}, ["receivers"]),
        ({"alerts": {"valid_s": 9.0}}, ["alerts"]),
        ({"shift": {"begin": "07:00", "end": "17:00"}}, ["shift"]),
        ({"notify": [{"apprise": "env:HOME"}]}, ["notify"]),
    ],
)
def test_what_can_change_while_it_runs_is_named(tmp_path: Path, changes: dict[str, Any], applied: list[str]) -> None:
    found, fixed = _differences(site(tmp_path), site(tmp_path, **changes))
    assert (sorted(found), fixed) == (sorted(applied), [])


@pytest.mark.parametrize(
    ("changes", "fixed"),
    [
        ({"site": "quarry"}, ["site"]),
        ({"state": "elsewhere"}, ["state"]),
        ({"broker": {"address": "mqtt://10.0.0.1"}}, ["broker"]),
        ({"page": {"port": 1234}}, ["page"]),
    ],
)
def test_what_holds_only_after_a_restart_is_named(tmp_path: Path, changes: dict[str, Any], fixed: list[str]) -> None:
    both = _differences(site(tmp_path), site(tmp_path, **changes, alerts={"valid_s": 9.0}))
    assert both == (["alerts"], fixed)


def test_a_secret_that_changed_is_a_change(tmp_path: Path) -> None:
    with_password = streams(gate={"user": "anna", "password": "file:door"})
    (tmp_path / "door").write_text("sesame")
    before = site(tmp_path, **with_password)
    assert _differences(before, site(tmp_path, **with_password)) == ([], [])
    (tmp_path / "door").write_text("another")
    assert _differences(before, site(tmp_path, **with_password)) == (["streams.gate"], [])


def test_what_a_killed_service_left_in_memory_is_removed(tmp_path: Path) -> None:
    left = tmp_path / "standoff-abc"
    left.mkdir()
    (left / "stream-gate.pictures").write_bytes(b"x")
    (tmp_path / "service.json").write_text(json.dumps({"pid": 1, "workplace": str(left)}))
    _remove_left(tmp_path)
    assert not left.exists() and not (tmp_path / "service.json").exists()


@pytest.mark.parametrize(
    "content", ["", "{", "[]", "null", "5", "{}", '{"workplace": null}', '{"workplace": 5}', "\xff"]
)
def test_what_was_left_damaged_keeps_nobody_from_beginning(tmp_path: Path, content: str) -> None:
    (tmp_path / "service.json").write_bytes(content.encode("latin-1"))
    _remove_left(tmp_path)
    _remove_left(tmp_path / "nowhere")


def test_no_other_folder_is_removed(tmp_path: Path) -> None:
    other = tmp_path / "plans"
    other.mkdir()
    (tmp_path / "service.json").write_text(json.dumps({"pid": 1, "workplace": str(other)}))
    _remove_left(tmp_path)
    assert other.is_dir()


def test_the_service_that_runs_is_found_and_one_that_is_gone_is_not(tmp_path: Path) -> None:
    words = {"pid": os.getpid(), "workplace": str(tmp_path)}
    (tmp_path / "service.json").write_text(json.dumps(words))
    assert running_service(tmp_path) == words
    (tmp_path / "service.json").write_text(json.dumps({**words, "pid": 2**22 + 1}))
    with pytest.raises(ConfigError, match="a service that runs on"):
        running_service(tmp_path)


@pytest.mark.parametrize(
    "content",
    ["", "[]", "{}", '{"pid": null}', '{"pid": "x"}', '{"pid": 1e30}', '{"pid": 0}', '{"pid": -1}', '{"pid": [1]}'],
)
def test_what_is_damaged_is_no_service_that_runs(tmp_path: Path, content: str) -> None:
    (tmp_path / "service.json").write_text(content)
    with pytest.raises(ConfigError, match="found none"):
        running_service(tmp_path)


def test_a_plan_is_read_as_it_was_written_and_its_stamp_changes(tmp_path: Path) -> None:
    workplace = Workplace(tmp_path)
    first = site(tmp_path, **streams(gate={"user": "anna", "password": "env:HOME"}))
    workplace.write_plan(first)
    stamp = workplace.plan_stamp()
    assert workplace.plan() == first and workplace.secrets() == (os.environ["HOME"],)
    os.utime(tmp_path / "site.plan", ns=(stamp - 1, stamp - 1))
    workplace.write_plan(site(tmp_path))
    assert workplace.plan_stamp() != stamp - 1 and workplace.plan() == site(tmp_path)


def test_a_workplace_is_for_this_user_only_and_goes_as_a_whole() -> None:
    workplace = Workplace.make()
    try:
        assert workplace.folder.stat().st_mode & 0o777 == 0o700
        workplace.record("page").write({"beat_s": 1.0})
    finally:
        workplace.remove()
    assert not workplace.folder.exists()
