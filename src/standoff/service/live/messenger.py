"""The messenger: one process between the outbox and everybody who is told."""

from __future__ import annotations

import contextlib
import math
import os
import queue
import signal
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any, Final

from standoff.config import SiteSettings, site_origin
from standoff.core.errors import StandoffError
from standoff.core.geographic import GeographicOrigin
from standoff.messages import (
    CONTENT_TYPE,
    Acknowledgement,
    DevicePosition,
    Echo,
    Timing,
    Topics,
    Unreadable,
    event_text,
    read_message,
)
from standoff.service.live.alarms import Alarms
from standoff.service.live.broker import Broker, Confirmed, Connected, Disconnected, LastWill, Received, waiting_in
from standoff.service.live.broker_access import broker_access
from standoff.service.live.drone_word import osd_topic, read_osd
from standoff.service.live.echoes import Echoes
from standoff.service.live.heartbeat import heartbeat_of
from standoff.service.live.home_assistant import discovery
from standoff.service.live.letters import LetterWriter, sent_text
from standoff.service.live.log import log_of
from standoff.service.live.notifier import TOPIC as NOTIFY_TOPIC
from standoff.service.live.notifier import Notifier, notifiers
from standoff.service.live.outbox import Letter, Outbox
from standoff.service.live.recipients import Recipients
from standoff.service.live.service_clock import Moment, ServiceClock
from standoff.service.live.sighting import Sighting
from standoff.service.live.workplace import Workplace

HEARTBEAT_EVERY_S: Final = 1.0
HEARTBEAT_VALID_S: Final = 3.0
_WAIT_S: Final = 0.05
_ROUTE_EVERY_S: Final = 0.5
"""Without a ring: one may get lost."""
_WORDS_EVERY_S: Final = 0.5
_PRUNE_EVERY_S: Final = 3600.0
_MOST_REFUSED_LOGGED: Final = 20
_ON_THE_WAY_S: Final = 0.1
"""What holds for less than this would come when it is true no more."""


