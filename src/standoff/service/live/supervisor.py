"""The supervisor: starts every process of the service, and starts again what dies or does not answer."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from standoff.config import SiteSettings, load_site
from standoff.core.errors import ConfigError, OutputError, StandoffError
from standoff.files.in_use import FolderInUse
from standoff.files.json_text import parse_json, write_json
from standoff.files.plain_text import read_text
from standoff.files.whole import make_folder
from standoff.service.live.capture import CapturePlan
from standoff.service.live.child import SPARE
from standoff.service.live.log import log_of
from standoff.service.live.outbox import Outbox
from standoff.service.live.shared import SharedRecord
from standoff.service.live.workplace import Workplace

_LOOK_S: Final = 0.1
_SILENT_S: Final = 4.0
_BEGINS_S: Final = 30.0
"""A process that has just been started has so long until its first beat."""
_BUSY_S: Final = 180.0
"""At one picture: a machine that sees standoff for the first time compiles for a minute."""
_SETTLED_S: Final = 3.0
"""A process that has just begun needs the machine for itself."""
_STOPPING_S: Final = 5.0
_QUICK_DEATH_S: Final = 2.0
_LONGEST_PAUSE_S: Final = 3.0
_RUN_FILE: Final = "service.json"
_FIXED: Final = ("site", "state", "broker", "page")
"""Of the settings: what holds until the service begins anew."""


@dataclass(frozen=True, slots=True)
class Reloaded:
    """What came of reading the settings again.

    Attributes:
        applied: What has changed and holds now.
        needs_restart: What has changed and holds once the service begins anew.
        problem: Why nothing has changed; empty otherwise.
    """

    applied: tuple[str, ...] = ()
    needs_restart: tuple[str, ...] = ()
    problem: str = ""


class _Child:
    """One process.

    Args:
        name: Of the process; of a capture with its stream.
        words: Behind `child`.
        beat: What it says of itself.
        has_spare: Whether another one is kept that has loaded all it needs and waits for its turn: the analysis needs
            seconds to begin, in which nobody would be warned.
    """

    def __init__(self, name: str, words: tuple[str, ...], beat: SharedRecord, *, has_spare: bool = False) -> None:
        self.name, self._words, self._beat, self._has_spare = name, words, beat, has_spare
        self._log = log_of("supervisor", process=name)
        self._process: subprocess.Popen[bytes] | None = None
        self._spare: subprocess.Popen[bytes] | None = None
        self._started_s = self._pause_until_s = self._spare_s = 0.0
        self._pause_s = 0.0
        self.starts = 0

    @property
    def pid(self) -> int | None:
        """Of the process; None while there is none."""
        return None if self._process is None else self._process.pid

    def look(self, now_s: float) -> None:
        """Start it, or start it again, where that has to be."""
        if self._process is None:
            if now_s >= self._pause_until_s:
                self._start(now_s)
            return
        code = self._process.poll()
        if code is None and (why := self._not_answering(now_s)):
            self._log.error("does not answer; killed", why=why)
            self._process.kill()
            code = self._process.wait()
        if code is not None:
            lived_s = now_s - self._started_s
            quick = lived_s < _QUICK_DEATH_S
            self._pause_s = min(max(2.0 * self._pause_s, 0.25), _LONGEST_PAUSE_S) if quick else 0.0
            self._log.warning("ended; begins anew", code=code, lived_s=round(lived_s, 1))
            self._process, self._pause_until_s = None, now_s + self._pause_s
            if not quick:
                self._start(now_s)
        elif self._has_spare and now_s - self._started_s > _SETTLED_S:
            self._keep_spare(now_s)

    def _start(self, now_s: float) -> None:
        spare, self._spare = self._spare, None
        if spare is not None and spare.poll() is None and spare.stdin is not None:
            with contextlib.suppress(OSError):
                spare.stdin.write(b"go\n")
                spare.stdin.flush()
            self._process = spare
        else:
            self._process = self._popen()
        self._started_s = now_s
        self.starts += 1

    def _keep_spare(self, now_s: float) -> None:
        if (self._spare is None or self._spare.poll() is not None) and now_s - self._spare_s > _SETTLED_S:
            self._spare, self._spare_s = self._popen(SPARE), now_s

    def _popen(self, *more: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "standoff.service.live.child", *self._words, *more]
        # Of its own group: Ctrl-C in a terminal is for the supervisor, which lets all others end in order.
        return subprocess.Popen(command, stdin=subprocess.PIPE if more else subprocess.DEVNULL, start_new_session=True)

    def _not_answering(self, now_s: float) -> str:
        words = self._beat.read()
        if words is None or words["pid"] != self.pid:
            return "no first beat" if now_s - self._started_s > _BEGINS_S else ""
        silent_s, busy_s = now_s - words["beat_s"], words.get("busy_s", 0.0)
        if silent_s > _SILENT_S:
            return f"silent for {silent_s:.1f} s"
        return f"at one picture for {busy_s:.0f} s" if busy_s > _BUSY_S else ""

    def stop(self) -> None:
        """Ask it to end."""
        self._has_spare = False
        if self._process is not None:
            self._process.terminate()
        if self._spare is not None:
            self._spare.kill()
            self._spare.wait()
            self._spare = None

    def wait(self, until_s: float) -> None:
        """Wait for its end, and enforce it."""
        if self._process is None:
            return
        try:
            self._process.wait(max(0.0, until_s - time.monotonic()))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None


class Supervisor:
    """Runs a site until it is asked to end.

    Args:
        path: Of the site's settings, for when they are to be read again.
        site: The settings.
        tell: Called with the address of the status page.

    Raises:
        StandoffError: The settings, the state's folder, or another service on it.
    """

    def __init__(self, path: Path, site: SiteSettings, tell: Callable[[str], None]) -> None:
        self._path, self.site, self._tell = path, site, tell
        self._log = log_of("supervisor")
        state = self.site.live.state
        make_folder(state)
        try:
            self._mark = FolderInUse(state)
        except OutputError:
            raise ConfigError(
                expected=f"no other service on {state}", found="one that runs", fix="stop it, or give another `state`"
            ) from None
        _remove_left(state)
        Outbox(state).close()
        self.workplace = Workplace.make()
        self.workplace.write_plan(self.site)
        self._children: dict[str, _Child] = {}
        self._is_ended, self._wants_reload = False, False
        self._address_told = False
        self._lock = threading.Lock()
        self._make_children()

    def run(self) -> None:
        """Go on until SIGTERM or Ctrl-C."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: self._end())
        signal.signal(signal.SIGHUP, lambda *_: self._ask_reload())
        write_json(self.site.live.state / _RUN_FILE, {"pid": os.getpid(), "workplace": str(self.workplace.folder)})
        _tell_systemd("READY=1")
        word = self.workplace.record("supervisor")
        try:
            while not self._is_ended:
                if self._wants_reload:
                    self._wants_reload = False
                    self._say_reloaded(self.reload())
                now_s = time.monotonic()
                for child in [*self._children.values()]:
                    child.look(now_s)
                starts = {name: child.starts for name, child in self._children.items()}
                pids = {name: child.pid for name, child in self._children.items()}
                word.write({"beat_s": now_s, "starts": starts, "pids": pids})
                self._tell_address()
                _tell_systemd("WATCHDOG=1")
                time.sleep(_LOOK_S)
        finally:
            self._stop()

    def _end(self) -> None:
        self._is_ended = True

    def _ask_reload(self) -> None:
        self._wants_reload = True

    def reload(self) -> Reloaded:
        """Read the settings again, and take what can change without a restart."""
        try:
            site = load_site(self._path)
        except StandoffError as error:
            return Reloaded(problem=str(error))
        before = self.site
        applied, fixed = _differences(before, site)
        kept = {name: getattr(before.live, name) for name in _FIXED}
        self.site = SiteSettings(site.defaults, site.streams, site.live.model_copy(update=kept))
        self.workplace.write_plan(self.site)
        for name in before.streams:
            if name not in site.streams or site.streams[name].live_address != before.streams[name].live_address:
                self._drop(f"capture-{name}")
        self._make_children()
        return Reloaded(tuple(applied), tuple(fixed))

    def _say_reloaded(self, reloaded: Reloaded) -> None:
        answer = {
            "applied": list(reloaded.applied), "needs_restart": list(reloaded.needs_restart),
            "problem": reloaded.problem, "at_s": time.monotonic(),
        }  # fmt: skip
        self.workplace.record("reload").write(answer)
        self._log.info("settings read again", **answer)

    def _make_children(self) -> None:
        """Have a process for each part, and for each stream that is wanted; no other."""
        folder = str(self.workplace.folder)
        wanted = {name for name, one in self.site.streams.items() if one.capture.enabled}
        for stream in [*self.site.streams]:
            if stream in wanted and f"capture-{stream}" not in self._children:
                self.workplace.write_capture_plan(CapturePlan(stream, self.site.streams[stream].live_address))
                record = self.workplace.capture_record(stream)
                self._children[f"capture-{stream}"] = _Child(f"capture-{stream}", ("capture", folder, stream), record)
        for name in [*self._children]:
            if name.startswith("capture-") and name.removeprefix("capture-") not in wanted:
                self._drop(name)
        for process in ("messenger", "analysis", "page"):
            if process not in self._children:
                record, has_spare = self.workplace.record(process), process != "page"
                self._children[process] = _Child(process, (process, folder), record, has_spare=has_spare)

    def _drop(self, name: str) -> None:
        child = self._children.pop(name, None)
        if child is not None:
            child.stop()
            child.wait(time.monotonic() + 1.0)

    def _tell_address(self) -> None:
        if not self._address_told and (words := self.workplace.record("page").read()) is not None:
            self._address_told = True
            self._tell(str(words["address"]))

    def _stop(self) -> None:
        """Let all end in order: first the captures, then the analysis, whose last words the messenger still sends."""
        _tell_systemd("STOPPING=1")
        until_s = time.monotonic() + _STOPPING_S
        captures = [child for name, child in self._children.items() if name.startswith("capture-")]
        for group in (captures, *([self._children[name]] for name in ("analysis", "messenger", "page"))):
            for child in group:
                child.stop()
            for child in group:
                child.wait(max(until_s, time.monotonic() + 1.0))
            if group == [self._children["analysis"]]:
                time.sleep(_LOOK_S * 5)
        self.workplace.remove()
        with contextlib.suppress(OSError):
            (self.site.live.state / _RUN_FILE).unlink()
        self._mark.release()


