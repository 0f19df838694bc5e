"""Alerts and words on supervision as they arrive at a device."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from standoff.messages import Alert, HazardNews, Supervision, Timing, event_text

AT = datetime(2026, 1, 1, 12, tzinfo=UTC)
SERVICE_MS = 5_000_000.0
"""The service's clock as the device's stands at zero: neither knows."""


def timing(sent_ms: float, remaining_ms: float = 5000.0, clock: str = "boot-1") -> Timing:
    """Return the moment of a sending, `sent_ms` after all began."""
    return Timing(clock, SERVICE_MS + sent_ms, remaining_ms, 120.0)


def alert(event_id: str = "e-1", sent_ms: float = 0.0, **changes: Any) -> bytes:
    """Return an alert of danger; `remaining_ms`, `clock`, `silent` and `device`, and parts of the hazard."""
    parts = {name: changes.pop(name) for name in ("remaining_ms", "clock") if name in changes}
    silent, device = changes.pop("silent", False), changes.pop("device", "wrist")
    hazard: dict[str, Any] = {
        "site": "yard", "stream": "gate", "session": "s", "hazard_id": "h-1", "phase": "opened", "rule": "proximity",
        "severity": "danger", "track_ids": (1, 2), "classes": ("worker", "excavator"), "zone": "", "distance_m": 4.0,
        "gap_m": -1.0, "sigma_m": 0.3, "breach_now": 1.0, "breach_ahead": 1.0, "reason": "", "time_s": 10.0,
        "captured_at": AT, "delay": "told",
    }  # fmt: skip
    told = Alert(device, HazardNews(**{**hazard, **changes}), "position", silent)
    return _text(told, event_id, timing(sent_ms, **parts))


def supervision(sent_ms: float = 0.0, *, supervised: bool = True, reason: str = "", **changes: Any) -> bytes:
    device = changes.pop("device", "wrist")
    told = Supervision(device, 1, supervised, reason, ("gate",), 1)
    return _text(told, f"s-{sent_ms}", timing(sent_ms, **{"remaining_ms": 3000.0, **changes}))


def _text(told: object, event_id: str, when: Timing | None) -> bytes:
    return event_text(told, event_id=event_id, source="standoff/yard", subject="x", at=AT, timing=when).encode()
