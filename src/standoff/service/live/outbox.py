"""What is to be told, on disk: written before it is sent, kept until it is confirmed or true no more."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from ulid import ULID

from standoff.core.errors import OutputError
from standoff.messages import HazardNews, HealthNews, read_message
from standoff.service.live.service_clock import Moment

_SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS news (
  number INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT UNIQUE NOT NULL, kind TEXT NOT NULL, stream TEXT NOT NULL,
  body TEXT NOT NULL, captured_s REAL, clock TEXT NOT NULL, at_s REAL NOT NULL, at_unix_s REAL NOT NULL,
  routed INTEGER NOT NULL DEFAULT 0);
CREATE INDEX IF NOT EXISTS news_unrouted ON news (number) WHERE routed = 0;
CREATE TABLE IF NOT EXISTS letter (
  number INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT UNIQUE NOT NULL, news_id TEXT NOT NULL, topic TEXT NOT NULL,
  body TEXT NOT NULL, valid_s REAL NOT NULL, retained INTEGER NOT NULL, captured_s REAL, clock TEXT NOT NULL,
  at_s REAL NOT NULL, at_unix_s REAL NOT NULL, state TEXT NOT NULL DEFAULT 'waiting', ended_unix_s REAL);
CREATE INDEX IF NOT EXISTS letter_waiting ON letter (number) WHERE state = 'waiting';
CREATE TABLE IF NOT EXISTS open_hazard (
  hazard_id TEXT PRIMARY KEY, stream TEXT NOT NULL, body TEXT NOT NULL, opened_clock TEXT NOT NULL,
  opened_s REAL NOT NULL, opened_unix_s REAL NOT NULL);
CREATE TABLE IF NOT EXISTS acknowledgement (
  hazard_id TEXT NOT NULL, device TEXT NOT NULL, at_unix_s REAL NOT NULL, PRIMARY KEY (hazard_id, device));
CREATE TABLE IF NOT EXISTS shelf (
  id TEXT PRIMARY KEY, stream TEXT NOT NULL, zone TEXT NOT NULL, hazard_id TEXT NOT NULL, author TEXT NOT NULL,
  reason TEXT NOT NULL, until_unix_s REAL NOT NULL, taken_back INTEGER NOT NULL DEFAULT 0);
"""
_KEPT_DAYS: Final = 30
_BUSY_MS: Final = 5000
_DAY_S: Final = 86_400.0
_LONGEST_REASON: Final = 500


@dataclass(frozen=True, slots=True)
class News:
    """Something that happened.

    Attributes:
        id: Its own.
        told: What.
        captured_s: When the picture was taken that it rests on, monotonic; None: unknown.
        at: When it was written.
    """

    id: str
    told: HazardNews | HealthNews
    captured_s: float | None
    at: Moment


@dataclass(frozen=True, slots=True)
class Letter:
    """A message to be sent.

    Attributes:
        id: The same whenever it is sent again: receivers drop what they know.
        news_id: Of the news that it tells.
        topic: Where to.
        body: A CloudEvent, without the moment of its sending.
        valid_s: For how long it holds from `at` on; inf: until something newer comes.
        retained: Whether the broker keeps it for who comes later.
        captured_s: As of its news.
        at: When its news was written.
    """

    id: str
    news_id: str
    topic: str
    body: str
    valid_s: float
    retained: bool
    captured_s: float | None
    at: Moment

    def remaining_s(self, now: Moment) -> float:
        """Return for how much longer it holds; negative: not any more.

        What was written before the machine started anew counts by the wall clock; where that has been set back, it is
        taken for old.
        """
        passed_s = now.since(self.at)
        return self.valid_s - passed_s if passed_s >= 0.0 else -1.0


@dataclass(frozen=True, slots=True)
class OpenHazardRow:
    """A hazard that is open.

    Attributes:
        latest: The latest that was said of it.
        opened: When it opened.
    """

    latest: HazardNews
    opened: Moment