def running_service(state: Path) -> Mapping[str, Any]:
    """Return the process and the workplace of the service that runs on a state's folder.

    Raises:
        ConfigError: None does.
    """
    path = state / _RUN_FILE
    with contextlib.suppress(StandoffError, OSError, ValueError, KeyError, TypeError):
        words = parse_json(read_text(path, "a running service", ConfigError), "a running service", str(path))
        if isinstance(words, dict) and _is_alive(int(words["pid"])):
            return words
    raise ConfigError(
        expected=f"a service that runs on {state}", found="none", fix="start it: `standoff serve site.yaml`"
    )


def ask_reload(state: Path, patience_s: float = 15.0) -> Reloaded:
    """Let the service that runs read its settings again; return what came of it.

    Raises:
        ConfigError: None runs, or it does not answer.
    """
    words = running_service(state)
    record = Workplace(Path(words["workplace"])).record("reload")
    asked_s = time.monotonic()
    os.kill(int(words["pid"]), signal.SIGHUP)
    while time.monotonic() - asked_s < patience_s:
        answer = record.read()
        if answer is not None and answer["at_s"] >= asked_s:
            return Reloaded(tuple(answer["applied"]), tuple(answer["needs_restart"]), answer["problem"])
        time.sleep(_LOOK_S)
    raise ConfigError(expected="an answer of the service", found=f"none in {patience_s:g} s", fix="look at its log")


