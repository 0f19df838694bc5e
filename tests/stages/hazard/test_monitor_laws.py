"""What holds of the hazards of any frames."""

from __future__ import annotations

import itertools
import math

from hypothesis import given
from hypothesis import strategies as st
from stages.hazard.frames_of_gaps import (
    CALM,
    FOLLOWED,
    GROUND,
    NAN,
    NO_GROUND,
    STEP_S,
    Gaps,
    Pair,
    events_of,
    frame,
    told,
)

from standoff.core.types import Hazard, NoGroundMap
from standoff.stages.hazard import HazardMonitor, HazardParams

GAP = st.one_of(st.floats(-3, 5), st.just(NAN))
FRAME = st.one_of(
    st.dictionaries(st.sampled_from([(1, 2), (1, 3), (2, 3)]), GAP, max_size=3),
    st.sampled_from([NO_GROUND, NoGroundMap("map is stale")]),
)
FRAMES = st.lists(FRAME, min_size=5, max_size=60)


@given(frames=FRAMES)
def test_every_hazard_is_opened_first_and_closed_last_at_the_end_of_the_stream(
    frames: list[Gaps | NoGroundMap],
) -> None:
    params = HazardParams(min_duration_s=0.125, release_s=0.25, unknown_after_s=0.5, unknown_timeout_s=0.5)
    monitor = HazardMonitor(params)
    events: list[Hazard] = []
    for index, gaps in enumerate(frames):
        ground = gaps if isinstance(gaps, NoGroundMap) else GROUND
        rows = frame({(1, 2): NAN} if isinstance(gaps, NoGroundMap) else gaps)
        events += monitor.update(STEP_S * index, *rows, ground, FOLLOWED)
    events += monitor.close(STEP_S * len(frames))
    lives: dict[str, list[Hazard]] = {}
    for event in events:
        lives.setdefault(event.hazard_id, []).append(event)
    for life in lives.values():
        phases = [event.phase for event in life]
        assert (phases[0], phases[-1]) == ("opened", "closed")
        assert set(phases[1:-1]) <= {"updated", "unknown"}
        assert len({(event.rule, event.track_ids) for event in life}) == 1
        assert all(earlier.time_s <= later.time_s for earlier, later in itertools.pairwise(life))
        assert all(event.reason and math.isnan(event.gap_m) for event in life if event.phase == "unknown")


def open_intervals(events: list[Hazard], end_s: float) -> dict[Pair, list[tuple[float, float]]]:
    """Return by pair when a hazard was open."""
    opened: dict[str, tuple[Pair, float]] = {}
    spans: dict[Pair, list[tuple[float, float]]] = {}
    for event in events:
        if event.rule == "proximity" and event.phase == "opened":
            opened[event.hazard_id] = ((event.track_ids[0], event.track_ids[1]), event.time_s)
        elif event.rule == "proximity" and event.phase == "closed":
            pair, start_s = opened.pop(event.hazard_id)
            spans.setdefault(pair, []).append((start_s, event.time_s))
    for pair, start_s in opened.values():
        spans.setdefault(pair, []).append((start_s, end_s))
    return spans


@given(frames=FRAMES, buffer_m=st.floats(0, 2), wider_m=st.floats(0, 3), radius_m=st.floats(0, 3))
def test_a_wider_buffer_or_radius_never_removes_a_hazard(
    frames: list[Gaps | NoGroundMap], buffer_m: float, wider_m: float, radius_m: float
) -> None:
    def spans(buffer_m: float, radius_m: float) -> dict[Pair, list[tuple[float, float]]]:
        params = HazardParams(
            buffer_m=buffer_m, min_duration_s=0.125, release_s=0.25, unknown_after_s=0.5, unknown_timeout_s=0.5
        )
        nearer: list[Gaps | NoGroundMap] = [
            gaps if isinstance(gaps, NoGroundMap) else {pair: gap_m - radius_m for pair, gap_m in gaps.items()}
            for gaps in frames
        ]
        return open_intervals(events_of(nearer, params), STEP_S * len(frames))

    wide = spans(buffer_m + wider_m, radius_m)
    for pair, narrow_spans in spans(buffer_m, 0.0).items():
        for start_s, end_s in narrow_spans:
            assert any(first <= start_s and end_s <= last for first, last in wide.get(pair, []))


@given(gaps=st.lists(st.dictionaries(st.sampled_from([(1, 2), (1, 3), (2, 3)]), GAP, min_size=3), max_size=30))
def test_the_order_of_the_rows_does_not_matter(gaps: list[Gaps]) -> None:
    straight, mixed = HazardMonitor(CALM), HazardMonitor(CALM)
    for index, pairs in enumerate(gaps):
        first = straight.update(STEP_S * index, *frame(pairs), GROUND, FOLLOWED)
        second = mixed.update(STEP_S * index, *frame(pairs, order=[2, 0, 1]), GROUND, FOLLOWED)
        assert [(e.track_ids, e.phase, e.severity) for e in first] == [
            (e.track_ids, e.phase, e.severity) for e in second
        ]


@given(frames=FRAMES, factor=st.sampled_from([0.25, 2.0, 16.0]))
def test_a_slower_clock_with_slower_settings_tells_the_same_story(
    frames: list[Gaps | NoGroundMap], factor: float
) -> None:
    durations = {"min_duration_s": 0.25, "release_s": 0.5, "update_every_s": 1.0, "unknown_after_s": 1.0}
    plain = HazardParams("distance", **durations, unknown_timeout_s=2.0)
    slow = HazardParams(
        "distance", **{name: factor * s for name, s in durations.items()}, unknown_timeout_s=2.0 * factor
    )
    told_plain = [(p, s, t * factor) for p, s, t in told(events_of(frames, plain))]
    assert told(events_of(frames, slow, step_s=STEP_S * factor)) == told_plain
