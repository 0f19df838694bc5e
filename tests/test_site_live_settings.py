"""What a site has beside its streams: secrets that stand elsewhere and are never said, and people who can be told."""

from __future__ import annotations

import pickle
import re
from pathlib import Path
from typing import Any, Final

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from known_settings import know_settings

from standoff.config import Secret, SiteSettings, load_site, read_secret
from standoff.core.errors import ConfigError

HIDDEN: Final = "hunter2"
ADDRESS: Final = "rtsp://10.0.0.5/live"
ZONES: Final = (
    '{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"name": "pit", "kind": "no_go"},'
    ' "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]]}}]}'
)
SURVEY: Final = """image_size_px: [640, 480]
points:
  - {name: a, px: [10, 10], m: [0, 10]}
  - {name: b, px: [600, 10], m: [10, 10]}
  - {name: c, px: [600, 400], m: [10, 0]}
  - {name: d, px: [10, 400], m: [0, 0]}
"""


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    know_settings(monkeypatch)


def loaded(folder: Path, gate: dict[str, Any] | None = None, **parts: Any) -> SiteSettings:
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump({"streams": {"gate": {"address": ADDRESS, **(gate or {})}}, **parts}))
    return load_site(path)


def refusal(folder: Path, gate: dict[str, Any] | None = None, **parts: Any) -> str:
    with pytest.raises(ConfigError) as raised:
        loaded(folder, gate, **parts)
    said = str(raised.value)
    assert "\n" not in said and HIDDEN not in said
    return said


def test_a_site_that_says_little_has_a_broker_here_and_nobody_to_tell(tmp_path: Path) -> None:
    live = loaded(tmp_path).live
    assert (live.broker.host, live.broker.port, live.broker.is_secure) == ("127.0.0.1", 1883, False)
    assert (live.receivers, live.notify, live.state) == ({}, (), tmp_path / "standoff-state")
    assert loaded(tmp_path, broker={"address": "mqtts://b.example"}).live.broker.port == 8883
    assert loaded(tmp_path, broker={"address": "mqtts://[::1]:99/"}).live.broker.port == 99


def test_a_secret_comes_from_the_environment_or_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GATE_DOOR", HIDDEN)
    (tmp_path / "door.txt").write_text(f"{HIDDEN}\n")
    for origin in ("env:GATE_DOOR", "file:door.txt", f"file:{tmp_path / 'door.txt'}"):
        site = loaded(tmp_path, {"user": "anna", "password": origin})
        capture = site.streams["gate"].capture
        assert capture.password == Secret(origin, HIDDEN)
        assert site.secrets == (HIDDEN,)
        assert site.streams["gate"].live_address.opened_as() == "rtsp://anna:hunter2@10.0.0.5/live"
        for shown in (repr(site), str(site), str(capture.password), capture.model_dump_json(), repr(capture.password)):
            assert HIDDEN not in shown
        assert origin in capture.model_dump_json()


@pytest.mark.parametrize(
    ("origin", "told"),
    [
        ("env:NOT_THERE", "the environment variable NOT_THERE is not set"),
        ("env:EMPTY", "the environment variable EMPTY is not set"),
        ("file:nothing.txt", "nothing.txt cannot be read: No such file or directory"),
        ("file:.", "cannot be read"),
        ("file:empty.txt", "empty.txt is empty"),
        ("file:binary", "binary cannot be read: no text"),
        ("env:", "write env:NAME or file:PATH"),
        ("file:", "write env:NAME or file:PATH"),
        (HIDDEN, "write env:NAME or file:PATH"),
        (f"Env:{HIDDEN}", "write env:NAME or file:PATH"),
        (f"{HIDDEN}:env:X", "write env:NAME or file:PATH"),
        ("", "write env:NAME or file:PATH"),
    ],
)
def test_a_secret_that_is_not_there_is_told_without_any(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, origin: str, told: str
) -> None:
    monkeypatch.setenv("EMPTY", "")
    (tmp_path / "empty.txt").write_text(" \n")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00hunter2")
    with pytest.raises(ValueError, match=re.escape(told)) as raised:
        read_secret(origin, tmp_path)
    assert HIDDEN not in str(raised.value)
    assert told in refusal(tmp_path, {"user": "anna", "password": origin})