@dataclass(frozen=True, slots=True)
class Shelf:
    """An alarm that somebody has set aside for a while.

    Attributes:
        id: Its own.
        stream: Of these hazards; empty: of any stream.
        zone: Of this zone; empty: of any rule.
        hazard_id: This hazard only; empty: all.
        author: Who has.
        reason: Why.
        until_unix_s: Until when, seconds since 1970.
    """

    id: str
    stream: str
    zone: str
    hazard_id: str
    author: str
    reason: str
    until_unix_s: float

    def holds(self, hazard: HazardNews) -> bool:
        """Return whether a hazard is meant."""
        return (
            self.stream in ("", hazard.stream)
            and self.zone in ("", hazard.zone)
            and self.hazard_id in ("", hazard.hazard_id)
        )


class Outbox:
    """The database that analysis and messenger share; each commit is on disk before the call returns.

    Args:
        folder: Of the service's state.

    Raises:
        OutputError: It cannot be used.
    """

    def __init__(self, folder: Path) -> None:
        path = folder / "outbox.sqlite"
        try:
            self._db = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=_BUSY_MS / 1e3)
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = FULL")
            with self._writing():
                for statement in filter(str.strip, _SCHEMA.split(";")):
                    self._db.execute(statement)
        except sqlite3.Error as error:
            raise OutputError(
                expected=f"a database that can be written in {path}",
                found=str(error),
                fix="make room and give write permission, or move the file away if it is damaged",
            ) from error

    @contextmanager
    def _writing(self) -> Generator[None, None, None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    def tell(
        self, told: Sequence[HazardNews | HealthNews], at: Moment, captured_s: float | None = None
    ) -> tuple[str, ...]:
        """Write down what happened in one moment; return the ids of the news.

        Args:
            told: What; hazards are open until one says "closed".
            at: The moment.
            captured_s: As in `News`.
        """
        ids = tuple(str(ULID()) for _ in told)
        with self._writing():
            for news_id, one in zip(ids, map(_readable, told), strict=True):
                kind = "hazard" if isinstance(one, HazardNews) else "health"
                self._db.execute(
                    "INSERT INTO news (id, kind, stream, body, captured_s, clock, at_s, at_unix_s)"
                    " VALUES (?,?,?,?,?,?,?,?)",
                    (news_id, kind, one.stream, _text(one), captured_s, *at),
                )
                if isinstance(one, HazardNews):
                    self._note_open(one, at)
        return ids

    def _note_open(self, hazard: HazardNews, at: Moment) -> None:
        if hazard.phase == "closed":
            self._db.execute("DELETE FROM open_hazard WHERE hazard_id = ?", (hazard.hazard_id,))
            return
        self._db.execute(
            "INSERT INTO open_hazard (hazard_id, stream, body, opened_clock, opened_s, opened_unix_s)"
            " VALUES (?,?,?,?,?,?)"
            " ON CONFLICT (hazard_id) DO UPDATE SET body = excluded.body",
            (hazard.hazard_id, hazard.stream, _text(hazard), *at),
        )

    def latest_health(self) -> list[News]:
        """Return the latest news of the state of each stream, of which letters are written already."""
        rows = self._db.execute(
            "SELECT id, kind, body, captured_s, clock, at_s, at_unix_s FROM news WHERE number IN"
            " (SELECT max(number) FROM news WHERE kind = 'health' AND routed = 1 GROUP BY stream)"
        )
        return [News(row[0], _told(row[1], row[2]), row[3], Moment(*row[4:])) for row in rows]

    def unrouted(self, most: int = 200) -> list[News]:
        """Return the oldest news for which nobody has written letters yet."""
        rows = self._db.execute(
            "SELECT id, kind, body, captured_s, clock, at_s, at_unix_s FROM news WHERE routed = 0"
            " ORDER BY number LIMIT ?",
            (most,),
        )
        return [News(row[0], _told(row[1], row[2]), row[3], Moment(*row[4:])) for row in rows]

    def route(self, news_id: str, letters: Iterable[Letter]) -> None:
        """Write the letters of some news, all or none; what is retained takes the place of what still waits there."""
        with self._writing():
            for one in letters:
                values = asdict(one)
                at: Sequence[Any] = one.at
                is_new = self._db.execute(
                    "INSERT OR IGNORE INTO letter (id, news_id, topic, body, valid_s, retained, captured_s, clock,"
                    " at_s, at_unix_s) VALUES (?,?,?,?,?,?,?,?,?,?)",
                    (*(values[name] for name in _LETTER_COLUMNS), *at),
                ).rowcount
                if one.retained and is_new:
                    older = "state = 'waiting' AND retained = 1 AND topic = ? AND id != ?"
                    self._end("superseded", older, (one.topic, one.id), one.at)
            self._db.execute("UPDATE news SET routed = 1 WHERE id = ?", (news_id,))

    def waiting(self, most: int = 200) -> list[Letter]:
        """Return the letters that nobody has confirmed yet, oldest first."""
        rows = self._db.execute(
            "SELECT id, news_id, topic, body, valid_s, retained, captured_s, clock, at_s, at_unix_s FROM letter"
            " WHERE state = 'waiting' ORDER BY number LIMIT ?",
            (most,),
        )
        return [
            Letter(news_id=row[1], id=row[0], topic=row[2], body=row[3], valid_s=row[4], retained=bool(row[5]),
                   captured_s=row[6], at=Moment(*row[7:]))
            for row in rows
        ]  # fmt: skip

    def delivered(self, ids: Sequence[str], now: Moment) -> None:
        """Take that the broker has confirmed letters."""
        self._end_all("delivered", ids, now)

    def expired(self, ids: Sequence[str], now: Moment) -> None:
        """Take that letters are not true any more: they are never sent, and the record says so."""
        self._end_all("expired", ids, now)

    def _end_all(self, state: str, ids: Sequence[str], now: Moment) -> None:
        if ids:
            with self._writing():
                for one in ids:
                    self._end(state, "id = ? AND state = 'waiting'", (one,), now)

    def _end(self, state: str, where: str, values: tuple[Any, ...], now: Moment) -> None:
        # `where` is one of our own texts above, never anybody's words.
        self._db.execute(f"UPDATE letter SET state = ?, ended_unix_s = ? WHERE {where}", (state, now.unix_s, *values))

    def counts(self) -> dict[str, int]:
        """Return how many letters there are, by state."""
        return dict(self._db.execute("SELECT state, count(*) FROM letter GROUP BY state").fetchall())

    def open_hazards(self, stream: str | None = None) -> list[OpenHazardRow]:
        """Return the hazards that are open, of one stream or of all, oldest first."""
        rows = self._db.execute(
            "SELECT body, opened_clock, opened_s, opened_unix_s FROM open_hazard WHERE ? IS NULL OR stream = ?"
            " ORDER BY opened_unix_s",
            (stream, stream),
        )
        return [OpenHazardRow(_hazard(row[0]), Moment(*row[1:])) for row in rows]

    def leave_unknown(self, stream: str, reason: str, at: Moment) -> None:
        """Say of all hazards of a stream that are open and measured that nobody knows any more."""
        rows = [one.latest for one in self.open_hazards(stream) if one.latest.phase != "unknown"]
        told = [
            replace(
                one, phase="unknown", reason=reason, distance_m=None, gap_m=None, sigma_m=None, breach_now=None,
                breach_ahead=None,
            )
            for one in rows
        ]  # fmt: skip
        if told:
            self.tell(told, at)

    def close_left(self, stream: str, session: str, reason: str, at: Moment) -> None:
        """Close the hazards of a stream that belong to an earlier session than this one: nobody can follow them."""
        rows = [one.latest for one in self.open_hazards(stream) if one.latest.session != session]
        if rows:
            self.tell([replace(one, phase="closed", reason=reason) for one in rows], at)

    def devices_told(self, topic_start: str) -> dict[str, set[str]]:
        """Return for each hazard that is open to which topics with some beginning it was sent, or is to be.

        Args:
            topic_start: Of the topics.
        """
        rows = self._db.execute(
            "SELECT open_hazard.hazard_id, letter.topic FROM open_hazard"
            " JOIN news ON json_extract(news.body, '$.hazard_id') = open_hazard.hazard_id"
            " JOIN letter ON letter.news_id = news.id WHERE substr(letter.topic, 1, ?) = ?",
            (len(topic_start), topic_start),
        )
        told: dict[str, set[str]] = {}
        for hazard_id, topic in rows:
            told.setdefault(hazard_id, set()).add(topic)
        return told

    def acknowledge(self, hazard_id: str, device: str, now: Moment) -> None:
        """Take that somebody has taken note of a hazard."""
        with self._writing():
            self._db.execute("INSERT OR IGNORE INTO acknowledgement VALUES (?,?,?)", (hazard_id, device, now.unix_s))

    def acknowledged(self) -> frozenset[str]:
        """Return the ids of the hazards of which somebody has taken note."""
        return frozenset(row[0] for row in self._db.execute("SELECT DISTINCT hazard_id FROM acknowledgement"))

    def shelve(self, shelf: Shelf) -> None:
        """Set an alarm aside."""
        with self._writing():
            self._db.execute(
                "INSERT INTO shelf (id, stream, zone, hazard_id, author, reason, until_unix_s) VALUES (?,?,?,?,?,?,?)",
                tuple(asdict(shelf).values()),
            )

    def unshelve(self, shelf_id: str) -> bool:
        """Take back that an alarm is set aside; return whether it was."""
        with self._writing():
            found = self._db.execute(
                "UPDATE shelf SET taken_back = 1 WHERE id = ? AND taken_back = 0", (shelf_id,)
            ).rowcount
        return found > 0

    def shelves(self, now: Moment) -> list[Shelf]:
        """Return what is set aside at this moment."""
        rows = self._db.execute(
            "SELECT id, stream, zone, hazard_id, author, reason, until_unix_s FROM shelf"
            " WHERE taken_back = 0 AND until_unix_s > ? ORDER BY until_unix_s",
            (now.unix_s,),
        )
        return [Shelf(*row) for row in rows]

    def prune(self, now: Moment) -> None:
        """Forget what has ended a month ago."""
        before = now.unix_s - _KEPT_DAYS * _DAY_S
        with self._writing():
            self._db.execute("DELETE FROM letter WHERE state != 'waiting' AND ended_unix_s < ?", (before,))
            self._db.execute("DELETE FROM news WHERE routed = 1 AND at_unix_s < ?", (before,))
            self._db.execute("DELETE FROM acknowledgement WHERE at_unix_s < ?", (before,))
            self._db.execute("DELETE FROM shelf WHERE until_unix_s < ?", (before,))

    def close(self) -> None:
        """Let go of it."""
        self._db.close()


_LETTER_COLUMNS: Final = ("id", "news_id", "topic", "body", "valid_s", "retained", "captured_s")


def _readable(told: HazardNews | HealthNews) -> HazardNews | HealthNews:
    """Return news with a reason that can be read again, whatever somebody's error had to say."""
    return replace(told, reason=told.reason.encode(errors="replace").decode()[:_LONGEST_REASON])


def _text(told: HazardNews | HealthNews) -> str:
    return json.dumps(asdict(told), default=_plain_time)


def _plain_time(value: object) -> str:
    assert isinstance(value, datetime)
    return value.astimezone(UTC).isoformat()


def _told(kind: str, body: str) -> HazardNews | HealthNews:
    return _hazard(body) if kind == "hazard" else read_message(body.encode(), HealthNews)


def _hazard(body: str) -> HazardNews:
    return read_message(body.encode(), HazardNews)
