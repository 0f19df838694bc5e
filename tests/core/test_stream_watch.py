"""A stream's state follows from its silence: the same words for the same cause, and silence never makes it better."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.health import STREAM_STATES, StreamState
from standoff.core.stream_watch import (
    CapturePhase,
    CaptureWord,
    PictureWord,
    StreamCondition,
    WatchLimits,
    stream_condition,
)

NOW_S = 1000.0
LIMITS = WatchLimits()
PHASES: tuple[CapturePhase, ...] = get_args(CapturePhase)
WITH_PICTURES = frozenset({"live", "late", "frozen", "stale"})
SECONDS = st.floats(0.0, 20.0)
WORDS = st.none() | st.builds(
    lambda phase, age_s: CaptureWord(phase, "" if phase == "receiving" else f"it is {phase}", NOW_S - age_s),
    st.sampled_from(PHASES),
    SECONDS,
)
PICTURES = st.builds(
    lambda age_s, still_s, delay_s: PictureWord(NOW_S - age_s, NOW_S - age_s - still_s, delay_s),
    SECONDS,
    SECONDS,
    st.floats(0.0, 60.0) | st.just(math.nan),
)
LIMITS_DRAWN = st.builds(
    lambda stale_s, more_s, frozen_s, late_s: WatchLimits(stale_s, stale_s + more_s, frozen_s, late_s),
    st.floats(0.01, 10.0),
    st.floats(0.0, 50.0),
    st.floats(0.1, 10.0),
    st.floats(0.1, 10.0),
)


def receiving(age_s: float = 0.0) -> CaptureWord:
    return CaptureWord("receiving", "", NOW_S - age_s)


def picture(silence_s: float = 0.0, still_s: float = 0.0, delay_s: float = math.nan) -> PictureWord:
    return PictureWord(NOW_S - silence_s, NOW_S - silence_s - still_s, delay_s)


def condition(word: CaptureWord | None, newest: PictureWord | None, *, enabled: bool = True) -> StreamCondition:
    return stream_condition(word, newest, NOW_S, LIMITS, enabled=enabled)


@pytest.mark.parametrize(
    ("silence_s", "state"),
    [(0.0, "live"), (0.49, "live"), (0.51, "stale"), (1.49, "stale"), (1.51, "lost"), (1e4, "lost")],
)
def test_silence_makes_a_stream_stale_and_then_lost(silence_s: float, state: StreamState) -> None:
    found = condition(receiving(), picture(silence_s))
    assert found.state == state
    assert found.reason == ("" if state == "live" else "no picture comes")


def test_a_picture_that_stands_still_is_frozen_until_it_changes() -> None:
    still_s = LIMITS.frozen_after_s
    assert condition(receiving(), picture(still_s=still_s - 0.1)).state == "live"
    assert condition(receiving(), picture(still_s=still_s + 0.1)) == ("frozen", "the picture stands still")
    never = WatchLimits(frozen_after_s=math.inf)
    assert stream_condition(receiving(), picture(still_s=1e6), NOW_S, never).state == "live"


def test_pictures_that_are_too_old_are_late_where_their_age_is_known() -> None:
    assert condition(receiving(), picture(delay_s=1.9)).state == "live"
    assert condition(receiving(), picture(delay_s=2.1)) == ("late", "its pictures are too old when they come")
    assert condition(receiving(), picture(delay_s=math.nan)).state == "live"
    assert condition(receiving(), picture(still_s=9.0, delay_s=9.0)).state == "frozen"


@pytest.mark.parametrize("phase", ["connecting", "waiting_for_keyframe", "backing_off", "refused"])
def test_without_pictures_a_stream_is_what_its_capture_says(phase: CapturePhase) -> None:
    word = CaptureWord(phase, "401 Unauthorized", NOW_S)
    assert condition(word, None) == condition(word, picture(silence_s=2.0)) == (phase, "401 Unauthorized")
    assert condition(word, picture(silence_s=1.0)).state == "stale"


def test_a_capture_that_does_not_answer_is_lost_whatever_it_said_last() -> None:
    for phase in PHASES:
        dead = CaptureWord(phase, "as it was", NOW_S - 1.6)
        assert condition(dead, None) == condition(dead, picture(3.0)) == ("lost", "its capture does not answer")
    assert condition(receiving(), None) == ("lost", "no picture has come yet")
    assert condition(None, None) == ("connecting", "its capture begins")


@given(WORDS, st.none() | PICTURES)
def test_what_is_not_wanted_is_disabled_and_nothing_else_is(
    word: CaptureWord | None, newest: PictureWord | None
) -> None:
    assert condition(word, newest, enabled=False) == ("disabled", "disabled in the settings")
    assert condition(word, newest).state != "disabled"


@given(WORDS, st.none() | PICTURES, LIMITS_DRAWN)
def test_live_late_frozen_and_stale_are_streams_with_pictures_and_no_others(
    word: CaptureWord | None, newest: PictureWord | None, limits: WatchLimits
) -> None:
    found = stream_condition(word, newest, NOW_S, limits)
    comes = newest is not None and NOW_S - newest.arrived_s <= limits.lost_after_s
    assert (found.state in WITH_PICTURES) == comes
    assert found.state in STREAM_STATES
    assert (found.reason == "") == (found.state == "live")


@given(WORDS, st.none() | PICTURES, st.lists(st.floats(0.0, 5.0), min_size=1, max_size=8))
def test_more_silence_is_never_better(
    word: CaptureWord | None, newest: PictureWord | None, steps_s: list[float]
) -> None:
    moments_s = [NOW_S]
    for step_s in steps_s:
        moments_s.append(moments_s[-1] + step_s)
    states = [stream_condition(word, newest, now_s, LIMITS).state for now_s in moments_s]
    for before, after in pairwise(states):
        if before not in ("live", "late"):
            assert after not in ("live", "late")
        if before not in WITH_PICTURES:
            assert after in (before, "lost")
        if before == "lost":
            assert after == "lost"


@given(PICTURES, PICTURES, LIMITS_DRAWN)
def test_while_pictures_come_the_same_state_has_the_same_words(
    one: PictureWord, other: PictureWord, limits: WatchLimits
) -> None:
    first, second = (stream_condition(receiving(), each, NOW_S, limits) for each in (one, other))
    assert first.state != second.state or first.reason == second.reason


def test_limits_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(ValueError, match="lost_after_s"):
        WatchLimits(stale_after_s=2.0, lost_after_s=1.0)
