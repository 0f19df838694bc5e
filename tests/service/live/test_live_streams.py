"""What kinds of streams tell, and what becomes of settings that change."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import yaml
from service.live.drawn_site import DrawnSite
from service.live.running import ENVIRONMENT, Service, Wearable, service, site_settings
from service.live.scenes import NEAR_M, scene, told
from service.live.servers import mosquitto, nginx_rtmp, until
from service.live.test_live_broker import Listener

from standoff.service.latency import clock_picture

pytestmark = pytest.mark.live
SIZE_PX = (640, 360)


class Pusher:
    """A drone that pushes what is drawn to an RTMP server, some seconds late."""

    def __init__(self, address: str, draw: Any, late_s: float = 0.0) -> None:
        self._address, self._draw, self._late_s = address, draw, late_s
        self._is_ended = threading.Event()
        self._thread = threading.Thread(target=self._push, daemon=True)
        self._thread.start()

    def _push(self) -> None:
        with av.open(self._address, "w", format="flv") as out:
            stream = out.add_stream(
                "libx264", rate=25, options={"preset": "ultrafast", "tune": "zerolatency", "g": "25"}
            )
            stream.width, stream.height, stream.pix_fmt = *SIZE_PX, "yuv420p"
            begun_s, number = time.monotonic(), 0
            waiting: list[tuple[float, Any]] = []
            while not self._is_ended.is_set():
                waiting.append((time.monotonic(), self._draw()))
                while waiting and time.monotonic() - waiting[0][0] >= self._late_s:
                    frame = av.VideoFrame.from_ndarray(waiting.pop(0)[1], format="bgr24")
                    out.mux(stream.encode(frame))
                number += 1
                time.sleep(max(0.0, begun_s + number / 25 - time.monotonic()))

    def close(self) -> None:
        self._is_ended.set()
        self._thread.join(5.0)


@contextmanager
def pushed(folder: Path, draw: Any, late_s: float = 0.0, **more: Any) -> Generator[tuple[Service, int], None, None]:
    """Watch a site that a drone pushes through nginx."""
    drawn = DrawnSite(SIZE_PX)
    with mosquitto(folder) as broker, nginx_rtmp(folder) as relay:
        address = f"rtmp://127.0.0.1:{relay.port}/live/drone"
        pusher = Pusher(address, draw, late_s)
        settings = site_settings(drawn.write_survey(folder / "survey.yaml"), broker.port, address)
        settings["streams"]["gate"] |= more
        try:
            with service(folder, settings) as run:
                run.until_live()
                yield run, broker.port
        finally:
            pusher.close()


def test_a_stream_whose_delay_nobody_knows_warns_no_receiver_and_says_so(tmp_path: Path) -> None:
    drawn = DrawnSite(SIZE_PX)
    with pushed(tmp_path, lambda: drawn.picture(NEAR_M, (0.0, 0.0))) as (run, port):
        listener = Listener(port, "standoff/yard/stream/gate/hazard")
        with Wearable("foreman", port) as foreman:
            assert run.stream()["delay"] == "unknown"
            until(
                lambda: [one for one in listener.bodies("/hazard") if one["data"]["rule"] == "proximity"],
                what="a hazard",
            )
            time.sleep(1.0)
            assert not foreman.alerts() and foreman.level() == "unsupervised"
            (body,) = [one for one in listener.bodies("/hazard") if one["data"]["phase"] == "updated"][:1]
            assert (body["data"]["delay"], body["agems"]) == ("unknown", None)
        listener.close()


def test_an_operator_who_answers_for_a_bound_is_warned(tmp_path: Path) -> None:
    drawn = DrawnSite(SIZE_PX)
    with pushed(tmp_path, lambda: drawn.picture(NEAR_M, (0.0, 0.0)), delay_bound_s=1.5) as (run, port):
        with Wearable("foreman", port) as foreman:
            (alert, *_) = until(lambda: foreman.alerts(phase="updated"), what="an alert")
        assert run.stream()["delay"] == "bound"
        assert alert["alert"]["agems"] >= 1500.0


def test_the_delay_of_a_stream_is_measured_by_a_clock_that_its_camera_films(tmp_path: Path) -> None:
    def draw() -> Any:
        clock = clock_picture(time.time(), 8)
        picture = np.full((SIZE_PX[1], SIZE_PX[0], 3), 90, np.uint8)
        picture[20 : 20 + clock.shape[0], 200 : 200 + clock.shape[1]] = clock[..., None]
        return picture

    late_s = 3.0
    with pushed(tmp_path, draw, late_s) as (run, _):
        assert run.stream()["delay"] == "unknown"
        words = [sys.executable, "-m", "standoff", "latency", str(run.path), "gate", "--no-browser"]
        done = subprocess.run(
            words, env=ENVIRONMENT | {"PATH": "/usr/bin:/bin"}, capture_output=True, text=True, timeout=120, check=False
        )
        assert done.returncode == 0, done.stderr
        measured_s = float(done.stdout.split("gate: ")[1].split(" s late")[0])
        told(f"a stream that is {late_s:g} s late: measured {measured_s:.2f} s")
        assert late_s <= measured_s <= late_s + 1.0
        run.stop()
        run.start()
        until(lambda: run.stream().get("delay") == "measured", 60.0, "that the measured delay is used")
        until(lambda: run.stream().get("state") == "late", 20.0, "that it is late")


def test_settings_are_read_again_without_a_restart_and_what_needs_one_is_named(tmp_path: Path) -> None:
    with scene(tmp_path) as one, Wearable("chief", one.broker.port) as chief:
        session = one.run.stream()["session"]
        settings = yaml.safe_load(one.run.path.read_text())
        settings["receivers"]["chief"] = {"wearer": "nobody", "everything": True}
        settings["page"]["port"] = 8123
        one.run.path.write_text(yaml.safe_dump(settings))
        done = reload(one.run)
        assert done.returncode == 0 and "receivers" in done.stdout and "needs a restart: page" in done.stdout
        one.worker_m = NEAR_M
        until(lambda: chief.alerts(), what="an alert of the new receiver")
        assert one.run.stream()["session"] == session, "the stream is watched as before"
        one.run.path.write_text("streams: {gate: {address: 'file:///etc/passwd'}}\n")
        refused = reload(one.run)
        assert (refused.returncode, refused.stderr.count("\n")) == (2, 1) and "rtsp://" in refused.stderr
        assert one.run.is_live()


def test_a_stream_that_is_disabled_says_so_and_comes_back(tmp_path: Path) -> None:
    with scene(tmp_path) as one:
        settings = yaml.safe_load(one.run.path.read_text())
        for enabled, state in ((False, "disabled"), (True, "live")):
            settings["streams"]["gate"]["enabled"] = enabled
            one.run.path.write_text(yaml.safe_dump(settings))
            assert reload(one.run).returncode == 0
            until(partial(is_in, one.run, state), 20.0, state)
        assert one.run.pid("capture-gate") is not None


def test_alarms_that_are_set_aside_are_recorded_and_told_to_nobody(tmp_path: Path) -> None:
    with scene(tmp_path) as one, Wearable("foreman", one.broker.port) as foreman:
        listener = Listener(one.broker.port, "standoff/yard/stream/gate/hazard")
        by = ("--author", "anna", "--reason", "crane test")
        done = standoff("shelve", one.run.path, "--stream", "gate", "--minutes", 5, *by)
        assert done.returncode == 0, done.stderr
        time.sleep(1.0)
        one.worker_m = NEAR_M
        hazard = until(lambda: updated_pair(listener), what="a hazard")
        assert hazard["data"]["shelved_by"] == "anna"
        assert not foreman.alerts()
        shelf_id = done.stdout.partition(":")[0]
        assert standoff("shelve", one.run.path, *by, "--take-back", shelf_id).returncode == 0
        until(lambda: foreman.alerts(), what="an alert once it is taken back")
        listener.close()


def test_a_second_service_on_the_same_state_is_refused_and_a_killed_one_leaves_nothing_in_the_way(
    tmp_path: Path,
) -> None:
    with scene(tmp_path) as one:
        done = standoff("serve", one.run.path)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1) and "no other service" in done.stderr
        workplace, process = one.run.workplace(), one.run.process
        assert process is not None and workplace.is_dir()
        pids = [pid for pid in one.run.words("supervisor.record")["pids"].values() if pid]
        process.kill()
        process.wait()
        until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids), 10.0, "that no process is left")
        one.run.start()
        until(
            lambda: one.run.workplace() != workplace and not workplace.exists(),
            20.0,
            "a new workplace, the old one gone",
        )
        one.run.until_live()
        assert one.run.stop() == 0
        assert not one.run.state.joinpath("service.json").exists()


def is_in(run: Service, state: str) -> bool:
    return bool(run.stream().get("state") == state)


def reload(run: Service) -> subprocess.CompletedProcess[str]:
    return standoff("reload", run.path)


def standoff(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "standoff", *map(str, words)]
    return subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=150, check=False)


def updated_pair(listener: Listener) -> dict[str, Any] | None:
    """Return an event of a pair that has been said before; None where there is none yet."""
    found = [one for one in listener.bodies("/hazard") if one["data"]["rule"] == "proximity"]
    return next((one for one in found if one["data"]["phase"] == "updated"), None)
