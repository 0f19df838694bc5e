"""Silence is never safety: whoever would not be warned is told so."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from service.live.running import Wearable
from service.live.scenes import FAR_M, NEAR_M, scene, told
from service.live.servers import until
from service.live.test_live_broker import Listener

pytestmark = pytest.mark.live
TOLD_WITHIN_S = 3.0


def with_wrist(settings: dict[str, Any]) -> None:
    settings["receivers"]["wrist-1"] = {"wearer": "worker"}


def stand(listener: Listener, place_m: tuple[float, float]) -> None:
    body = {"x_m": place_m[0], "y_m": place_m[1], "sigma_m": 0.5, "age_ms": 50.0}
    listener.send("standoff/yard/device/wrist-1/position", json.dumps(body).encode())


def keep_standing(listener: Listener, place_m: tuple[float, float], condition: Any, what: str) -> float:
    """Tell again and again where a device is, until something holds; return after how long it did."""
    began_s = time.monotonic()

    def holds() -> bool:
        stand(listener, place_m)
        time.sleep(0.2)
        return bool(condition())

    until(holds, 20.0, what)
    return time.monotonic() - began_s


def test_a_wearer_who_is_seen_is_supervised_and_warned_and_one_without_a_track_is_told_so(tmp_path: Path) -> None:
    with scene(tmp_path, change=with_wrist) as one, Wearable("wrist-1", one.broker.port) as wrist:
        listener = Listener(one.broker.port, "nothing")
        until(lambda: listener.connections)
        assert wrist.level() == "unsupervised"
        keep_standing(listener, FAR_M, lambda: wrist.level() == "supervised", "supervised")
        one.worker_m = NEAR_M
        keep_standing(listener, NEAR_M, lambda: wrist.alerts(phase="opened"), "an alert")
        assert wrist.alerts()[-1]["alert"]["data"]["because"] == "position"
        one.worker_m = FAR_M
        keep_standing(listener, FAR_M, lambda: wrist.level() == "supervised", "supervised again")
        one.worker_m = None
        gone_s = keep_standing(
            listener, FAR_M, lambda: wrist.level() == "unsupervised", "not supervised: nobody is seen"
        )
        told(f"wearer without a track: not supervised after {gone_s:.2f} s")
        assert "nobody is seen" in wrist.of_kind("level")[-1]["reason"]
        listener.close()


def test_who_stands_where_nobody_looks_is_told_so(tmp_path: Path) -> None:
    with scene(tmp_path, change=with_wrist) as one, Wearable("wrist-1", one.broker.port) as wrist:
        listener = Listener(one.broker.port, "nothing")
        until(lambda: listener.connections)
        keep_standing(listener, FAR_M, lambda: wrist.level() == "supervised", "supervised")
        out_s = keep_standing(listener, (200.0, 200.0), lambda: wrist.level() == "unsupervised", "not supervised")
        told(f"wearer on ground that is not watched: not supervised after {out_s:.2f} s")
        assert out_s <= TOLD_WITHIN_S
        assert "outside the picture" in wrist.of_kind("level")[-1]["reason"]
        listener.close()


def test_while_the_analysis_is_stopped_nobody_is_supervised(tmp_path: Path) -> None:
    with scene(tmp_path) as one, Wearable("foreman", one.broker.port) as foreman:
        until(lambda: foreman.level() == "supervised", what="supervised")
        pid = until(lambda: one.run.pid("analysis"))
        os.kill(pid, signal.SIGSTOP)
        stopped_s = time.monotonic()
        until(lambda: foreman.level() == "unsupervised", what="not supervised")
        noticed_s = time.monotonic() - stopped_s
        until(lambda: foreman.level() == "supervised", 20.0, "supervised again: it is killed and begins anew")
        again_s = time.monotonic() - stopped_s
        told(f"analysis stopped: not supervised after {noticed_s:.2f} s, again after {again_s:.2f} s")
        assert noticed_s <= TOLD_WITHIN_S
        assert "overall" in json.loads(one.run.ask("/healthz")[1])


def test_while_the_messenger_is_stopped_the_receiver_says_so_by_itself(tmp_path: Path) -> None:
    with scene(tmp_path) as one, Wearable("foreman", one.broker.port) as foreman:
        until(lambda: foreman.level() == "supervised", what="supervised")
        os.kill(until(lambda: one.run.pid("messenger")), signal.SIGSTOP)
        stopped_s = time.monotonic()
        until(lambda: foreman.level() == "unsupervised", what="not supervised")
        noticed_s = time.monotonic() - stopped_s
        told(f"messenger stopped: not supervised after {noticed_s:.2f} s")
        assert noticed_s <= TOLD_WITHIN_S + 1.2, "three seconds after the last word, which came up to one before"


def test_while_the_broker_is_away_the_receiver_says_so_by_itself(tmp_path: Path) -> None:
    with scene(tmp_path) as one, Wearable("foreman", one.broker.port) as foreman:
        until(lambda: foreman.level() == "supervised", what="supervised")
        one.broker.kill()
        until(lambda: foreman.level() == "unsupervised", 5.0, "not supervised")
        one.broker.start()
        until(lambda: foreman.level() == "supervised", 10.0, "supervised again")
