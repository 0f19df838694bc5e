"""Hazards, moments and letters of a made-up site."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from standoff.messages import HazardNews, HealthNews
from standoff.service.live.outbox import Letter, News
from standoff.service.live.service_clock import Moment
from standoff.testing import FakeClock

UNIX_S = 1_767_268_800.0
AT = datetime.fromtimestamp(UNIX_S, UTC)


def moment(s: float = 0.0, clock: str = "boot-1") -> Moment:
    """Return a moment `s` seconds after all began."""
    return Moment(clock, 1000.0 + s, UNIX_S + s)


class ClockOfBoth:
    """The service's clock, which stands still until time passes.

    Args:
        utc: What it shows at first.
    """

    def __init__(self, utc: datetime = AT) -> None:
        self.clock, self.name = FakeClock(utc), "boot-1"

    def __call__(self) -> Moment:
        return Moment(self.name, 1000.0 + self.clock.monotonic_s(), self.clock.utc().timestamp())


def hazard(hazard_id: str = "h-1", **changes: Any) -> HazardNews:
    """Return a hazard of a worker, track 1, and an excavator, track 2."""
    told: dict[str, Any] = {
        "site": "yard",
        "stream": "gate",
        "session": "s-1",
        "hazard_id": hazard_id,
        "phase": "opened",
        "rule": "proximity",
        "severity": "danger",
        "track_ids": (1, 2),
        "classes": ("worker", "excavator"),
        "zone": "",
        "distance_m": 4.2,
        "gap_m": -0.5,
        "sigma_m": 0.3,
        "breach_now": 0.9,
        "breach_ahead": 0.95,
        "reason": "",
        "time_s": 12.5,
        "captured_at": AT,
        "delay": "told",
    }
    return HazardNews(**{**told, **changes})


def health(stream: str = "gate", state: Any = "live", reason: str = "") -> HealthNews:
    return HealthNews("yard", stream, state, reason, 12.5, AT)


def news(told: HazardNews | HealthNews | None = None, news_id: str = "n-1", s: float = 0.0) -> News:
    """Return news of a picture that was taken a fifth of a second before."""
    at = moment(s)
    return News(news_id, hazard() if told is None else told, at.s - 0.2, at)


def letter(letter_id: str = "n-1/a", **changes: Any) -> Letter:
    told: dict[str, Any] = {
        "id": letter_id,
        "news_id": letter_id.partition("/")[0],
        "topic": "standoff/yard/device/wrist/alert",
        "body": "{}",
        "valid_s": 5.0,
        "retained": False,
        "captured_s": 999.8,
        "at": moment(),
    }
    return Letter(**{**told, **changes})
