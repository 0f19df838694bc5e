"""From what happened to the messages that tell it: to whom, how loud, and for how long they hold."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Final

from standoff.config import LiveSettings
from standoff.core.hazards import GRAVENESS
from standoff.messages import Alert, HazardNews, HealthNews, Timing, Topics, event_text
from standoff.messages.envelope import with_timing
from standoff.messages.events import Because
from standoff.service.live.alarms import Alarms, shelved_by
from standoff.service.live.notifier import TOPIC as NOTIFY_TOPIC
from standoff.service.live.outbox import Letter, News, OpenHazardRow, Shelf
from standoff.service.live.recipients import Recipients
from standoff.service.live.service_clock import Moment

_ENDING_VALID_S: Final = 60.0
"""That something is over may be told later than that it began: nobody is hurt by it."""
_NOTIFY_VALID_S: Final = 60.0


@dataclass
class LetterWriter:
    """Writes the letters of news.

    Attributes:
        live: The settings of the site.
        topics: Of the site.
        recipients: Who is told.
        alarms: What each device has told already.
    """

    live: LiveSettings
    topics: Topics
    recipients: Recipients
    alarms: Alarms

    def letters(self, news: News, told_before: Collection[str], shelves: Sequence[Shelf]) -> list[Letter]:
        """Return all messages that tell some news.

        Args:
            news: What happened.
            told_before: Devices that were told of the same hazard before: they hear its end, too.
            shelves: What is set aside.
        """
        if isinstance(news.told, HealthNews):
            return [self._letter(news, "", self.topics.health(news.told.stream), news.told, math.inf, retained=True)]
        hazard = replace(news.told, shelved_by=shelved_by(news.told, shelves))
        is_ending = hazard.phase in ("closed", "unknown")
        valid_s = _ENDING_VALID_S if is_ending else self.live.alerts.valid_s
        found = [self._letter(news, "", self.topics.hazard(hazard.stream), hazard, valid_s)]
        if hazard.zone:
            found.append(self._letter(news, "/zone", self.topics.zone(hazard.zone), hazard, valid_s))
        if not hazard.shelved_by and hazard.delay != "unknown":
            found += self._alerts(news, hazard, told_before, valid_s)
            found += self._notices(news, hazard)
        elif is_ending:
            found += [self._alert(news, hazard, device, "stream", valid_s) for device in sorted(told_before)]
        return found

    def _alerts(self, news: News, hazard: HazardNews, told_before: Collection[str], valid_s: float) -> Iterator[Letter]:
        told = {one.device: one.because for one in self.recipients.told_of(hazard)}
        # Whoever was told that it began is told how it went on, wherever he is now.
        for device in sorted(set(told_before) - told.keys()):
            told[device] = "stream"
        for device, because in told.items():
            yield self._alert(news, hazard, device, because, valid_s)

    def _alert(self, news: News, hazard: HazardNews, device: str, because: Because, valid_s: float) -> Letter:
        silent = self.alarms.is_silent(device, hazard, news.at.s)
        topic = self.topics.device(device).alert
        return self._letter(news, f"/{device}", topic, Alert(device, hazard, because, silent), valid_s)

    def _notices(self, news: News, hazard: HazardNews) -> Iterator[Letter]:
        """Yield what messengers and web services are told: each level of a hazard once."""
        if hazard.phase not in ("opened", "updated"):
            return
        for number, one in enumerate(self.live.notify):
            levels = [level for level in GRAVENESS if level in one.severities]
            if hazard.severity in levels:
                letter_id = f"{hazard.hazard_id}/{hazard.severity}/notify-{number}"
                yield replace(self._letter(news, "", f"{NOTIFY_TOPIC}{number}", hazard, _NOTIFY_VALID_S), id=letter_id)

    def escalation(self, row: OpenHazardRow, step: int, device: str, now: Moment) -> Letter:
        """Return what goes to the next in line."""
        alert = Alert(device, row.latest, "escalation", silent=False)
        news = News(f"{row.latest.hazard_id}/escalated-{step}", row.latest, None, now)
        return self._letter(news, f"/{device}", self.topics.device(device).alert, alert, self.live.alerts.valid_s)

    def _letter(
        self, news: News, ending: str, topic: str, told: object, valid_s: float, *, retained: bool = False
    ) -> Letter:
        of = news.told
        subject = of.hazard_id if isinstance(of, HazardNews) else of.stream
        letter_id = f"{news.id}{ending}"
        body = event_text(
            told,
            event_id=letter_id,
            source=f"standoff/{of.site}/stream/{of.stream}",
            subject=subject,
            at=datetime.fromtimestamp(news.at.unix_s, UTC),
        )
        return Letter(letter_id, news.id, topic, body, valid_s, retained, news.captured_s, news.at)


def sent_text(letter: Letter, now: Moment) -> tuple[bytes, Timing]:
    """Return a letter as it is sent at a moment, and its timing: what is left of it is computed now, never before."""
    remaining_s = letter.remaining_s(now)
    age_ms = None
    if letter.captured_s is not None and letter.at.clock == now.clock:
        age_ms = (now.s - letter.captured_s) * 1e3
    remaining_ms = remaining_s * 1e3 if math.isfinite(remaining_s) else 1e12
    timing = Timing(now.clock, round(now.s * 1e3, 1), round(remaining_ms, 1), age_ms and round(age_ms, 1))
    event = with_timing(json.loads(letter.body), timing)
    return json.dumps(event, ensure_ascii=False, separators=(",", ":")).encode(), timing
