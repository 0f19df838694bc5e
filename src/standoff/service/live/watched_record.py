"""Which share of a shift was watched: by stream, place and reason, a file for each day."""

from __future__ import annotations

import contextlib
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any, Final
from zoneinfo import ZoneInfo

from standoff.config import ShiftSettings
from standoff.core.errors import DataError, StandoffError
from standoff.core.types import WatchedGround
from standoff.files.json_text import read_json, write_json
from standoff.files.whole import make_folder
from standoff.messages import WatchedZone
from standoff.service.live.service_clock import Moment, Now

PICTURE: Final = "the ground in the picture"
"""The place of a stream that is no zone."""
_WRITE_EVERY_S: Final = 10.0
_LONGEST_STEP_S: Final = 5.0
"""Longer, and nobody was there to look."""
_LEAST_STEP_S: Final = 1e-3
_LEAST_GAP_S: Final = 1.0
_NOT_RUNNING: Final = "the service was not running"
_NOT_BEGUN: Final = "nobody watched it yet"
_NOT_JUDGED: Final = "nobody has judged it yet"
_SLEPT: Final = "the service was held up"
_LIVE: Final = ("live", "late")
_MOST_GAPS: Final = 2000


@dataclass
class PlaceRecord:
    """One place of one stream in one shift.

    Attributes:
        watched_s: Seconds, each counted by the share of the place that was watched.
        unwatched_s: The rest, by reason.
    """

    watched_s: float = 0.0
    unwatched_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def words(self, shift_s: float) -> dict[str, Any]:
        """Return it for the file."""
        by_reason = sorted(self.unwatched_s.items(), key=lambda item: -item[1])
        return {
            "watched_share": round(self.watched_s / shift_s, 4) if shift_s > 0 else None,
            "watched_s": round(self.watched_s, 1),
            "unwatched_s": {reason: round(seconds, 1) for reason, seconds in by_reason},
        }


@dataclass
class StreamRecord:
    """One stream in one shift.

    Attributes:
        states_s: Seconds in each state.
        places: By name.
        gaps: When it was not live.
        until_unix_s: Up to when it is counted.
    """

    states_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    places: dict[str, PlaceRecord] = field(default_factory=dict)
    gaps: list[dict[str, Any]] = field(default_factory=list)
    until_unix_s: float = 0.0


