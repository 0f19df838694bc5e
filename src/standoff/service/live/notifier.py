"""Messengers and web services: told in threads of their own, because any of them may be slow."""

from __future__ import annotations

import hashlib
import hmac
import math
import queue
import threading
import urllib.error
import urllib.request
from collections.abc import Sequence
from typing import Final

from standoff.config import NotifySettings
from standoff.core.lengths import METRES
from standoff.messages import HazardNews, read_event
from standoff.service.live.log import log_of

TOPIC: Final = "notify:"
"""Before the number of the messenger, in place of a topic of the broker."""
_PATIENCE_S: Final = 5.0
_MOST_WAITING: Final = 100
_OK: Final = range(200, 300)


class Notifier:
    """Takes letters for one messenger or web service.

    Args:
        number: Which of the settings.
        settings: Of it.
        done: Hears the ids of letters that were taken over.
    """

    def __init__(self, number: int, settings: NotifySettings, done: queue.SimpleQueue[str]) -> None:
        self._settings, self._done = settings, done
        self._log = log_of("notifier", number=str(number))
        self._waiting: queue.Queue[tuple[str, str, str] | None] = queue.Queue(_MOST_WAITING)
        self._taken: set[str] = set()
        self.failures = 0
        self._thread = threading.Thread(target=self._work, name=f"notifier {number}", daemon=True)
        self._thread.start()

    def send(self, letter_id: str, title: str, body: str) -> None:
        """Send a letter, unless it is on its way; where too many wait it is tried again later."""
        if letter_id in self._taken:
            return
        try:
            self._waiting.put_nowait((letter_id, title, body))
        except queue.Full:
            return
        self._taken.add(letter_id)

    def close(self) -> None:
        """End, once what is on its way has arrived or failed."""
        self._waiting.put(None)
        self._thread.join(_PATIENCE_S)

    def _work(self) -> None:
        while (letter := self._waiting.get()) is not None:
            letter_id, title, body = letter
            try:
                is_sent = self._post(body) if self._settings.webhook else self._tell(title, body)
            except (OSError, ValueError) as error:
                is_sent = False
                self._log.warning("not told", reason=str(error))
            if is_sent:
                self._done.put(letter_id)
            else:
                self.failures += 1
            self._taken.discard(letter_id)

    def _post(self, body: str) -> bool:
        """Send an event to a web service, with what proves that it is ours."""
        settings = self._settings
        assert settings.webhook is not None and settings.secret is not None
        payload = body.encode()
        request = urllib.request.Request(
            settings.webhook,
            payload,
            {
                "Content-Type": "application/cloudevents+json",
                "X-Standoff-Signature": signature(payload, settings.secret.value),
            },
            method="POST",
        )
        try:
            with urllib.request.urlopen(request, timeout=_PATIENCE_S) as answer:
                return answer.status in _OK
        except urllib.error.HTTPError as error:
            self._log.warning("the web service refuses", status=error.code)
            return False

    def _tell(self, title: str, body: str) -> bool:
        import apprise

        assert self._settings.apprise is not None
        told = apprise.Apprise()
        if not told.add(self._settings.apprise.value):
            self._log.error("apprise does not know this address")
            return False
        return bool(told.notify(title=title, body=in_words(body)))


def in_words(body: str) -> str:
    """Return what an event says, for people.

    Args:
        body: A CloudEvent of a hazard.
    """
    _, hazard, _ = read_event(body.encode(), HazardNews)
    who = " and ".join(one.replace("_", " ") for one in hazard.classes) or "nobody in particular"
    where = f"in or near {hazard.zone}" if hazard.zone else ""
    is_far = hazard.distance_m is not None and not hazard.zone
    far = METRES.distance(hazard.distance_m or 0.0, hazard.sigma_m or math.nan) if is_far else ""
    parts = [f"{hazard.severity.upper()}: {who}", where, far, hazard.reason, f"stream {hazard.stream}"]
    return ", ".join(filter(None, parts))


def signature(payload: bytes, secret: str) -> str:
    """Return what a web service checks that an event is ours: HMAC-SHA256 of its bytes, in hexadecimal.

    >>> signature(b"{}", "shared")[:23]
    'sha256=4c053bf942c3ef31'
    """
    return "sha256=" + hmac.new(secret.encode(), payload, hashlib.sha256).hexdigest()


def notifiers(settings: Sequence[NotifySettings], done: queue.SimpleQueue[str]) -> list[Notifier]:
    """Begin all that the settings name."""
    return [Notifier(number, one, done) for number, one in enumerate(settings)]
