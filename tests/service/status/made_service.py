"""A service of which only the words are there: what its processes would say of themselves, written by hand."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import av
import numpy as np
import yaml

from standoff.config import load_site
from standoff.service.live.workplace import Workplace
from standoff.service.status.overview import Overview

SITE = {
    "site": "yard",
    "broker": {"address": "mqtt://127.0.0.1:1883"},
    "streams": {"gate": {"address": "rtsp://10.0.0.5/live"}, "crane": {"address": "rtsp://10.0.0.6/live"}},
    "receivers": {"wrist": {"wearer": "worker"}, "foreman": {"wearer": "nobody", "everything": True}},
}
PROCESSES = ("messenger", "analysis", "page", "capture-gate", "capture-crane")
QUANTILES = {"p50": 40.0, "p95": 90.5, "p99": 120.0, "count": 1500}


class MadeService:
    """Speaks for all processes.

    Args:
        folder: Of the test.
    """

    def __init__(self, folder: Path) -> None:
        (folder / "memory").mkdir()
        (folder / "site.yaml").write_text(yaml.safe_dump(SITE, sort_keys=False))
        self.workplace = Workplace(folder / "memory")
        self.workplace.write_plan(load_site(folder / "site.yaml"))
        self.overview = Overview(self.workplace)

    def say_all(self, **ages_s: float) -> None:
        """Let each process speak now, or some time ago; by name, `-` as `_`."""
        self.say("supervisor", starts=dict.fromkeys(PROCESSES, 1), pids=dict.fromkeys(PROCESSES, 1))
        for name in ("analysis", "page"):
            self.say(name, ages_s.get(name, 0.0))
        self.say_messenger(ages_s.get("messenger", 0.0))
        for stream in SITE["streams"]:
            record = self.workplace.capture_record(stream)
            record.write({"beat_s": time.monotonic() - ages_s.get(f"capture_{stream}", 0.0), "phase": "receiving",
                          "reason": "", "pid": 1, "connections": 1})  # fmt: skip
            self.say_stream(stream)

    def say(self, process: str, age_s: float = 0.0, **words: Any) -> None:
        self.workplace.record(process).write({"beat_s": time.monotonic() - age_s, "pid": 1, **words})

    def say_messenger(self, age_s: float = 0.0, **words: Any) -> None:
        supervised = {"supervised": True, "reason": "", "streams": ["gate"]}
        told = {
            "is_connected": True,
            "letters": {"delivered": 12, "waiting": 1, "expired": 2},
            "to_wrist_ms": QUANTILES,
            "sent_to_shown_ms": None,
            "devices": {"wrist": supervised, "foreman": {**supervised, "supervised": False, "reason": "crane: late"}},
            "shelves": [],
        }
        self.say("messenger", age_s, **{**told, **words})

    def say_stream(self, stream: str, **words: Any) -> None:
        told = {
            "state": "live", "reason": "", "delay": "told", "session": "s", "frames": 250, "not_looked_at": 3,
            "seen_s": time.monotonic(), "captured_s": time.monotonic() - 0.2, "arrival_to_result_ms": QUANTILES,
            "detect_ms": None, "open": [], "size_px": [640, 360], "map": "surveyed", "map_reason": "",
            "watched_share": 0.875, "unwatched": {"blurred": 0.125},
            "tracks": [{"id": 1, "class": "worker", "xyxy_px": [1.0, 2.0, 3.5, 4.0]}],
        }  # fmt: skip
        self.workplace.stream_record(stream).write({**told, **words})

    def show(self, stream: str, age_s: float = 0.0, size_px: tuple[int, int] = (1280, 720), level: int = 128) -> None:
        """Put a picture into a stream's slot, of one brightness."""
        planes = np.full((size_px[1] * 3 // 2, size_px[0]), 128, np.uint8)
        planes[: size_px[1]] = level
        with self.workplace.pictures(stream) as slot:
            slot.put(av.VideoFrame.from_ndarray(planes, format="yuv420p"), {"arrived_s": time.monotonic() - age_s})


def hazard(severity: str = "danger", **changes: Any) -> dict[str, Any]:
    return {
        "hazard_id": "h-1", "rule": "proximity", "severity": severity, "phase": "opened", "zone": "",
        "track_ids": [1, 2], "distance_m": 4.2, "gap_m": None, "sigma_m": 0.3, "reason": "", **changes,
    }  # fmt: skip