class WatchedRecord:
    """Counts, and writes the record of the day every few seconds; goes on with it after a restart.

    Args:
        folder: Of the service's state.
        site: Name of the site.
        shift: When people work.
        now: The clock.
    """

    def __init__(self, folder: Path, site: str, shift: ShiftSettings, now: Now) -> None:
        self._folder, self._site, self._shift, self._now = folder / "days", site, shift, now
        make_folder(self._folder)
        self._streams: dict[str, StreamRecord] = {}
        self._shares: dict[str, dict[str, tuple[float, Mapping[str, float]]]] = {}
        self._last: dict[str, Moment] = {}
        self._written_s = now().s
        self._span = shift_at(shift, now().unix_s)
        self._read()

    def note_ground(self, stream: str, watched: WatchedGround, zones: Sequence[WatchedZone]) -> None:
        """Take which ground a stream's newest frame shows as watched."""
        shares: dict[str, tuple[float, Mapping[str, float]]] = {}
        if watched.judged:
            shares[PICTURE] = (watched.share, watched.unwatched)
        for zone in zones:
            rest = {zone.reason: 1.0 - zone.share} if zone.share < 1.0 else {}
            shares[zone.name] = (zone.share, rest)
        self._shares[stream] = shares

    def note_state(self, stream: str, state: str, reason: str) -> None:
        """Take how a stream is now: so it was since it was asked last."""
        now = self._now()
        before = self._last.get(stream)
        self._last[stream] = now
        span = shift_at(self._shift, now.unix_s)
        if span != self._span:
            self.write()
            self._streams, self._span = {}, span
        if span is None:
            return
        if before is None:
            reason_before = _NOT_RUNNING if stream in self._streams else _NOT_BEGUN
            record = self._streams.setdefault(stream, StreamRecord(until_unix_s=span.begin_unix_s))
            _note_absence(record, now.unix_s, reason_before)
            return
        passed_s = min(now.since(before), now.unix_s - span.begin_unix_s)
        if passed_s <= 0.0:
            return
        record = self._streams.setdefault(stream, StreamRecord())
        record.until_unix_s = now.unix_s
        if passed_s > _LONGEST_STEP_S:
            state, reason = "lost", _SLEPT
        record.states_s[state] += passed_s
        self._count(stream, record, state, reason, passed_s)
        _note_gap(record, now.unix_s - passed_s, now.unix_s, state, reason)
        if now.s - self._written_s >= _WRITE_EVERY_S:
            self.write()

    def _count(self, stream: str, record: StreamRecord, state: str, reason: str, passed_s: float) -> None:
        shares = self._shares.get(stream, {})
        for place in {PICTURE, *shares, *record.places}:
            is_new, counted = place not in record.places, record.places.setdefault(place, PlaceRecord())
            if is_new and (before_s := sum(record.states_s.values()) - passed_s) > _LEAST_STEP_S:
                counted.unwatched_s[_NOT_JUDGED] += before_s
            if state not in _LIVE:
                counted.unwatched_s[reason or state] += passed_s
            elif place not in shares:
                counted.unwatched_s[_NOT_JUDGED] += passed_s
            else:
                share, unwatched = shares[place]
                counted.watched_s += share * passed_s
                for why, part in unwatched.items():
                    counted.unwatched_s[why] += part * passed_s

    def words(self) -> dict[str, Any] | None:
        """Return the record of this shift so far; None outside of shifts."""
        if self._span is None:
            return None
        shift_s = max(0.0, min(self._now().unix_s, self._span.end_unix_s) - self._span.begin_unix_s)
        return {
            "site": self._site,
            "day": self._span.day.isoformat(),
            "shift": {"begin": self._shift.begin, "end": self._shift.end, "timezone": self._shift.timezone},
            "passed_s": round(shift_s, 1),
            "streams": {
                name: {
                    "states_s": {state: round(seconds, 1) for state, seconds in record.states_s.items()},
                    "places": {place: one.words(shift_s) for place, one in record.places.items()},
                    "gaps": record.gaps,
                    "until": _utc(record.until_unix_s),
                }
                for name, record in self._streams.items()
            },
        }

    def write(self) -> None:
        """Write the record of the day; where there is no room, later."""
        self._written_s = self._now().s
        words = self.words()
        if words is not None:
            with contextlib.suppress(StandoffError):
                write_json(self._folder / f"{words['day']}.json", words)

    def _read(self) -> None:
        """Go on with the record of the day; what passed since it was written nobody has watched."""
        if self._span is None:
            return
        path = self._folder / f"{self._span.day.isoformat()}.json"
        if not path.is_file():
            return
        try:
            told = read_json(path, "the record of a day", DataError)
            self._streams = {name: _stream_record(one) for name, one in told["streams"].items()}
        except (StandoffError, KeyError, TypeError, ValueError, AttributeError, OverflowError):
            # Kept under another name: somebody may want to know what it was.
            path.replace(path.with_suffix(".unreadable"))
            return
        for record in self._streams.values():
            record.until_unix_s = max(record.until_unix_s, self._span.begin_unix_s)
            _note_absence(record, self._now().unix_s, _NOT_RUNNING)


@dataclass(frozen=True, slots=True)
class ShiftSpan:
    """One shift.

    Attributes:
        day: On which it begins, local.
        begin_unix_s: Since 1970.
        end_unix_s: Since 1970.
    """

    day: date
    begin_unix_s: float
    end_unix_s: float