@pytest.mark.parametrize(
    ("gate", "parts"),
    [
        ({"user": "anna", "password": HIDDEN}, {}),
        ({"user": "anna", "password": [HIDDEN]}, {}),
        ({"user": "anna", "password": {"value": HIDDEN}}, {}),
        ({"user": "anna", "passwort": HIDDEN}, {}),
        ({"password": HIDDEN}, {}),
        ({"address": f"rtsp://anna:{HIDDEN}@10.0.0.5/live"}, {}),
        ({"address": f"rtsp://anna:p/{HIDDEN}@10.0.0.5/live"}, {}),
        ({"address": f"rtsp://anna:1/{HIDDEN} @10.0.0.5/live"}, {}),
        ({"address": f"anna:{HIDDEN}@10.0.0.5/live"}, {}),
        ({"address": f"http://anna:{HIDDEN}@10.0.0.5/live"}, {}),
        ({}, {"broker": {"user": "a", "password": HIDDEN}}),
        ({}, {"broker": {"address": f"mqtt://anna:{HIDDEN}@10.0.0.5"}}),
        ({}, {"broker": {"address": f"mqtt://anna:{HIDDEN}@:1"}}),
        ({}, {"broker": f"mqtt://anna:{HIDDEN}@10.0.0.5"}),
        ({}, {"broker": {"pasword": HIDDEN}}),
        ({}, {"notify": [{"apprise": f"tgram://{HIDDEN}/1"}]}),
        ({}, {"notify": [f"tgram://{HIDDEN}/1"]}),
        ({}, {"notify": f"tgram://{HIDDEN}/1"}),
        ({}, {"notify": [{"webhook": "https://h/x", "secret": HIDDEN}]}),
        ({}, {"notify": [{"webhook": f"https://anna:{HIDDEN}@h/x", "secret": "env:HOME"}]}),
        ({}, {"password": HIDDEN}),
    ],
)
def test_a_secret_in_the_settings_is_refused_and_not_shown(
    tmp_path: Path, gate: dict[str, Any], parts: dict[str, Any]
) -> None:
    assert str(tmp_path / "site.yaml") in refusal(tmp_path, gate, **parts)


@given(st.text(min_size=1, max_size=30))
def test_no_text_that_is_given_as_a_secret_is_shown(given_secret: str) -> None:
    if not given_secret.startswith(("env:", "file:")):
        with pytest.raises(
            ValueError, match=r"\Aa secret does not stand in the settings: write env:NAME or file:PATH\Z"
        ):
            read_secret(given_secret, Path())


def test_a_password_needs_a_user_and_a_line_that_nobody_reads(tmp_path: Path) -> None:
    (tmp_path / "door").write_text(HIDDEN)
    assert "needs a `user`" in refusal(tmp_path, {"password": "file:door"})
    account = {"user": "standoff", "password": "file:door"}
    for address in ("mqtt://broker.example", "mqtt://10.0.0.9:1883", "mqtt://127.0.0.1.evil.example"):
        assert "through mqtts:// only" in refusal(tmp_path, broker={"address": address, **account})
    for address in ("mqtt://127.0.0.1", "mqtt://localhost:1", "mqtt://[::1]", "mqtts://broker.example"):
        assert loaded(tmp_path, broker={"address": address, **account}).secrets == (HIDDEN,)


@pytest.mark.parametrize(
    "address", ["", "mqtt", "broker:1883", "http://broker", "mqtt://", "mqtt://b:x", "mqtt://b/path", "mqtt://[::1"]
)
def test_a_broker_is_where_mqtt_is_spoken(tmp_path: Path, address: str) -> None:
    assert "write mqtt://host:port or mqtts://host:port" in refusal(tmp_path, broker={"address": address})


def test_a_certificate_and_its_key_go_together_and_are_there(tmp_path: Path) -> None:
    for name in ("own.crt", "own.key", "ca.crt"):
        (tmp_path / name).write_text("-")
    assert "go together" in refusal(tmp_path, broker={"cert_file": "own.crt"})
    assert "go together" in refusal(tmp_path, broker={"key_file": "own.key"})
    assert "no such file: no.crt" in refusal(tmp_path, broker={"ca_file": "no.crt"})
    assert "no such file" in refusal(tmp_path, {"ca_file": "x" * 300})
    broker = loaded(tmp_path, broker={"cert_file": "own.crt", "key_file": "own.key", "ca_file": "ca.crt"}).live.broker
    assert (broker.cert_file, broker.key_file) == (tmp_path / "own.crt", tmp_path / "own.key")


def test_a_messenger_is_one_of_two_kinds_and_a_web_service_has_a_secret(tmp_path: Path) -> None:
    (tmp_path / "key").write_text(HIDDEN)
    assert "one of apprise and webhook" in refusal(tmp_path, notify=[{}])
    both = {"apprise": "file:key", "webhook": "https://h/x", "secret": "file:key"}
    assert "one of apprise and webhook" in refusal(tmp_path, notify=[both])
    assert "webhook and secret go together" in refusal(tmp_path, notify=[{"webhook": "https://h/x"}])
    assert "webhook and secret go together" in refusal(tmp_path, notify=[{"apprise": "file:key", "secret": "file:key"}])
    assert "notify.0.webhook" in refusal(tmp_path, notify=[{"webhook": "ftp://h/x", "secret": "file:key"}])
    assert "notify.1.severities.0" in refusal(
        tmp_path, notify=[{"apprise": "file:key"}, {"apprise": "file:key", "severities": ["grave"]}]
    )
    assert loaded(tmp_path, notify=[{"webhook": "https://h/x", "secret": "file:key"}]).secrets == (HIDDEN,)


