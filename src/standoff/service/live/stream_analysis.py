"""One stream in the analysis: its pictures through its monitor, its state, and what is said of both."""

from __future__ import annotations

import math
import sqlite3
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any, Final

from ulid import ULID

from standoff.config import StreamSettings, build_zones
from standoff.core.camera import CameraPrior
from standoff.core.classes import CLASSES
from standoff.core.clock import StreamClock, ToldBy
from standoff.core.protocols import Detector
from standoff.core.stream_watch import CaptureWord, PictureWord, StreamCondition, stream_condition
from standoff.core.types import Frame, FrameResult, GroundMap, Hazard, NoGroundMap
from standoff.messages import HazardNews, HealthNews
from standoff.messages.events import Delay
from standoff.monitor import Monitor, build_monitor
from standoff.service.live.delays import MeasuredDelay
from standoff.service.live.drone_word import telemetry_at
from standoff.service.live.log import log_of
from standoff.service.live.outbox import Outbox
from standoff.service.live.percentiles import Percentiles
from standoff.service.live.service_clock import Moment, Now
from standoff.service.live.shared import SlotPicture
from standoff.service.live.sighting import Sighting, ground_cells, seen_tracks, share_watched
from standoff.service.live.watched_record import WatchedRecord
from standoff.service.live.workplace import Workplace
from standoff.service.live.zone_grid import zone_grid_m
from standoff.stages.frames import AvPicture, Scaler

_TICK_S: Final = 0.25
_ZONES_EVERY_S: Final = 1.0
_SHOW_EVERY_S: Final = 0.4
_SETTLED_S: Final = 5.0
"""How long a stream must be measured anew before what an earlier session left open is closed."""
_BEGUN_ANEW: Final = "the analysis began anew"
_NOT_FOLLOWED: Final = "its tracks were lost when the analysis began anew; what is near is told anew"

Tell = Callable[[str, dict[str, Any]], object]
"""Rings the messenger: about what, and its words."""


