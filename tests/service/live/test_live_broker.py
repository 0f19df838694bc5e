"""A broker that goes away and comes back: nothing that is true is lost, and nothing is told that is true no more."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from service.live.running import ENVIRONMENT, Wearable, site_settings
from service.live.scenes import told
from service.live.servers import Cable, mosquitto, until

from standoff.config import load_site
from standoff.messages import HazardNews, Topics
from standoff.service.live.broker import Broker, BrokerAccess, Connected, Received
from standoff.service.live.outbox import Outbox
from standoff.service.live.service_clock import ServiceClock
from standoff.service.live.workplace import Workplace

pytestmark = pytest.mark.live
AWAY_S, ALERTS, VALID_S = 20.0, 170, 5.0
FRESH_S = 1.5
"""Left to live when the broker is back: reconnecting takes a moment."""
HAZARD = HazardNews(
    site="yard", stream="gate", session="s", hazard_id="", phase="opened", rule="proximity", severity="danger",
    track_ids=(1, 2), classes=("worker", "wheel_loader"), zone="", distance_m=4.0, gap_m=-3.8, sigma_m=0.3,
    breach_now=1.0, breach_ahead=1.0, reason="", time_s=1.0, captured_at=None, delay="told",
)  # fmt: skip


class Listener:
    """Hears everything on a broker, for ever, and writes down when."""

    def __init__(self, port: int, topic: str, **access: Any) -> None:
        self._broker = Broker(BrokerAccess("127.0.0.1", port, **access), f"listener-{time.monotonic_ns()}", [topic])
        self.heard: list[Received] = []
        self.connections = 0
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        while True:
            news = self._broker.news.get()
            self.connections += isinstance(news, Connected)
            if isinstance(news, Received):
                self.heard.append(news)

    def bodies(self, ending: str) -> list[dict[str, Any]]:
        return [json.loads(one.payload) for one in [*self.heard] if one.topic.endswith(ending)]

    def send(self, topic: str, body: bytes) -> bool:
        return self._broker.send(topic, body)

    def close(self) -> None:
        self._broker.close()


@contextmanager
def messenger(folder: Path, port: int, **more: Any) -> Generator[tuple[Outbox, Workplace], None, None]:
    """Give the outbox of a messenger that runs alone."""
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(site_settings(None, port, "rtsp://127.0.0.1:9/none", **more)))
    site = load_site(path)
    site.live.state.mkdir()
    workplace = Workplace.make()
    workplace.write_plan(site)
    command = [sys.executable, "-m", "standoff.service.live.child", "messenger", str(workplace.folder)]
    process = subprocess.Popen(command, env={**ENVIRONMENT})
    outbox = Outbox(site.live.state)
    try:
        until(lambda: (workplace.record("messenger").read() or {}).get("is_connected"), 30.0, "its connection")
        yield outbox, workplace
    finally:
        process.terminate()
        process.wait(10)
        outbox.close()
        workplace.remove()


def raise_alert(outbox: Outbox, workplace: Workplace, number: int, **changes: Any) -> None:
    now = ServiceClock.of_machine()()
    hazard = replace(HAZARD, hazard_id=f"hazard-{number:04d}", **changes)
    outbox.tell([hazard], now, now.s - 0.05)
    workplace.ring("messenger", "news")


@pytest.mark.parametrize("protocol", ["5", "3.1.1"])
def test_while_the_broker_is_away_nothing_true_is_lost_and_nothing_stale_arrives(protocol: str, tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker:
        listener, cable = Listener(broker.port, "standoff/yard/device/foreman/alert"), Cable(broker.port)
        until(lambda: listener.connections)
        with messenger(tmp_path, cable.port, broker={"protocol": protocol}) as (outbox, workplace):
            raised_s = {}
            cable.pull()
            began_s = time.monotonic()
            for number in range(ALERTS):
                raise_alert(outbox, workplace, number)
                raised_s[f"hazard-{number:04d}"] = time.monotonic()
                time.sleep(max(0.0, began_s + (number + 1) * AWAY_S / ALERTS - time.monotonic()))
            back_s = time.monotonic()
            cable.plug()
            fresh = {one for one, at_s in raised_s.items() if back_s - at_s < VALID_S - FRESH_S}
            until(lambda: fresh <= set(heard_ids(listener)), 10.0, "all that are fresh")
            time.sleep(2.0)
            ids = heard_ids(listener)
            ages_s = [one.at_s - raised_s[json.loads(one.payload)["subject"]] for one in listener.heard]
            counts = outbox.counts()
        cable.pull()
        listener.close()
        told(
            f"MQTT {protocol}: away {AWAY_S:g} s, {ALERTS} alerts: {len(ids)} delivered, oldest {max(ages_s):.2f} s, "
            f"{sum(age > VALID_S for age in ages_s)} stale, {len(fresh - set(ids))} of {len(fresh)} fresh ones lost, "
            f"{len(ids) - len(set(ids))} doubles; {counts}"
        )
        assert max(ages_s) <= VALID_S
        assert len(ids) == len(set(ids))
        assert counts["expired"] > 0 and "waiting" not in counts


def heard_ids(listener: Listener) -> list[str]:
    return [one["subject"] for one in listener.bodies("/alert")]


def test_what_is_left_of_a_message_is_computed_when_it_is_sent(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker:
        listener, cable = Listener(broker.port, "standoff/#"), Cable(broker.port)
        until(lambda: listener.connections)
        with messenger(tmp_path, cable.port) as (outbox, workplace):
            cable.pull()
            raise_alert(outbox, workplace, 1)
            time.sleep(2.0)
            cable.plug()
            (alert,) = until(lambda: listener.bodies("/alert"))
        cable.pull()
        listener.close()
    assert 0.0 < alert["remainingms"] <= (VALID_S - 2.0) * 1e3
    assert 2000.0 < alert["agems"] < VALID_S * 1e3


def test_danger_that_nobody_acknowledges_goes_to_the_next_in_line(tmp_path: Path) -> None:
    receivers = {name: {"wearer": "nobody", "streams": ["gate"]} for name in ("foreman",)}
    receivers["chief"] = {"wearer": "nobody", "zones": []} | {"streams": ["other"]}
    streams = {"other": {"address": "rtsp://127.0.0.1:9/other"}}
    alerts = {"escalate_after_s": 1.0, "escalate_to": ["chief"]}
    with (
        mosquitto(tmp_path) as broker,
        messenger(tmp_path, broker.port, receivers=receivers, streams=streams, alerts=alerts) as (outbox, workplace),
        Wearable("foreman", broker.port) as foreman,
        Wearable("chief", broker.port) as chief,
    ):
        raise_alert(outbox, workplace, 1)
        (escalated,) = until(lambda: chief.alerts(), what="an alert of the chief")
        assert escalated["alert"]["data"]["because"] == "escalation"
        assert escalated["sounds"] == "danger"
        raise_alert(outbox, workplace, 2)
        until(lambda: foreman.alerts(hazard_id="hazard-0002"), what="an alert of the foreman")
        foreman.press_enter()
        until(lambda: "hazard-0002" in outbox.acknowledged(), what="an acknowledgement")
        time.sleep(2.5)
        assert not chief.alerts(hazard_id="hazard-0002")


def test_the_broker_tells_when_the_service_is_gone(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker:
        listener = Listener(broker.port, "standoff/yard/service")
        with messenger(tmp_path, broker.port):
            until(lambda: [one.payload for one in listener.heard] == [b"online"], what="that it is there")
        until(lambda: [one.payload for one in listener.heard] == [b"online", b"offline"], what="that it is gone")
        listener.close()


def test_home_assistant_hears_of_streams_and_receivers(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker:
        listener = Listener(broker.port, "homeassistant/#")
        with messenger(tmp_path, broker.port, broker={"home_assistant": True}):
            found = until(lambda: len(listener.heard) >= 2 and listener.bodies("/config"))
        listener.close()
    assert {one["state_topic"] for one in found} == {
        Topics("standoff/yard").health("gate"),
        Topics("standoff/yard").device("foreman").supervision,
    }


def test_a_will_is_left_by_who_is_killed(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker:
        listener = Listener(broker.port, "here/#")
        until(lambda: listener.connections)
        code = (
            "import time; from standoff.service.live.broker import *; "
            f"Broker(BrokerAccess('127.0.0.1', {broker.port}), 'x', [], LastWill('here/x', b'online', b'offline')); "
            "time.sleep(60)"
        )
        process = subprocess.Popen([sys.executable, "-c", code], env={**ENVIRONMENT})
        until(lambda: [one.payload for one in listener.heard] == [b"online"])
        process.kill()
        process.wait()
        killed_s = time.monotonic()
        until(lambda: [one.payload for one in listener.heard][-1:] == [b"offline"])
        told(f"killed: the will after {time.monotonic() - killed_s:.2f} s")
        listener.close()
