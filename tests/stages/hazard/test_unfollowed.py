"""What the detector is sure of and no track shows is a hazard of its own."""

from __future__ import annotations

import numpy as np

from standoff.core.types import GroundMap, GroundPositions, Hazard, Proximities
from standoff.stages.hazard import HazardMonitor

GROUND = GroundMap(np.eye(3), np.zeros((9, 9)), (1920, 1080), "exact", 0.02)


def events_of(shares: list[float], step_s: float) -> tuple[list[Hazard], HazardMonitor]:
    """Run a monitor over frames of ten sure detections, of which a share is in no track."""
    monitor = HazardMonitor()
    events: list[Hazard] = []
    for index, share in enumerate(shares):
        lost = np.arange(10) < round(10 * share)
        events += monitor.update(step_s * index, GroundPositions.empty(), Proximities.empty(), GROUND, lost)
    return [*events, *monitor.close(step_s * len(shares))], monitor


def test_many_sure_detections_in_no_track_are_one_measurement_hazard_at_any_rate() -> None:
    for step_s in (0.04, 0.2, 1.0, 10.0):
        events, monitor = events_of([1.0] * 20, step_s)
        assert [(event.rule, event.severity, event.phase) for event in events] == [
            ("measurement", "unknown", "opened"),
            ("measurement", "unknown", "closed"),
        ]
        assert events[0].time_s == 0.0
        assert "200 of 200" in monitor.describe()["warnings"][0]


def test_a_few_are_none() -> None:
    events, monitor = events_of([0.2] * 50, 0.2)
    assert events == []
    assert monitor.describe()["warnings"] == []


def test_it_ends_once_tracks_show_again_what_is_seen() -> None:
    events, monitor = events_of([1.0] * 5 + [0.0] * 40, 0.2)
    assert [event.reason for event in events] == [
        "sure detections are in no track",
        "sure detections are in tracks again",
    ]
    # The run says so all the same.
    assert len(monitor.describe()["warnings"]) == 1
