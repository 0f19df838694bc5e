from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from laws import examples

from standoff.clips import Clip
from standoff.config import load_settings
from standoff.core.types import Hazard, Phase, Severity
from standoff.evaluation.paper.answers import (
    ANSWERS,
    CLEAR,
    DANGER,
    UNKNOWN,
    WARNING,
    Answers,
    FrameByFrame,
    answers_of,
    score_frames,
)
from standoff.evaluation.paper.monitored_clip import MonitoredClip
from standoff.evaluation.paper.pair_alarms import PairAlarms
from standoff.evaluation.paper.warning_time import Breach, find_breaches, summarise

NAN = float("nan")


def test_a_hand_made_table_of_answers() -> None:
    """Six breaches: four recognised, one called clear, one unknown; two warnings: one right; four clear: three."""
    true = [DANGER] * 6 + [WARNING] * 2 + [CLEAR] * 4
    said = [DANGER] * 4 + [CLEAR, UNKNOWN] + [WARNING, DANGER] + [CLEAR] * 3 + [WARNING]
    found = Answers.of(np.array(true), np.array(said))
    danger, warning, clear, unknown = found.each
    assert (danger.truths, danger.said) == (6, 5)
    assert (danger.precision, danger.recall) == (4 / 5, 4 / 6)
    assert danger.f1 == pytest.approx(2 * (4 / 5) * (4 / 6) / (4 / 5 + 4 / 6))
    assert (warning.precision, warning.recall, warning.f1) == (1 / 2, 1 / 2, 1 / 2)
    assert (clear.precision, clear.recall, clear.f1) == (3 / 4, 3 / 4, 3 / 4)
    assert (unknown.truths, unknown.said, unknown.precision) == (0, 1, 0.0)
    assert np.isnan(unknown.recall)
    assert found.macro_precision == pytest.approx((4 / 5 + 1 / 2 + 3 / 4) / 3)
    assert found.macro_recall == pytest.approx((4 / 6 + 1 / 2 + 3 / 4) / 3)
    assert found.macro_f1 == pytest.approx((danger.f1 + 1 / 2 + 3 / 4) / 3)
    assert found.breach_called_clear_share == 1 / 6
    assert found.unknown_share == 1 / 12


def test_an_answer_that_is_never_given_counts_nothing_and_one_that_is_never_true_is_left_out() -> None:
    never_warned = Answers.of(np.array([DANGER, WARNING]), np.array([DANGER, DANGER]))
    assert never_warned.macro_precision == pytest.approx((1 / 2 + 0) / 2)
    assert never_warned.macro_f1 == pytest.approx((2 / 3 + 0) / 2)
    nothing = Answers.of(np.zeros(0, np.int64), np.zeros(0, np.int64))
    assert np.isnan([nothing.macro_f1, nothing.unknown_share, nothing.breach_called_clear_share]).all()


_ANSWERS = st.integers(1, 40).flatmap(
    lambda count: st.tuples(
        arrays.arrays(np.int64, count, elements=st.integers(DANGER, CLEAR)),
        arrays.arrays(np.int64, count, elements=st.integers(DANGER, UNKNOWN)),
    )
)


@given(_ANSWERS, _ANSWERS)
@examples(50)
def test_pooled_answers_are_those_of_all_frames_together(
    one: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]], other: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]
) -> None:
    together = Answers.of(*(np.concatenate(both) for both in zip(one, other, strict=True)))
    assert Answers.together([Answers.of(*one), Answers.of(*other)]) == together
    assert sum(score.truths for score in together.each) == sum(score.said for score in together.each)
    true, said = one
    assert Answers.of(true, true).macro_f1 == 1.0
    # Whatever order the frames come in.
    assert Answers.of(true[::-1], said[::-1]) == Answers.of(true, said)


@given(arrays.arrays(np.float64, 12, elements=st.floats(-5.0, 5.0) | st.just(NAN)), st.floats(0.0, 2.0))
@examples(50)
def test_a_smaller_gap_is_never_a_milder_answer(gap_m: np.ndarray[Any, Any], nearer_m: float) -> None:
    before, after = answers_of(gap_m, 1.0), answers_of(gap_m - nearer_m, 1.0)
    assert (after <= before).all()
    assert ((before == UNKNOWN) == np.isnan(gap_m)).all()