@pytest.mark.parametrize(
    ("receivers", "told"),
    [
        ({"wrist": {"streams": ["gate", "crane"]}}, "receivers.wrist.streams to be streams of .*found crane"),
        ({"wrist": {"zones": ["pit", "yard"]}}, "receivers.wrist.zones to be zones of .*found yard. There are pit"),
        ({"wrist": {"wearer": "nobody"}}, "receivers.wrist: worn by nobody"),
        ({"wrist": {"wearer": "dog"}}, "receivers.wrist.wearer"),
        ({"a/b": {}}, "a name has letters"),
        ({"+": {}}, "a name has letters"),
    ],
)
def test_nobody_is_told_of_what_does_not_exist(tmp_path: Path, receivers: dict[str, Any], told: str) -> None:
    (tmp_path / "zones.geojson").write_text(ZONES)
    (tmp_path / "survey.yaml").write_text(SURVEY)
    gate = {"zones": "zones.geojson", "ground": {"survey": "survey.yaml"}}
    assert re.search(told, refusal(tmp_path, gate, receivers=receivers))


def test_a_site_without_zones_says_so(tmp_path: Path) -> None:
    assert "the site has no zone" in refusal(tmp_path, receivers={"wrist": {"zones": ["pit"]}}).lower()


def test_who_is_next_in_line_is_a_receiver(tmp_path: Path) -> None:
    people = {"foreman": {"wearer": "nobody", "everything": True}}
    assert loaded(tmp_path, receivers=people, alerts={"escalate_to": ["foreman"]}).live.alerts.escalate_to
    assert "no receiver chief" in refusal(tmp_path, receivers=people, alerts={"escalate_to": ["foreman", "chief"]})


@pytest.mark.parametrize(
    ("shift", "told"),
    [
        ({"begin": "24:00"}, "shift.begin"),
        ({"begin": "7:00"}, "shift.begin"),
        ({"begin": "07:60"}, "shift.begin"),
        ({"begin": "07:00\n"}, "shift.begin"),
        ({"end": "24:01"}, "shift.end"),
        ({"end": "00:00"}, "begin and end are the same"),
        ({"begin": "07:30", "end": "07:30"}, "begin and end are the same"),
        ({"timezone": "Mars/Olympus_Mons"}, "no such time zone"),
        ({"timezone": "Europe"}, "no such time zone"),
        ({"timezone": "../etc/passwd"}, "no such time zone"),
        ({"timezone": ""}, "no such time zone"),
    ],
)
def test_a_shift_lasts_and_is_in_a_time_zone_that_exists(tmp_path: Path, shift: dict[str, str], told: str) -> None:
    assert told in refusal(tmp_path, shift=shift)


@pytest.mark.parametrize(
    ("gate", "parts", "told"),
    [
        ({"watch": {"stale_after_s": 2.0}}, {}, "lost_after_s must not be less"),
        ({"watch": {"stale_after_s": 0}}, {}, "watch.stale_after_s"),
        ({"delay_bound_s": 31}, {}, "delay_bound_s"),
        ({"dji_serial": "a/+"}, {}, "dji_serial"),
        ({}, {"alerts": {"valid_s": 1}}, "alerts.valid_s"),
        ({}, {"alerts": {"valid_s": ".nan"}}, "alerts.valid_s"),
        ({}, {"broker": {"prefix": "a/#"}}, "broker.prefix"),
        ({}, {"broker": {"prefix": "/a"}}, "broker.prefix"),
        ({}, {"site": "the yard"}, "site: a name has letters"),
        ({}, {"page": {"port": 65536}}, "page.port"),
        ({}, {"brokers": {}}, "brokers at the top level"),
    ],
)
def test_what_is_out_of_bounds_is_named(tmp_path: Path, gate: dict[str, Any], parts: dict[str, Any], told: str) -> None:
    assert told in refusal(tmp_path, gate, **parts)


def test_settings_go_to_another_process_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "key").write_text(HIDDEN)
    (tmp_path / "zones.geojson").write_text(ZONES)
    (tmp_path / "survey.yaml").write_text(SURVEY)
    site = loaded(
        tmp_path,
        {
            "user": "anna",
            "password": "file:key",
            "zones": "zones.geojson",
            "ground": {"survey": "survey.yaml"},
            "watch": {"stale_after_s": 0.7},
        },
        site="yard",
        receivers={"wrist": {"zones": ["pit"]}, "foreman": {"wearer": "nobody", "everything": True}},
        alerts={"escalate_to": ["foreman"]},
        notify=[{"webhook": "https://h/x", "secret": "file:key"}],
        shift={"begin": "07:00", "end": "17:00", "timezone": "Europe/Berlin"},
    )
    again = pickle.loads(pickle.dumps(site))
    assert again == site and again.secrets == site.secrets == (HIDDEN, HIDDEN)
    assert again.streams["gate"].live_address == site.streams["gate"].live_address
