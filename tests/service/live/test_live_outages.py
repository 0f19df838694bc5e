"""A sender that dies, hangs or says nothing: nobody takes the last picture for what is now, and it is found again."""

from __future__ import annotations

import signal
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from service.live.drawn_site import DrawnSite
from service.live.faulty import Behaviour, drip, faulty_server, no_pictures, silent
from service.live.running import Wearable, service, site_settings
from service.live.scenes import FAR_M, NEAR_M, Scene, scene, told
from service.live.servers import mosquitto, rtsp_server, until

pytestmark = pytest.mark.live
UNKNOWN_WITHIN_S = 2.0
BACK_WITHIN_S = 3.0
LONGEST_PAUSE_S = 2.0
"""In the first minute of an outage."""
OUTAGE_S = 5.0


def not_live_after(one: Scene, since_s: float) -> float:
    until(lambda: one.run.stream().get("state") != "live", 10.0, "that the stream is not live")
    return time.monotonic() - since_s


def live_after(one: Scene, since_s: float) -> float:
    frames = one.run.stream().get("frames", 0)
    until(lambda: one.run.is_live() and one.run.stream()["frames"] > frames + 3, 20.0, "a live stream")
    return time.monotonic() - since_s


@pytest.mark.parametrize(
    ("name", "behaviour"),
    [("killed", None), ("silent", silent), ("slow drip", drip), ("RTSP without pictures", no_pictures)],
)
def test_what_a_lost_sender_showed_is_unknown_soon_and_it_is_found_again(
    name: str, behaviour: Behaviour | None, tmp_path: Path
) -> None:
    with scene(tmp_path) as one, Wearable("foreman", one.broker.port) as foreman:
        one.worker_m = NEAR_M
        until(lambda: foreman.alerts(phase="opened"), what="an alert")
        hazard_id = foreman.alerts(phase="opened")[-1]["alert"]["data"]["hazard"]["hazard_id"]
        before_s = one.run.stream()["seen_s"]
        one.sender.kill()
        killed_s = time.monotonic()
        instead: Any = nullcontext() if behaviour is None else faulty_server(one.sender.port, behaviour)
        with instead:
            noticed_s = not_live_after(one, killed_s)
            until(lambda: foreman.alerts(phase="unknown", hazard_id=hazard_id), what="that it is unknown")
            unknown_s = foreman.alerts(phase="unknown", hazard_id=hazard_id)[0]["at_s"] - killed_s
            until(lambda: foreman.level() == "unsupervised" or foreman.level() == "unknown", what="not supervised")
            one.worker_m = FAR_M
            time.sleep(OUTAGE_S)
        one.sender.start()
        back_s = live_after(one, time.monotonic())
        told(
            f"{name}: not live after {noticed_s:.2f} s, hazard unknown after {unknown_s:.2f} s, "
            f"live again {back_s:.2f} s"
        )
        assert noticed_s <= UNKNOWN_WITHIN_S and unknown_s <= UNKNOWN_WITHIN_S
        assert back_s <= LONGEST_PAUSE_S + BACK_WITHIN_S
        assert one.run.stream()["seen_s"] > before_s
        until(lambda: foreman.alerts(phase="closed", hazard_id=hazard_id), what="that the hazard is over")


def test_a_sender_that_is_stopped_is_lost_and_found_again(tmp_path: Path) -> None:
    with scene(tmp_path) as one:
        one.sender.signal(signal.SIGSTOP)
        noticed_s = not_live_after(one, time.monotonic())
        time.sleep(OUTAGE_S)
        one.sender.signal(signal.SIGCONT)
        back_s = live_after(one, time.monotonic())
        told(f"stopped: not live after {noticed_s:.2f} s, live again {back_s:.2f} s")
        assert noticed_s <= UNKNOWN_WITHIN_S
        assert back_s <= LONGEST_PAUSE_S + BACK_WITHIN_S


def test_time_rises_and_tracks_are_new_after_a_reconnect(tmp_path: Path) -> None:
    with scene(tmp_path) as one:
        before = until(lambda: one.run.stream().get("tracks"), what="tracks")
        one.sender.kill()
        time.sleep(2.5)
        one.sender.start()
        live_after(one, time.monotonic())
        after = until(lambda: one.run.stream().get("tracks"), what="tracks")
        assert {track["id"] for track in before}.isdisjoint(track["id"] for track in after)
        assert one.run.stream()["session"], "the monitor, and with it the map, is the same"


def test_the_same_picture_again_and_again_is_not_live(tmp_path: Path) -> None:
    with scene(tmp_path) as one:
        still = one.drawn.picture(FAR_M, (0.0, 0.0))
        one.drawn.picture = lambda *_: still  # type: ignore[method-assign]
        until(lambda: one.run.stream()["state"] == "frozen", 10.0, "a frozen picture")
        del one.drawn.picture
        live_after(one, time.monotonic())


def test_a_wrong_password_is_refused_and_shown_nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, secret = DrawnSite((640, 360)), "Wr0ng-p4ssword"
    monkeypatch.setenv("GATE_PASSWORD", secret)
    with mosquitto(tmp_path) as broker, rtsp_server(tmp_path, "viewer", "right") as sender:
        settings = site_settings(drawn.write_survey(tmp_path / "survey.yaml"), broker.port, sender.address)
        settings["streams"]["gate"] |= {"user": "viewer", "password": "env:GATE_PASSWORD"}
        with service(tmp_path, settings) as run:
            until(lambda: run.stream().get("state") == "refused", 40.0, "that the sender refuses")
            code, metrics = run.ask("/metrics")
            assert code == 200 and secret not in metrics.decode()
            log = run.log.read_text()
        assert secret not in log and "401" in log
