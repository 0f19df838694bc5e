"""The analysis: one process with the detector and every stream's monitor, each with its share of the time."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from typing import Final

from standoff.config import SiteSettings, StreamSettings, build_stage
from standoff.core.errors import StandoffError
from standoff.core.protocols import Detector
from standoff.service.live.delays import MeasuredDelay, read_delays
from standoff.service.live.log import log_of
from standoff.service.live.outbox import Outbox
from standoff.service.live.service_clock import ServiceClock
from standoff.service.live.stream_analysis import StreamAnalysis
from standoff.service.live.turns import Turns
from standoff.service.live.watched_record import WatchedRecord
from standoff.service.live.workplace import Workplace

_WAIT_S: Final = 0.05
_CHECK_EVERY_S: Final = 0.1
_WORDS_EVERY_S: Final = 0.5
_BEAT_S: Final = 0.2
_LEFT_OUT: Final = "taken out of the settings"
_STOPPED: Final = "the service was stopped"


class Analysis:
    """Looks at the newest picture of one stream after another, for ever.

    Args:
        workplace: Where the pictures are.
        site: The settings.
    """

    def __init__(self, workplace: Workplace, site: SiteSettings) -> None:
        self._workplace, self._site = workplace, site
        self._log = log_of("analysis")
        self._now = ServiceClock.of_machine()
        self._outbox = Outbox(site.live.state)
        self._record = WatchedRecord(site.live.state, site.live.site, site.live.shift, self._now)
        self._bell = workplace.bell("analysis")
        self._word = workplace.record("analysis")
        self._turns = Turns()
        self._detectors: dict[str, Detector | None] = {}
        self._streams: dict[str, StreamAnalysis] = {}
        self._busy_since_s: float | None = None
        self._is_ended = False
        self._plan_stamp = workplace.plan_stamp()
        self._take(site)

    def run(self) -> None:
        """Go on until the process that started it is gone, or asks for the end."""
        signal.signal(signal.SIGTERM, lambda *_: self._end())
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self._workplace.repeat(self._beat, _BEAT_S)
        checked_s = written_s = 0.0
        while not self._is_ended:
            waiting = [name for name, stream in self._streams.items() if stream.has_news()]
            if waiting:
                self._look(self._turns.next_of(waiting))
            else:
                self._bell.wait(_WAIT_S)
            now_s = time.monotonic()
            if now_s - checked_s >= _CHECK_EVERY_S:
                checked_s = now_s
                self._follow_plan()
                for stream in self._streams.values():
                    stream.check(now_s)
            if now_s - written_s >= _WORDS_EVERY_S:
                written_s = now_s
                self._write_words()
        for stream in self._streams.values():
            stream.close(_STOPPED)
        self._record.write()

    def _end(self) -> None:
        self._is_ended = True

    def _look(self, name: str) -> None:
        stream, began_s = self._streams[name], time.monotonic()
        self._busy_since_s = began_s
        try:
            stream.look()
        except Exception as error:  # noqa: BLE001 - one stream's trouble must not end the watch over the others
            self._log.error("analysis failed", stream=name, error=str(error) or type(error).__name__, exc_info=True)
            stream.fail(str(error) or type(error).__name__)
        finally:
            self._busy_since_s = None
        self._turns.used(name, time.monotonic() - began_s)

    def _follow_plan(self) -> None:
        stamp = self._workplace.plan_stamp()
        if stamp != self._plan_stamp:
            self._plan_stamp = stamp
            self._take(self._workplace.plan())

    def _take(self, site: SiteSettings) -> None:
        """Take settings: streams that are as before go on, others begin anew."""
        before, self._site = self._site, site
        for name in [*self._streams]:
            if name not in site.streams or site.streams[name] != before.streams.get(name):
                self._streams.pop(name).close(_LEFT_OUT)
        for name, settings in site.streams.items():
            if name not in self._streams:
                detector = self._detector(name, settings)
                self._streams[name] = StreamAnalysis(
                    name,
                    site.live.site,
                    settings,
                    self._workplace,
                    detector,
                    self._outbox,
                    self._record,
                    lambda about, words: self._workplace.ring("messenger", about, words),
                    self._now,
                )
        for name, measured in self._delays().items():
            if name in site.streams and measured.address == site.streams[name].address:
                self._streams[name].measured = measured

    def _delays(self) -> dict[str, MeasuredDelay]:
        try:
            return dict(read_delays(self._site.live.state))
        except StandoffError as error:
            self._log.error("delays are not used", error=str(error))
            return {}

    def _detector(self, name: str, settings: StreamSettings) -> Detector | None:
        """Return the detector of a stream, shared by all that have the same; None: the stream makes its own.

        A detector of the user's own, or a recording, may keep something of each frame: it belongs to one stream.
        """
        own = settings.settings
        if "detect" in own.replace or own.detections is not None:
            return None
        key = f"{own.model} {own.detect}"
        if key not in self._detectors:
            self._log.info("loading the detector", stream=name)
            self._detectors[key] = build_stage("detect", own)
        return self._detectors[key]

    def _write_words(self) -> None:
        for stream in self._streams.values():
            stream.write_words()

    def _beat(self) -> None:
        """Say that it is alive, and for how long it has been at one picture."""
        now_s, since_s = time.monotonic(), self._busy_since_s
        busy_s = 0.0 if since_s is None else now_s - since_s
        with contextlib.suppress(ValueError):
            self._word.write({"beat_s": now_s, "pid": os.getpid(), "busy_s": busy_s})


def run(workplace: Workplace) -> None:
    """Analyse the streams of a site until the process that started this one is gone."""
    Analysis(workplace, workplace.plan()).run()
