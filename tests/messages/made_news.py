"""News of every kind as hypothesis draws them, and one plain example of each."""

from __future__ import annotations

from datetime import UTC, datetime

from hypothesis import strategies as st

from standoff.core.health import STREAM_STATES
from standoff.messages import (
    Acknowledgement,
    Alert,
    DevicePosition,
    Echo,
    HazardNews,
    HealthNews,
    Heartbeat,
    Supervision,
    Timing,
    WatchedZone,
)

AT = datetime(2026, 3, 29, 1, 30, 0, 250_000, UTC)

_FLOATS = st.floats(allow_nan=False, allow_infinity=False)
_MAYBE = st.none() | _FLOATS
_NAMES = st.text(max_size=64)
_REASONS = st.text(max_size=60)
_MOMENTS = st.datetimes(timezones=st.just(UTC))
_DELAYS = st.sampled_from(["told", "measured", "bound", "unknown"])
_COUNTS = st.integers(0, 2**62)

HAZARDS = st.builds(
    HazardNews,
    site=_NAMES,
    stream=_NAMES,
    session=_NAMES,
    hazard_id=_NAMES,
    phase=st.sampled_from(["opened", "updated", "closed", "unknown"]),
    rule=_NAMES,
    severity=st.sampled_from(["warning", "danger", "unknown"]),
    track_ids=st.lists(st.integers(), max_size=8).map(tuple),
    classes=st.lists(_NAMES, max_size=8).map(tuple),
    zone=_NAMES,
    distance_m=_MAYBE,
    gap_m=_MAYBE,
    sigma_m=_MAYBE,
    breach_now=_MAYBE,
    breach_ahead=_MAYBE,
    reason=_REASONS,
    time_s=_FLOATS,
    captured_at=st.none() | _MOMENTS,
    delay=_DELAYS,
    shelved_by=_REASONS,
)
ALERTS = st.builds(
    Alert,
    device=_NAMES,
    hazard=HAZARDS,
    because=st.sampled_from(["position", "near", "zone", "stream", "everything", "escalation"]),
    silent=st.booleans(),
)
HEARTBEATS = st.builds(
    Heartbeat,
    site=_NAMES,
    stream=_NAMES,
    session=_NAMES,
    sequence=_COUNTS,
    frame=_COUNTS,
    time_s=_FLOATS,
    measured=st.booleans(),
    reason=_REASONS,
    watched_share=_MAYBE,
    unwatched=st.dictionaries(_NAMES, _FLOATS, max_size=4),
    zones=st.lists(st.builds(WatchedZone, _NAMES, _FLOATS, _REASONS), max_size=3).map(tuple),
    delay=_DELAYS,
    open_hazards=st.lists(_NAMES, max_size=4).map(tuple),
)
SUPERVISIONS = st.builds(
    Supervision,
    device=_NAMES,
    sequence=_COUNTS,
    supervised=st.booleans(),
    reason=_REASONS,
    streams=st.lists(_NAMES, max_size=4).map(tuple),
    candidates=_COUNTS,
)
HEALTHS = st.builds(
    HealthNews,
    site=_NAMES,
    stream=_NAMES,
    state=st.sampled_from(STREAM_STATES),
    reason=_REASONS,
    time_s=_FLOATS,
    since=_MOMENTS,
)
TIMINGS = st.builds(Timing, clock=_NAMES, sent_ms=_FLOATS, remaining_ms=_FLOATS, age_ms=_MAYBE)
EVENTS = HAZARDS | ALERTS | HEARTBEATS | SUPERVISIONS | HEALTHS

HAZARD = HazardNews(
    site="yard",
    stream="gate",
    session="01JSESSION",
    hazard_id="01JHAZARD",
    phase="opened",
    rule="proximity",
    severity="danger",
    track_ids=(1, 2),
    classes=("worker", "excavator"),
    zone="",
    distance_m=4.2,
    gap_m=-0.5,
    sigma_m=0.3,
    breach_now=0.9,
    breach_ahead=0.95,
    reason="",
    time_s=12.5,
    captured_at=AT,
    delay="told",
)
ALERT = Alert("wrist-7", HAZARD, "position", silent=False)
SUPERVISION = Supervision("wrist-7", 3, supervised=True, reason="", streams=("gate",), candidates=1)
HEALTH = HealthNews("yard", "gate", "stale", "no picture comes", 12.5, AT)
HEARTBEAT = Heartbeat(
    site="yard",
    stream="gate",
    session="01JSESSION",
    sequence=7,
    frame=180,
    time_s=12.5,
    measured=True,
    reason="",
    watched_share=0.8,
    unwatched={"blurred": 0.2},
    zones=(WatchedZone("pit", 0.5, "blurred"),),
    delay="bound",
    open_hazards=("01JHAZARD",),
)
TIMING = Timing("boot-1", 12_600.0, 4_900.0, 150.0)
POSITION = DevicePosition(sigma_m=0.3, x_m=1.5, y_m=-2.5, age_ms=40.0)
ONE_OF_EACH = (HAZARD, ALERT, HEARTBEAT, SUPERVISION, HEALTH)
DEVICE_KINDS = (DevicePosition, Acknowledgement, Echo)
