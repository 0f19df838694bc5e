"""The folder in which the processes of one service meet: their words, pictures and bells."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import shutil
import socket
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from standoff.service.live.shared import PictureSlot, SharedRecord

if TYPE_CHECKING:
    # A capture begins anew in a fraction of a second, because it loads nothing of the settings.
    from standoff.config import SiteSettings
    from standoff.service.live.capture import CapturePlan

_MEMORY: Final = Path("/dev/shm")
_PLAN: Final = "site.plan"
_OWNER: Final = "owner"
_SECRETS: Final = "secrets.plan"
_LARGEST_RING: Final = 1 << 17


@dataclass(frozen=True, slots=True)
class Workplace:
    """A folder in memory that only this user can read.

    Attributes:
        folder: Where it is.
    """

    folder: Path

    @classmethod
    def make(cls) -> Workplace:
        """Make a new one."""
        parent = _MEMORY if os.access(_MEMORY, os.W_OK) else None
        made = cls(Path(tempfile.mkdtemp(prefix="standoff-", dir=parent)))
        (made.folder / _OWNER).write_text(str(os.getpid()), encoding="ascii")
        return made

    def is_owned(self) -> bool:
        """Return whether who made it is still there, as the parent of who asks: whoever is left alone has to end."""
        try:
            return os.getppid() == int((self.folder / _OWNER).read_text(encoding="ascii"))
        except (OSError, ValueError):
            return False

    def repeat(self, beat: Callable[[], object], every_s: float) -> None:
        """Do something again and again, in a thread of its own; where the process is left alone, it ends at once.

        Args:
            beat: What to do.
            every_s: Pause in between.
        """

        def go_on() -> None:
            while True:
                beat()
                if not self.is_owned():
                    os._exit(0)
                time.sleep(every_s)

        threading.Thread(target=go_on, daemon=True, name="beat").start()

    def remove(self) -> None:
        """Take it away, with all that is in it."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def write_plan(self, site: SiteSettings) -> None:
        """Keep the settings that hold now: who begins anew must not read a file that is just being edited."""
        self._keep(_SECRETS, site.secrets)
        self._keep(_PLAN, site)

    def plan(self) -> SiteSettings:
        """Return the settings that hold now."""
        site: SiteSettings = self._kept(_PLAN)
        return site

    def secrets(self) -> tuple[str, ...]:
        """Return what must be in no log."""
        words: tuple[str, ...] = self._kept(_SECRETS)
        return words

    def write_capture_plan(self, plan: CapturePlan) -> None:
        """Keep what the capture of a stream is to do."""
        self._keep(f"stream-{plan.stream_id}.plan", plan)

    def capture_plan(self, stream: str) -> CapturePlan:
        """Return what the capture of a stream is to do."""
        plan: CapturePlan = self._kept(f"stream-{stream}.plan")
        return plan

    def _keep(self, name: str, plan: object) -> None:
        partial = self.folder / f"{name}.partial"
        partial.write_bytes(pickle.dumps(plan))
        partial.replace(self.folder / name)

    def _kept(self, name: str) -> Any:  # noqa: ANN401
        # Written by ourselves, in a folder that nobody else can enter.
        return pickle.loads((self.folder / name).read_bytes())

    def plan_stamp(self) -> int:
        """Return a number that changes with the plan."""
        return (self.folder / _PLAN).stat().st_mtime_ns

    def capture_record(self, stream: str) -> SharedRecord:
        """Return what the capture of a stream says of itself."""
        return SharedRecord(self.folder / f"stream-{stream}.capture", 4096)

    def stream_record(self, stream: str) -> SharedRecord:
        """Return what the analysis says of a stream."""
        return SharedRecord(self.folder / f"stream-{stream}.analysis")

    def telemetry_record(self, stream: str) -> SharedRecord:
        """Return what a stream's drone said last."""
        return SharedRecord(self.folder / f"stream-{stream}.telemetry", 4096)

    def pictures(self, stream: str) -> PictureSlot:
        """Return where a stream's newest picture is."""
        return PictureSlot(self.folder, f"stream-{stream}")

    def analysed(self, stream: str) -> PictureSlot:
        """Return where the newest picture of a stream is that was analysed."""
        return PictureSlot(self.folder, f"stream-{stream}-analysed")

    def record(self, process: str) -> SharedRecord:
        """Return what a process of the service says of itself."""
        return SharedRecord(self.folder / f"{process}.record")

    def bell(self, process: str) -> Bell:
        """Return the bell of a process, for the process itself."""
        return Bell(self.folder / f"{process}.bell")

    def ring(self, process: str, about: str, words: dict[str, Any] | None = None) -> bool:
        """Ring a process; return whether it heard. Never waits.

        Args:
            process: Whose bell.
            about: Why.
            words: To be told with it.
        """
        body = json.dumps({"about": about, **(words or {})}, separators=(",", ":")).encode()
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ringing:
            ringing.setblocking(False)
            try:
                ringing.sendto(body, str(self.folder / f"{process}.bell"))
            except OSError:
                return False
        return True


class Bell:
    """What wakes a process; what rings while it is busy waits, within limits.

    Args:
        path: Of its socket; one that a killed process left is replaced.
    """

    def __init__(self, path: Path) -> None:
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(path))

    def wait(self, longest_s: float) -> dict[str, Any] | None:
        """Return what it is rung for; None where nobody rings for so long."""
        self._socket.settimeout(longest_s)
        try:
            body = self._socket.recv(_LARGEST_RING)
        except (TimeoutError, BlockingIOError):
            return None
        words: dict[str, Any] = json.loads(body)
        return words

    def close(self) -> None:
        """Hear no more."""
        self._socket.close()
