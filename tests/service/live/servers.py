"""Real servers on this machine, each started by who needs it: Mosquitto, GStreamer's RTSP server, nginx with RTMP."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
SYSTEM_PYTHON = "/usr/bin/python3"
PATIENCE_S = 15.0


def needs(*programs: str) -> None:
    """Skip where a program is missing; CI has all."""
    missing = [one for one in programs if shutil.which(one) is None]
    if missing and os.environ.get("REQUIRE_SERVERS"):
        pytest.fail(f"this machine is to have {', '.join(missing)}")
    if missing:
        pytest.skip(f"needs {', '.join(missing)}")


def free_port() -> int:
    with socket.socket() as asking:
        asking.bind(("127.0.0.1", 0))
        return int(asking.getsockname()[1])


def until(condition: Callable[[], Any], longest_s: float = PATIENCE_S, what: str = "") -> Any:
    """Wait for something; return what it is."""
    end_s = time.monotonic() + longest_s
    while time.monotonic() < end_s:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError(f"not within {longest_s:g} s: {what or condition}")


def answers(port: int) -> bool:
    with socket.socket() as asking:
        asking.settimeout(0.2)
        return asking.connect_ex(("127.0.0.1", port)) == 0


class Server:
    """A process that listens on a port.

    Args:
        command: Starts it.
        port: On which it listens.
    """

    def __init__(self, command: list[str], port: int, log: Path) -> None:
        self._command, self.port, self._log = command, port, log
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        with self._log.open("ab") as log:
            self.process = subprocess.Popen(self._command, stdout=log, stderr=log, stdin=subprocess.PIPE)
        until(lambda: answers(self.port), what=f"{self._command[0]} on {self.port}: {self._log.read_text()[-500:]}")

    def kill(self) -> None:
        if self.process is not None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
            self.process.wait()
            if self.process.stdin is not None:
                with contextlib.suppress(OSError):
                    self.process.stdin.close()
            self.process = None

    def signal(self, number: int) -> None:
        assert self.process is not None
        self.process.send_signal(number)


@contextmanager
def mosquitto(folder: Path, *lines: str, port: int | None = None) -> Generator[Server, None, None]:
    """Give a broker; without lines everybody on this machine may do everything."""
    needs("mosquitto")
    port = port or free_port()
    config = folder / f"mosquitto-{port}.conf"
    own = lines or (f"listener {port} 127.0.0.1", "allow_anonymous true")
    config.write_text("\n".join([*own, "persistence false", ""]))
    server = Server(["mosquitto", "-c", str(config)], port, folder / f"mosquitto-{port}.log")
    server.start()
    try:
        yield server
    finally:
        server.kill()


class RtspServer(Server):
    """Passes on H.264 that is written to it."""

    def __init__(self, folder: Path, path: str = "/live", user: str = "", password: str = "") -> None:
        port = free_port()
        command = [SYSTEM_PYTHON, str(HERE / "rtsp_server.py"), str(port), path, user, password]
        super().__init__(command, port, folder / f"rtsp-{port}.log")
        self.address = f"rtsp://127.0.0.1:{port}{path}"

    def write(self, data: bytes, *, is_key: bool) -> None:
        """Send a coded picture."""
        process = self.process
        if process is not None and process.stdin is not None:
            with contextlib.suppress(OSError, ValueError):
                process.stdin.write(struct.pack(">IB", len(data), is_key) + data)
                process.stdin.flush()


@contextmanager
def rtsp_server(folder: Path, user: str = "", password: str = "") -> Generator[RtspServer, None, None]:
    needs(SYSTEM_PYTHON)
    asked = [SYSTEM_PYTHON, "-c", "import gi; gi.require_version('GstRtspServer', '1.0')"]
    if subprocess.run(asked, capture_output=True, check=False).returncode != 0:
        if os.environ.get("REQUIRE_SERVERS"):
            pytest.fail("this machine is to have gir1.2-gst-rtsp-server-1.0")
        pytest.skip("needs gir1.2-gst-rtsp-server-1.0")
    server = RtspServer(folder, user=user, password=password)
    server.start()
    try:
        yield server
    finally:
        server.kill()


@contextmanager
def nginx_rtmp(folder: Path) -> Generator[Server, None, None]:
    """Give a server that takes pushes on /live and hands them on."""
    needs("nginx")
    port = free_port()
    config = folder / "nginx.conf"
    config.write_text(
        f"""load_module /usr/lib/nginx/modules/ngx_rtmp_module.so;
daemon off; master_process off; pid {folder}/nginx.pid; error_log {folder}/nginx-error.log;
events {{ worker_connections 64; }}
rtmp {{ server {{ listen 127.0.0.1:{port}; application live {{ live on; sync 10ms; allow publish 127.0.0.1; }} }} }}
"""
    )
    server = Server(["nginx", "-c", str(config), "-p", str(folder)], port, folder / "nginx.log")
    server.start()
    try:
        yield server
    finally:
        server.kill()


class Cable:
    """A connection to a server that can be pulled out and plugged in again.

    Args:
        target: Port of the server.
    """

    def __init__(self, target: int) -> None:
        self.port, self._target = free_port(), target
        self._held: list[socket.socket] = []
        self._listening: socket.socket | None = None
        self.plug()

    def plug(self) -> None:
        self._listening = socket.create_server(("127.0.0.1", self.port))
        threading.Thread(target=self._serve, args=(self._listening,), daemon=True).start()

    def pull(self) -> None:
        assert self._listening is not None
        for one in (self._listening, *self._held):
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()
        self._held.clear()

    def _serve(self, listening: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = listening.accept()
                far = socket.create_connection(("127.0.0.1", self._target))
                for one in (near, far):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._held += [near, far]
                for source, target in ((near, far), (far, near)):
                    threading.Thread(target=_pump, args=(source, target), daemon=True).start()


def _pump(source: socket.socket, target: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(65536):
            target.sendall(data)
    for one in (source, target):
        with contextlib.suppress(OSError):
            one.shutdown(socket.SHUT_RDWR)
