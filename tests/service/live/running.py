"""The service as people start it, and receivers beside it."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from service.live.servers import until

PROJECT = Path(__file__).resolve().parents[3]
OURS = {
    "PYTHONPATH": os.pathsep.join(str(PROJECT / part) for part in ("src", "tests")),
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
ENVIRONMENT = os.environ | OURS


def site_settings(survey: Path | None, broker_port: int, address: str, **more: Any) -> dict[str, Any]:
    """Return the settings of a drawn site with one stream, `gate`."""
    settings: dict[str, Any] = {
        "site": "yard",
        "broker": {"address": f"mqtt://127.0.0.1:{broker_port}"},
        "page": {"port": 0},
        "defaults": {
            "replace": {"detect": {"factory": "service.live.drawn_site:ColourDetector", "options": {}}},
            "hazard": {"rule": "distance"},
            **({} if survey is None else {"ground": {"survey": str(survey)}}),
        },
        "streams": {"gate": {"address": address}},
        "receivers": {"foreman": {"wearer": "nobody", "everything": True}},
    }
    for name, value in more.items():
        settings[name] = {**settings[name], **value} if isinstance(settings.get(name), dict) else value
    return settings


def with_work(settings: dict[str, Any], work_ms: float) -> dict[str, Any]:
    settings["defaults"]["replace"]["detect"]["options"] = {"work_ms": work_ms}
    return settings


class Service:
    """A service that runs.

    Args:
        path: Of its settings.
        log: Where its log goes.
    """

    def __init__(self, path: Path, log: Path) -> None:
        self.path, self.log = path, log
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        with self.log.open("ab") as log:
            command = [sys.executable, "-m", "standoff", "serve", str(self.path)]
            self.process = subprocess.Popen(
                command,
                stdout=log,
                stderr=log,
                env=os.environ | OURS,
            )

    @property
    def state(self) -> Path:
        return self.path.parent / "standoff-state"

    def workplace(self) -> Path:
        written = self.state / "service.json"
        words = until(lambda: written.exists() and written.read_text(), 60.0, "the beginning of the service")
        return Path(json.loads(words)["workplace"])

    def words(self, name: str) -> dict[str, Any]:
        """Return what a process, or `stream-gate.analysis`, says of itself."""
        from standoff.service.live.shared import SharedRecord

        path = self.workplace() / name
        return (SharedRecord(path).read() or {}) if path.exists() else {}

    def pid(self, process: str) -> int | None:
        found = self.words("supervisor.record").get("pids", {}).get(process)
        return None if found is None else int(found)

    def stream(self) -> dict[str, Any]:
        return self.words("stream-gate.analysis")

    def is_live(self) -> bool:
        return self.stream().get("state") == "live" and self.stream().get("frames", 0) > 3

    def until_live(self, longest_s: float = 60.0) -> None:
        until(self.is_live, longest_s, f"a live stream: {self.stream()}; {self.log.read_text()[-2000:]}")

    def address(self) -> str:
        return str(until(lambda: self.words("page.record").get("address"), 30.0, "the page"))

    def ask(self, path: str) -> tuple[int, bytes]:
        base = self.address().partition("/?")[0]
        try:
            with urllib.request.urlopen(base + path, timeout=5) as answer:
                return answer.status, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.read()

    def stop(self) -> int:
        assert self.process is not None
        self.process.terminate()
        code = self.process.wait(20)
        self.process = None
        return code


@contextmanager
def service(folder: Path, settings: dict[str, Any]) -> Generator[Service, None, None]:
    """Start a service."""
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(settings))
    running = Service(path, folder / "service.log")
    running.start()
    try:
        yield running
    finally:
        if running.process is not None:
            running.process.terminate()
            try:
                running.process.wait(15)
            except subprocess.TimeoutExpired:
                running.process.kill()
                running.process.wait()


class Wearable:
    """A receiver; what happens to it, with the moment."""

    def __init__(self, device: str, port: int, *more: str) -> None:
        command = [sys.executable, "-m", "standoff", "wearable", "--device", device, "--site", "yard", "--json"]
        command += ["--broker", f"mqtt://127.0.0.1:{port}", *more]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | OURS,
        )
        self.events: list[dict[str, Any]] = []
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith(b"{"):
                self.events.append({**json.loads(line), "read_s": time.monotonic()})

    def of_kind(self, event: str) -> list[dict[str, Any]]:
        return [one for one in [*self.events] if one["event"] == event]

    def alerts(self, **wanted: Any) -> list[dict[str, Any]]:
        """Return the alerts that were taken, and whose hazard is as wanted."""
        found = [one for one in self.of_kind("alert") if not one["dropped"]]
        return [
            one for one in found if all(one["alert"]["data"]["hazard"][name] == value for name, value in wanted.items())
        ]

    def receiver_heard(self) -> bool:
        """Return whether a word on supervision has come."""
        return bool(self.of_kind("supervision"))

    def level(self) -> str:
        levels = self.of_kind("level")
        return str(levels[-1]["level"]) if levels else "unsupervised"

    def press_enter(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(b"\n")
        self._process.stdin.flush()

    def __enter__(self) -> Wearable:
        until(lambda: self.of_kind("connected"), 30.0, "a receiver's connection")
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(10)
        self._reading.join(5.0)
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()
