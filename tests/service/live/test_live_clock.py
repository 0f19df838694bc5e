"""Somebody sets the machine's clock by an hour while a site is watched: no alarm is dropped, and nobody is lulled."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from service.live.running import OURS, Wearable
from service.live.scenes import FAR_M, NEAR_M, Scene, scene, told
from service.live.servers import until

pytestmark = pytest.mark.live
HOUR_S = 3600.0
TOLD_WITHIN_S = 3.0


@pytest.fixture
def set_clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Give what sets the wall clock of all processes that are started from now on."""
    clock = tmp_path / "clock"
    clock.write_text("0")
    monkeypatch.setitem(OURS, "STEPPED_CLOCK", str(clock))
    stepped = str(Path(__file__).with_name("stepped_clock"))
    monkeypatch.setitem(OURS, "PYTHONPATH", os.pathsep.join((stepped, OURS["PYTHONPATH"])))

    def step(by_s: float) -> None:
        partial = clock.with_suffix(".partial")
        partial.write_text(str(by_s))
        partial.replace(clock)

    return step


def come_near(one: Scene, foreman: Wearable) -> float:
    """Let the worker come near; return after how long that was told."""
    before = len(foreman.alerts(phase="opened"))
    one.worker_m, near_s = NEAR_M, time.monotonic()
    until(lambda: len(foreman.alerts(phase="opened")) > before, 10.0, "an alert")
    return time.monotonic() - near_s


def go_away(one: Scene, foreman: Wearable) -> None:
    before = len(foreman.alerts(phase="closed"))
    one.worker_m = FAR_M
    until(lambda: len(foreman.alerts(phase="closed")) > before, 20.0, "that it is over")
    # The like of it sounds again after the cool-down only, and then is told as anew.
    time.sleep(1.0)


@pytest.mark.parametrize("by_s", [HOUR_S, -HOUR_S])
def test_a_clock_that_is_set_by_an_hour_drops_no_alarm_and_lulls_nobody(
    by_s: float, tmp_path: Path, set_clock: Callable[[float], None]
) -> None:
    with scene(tmp_path) as one, Wearable("foreman", one.broker.port) as foreman:
        until(lambda: foreman.level() == "supervised", what="supervised")
        first_s = come_near(one, foreman)
        lasting = len(foreman.alerts())
        set_clock(by_s)
        until(lambda: len(foreman.alerts()) > lasting + 1, 5.0, "word of what lasts")
        go_away(one, foreman)
        again_s = come_near(one, foreman)
        assert foreman.level() != "unsupervised"
        go_away(one, foreman)
        until(lambda: foreman.level() == "supervised", 5.0, "supervised again")
        one.sender.kill()
        until(lambda: foreman.level() != "supervised", TOLD_WITHIN_S, "not supervised")
        one.sender.start()
        one.run.until_live()
        after_s = come_near(one, foreman)
        assert not [event for event in foreman.of_kind("alert") if event["dropped"]]
        told(
            f"clock set by {by_s / HOUR_S:+.0f} h: told after {first_s:.2f} s before, {again_s:.2f} s after, "
            f"{after_s:.2f} s after a new connection"
        )
        assert again_s <= TOLD_WITHIN_S