class StreamAnalysis:
    """Watches one stream.

    Args:
        name: Of the stream.
        site: Name of the site.
        settings: Of the stream.
        workplace: Where its pictures are.
        detector: Shared with others that have the same.
        outbox: Where its news go.
        record: Of what was watched.
        tell: Rings the messenger.
        now: The clock.

    Attributes:
        measured: How late its pictures come, where somebody has measured it.
    """

    def __init__(
        self,
        name: str,
        site: str,
        settings: StreamSettings,
        workplace: Workplace,
        detector: Detector | None,
        outbox: Outbox,
        record: WatchedRecord,
        tell: Tell,
        now: Now,
    ) -> None:
        self.name, self._site, self._settings = name, site, settings
        self._workplace, self._detector, self._outbox = workplace, detector, outbox
        self._record, self._tell, self._now = record, tell, now
        self.measured: MeasuredDelay | None = None
        self._log = log_of("analysis", stream=name)
        self._slot, self._capture = workplace.pictures(name), workplace.capture_record(name)
        self._shown, self._shown_s = workplace.analysed(name), -math.inf
        self._words, self._telemetry = workplace.stream_record(name), workplace.telemetry_record(name)
        self._zones = [(zone.name, zone_grid_m(zone)) for zone in build_zones(settings.settings)]
        self._scaler = Scaler()
        self._clock = StreamClock()
        self._monitor: Monitor | None = None
        self._size_px = (0, 0)
        self.session = str(ULID())
        self._connection = self._seen_number = 0
        self._frames = self._missed = 0
        self._condition = StreamCondition("connecting", "it begins")
        self._told_condition: StreamCondition | None = None
        self._tick_s = self._zones_s = -math.inf
        self._measured_since_s: float | None = None
        self._watched_zones: tuple[Any, ...] = ()
        self._latest: FrameResult | None = None
        self._latencies, self._detecting, self._looks_s = Percentiles(), Percentiles(), Percentiles(50)
        self._seen_s = -math.inf
        self._delay: Delay = "unknown"
        self._captured_s: float | None = None
        self._problem, self._problem_s = "", -math.inf
        self._outbox.leave_unknown(name, _BEGUN_ANEW, now())
        self.check(time.monotonic())

    def has_news(self) -> bool:
        """Return whether a picture waits that nobody has looked at, of a stream that shows what is now."""
        about = self._slot.about()
        fresh = about is not None and about[0] != self._seen_number
        return fresh and self._settings.capture.enabled and self._condition.state != "frozen"

    def look(self) -> None:
        """Take the newest picture through the monitor, and tell what comes of it."""
        taken = self._slot.newest()
        if taken is None or taken.number == self._seen_number:
            return
        self._missed += max(0, taken.number - self._seen_number - 1) if self._seen_number else 0
        self._seen_number = taken.number
        began_s = time.monotonic()
        frame = self._frame(taken)
        monitor = self._monitor_for(frame)
        result = monitor.step(frame)
        self._frames += 1
        self._latest = result
        self._publish(result.hazards)
        ended_s = time.monotonic()
        self._seen_s = ended_s
        self._latencies.add((ended_s - taken.about["arrived_s"]) * 1e3)
        self._looks_s.add(ended_s - began_s)
        if "detect" in result.stage_ms:
            self._detecting.add(result.stage_ms["detect"])
        self._settle(result, ended_s)
        self._show(taken, ended_s)
        self.check(ended_s)
        self._tell("sighting", self._sighting(result, ended_s).words())
        self._record.note_ground(self.name, result.watched, self._watched_zones)

    def fail(self, problem: str) -> None:
        """Take that looking failed: the monitor is given up, and a new one is made for the next picture."""
        self._problem, self._problem_s = f"its analysis failed: {problem}", time.monotonic()
        self._lose(self._problem)
        self._monitor = None

    def check(self, now_s: float) -> None:
        """Find out how the stream is, and tell it where that has changed; what is open becomes unknown in silence."""
        self._condition = self._found(now_s)
        if self._condition != self._told_condition:
            self._tell_health()
        if self._condition.state not in ("live", "late") and now_s - self._tick_s >= _TICK_S:
            self._tick_s = now_s
            self._measured_since_s = None
            if self._monitor is not None:
                silence = self._monitor.tick(self._clock.now_s(), self._condition.reason or "no picture", self.name)
                self._publish(silence.hazards)
        self._record.note_state(self.name, self._condition.state, self._condition.reason)

    def write_words(self) -> None:
        """Say how the stream is, for the page."""
        result, monitor = self._latest, self._monitor
        words: dict[str, Any] = {
            "state": self._condition.state,
            "reason": self._condition.reason,
            "delay": self._delay,
            "session": self.session,
            "frames": self._frames,
            "not_looked_at": self._missed,
            "seen_s": self._seen_s if math.isfinite(self._seen_s) else None,
            "captured_s": self._captured_s,
            "arrival_to_result_ms": self._latencies.summary(),
            "detect_ms": self._detecting.summary(),
            "open": [] if monitor is None else [_open_words(one) for one in monitor.open_hazards.latest],
        }
        if result is not None:
            share = result.watched.share
            words |= {
                "size_px": self._size_px,
                "map": result.ground.method if isinstance(result.ground, GroundMap) else "",
                "map_reason": result.ground.reason if isinstance(result.ground, NoGroundMap) else "",
                "watched_share": None if math.isnan(share) else round(share, 3),
                "unwatched": {reason: round(part, 3) for reason, part in result.watched.unwatched.items()},
                "tracks": _track_words(result),
            }
        self._words.write(words)

    def close(self, reason: str) -> None:
        """End: what is open is unknown from now on, and nobody may take the stream for live."""
        self._condition = StreamCondition("lost", reason)
        self._tell_health()
        self._lose(reason)
        self._slot.close()
        self._shown.close()

    def _lose(self, reason: str) -> None:
        if self._monitor is not None:
            self._publish(self._monitor.close(self._clock.now_s(), lost=reason))
        with suppress(sqlite3.Error):
            self._outbox.leave_unknown(self.name, reason, self._now())
        self._tell("news", {})

    def _found(self, now_s: float) -> StreamCondition:
        said, about = self._capture.read(), self._slot.about()
        word = None if said is None else CaptureWord(said["phase"], said["reason"], said["beat_s"])
        picture = None
        if about is not None:
            told = about[1]
            picture = PictureWord(told["arrived_s"], told["changed_s"], self._delay_of(told)[0])
        limits = self._settings.capture.watch
        found = stream_condition(word, picture, now_s, limits, enabled=self._settings.capture.enabled)
        if found.state == "live" and now_s - self._problem_s < limits.lost_after_s:
            return StreamCondition("lost", self._problem)
        self._problem = ""
        return found

    def _delay_of(self, about: dict[str, Any]) -> tuple[float, Delay]:
        """Return how long a picture took from its capture to here, NaN where nobody knows, and who says so."""
        if about["delay_s"] is not None:
            return float(about["delay_s"]), "told"
        if self.measured is not None:
            return self.measured.delay_s, "measured"
        bound_s = self._settings.capture.delay_bound_s
        return (math.nan, "unknown") if bound_s is None else (bound_s, "bound")

    def _frame(self, taken: SlotPicture) -> Frame:
        about = taken.about
        if about["connection"] != self._connection:
            if self._connection:
                self._clock.reconnect()
                if self._monitor is not None:
                    self._monitor.resume()
            self._connection = about["connection"]
        delay_s, self._delay = self._delay_of(about)
        self._captured_s = None if math.isnan(delay_s) else about["arrived_s"] - delay_s
        told_by: ToldBy = about["told_by"]
        unix_s = about["arrived_unix_s"] - (0.0 if math.isnan(delay_s) else delay_s)
        told_unix_s = unix_s if about["told_unix_s"] is None else about["told_unix_s"]
        told_at = datetime.fromtimestamp(told_unix_s, UTC)
        moment = self._clock.at(about["stamp_s"], told_at, told_by, arrived_s=about["arrived_s"])
        return Frame(
            self.name,
            self._frames,
            moment.time_s,
            AvPicture(taken.frame, scaler=self._scaler),
            moment.captured_at,
            moment.told_by,
            telemetry_at(self._telemetry.read(), moment.time_s, about["arrived_s"]),
        )

    def _monitor_for(self, frame: Frame) -> Monitor:
        """Return the monitor; a new one for the first picture, and for pictures of another size."""
        if self._monitor is None or frame.size_px != self._size_px:
            if self._monitor is not None:
                self._lose("the size of the picture changed")
            self._size_px = frame.size_px
            self.session = str(ULID())
            self._monitor = build_monitor(self._settings.settings, CameraPrior.unknown(*frame.size_px), self._detector)
            self._monitor.prepare(frame.size_px)
            self._measured_since_s = None
        return self._monitor

    def _show(self, taken: SlotPicture, now_s: float) -> None:
        """Let the page have the picture that was analysed, with what was seen in it, now and then."""
        if now_s - self._shown_s >= _SHOW_EVERY_S:
            self._shown_s = now_s
            with suppress(OSError):
                self._shown.put(taken.frame, {"arrived_s": taken.about["arrived_s"]})
            self.write_words()

    def _settle(self, result: FrameResult, now_s: float) -> None:
        """Close what an earlier session left open, once this one has measured for a while: it would have been told."""
        if not result.ground:
            self._measured_since_s = None
        elif self._measured_since_s is None:
            self._measured_since_s = now_s
        elif now_s - self._measured_since_s >= _SETTLED_S:
            self._measured_since_s = math.inf
            with suppress(sqlite3.Error):
                self._outbox.close_left(self.name, self.session, _NOT_FOLLOWED, self._now())
            self._tell("news", {})

    def _sighting(self, result: FrameResult, now_s: float) -> Sighting:
        if now_s - self._zones_s >= _ZONES_EVERY_S:
            self._zones_s = now_s
            self._watched_zones = tuple(
                share_watched(name, ground_cells(result.ground, result.watched, self._size_px, grid_m))
                for name, grid_m in self._zones
            )
        return Sighting(
            self.name,
            self.session,
            self._frames,
            result.frame.time_s,
            self._condition.state == "live",
            self._captured_s,
            self._delay,
            now_s,
            result.ground,
            isinstance(result.ground, GroundMap) and result.ground.frame_stated,
            result.watched,
            self._size_px,
            seen_tracks(result),
            self._watched_zones,
            tuple(one.hazard_id for one in result.open_hazards.latest),
        )

    def _publish(self, hazards: Sequence[Hazard]) -> None:
        if hazards:
            self._write_down(self._news_of(hazards), self._captured_s)

    def _write_down(self, news: Sequence[HazardNews | HealthNews], captured_s: float | None = None) -> None:
        """Write news into the outbox; where that cannot be, nobody would be warned: the stream is not live then."""
        try:
            self._outbox.tell(news, self._now(), captured_s)
        except sqlite3.Error as error:
            if not self._problem:
                self._log.critical("nobody is told", error=str(error))
            self._problem, self._problem_s = f"what happens cannot be written down: {error}", time.monotonic()
        else:
            self._tell("news", {})

    def _news_of(self, hazards: Sequence[Hazard]) -> list[HazardNews]:
        frame = None if self._latest is None else self._latest.frame
        known = {} if self._latest is None else self._classes()
        return [
            HazardNews(
                site=self._site,
                stream=self.name,
                session=self.session,
                hazard_id=one.hazard_id,
                phase=one.phase,
                rule=one.rule,
                severity=one.severity,
                track_ids=one.track_ids,
                classes=tuple(known.get(track, "unknown") for track in one.track_ids),
                zone=one.zone,
                distance_m=_number(one.distance_m),
                gap_m=_number(one.gap_m),
                sigma_m=_number(one.sigma_m),
                breach_now=_number(one.breach_now),
                breach_ahead=_number(one.breach_ahead),
                reason=one.reason[:500],
                time_s=one.time_s,
                captured_at=None if frame is None else frame.captured_at,
                delay=self._delay,
            )
            for one in hazards
        ]

    def _classes(self) -> dict[int, str]:
        assert self._latest is not None
        tracks = self._latest.tracks
        return {
            int(track): CLASSES[int(kind)].name for track, kind in zip(tracks.track_id, tracks.class_id, strict=True)
        }

    def _tell_health(self) -> None:
        self._told_condition = self._condition
        at: Moment = self._now()
        since = datetime.fromtimestamp(at.unix_s, UTC)
        state, reason = self._condition
        self._log.info("state", state=state, reason=reason)
        news = HealthNews(self._site, self.name, state, reason[:500], self._clock.now_s(), since)
        self._write_down([news])


def _number(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None


def _open_words(hazard: Hazard) -> dict[str, Any]:
    return {
        "hazard_id": hazard.hazard_id,
        "rule": hazard.rule,
        "severity": hazard.severity,
        "phase": hazard.phase,
        "zone": hazard.zone,
        "track_ids": hazard.track_ids,
        "distance_m": _number(hazard.distance_m),
        "gap_m": _number(hazard.gap_m),
        "sigma_m": _number(hazard.sigma_m),
        "reason": hazard.reason,
    }


def _track_words(result: FrameResult) -> list[dict[str, Any]]:
    tracks = result.tracks
    return [
        {"id": int(one), "class": CLASSES[int(kind)].name, "xyxy_px": [round(float(side), 1) for side in box]}
        for one, kind, box in zip(tracks.track_id, tracks.class_id, tracks.xyxy_px, strict=True)
    ]