def _differences(before: SiteSettings, after: SiteSettings) -> tuple[list[str], list[str]]:
    """Return what has changed: what can be taken at once, and what cannot."""
    applied = [f"streams.{name} (new)" for name in after.streams if name not in before.streams]
    applied += [f"streams.{name} (gone)" for name in before.streams if name not in after.streams]
    applied += [
        f"streams.{name}"
        for name, one in after.streams.items()
        if name in before.streams and one != before.streams[name]
    ]
    fixed: list[str] = []
    for name in type(after.live).model_fields:
        if getattr(after.live, name) != getattr(before.live, name):
            (fixed if name in _FIXED else applied).append(name)
    return applied, fixed


def _remove_left(state: Path) -> None:
    """Remove the workplace of a service that was killed."""
    path = state / _RUN_FILE
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        words = json.loads(path.read_text(encoding="utf-8"))
        folder = Path(words["workplace"])
        if folder.name.startswith("standoff-"):
            Workplace(folder).remove()
        path.unlink()


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (OSError, OverflowError):
        return False
    # Zero and less name groups of processes, and a signal is for one.
    return pid > 0


def _tell_systemd(word: str) -> None:
    """Tell systemd how we are, where it has started us (sd_notify)."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as telling:
        telling.sendto(word.encode(), f"\0{address[1:]}" if address.startswith("@") else address)