class Messenger:
    """Sends what the outbox holds while the broker is there, and heartbeats while frames are watched.

    Args:
        workplace: Where the analysis rings.
        site: The settings.
    """

    def __init__(self, workplace: Workplace, site: SiteSettings) -> None:
        self._workplace, self._site = workplace, site
        self._log = log_of("messenger")
        self._now = ServiceClock.of_machine()
        self._outbox = Outbox(site.live.state)
        self._topics = Topics.of(site.live.broker.prefix, site.live.site)
        self._bell, self._word = workplace.bell("messenger"), workplace.record("messenger")
        self._rung: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._sightings: dict[str, Sighting] = {}
        self._beaten: dict[str, tuple[str, int]] = {}
        self._sequences: dict[str, int] = {}
        self._in_flight: set[str] = set()
        self._echoes = Echoes()
        self._is_connected, self._refused, self._expired = False, 0, 0
        self._is_ended = False
        self._supervised: dict[str, dict[str, Any]] = {}
        self._plan_stamp = workplace.plan_stamp()
        self._told_devices: dict[str, set[str]] = {}
        self._escalated: dict[str, int] = {}
        self._notified: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._notifiers: list[Notifier] = []
        self._recipients = Recipients({}, {}, ())
        self._alarms = Alarms(site.live.alerts)
        self._take(site)
        self._recall_told()
        self._broker = Broker(
            broker_access(site.live.broker),
            f"standoff-service-{site.live.site}",
            self._subscriptions(),
            LastWill(self._topics.service, b"online", b"offline"),
        )

    def run(self) -> None:
        """Go on until the process that started it is gone, or asks for the end."""
        signal.signal(signal.SIGTERM, lambda *_: self._end())
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self._workplace.repeat(self._listen, 0.0)
        routed_s = beaten_s = written_s = 0.0
        pruned_s = -math.inf
        while not self._is_ended:
            is_rung = self._hear()
            now = self._now()
            if is_rung or now.s - routed_s >= _ROUTE_EVERY_S:
                routed_s = now.s
                self._route()
            self._send(self._now())
            if now.s - beaten_s >= HEARTBEAT_EVERY_S:
                beaten_s = now.s
                self._beat(now)
            if now.s - written_s >= _WORDS_EVERY_S:
                written_s = now.s
                self._follow_plan()
                self._write_words(now)
            if now.s - pruned_s >= _PRUNE_EVERY_S:
                pruned_s = now.s
                self._outbox.prune(now)
        self._broker.close()
        for notifier in self._notifiers:
            notifier.close()

    def _end(self) -> None:
        self._is_ended = True

    def _listen(self) -> None:
        words = self._bell.wait(HEARTBEAT_EVERY_S)
        if words is not None:
            self._rung.put(words)

    def _hear(self) -> bool:
        """Take what has come, from the analysis and the broker; return whether there are news to be routed."""
        is_rung = False
        with contextlib.suppress(queue.Empty):
            words = self._rung.get(timeout=_WAIT_S if self._broker.news.empty() else 0.0)
            while True:
                is_rung |= self._take_words(words)
                words = self._rung.get_nowait()
        confirmed = [*waiting_in(self._notified)]
        for news in waiting_in(self._broker.news):
            if isinstance(news, Confirmed):
                confirmed.append(news.token)
            else:
                self._take_broker_news(news)
        self._outbox.delivered(confirmed, self._now())
        self._in_flight.difference_update(confirmed)
        return is_rung

    def _take_words(self, words: dict[str, Any]) -> bool:
        if words["about"] == "sighting":
            sighting = Sighting.read(words)
            self._sightings[sighting.stream] = sighting
            self._recipients.take_sighting(sighting)
        return bool(words["about"] == "news")

    def _take_broker_news(self, news: object) -> None:
        if isinstance(news, Connected):
            self._is_connected = True
            self._in_flight.clear()
            # A broker that began anew has forgotten what it had kept.
            self._send_now(self._health_letters())
            if self._site.live.broker.home_assistant:
                for topic, payload in discovery(self._site, self._topics):
                    self._broker.send(topic, payload, retained=True)
        elif isinstance(news, Disconnected):
            if self._is_connected:
                self._log.warning("the broker is away", reason=news.reason)
            self._is_connected = False
            self._in_flight.clear()
        elif isinstance(news, Received):
            self._take_message(news)

    def _take_message(self, message: Received) -> None:
        """Take what a device or a drone says; what cannot be read is counted, and said a few times."""
        try:
            for stream, settings in self._site.streams.items():
                serial = settings.capture.dji_serial
                if serial is not None and message.topic == osd_topic(serial):
                    word = {"readings": read_osd(message.payload), "at_s": message.at_s}
                    self._workplace.telemetry_record(stream).write(word)
                    return
            found = self._topics.device_of(message.topic)
            if found is None or found[0] not in self._recipients.devices:
                raise Unreadable("no device of this site")
            self._take_device(*found, message)
        except Unreadable as error:
            self._refused += 1
            if self._refused <= _MOST_REFUSED_LOGGED:
                self._log.warning("message refused", topic=message.topic[:200], reason=str(error))

    def _take_device(self, device: str, part: str, message: Received) -> None:
        if part == "position":
            position = read_message(message.payload, DevicePosition)
            self._recipients.take_position(device, position, message.at_s)
        elif part == "ack":
            said = read_message(message.payload, Acknowledgement)
            self._outbox.acknowledge(said.hazard_id, device, self._now())
            self._log.info("acknowledged", device=device, hazard=said.hazard_id)
        elif part == "echo":
            self._echoes.take(read_message(message.payload, Echo), message.at_s)
        else:
            raise Unreadable("no topic of a device")

    def _route(self) -> None:
        """Write the letters of all news that have none yet."""
        now = self._now()
        self._recipients.match(now.s)
        shelves = self._outbox.shelves(now)
        writer = LetterWriter(self._site.live, self._topics, self._recipients, self._alarms)
        for news in self._outbox.unrouted():
            told = news.told
            hazard_id = getattr(told, "hazard_id", "")
            if not hazard_id:
                reason = "" if told.state == "live" else told.reason or told.state  # type: ignore[union-attr]
                self._recipients.take_condition(told.stream, reason)
            before = self._told_devices.get(hazard_id, set())
            letters = writer.letters(news, before, shelves)
            # The news are on disk, and their letters have the same ids however often they are written: whoever is
            # killed between the next two lines sends them again, and receivers drop what they know.
            self._send_now(letters)
            self._outbox.route(news.id, letters)
            if hazard_id:
                self._note_told(hazard_id, letters, is_over=told.phase == "closed")  # type: ignore[union-attr]
        due = self._alarms.due(self._outbox.open_hazards(), self._outbox.acknowledged(), shelves, now)
        for row, step, device in due:
            if step < self._escalated.get(row.latest.hazard_id, 0):
                continue
            self._escalated[row.latest.hazard_id] = step + 1
            letter = writer.escalation(row, step, device, now)
            self._send_now([letter])
            self._outbox.route(letter.news_id, [letter])
            self._note_told(row.latest.hazard_id, [letter], is_over=False)

    def _note_told(self, hazard_id: str, letters: list[Letter], *, is_over: bool) -> None:
        if is_over:
            self._told_devices.pop(hazard_id, None)
            self._escalated.pop(hazard_id, None)
            return
        found = (self._topics.device_of(letter.topic) for letter in letters)
        self._told_devices.setdefault(hazard_id, set()).update(one[0] for one in found if one is not None)

    def _health_letters(self) -> list[Letter]:
        """Return the latest state of each stream, to be told again."""
        latest = self._outbox.latest_health()
        writer = LetterWriter(self._site.live, self._topics, self._recipients, self._alarms)
        there = [news for news in latest if news.told.stream in self._site.streams]
        return [letter for news in there for letter in writer.letters(news, (), ())]

    def _recall_told(self) -> None:
        """Find out whom an earlier messenger has told of what is still open."""
        for hazard_id, topics in self._outbox.devices_told(f"{self._topics.prefix}/device/").items():
            found = (self._topics.device_of(topic) for topic in topics)
            self._told_devices[hazard_id] = {one[0] for one in found if one is not None}

    def _send(self, now: Moment) -> None:
        """Send what waits and is true; what is true no more dies here."""
        waiting = [letter for letter in self._outbox.waiting() if letter.id not in self._in_flight]
        dead = [letter.id for letter in waiting if letter.remaining_s(now) <= _ON_THE_WAY_S]
        if dead:
            self._outbox.expired(dead, now)
            self._expired += len(dead)
            self._log.warning("not delivered in time", letters=len(dead), first=dead[0])
        gone = set(dead)
        for letter in waiting:
            if letter.id in gone:
                continue
            if letter.topic.startswith(NOTIFY_TOPIC):
                self._notify(letter, now)
            elif self._is_connected:
                self._send_letter(letter, now)

    def _send_now(self, letters: list[Letter]) -> None:
        """Send letters that are not in the outbox yet, alerts first; what the broker does not take waits there."""
        if not self._is_connected:
            return
        now = self._now()
        for letter in sorted(letters, key=lambda one: "/alert" not in one.topic):
            if not letter.topic.startswith(NOTIFY_TOPIC) and letter.remaining_s(now) > _ON_THE_WAY_S:
                self._send_letter(letter, now)

    def _send_letter(self, letter: Letter, now: Moment) -> None:
        payload, timing = sent_text(letter, now)
        expiry_s = None if math.isinf(letter.valid_s) else timing.remaining_ms / 1e3
        is_taken = self._broker.send(
            letter.topic,
            payload,
            token=letter.id,
            retained=letter.retained,
            expiry_s=expiry_s,
            content_type=CONTENT_TYPE,
        )
        if is_taken:
            self._in_flight.add(letter.id)
            self._echoes.expect(letter.id, letter.captured_s, now.s)

    def _notify(self, letter: Letter, now: Moment) -> None:
        number = int(letter.topic.removeprefix(NOTIFY_TOPIC))
        if number < len(self._notifiers):
            payload, _ = sent_text(letter, now)
            self._notifiers[number].send(letter.id, f"standoff: {self._site.live.site}", payload.decode())

    def _beat(self, now: Moment) -> None:
        """Tell what the newest frames have shown: no new frame, no heartbeat."""
        for stream, sighting in self._sightings.items():
            frame = (sighting.session, sighting.frame)
            if self._beaten.get(stream) == frame or not sighting.is_live:
                continue
            self._beaten[stream] = frame
            sequence = self._sequences[stream] = self._sequences.get(stream, -1) + 1
            beat = heartbeat_of(sighting, self._site.live.site, sequence)
            self._send_beat(beat, self._topics.heartbeat(stream), f"{stream}-{sequence}", stream, sighting, now)
        self._recipients.match(now.s)
        for device in self._recipients.devices:
            sequence = self._sequences[f"/{device}"] = self._sequences.get(f"/{device}", -1) + 1
            told = self._recipients.supervision(device, sequence, now.s)
            self._supervised[device] = {"supervised": told.supervised, "reason": told.reason, "streams": told.streams}
            topic = self._topics.device(device).supervision
            self._send_beat(told, topic, f"{device}-{sequence}", device, None, now)

    def _send_beat(
        self, told: object, topic: str, beat_id: str, subject: str, sighting: Sighting | None, now: Moment
    ) -> None:
        captured_s = None if sighting is None else sighting.captured_s
        age_ms = None if captured_s is None else round((now.s - captured_s) * 1e3, 1)
        timing = Timing(now.clock, round(now.s * 1e3, 1), HEARTBEAT_VALID_S * 1e3, age_ms)
        text = event_text(
            told,
            event_id=f"{now.clock}-{os.getpid()}-{beat_id}",
            source=f"standoff/{self._site.live.site}",
            subject=subject,
            at=datetime.fromtimestamp(now.unix_s, UTC),
            timing=timing,
        )
        if self._is_connected:
            self._broker.send(topic, text.encode(), expiry_s=HEARTBEAT_VALID_S, content_type=CONTENT_TYPE, qos=0)

    def _follow_plan(self) -> None:
        stamp = self._workplace.plan_stamp()
        if stamp != self._plan_stamp:
            self._plan_stamp = stamp
            self._take(self._workplace.plan())

    def _take(self, site: SiteSettings) -> None:
        """Take settings; the broker's hold until the service begins anew."""
        before, self._site = self._site, site
        recipients = Recipients(site.live.receivers, self._origins(site), tuple(site.streams))
        recipients.inherit(self._recipients)
        self._recipients = recipients
        self._sightings = {name: one for name, one in self._sightings.items() if name in site.streams}
        self._supervised = {name: one for name, one in self._supervised.items() if name in site.live.receivers}
        self._alarms.settings = site.live.alerts
        if not self._notifiers or before.live.notify != site.live.notify:
            for notifier in self._notifiers:
                notifier.close()
            self._notifiers = notifiers(site.live.notify, self._notified)

    def _origins(self, site: SiteSettings) -> dict[str, GeographicOrigin | None]:
        found: dict[str, GeographicOrigin | None] = {}
        for name, stream in site.streams.items():
            try:
                found[name] = site_origin(stream.settings)
            except StandoffError as error:
                self._log.error("no place on the earth", stream=name, error=str(error))
                found[name] = None
        return found

    def _subscriptions(self) -> list[str]:
        parts = (
            self._topics.device("+").position,
            self._topics.device("+").acknowledgement,
            self._topics.device("+").echo,
        )
        serials = [one.capture.dji_serial for one in self._site.streams.values()]
        return [*parts, *(osd_topic(serial) for serial in serials if serial is not None)]

    def _write_words(self, now: Moment) -> None:
        self._word.write(
            {
                "beat_s": now.s,
                "pid": os.getpid(),
                "is_connected": self._is_connected,
                "letters": self._outbox.counts(),
                "expired": self._expired,
                "refused": self._refused,
                "to_wrist_ms": self._echoes.to_wrist_ms.summary(),
                "sent_to_shown_ms": self._echoes.to_device_ms.summary(),
                "devices": self._supervised,
                "shelves": [asdict(one) for one in self._outbox.shelves(now)],
                "notify_failures": sum(one.failures for one in self._notifiers),
            }
        )


def run(workplace: Workplace) -> None:
    """Tell people what happens on a site until the process that started this one is gone."""
    Messenger(workplace, workplace.plan()).run()