def small_clip(distance_m: Iterable[float], visible: Iterable[bool] | None = None) -> Clip:
    """A worker (2 m) and a wheel loader (5.8 m): 7.8 m are a gap of 0."""
    series = np.array(list(distance_m))[:, None]
    box_px = np.zeros((len(series), 2, 4))
    box_px[~np.array(list(visible) if visible is not None else [True] * len(series)), 1] = NAN
    made = SimpleNamespace(
        box_px=box_px,
        pairs=np.array([[0, 1]]),
        distance_m=series,
        class_id=np.array([0, 2]),
        names=lambda: ["worker", "wheel_loader"],
    )
    return cast(Clip, made)


def watched_as(distance_m: Iterable[float], said: Iterable[str] | None = None) -> MonitoredClip:
    series = np.array(list(distance_m))[:, None]
    texts = np.array(list(said) if said is not None else [""] * len(series), dtype=object)[:, None]
    alarmed = (texts == "danger") | (texts == "warning")
    made = SimpleNamespace(distance_m=series, said=texts, alarmed=alarmed, time_s=0.5 * np.arange(len(series)))
    return cast(MonitoredClip, made)


SETTINGS = load_settings()


def test_frames_are_asked_for_where_both_can_be_seen_and_are_near() -> None:
    true_m = [7.0, 8.0, 20.0, 49.0, 51.0, 7.0]
    clip = small_clip(true_m, [True] * 5 + [False])
    found = score_frames(clip, watched_as([7.1, 7.5, NAN, 48.0, 48.0, 7.0]), SETTINGS)
    by_distance = found.measured
    assert [one.truths for one in by_distance.each] == [1, 1, 2, 0]
    assert by_distance.counts == ((1, 0, 0, 0), (1, 0, 0, 0), (0, 0, 1, 1))
    assert score_frames(clip, watched_as(true_m), SETTINGS).measured.macro_f1 == 1.0


def test_what_is_said_is_what_an_operator_sees_and_unknown_where_nothing_is_measured() -> None:
    clip = small_clip([7.0, 7.0, 8.0, 20.0, 20.0])
    by_distance = load_settings(None, {"hazard": {"rule": "distance"}})
    found = score_frames(
        clip, watched_as([7.0, 7.0, 8.0, NAN, 20.0], ["", "danger", "warning", "danger", "unknown"]), by_distance
    )
    assert found.said.counts == ((1, 0, 1, 0), (0, 1, 0, 0), (0, 0, 0, 2))
    assert found.measured.counts == ((2, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 1))
    pooled = FrameByFrame.together([found, found])
    assert pooled.said.macro_f1 == found.said.macro_f1
    assert found.to_dict()["said"]["breach_called_clear_share"] == 0.5


def test_a_warning_by_probability_is_due_while_a_breach_is_to_come() -> None:
    true_m = [9.0] * 8 + [7.0] + [9.0] * 9
    said = [""] * 3 + ["warning"] * 5 + ["danger"] + [""] * 9
    settings = load_settings(None, {"proximity": {"horizon_s": 2.0}})
    found = score_frames(small_clip(true_m), watched_as(true_m, said), settings).said
    # The frames are half a second apart: four of them are within two seconds before the breach, and of the last four
    # nobody knows what follows.
    assert found.counts == ((1, 0, 0, 0), (0, 4, 0, 0), (0, 1, 8, 0))


def test_the_radii_and_the_buffer_are_those_of_the_settings() -> None:
    settings = load_settings(None, {"locate": {"radius_m": {"worker": 0.0}}, "hazard": {"buffer_m": 3.0}})
    found = score_frames(small_clip([5.0, 7.0, 9.0]), watched_as([5.0, 7.0, 9.0]), settings)
    assert [one.truths for one in found.measured.each] == [1, 1, 1, 0]