def shift_at(shift: ShiftSettings, unix_s: float) -> ShiftSpan | None:
    """Return the shift of a moment, one that began the evening before perhaps; None between shifts.

    >>> early = ShiftSettings(begin="22:00", end="06:00")
    >>> shift_at(early, 3 * 3600.0).day.isoformat()
    '1969-12-31'
    """
    zone = ZoneInfo(shift.timezone)
    today = datetime.fromtimestamp(unix_s, zone).date()
    for day in (today, today - timedelta(days=1)):
        begin = _at(day, shift.begin, zone)
        end = _at(day if shift.end > shift.begin else day + timedelta(days=1), shift.end, zone)
        if begin <= unix_s < end:
            return ShiftSpan(day, begin, end)
    return None


def _at(day: date, clock: str, zone: ZoneInfo) -> float:
    hours, minutes = map(int, clock.split(":"))
    whole = datetime.combine(day + timedelta(days=hours // 24), datetime.min.time(), zone)
    return whole.replace(hour=hours % 24, minute=minutes).timestamp()


def _note_gap(record: StreamRecord, begin_unix_s: float, end_unix_s: float, state: str, reason: str) -> None:
    """Lengthen the last gap, or begin one; one that stayed shorter than a second is forgotten."""
    if state in _LIVE or len(record.gaps) >= _MOST_GAPS:
        return
    last = record.gaps[-1] if record.gaps else None
    if last is not None and abs(last["end_unix_s"] - begin_unix_s) < _LEAST_GAP_S:
        last.update(end_unix_s=end_unix_s, end=_utc(end_unix_s))
        if last["reasons"][-1] != reason and len(last["reasons"]) < 10:
            last["reasons"].append(reason)
        return
    if last is not None and last["end_unix_s"] - last["begin_unix_s"] < _LEAST_GAP_S:
        record.gaps.pop()
    gap = {"begin": _utc(begin_unix_s), "end": _utc(end_unix_s), "reasons": [reason]}
    record.gaps.append({**gap, "begin_unix_s": begin_unix_s, "end_unix_s": end_unix_s})


def _note_absence(record: StreamRecord, until_unix_s: float, reason: str) -> None:
    """Count what passed since a stream was counted last as time in which nobody watched it."""
    passed_s = until_unix_s - record.until_unix_s
    if passed_s <= 0.0:
        return
    for place in {PICTURE, *record.places}:
        record.places.setdefault(place, PlaceRecord()).unwatched_s[reason] += passed_s
    record.states_s["lost"] += passed_s
    _note_gap(record, record.until_unix_s, until_unix_s, "lost", reason)
    record.until_unix_s = until_unix_s


def _stream_record(told: Mapping[str, Any]) -> StreamRecord:
    until = datetime.fromisoformat(told["until"]).timestamp()
    record = StreamRecord(until_unix_s=until, gaps=[_gap(one) for one in told["gaps"]])
    record.states_s.update({str(name): _seconds(seconds) for name, seconds in told["states_s"].items()})
    for name, one in told["places"].items():
        place = record.places.setdefault(name, PlaceRecord(_seconds(one["watched_s"])))
        place.unwatched_s.update({str(reason): _seconds(seconds) for reason, seconds in one["unwatched_s"].items()})
    return record


def _gap(told: Mapping[str, Any]) -> dict[str, Any]:
    reasons = [str(one) for one in told["reasons"]]
    if not reasons:
        raise ValueError("a gap without a reason")
    begin, end = _seconds(told["begin_unix_s"]), _seconds(told["end_unix_s"])
    return {"begin": _utc(begin), "end": _utc(end), "reasons": reasons, "begin_unix_s": begin, "end_unix_s": end}


def _seconds(told: object) -> float:
    if isinstance(told, bool) or not isinstance(told, (int, float)) or not math.isfinite(told):
        raise ValueError("a number that is none")
    return float(told)


def _utc(unix_s: float) -> str:
    return datetime.fromtimestamp(unix_s, UTC).isoformat(timespec="seconds")
