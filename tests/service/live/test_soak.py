"""What takes long: the way to the wrist under load, hundreds of reconnects, hours of four streams. `make soak`."""

from __future__ import annotations

import os
import random
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from service.live.running import Service, Wearable
from service.live.scenes import FAR_M, NEAR_M, Scene, scene, told
from service.live.servers import until

from standoff.core.errors import SourceError
from standoff.stages.frames import LiveAddress, LiveStream

pytestmark = pytest.mark.soak
MINUTES = float(os.environ.get("SOAK_MINUTES", "10"))
HOURS = float(os.environ.get("SOAK_HOURS", "2"))
SETTLED_S = 90.0
"""After that memory has found its size."""


def bare_detector(settings: dict[str, Any]) -> None:
    """Leave all else as everybody has it."""
    settings["receivers"]["foreman"] = {"wearer": "nobody", "streams": ["gate"]}


def alarm_often(one: Scene, foreman: Wearable, duration_s: float) -> list[tuple[float, float, float]]:
    """Let the worker come near again and again; return when, and ms from capture and from onset to the wrist."""
    rng, known = random.Random(0), set[str]()
    one.drives = True
    found: list[tuple[float, float, float]] = []
    end_s = time.monotonic() + duration_s
    while time.monotonic() < end_s:
        one.worker_m = FAR_M
        time.sleep(rng.uniform(7.5, 8.5))
        one.worker_m, onset_s = NEAR_M, time.monotonic()
        opened = until(lambda: new_of(foreman, known), 20.0, "an alert")
        for event in opened:
            known.add(event["alert"]["id"])
            found.append((event["at_s"], from_capture_ms(event), (event["at_s"] - onset_s) * 1e3))
    return found


def new_of(foreman: Wearable, known: set[str]) -> list[dict[str, Any]]:
    return [one for one in foreman.alerts(phase="opened") if one["alert"]["id"] not in known]


def from_capture_ms(event: dict[str, Any]) -> float:
    """Return the milliseconds from the capture of the picture that completed a hazard to its arrival at the wrist.

    All processes are on this machine, and so is its one monotonic clock.
    """
    return float(event["alert"]["agems"] + event["at_s"] * 1e3 - event["alert"]["sentms"])


def quantiles(values: list[float]) -> str:
    p50, p95, p99 = np.percentile(values, (50, 95, 99))
    return f"{p50:.0f} / {p95:.0f} / {p99:.0f} ms"


@pytest.mark.parametrize(("work_ms", "minutes"), [(0.0, MINUTES / 2), (20.0, MINUTES / 2), (60.0, MINUTES)])
def test_soak_the_way_to_the_wrist_does_not_grow(work_ms: float, minutes: float, tmp_path: Path) -> None:
    with scene(tmp_path, (1920, 1080), work_ms, bare_detector) as one, Wearable("foreman", one.broker.port) as foreman:
        time.sleep(3.0)
        found = alarm_often(one, foreman, minutes * 60.0)
        words = one.run.stream()
    first, last = ([ms for _, ms, _ in part] for part in (found[: len(found) // 2], found[len(found) // 2 :]))
    to_wrist = [ms for _, ms, _ in found]
    told(
        f"1080p25 RTSP, {work_ms:g} ms of work, {minutes:g} min, {len(found)} alarms: "
        f"capture to wrist {quantiles(to_wrist)}, above the work {quantiles([ms - work_ms for ms in to_wrist])}, "
        f"from onset {quantiles([ms for *_, ms in found])}; first half {quantiles(first)}, second {quantiles(last)}; "
        f"arrival to result {words['arrival_to_result_ms']}; "
        f"{words['frames']} looked at, {words['not_looked_at']} not"
    )
    assert np.percentile(to_wrist, 99) < 400.0
    assert np.median(last) < 1.3 * np.median(first)


def test_soak_hundreds_of_reconnects_leave_nothing_behind(tmp_path: Path) -> None:
    with scene(tmp_path) as one:
        pid = until(lambda: one.run.pid("capture-gate"))
        sizes = []
        for _ in range(100):
            one.sender.kill()
            one.sender.start()
            until(one.run.is_live, 20.0, "a live stream")
            sizes.append(held_by(pid))
        told(f"100 reconnects: MB, descriptors, threads {sizes[10]} to {sizes[-1]}")
        assert one.run.pid("capture-gate") == pid
        assert sizes[-1][0] < 1.05 * sizes[10][0] + 1.0 and sizes[-1][1:] <= sizes[10][1:]


def test_soak_hundreds_of_refusals_leave_nothing_behind() -> None:
    address = LiveAddress.read("rtsp://127.0.0.1:9/none")
    sizes = []
    for _ in range(300):
        with pytest.raises(SourceError):
            LiveStream(address)
        sizes.append(held_by(os.getpid()))
    told(f"300 refusals: MB, descriptors, threads {sizes[20]} to {sizes[-1]}")
    assert sizes[-1][0] < 1.05 * sizes[20][0] and sizes[-1][1:] == sizes[20][1:]


def four_streams(settings: dict[str, Any]) -> None:
    gate = settings["streams"]["gate"]
    settings["streams"] = {name: dict(gate) for name in ("gate", "north", "south", "crane")}


def test_soak_four_streams_for_hours_stay_as_they_are(tmp_path: Path) -> None:
    with scene(tmp_path, (640, 360), 5.0, four_streams) as one:
        one.drives = True
        time.sleep(SETTLED_S)
        first = sizes_of(one.run)
        end_s, number = time.monotonic() + HOURS * 3600.0, 0
        while time.monotonic() < end_s:
            number += 1
            one.worker_m = NEAR_M if number % 2 else FAR_M
            time.sleep(5.0)
            if number % 120 == 0:
                # As in life: a drone that lands to change its battery.
                one.sender.signal(signal.SIGSTOP)
                time.sleep(4.0)
                one.sender.signal(signal.SIGCONT)
        last = sizes_of(one.run)
        for name, (memory, descriptors, threads) in last.items():
            told(f"{HOURS:g} h, {name}: {first[name]} to {(round(memory, 1), descriptors, threads)}")
        assert last.keys() == first.keys()
        for name, now in last.items():
            assert now[0] <= 1.05 * first[name][0] + 2.0, name
            assert now[1:] <= tuple(1.05 * part + 1 for part in first[name][1:]), name


def sizes_of(run: Service) -> dict[str, tuple[float, int, int]]:
    pids = run.words("supervisor.record")["pids"]
    return {name: held_by(pid) for name, pid in pids.items() if pid}


def held_by(pid: int) -> tuple[float, int, int]:
    """Return what a process holds: memory of its own in MB, descriptors, threads."""
    status = Path(f"/proc/{pid}/status").read_text()
    fields = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
    memory_mb = int(fields["RssAnon"].split()[0]) / 1024
    return round(memory_mb, 1), len(list(Path(f"/proc/{pid}/fd").iterdir())), int(fields["Threads"])