@pytest.mark.parametrize(
    ("said", "warned_s"),
    [
        (["", "warning", "danger", "danger", "", ""], 1.0),
        (["warning", "", "", "danger", "", ""], 0.0),
        (["", "", "", "", "danger", ""], -0.5),
        (["warning", "warning", "", "", "", "danger"], NAN),
        (["", "", "unknown", "unknown", "unknown", ""], NAN),
        (["danger"] * 6, 1.5),
    ],
)
def test_the_time_before_a_breach_is_that_of_the_alarm_which_is_open_then(said: list[str], warned_s: float) -> None:
    gone_m = [20.0, 12.0, 9.0, 7.0, 7.5, 9.0]
    (breach,) = find_breaches(small_clip(gone_m), watched_as(gone_m, said), SETTINGS)
    assert breach.names == ("worker", "wheel_loader")
    assert (breach.start_s, breach.from_start) == (1.5, False)
    assert breach.warned_s == pytest.approx(warned_s, nan_ok=True)


def test_each_breach_counts_and_those_that_nobody_could_see_do_not() -> None:
    true_m = [7.0, 9.0, 7.0, 7.0, 9.0, 7.0]
    clip = small_clip(true_m, [True] * 5 + [False])
    found = find_breaches(clip, watched_as(true_m), SETTINGS)
    assert [(one.start_s, one.from_start) for one in found] == [(0.0, True), (1.0, False)]


def test_breaches_are_summed_up() -> None:
    def breach(start_s: float, warned_s: float, *, from_start: bool = False) -> Breach:
        return Breach(("worker", "wheel_loader"), start_s, warned_s, from_start)

    found = summarise(
        [breach(0.0, -1.0, from_start=True), breach(1.0, 0.5), breach(5.0, 2.5), breach(6.0, -0.5), breach(9.0, NAN)]
    )
    assert (found.breaches, found.missed, found.late) == (4, 1, 1)
    assert (found.median_s, found.ahead, found.foreseeable) == (0.5, 1, 3)


def event(phase: Phase, severity: Severity, track_ids: tuple[int, ...] = (5, 9), hazard_id: str = "one") -> Hazard:
    return Hazard(hazard_id, "proximity", severity, phase, track_ids, 0.0, 1.0, 1.0, 0.1)


def test_hazards_are_followed_from_their_first_event_to_their_last() -> None:
    said = PairAlarms(np.array([[0, 1], [0, 2]]))
    shown = {5: 0, 9: 2}
    frames = [
        ([], ["", ""], [False, False]),
        ([event("opened", "warning")], ["", "warning"], [False, True]),
        ([], ["", "warning"], [False, True]),
        ([event("updated", "danger")], ["", "danger"], [False, True]),
        ([event("unknown", "danger")], ["", "unknown"], [False, True]),
        ([event("updated", "warning")], ["", "warning"], [False, True]),
        ([event("closed", "warning")], ["", ""], [False, False]),
    ]
    for events, texts, alarms in frames:
        text, alarmed = said.take(events, shown)
        assert (text.tolist(), alarmed.tolist()) == (texts, alarms)


def test_a_hazard_stays_with_its_pair_when_a_track_is_lost_and_the_worst_of_two_counts() -> None:
    said = PairAlarms(np.array([[0, 1]]))
    said.take([event("opened", "danger")], {5: 0, 9: 1})
    text, alarmed = said.take([event("unknown", "danger")], {5: 0})
    assert (text.tolist(), alarmed.tolist()) == (["unknown"], [True])
    text, alarmed = said.take([event("opened", "warning", (5, 11), "two")], {5: 0, 11: 1})
    assert (text.tolist(), alarmed.tolist()) == (["warning"], [True])
    text, alarmed = said.take([event("closed", "danger"), event("closed", "warning", (5, 11), "two")], {})
    assert (text.tolist(), alarmed.tolist()) == ([""], [False])


def test_hazards_of_nobody_and_of_the_whole_picture_are_left_out() -> None:
    said = PairAlarms(np.array([[0, 1]]))
    of_the_stream = replace(event("opened", "unknown", ()), rule="measurement")
    text, alarmed = said.take([of_the_stream, event("opened", "danger", (5, 30), "two")], {5: 0, 9: 1})
    assert (text.tolist(), alarmed.tolist()) == ([""], [False])
    assert ANSWERS[UNKNOWN] == "unknown"
