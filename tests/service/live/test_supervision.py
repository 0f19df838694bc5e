"""A wearer counts as watched only if all holds that a warning needs; whatever is missing is told."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from service.live.made_sightings import (
    EXCAVATOR_M,
    NOW_S,
    WORKER_M,
    at,
    ground,
    recipients,
    sighting,
    track,
    watched,
)

from standoff.core.types import NoGroundMap, WatchedGround
from standoff.core.watched_ground import BLURRED, NO_CONTRAST, TOO_DARK
from standoff.messages import Supervision, WatchedZone
from standoff.service.live.recipients import Recipients
from standoff.service.live.sighting import Sighting

WRIST: dict[str, Any] = {"wrist": {"wearer": "worker"}}
FOREMAN: dict[str, Any] = {"foreman": {"wearer": "nobody", "everything": True}}


def of_wrist(made: Recipients, now_s: float = NOW_S) -> Supervision:
    made.match(now_s)
    return made.supervision("wrist", 7, now_s)


def of_foreman(*sightings: Sighting, streams: tuple[str, ...] = ("gate",), **receiver: Any) -> Supervision:
    made = recipients({"foreman": {"wearer": "nobody", **receiver}}, *sightings, streams=streams)
    return made.supervision("foreman", 7, NOW_S)


def test_who_has_a_track_on_watched_ground_of_a_live_stream_is_supervised() -> None:
    told = of_wrist(recipients(WRIST, sighting(), wrist=at(WORKER_M)))
    assert told == Supervision("wrist", 7, supervised=True, reason="", streams=("gate",), candidates=1)
    operator = recipients({"wrist": {"wearer": "machine"}}, sighting(), wrist=at(EXCAVATOR_M))
    assert of_wrist(operator).supervised


LACKS: dict[str, tuple[Callable[[Sighting], Sighting], str]] = {
    "no track": (lambda one: replace(one, tracks=()), "gate: nobody is seen where you are"),
    "the machine's track": (
        lambda one: replace(one, tracks=(track(1, "excavator", WORKER_M),)),
        "gate: nobody is seen where you are",
    ),
    "unwatched ground": (lambda one: replace(one, watched=watched(BLURRED)), "gate: blurred"),
    "hardly any ground": (
        lambda one: replace(one, watched=watched(TOO_DARK, TOO_DARK)),
        "gate: hardly any ground is watched: too dark or too noisy",
    ),
    "not judged": (lambda one: replace(one, watched=WatchedGround()), "gate: outside the picture"),
    "not live": (lambda one: replace(one, is_live=False), "gate: it is not live"),
    "delay": (lambda one: replace(one, delay="unknown"), "gate: it is not known how late the pictures are"),
    "old frame": (lambda one: replace(one, seen_s=NOW_S - 2.1), "gate: no frame is watched"),
    "no map": (lambda one: replace(one, ground=NoGroundMap("too few points")), "gate: too few points"),
    "not placed": (lambda one: replace(one, is_placed=False), "gate: no stream can tell where the site frame lies"),
}


@pytest.mark.parametrize("lack", LACKS)
def test_whatever_is_missing_is_told_and_nobody_is_supervised(lack: str) -> None:
    change, reason = LACKS[lack]
    told = of_wrist(recipients(WRIST, change(sighting()), wrist=at(WORKER_M)))
    assert (told.supervised, told.reason, told.streams) == (False, reason, ())


@given(st.sets(st.sampled_from(sorted(LACKS)), max_size=4))
def test_he_is_supervised_if_nothing_is_missing_and_only_then(lacks: set[str]) -> None:
    one = sighting()
    for lack in sorted(lacks):
        one = LACKS[lack][0](one)
    told = of_wrist(recipients(WRIST, one, wrist=at(WORKER_M)))
    assert told.supervised == (not lacks) == (told.reason == "") == (told.streams == ("gate",))


def test_without_a_position_or_a_stream_nobody_is_supervised() -> None:
    assert of_wrist(recipients(WRIST, sighting())).reason == "your position is not known"
    old = recipients(WRIST, sighting(), wrist=at(WORKER_M, age_ms=5100.0))
    assert of_wrist(old).reason == "your position is not known"
    assert of_wrist(recipients(WRIST, wrist=at(WORKER_M))).reason == "gate: no frame is watched"
    nowhere = of_wrist(recipients(WRIST, streams=(), wrist=at(WORKER_M)))
    assert (nowhere.supervised, nowhere.reason) == (False, "no stream watches")


@pytest.mark.parametrize("place", [(64.1, 10.0), (-0.1, 10.0), (20.0, 36.1), (1e6, 1e6)])
def test_who_stands_outside_the_picture_is_told_so(place: tuple[float, float]) -> None:
    told = of_wrist(recipients(WRIST, sighting(), wrist=at(place)))
    assert (told.supervised, told.reason) == (False, "gate: outside the picture")


def test_ground_is_watched_where_he_stands_and_not_elsewhere() -> None:
    half = sighting(watched=watched(right_half=NO_CONTRAST), tracks=(track(1, "worker", (50.0, 10.0)),))
    assert "no contrast" in of_wrist(recipients(WRIST, half, wrist=at((50.0, 10.0)))).reason
    left = replace(half, tracks=(track(1, "worker", WORKER_M),))
    assert of_wrist(recipients(WRIST, left, wrist=at(WORKER_M))).supervised


def test_a_stream_that_says_why_it_is_not_live_is_believed_before_its_frames_are() -> None:
    made = recipients(WRIST, sighting(), wrist=at(WORKER_M))
    made.take_condition("gate", "the picture stands still")
    assert of_wrist(made).reason == "gate: the picture stands still"
    made.take_condition("gate", "")
    assert of_wrist(made).supervised


def test_one_stream_that_sees_him_is_enough_and_if_none_does_all_reasons_are_told() -> None:
    blind = sighting("crane", is_live=False)
    made = recipients(WRIST, sighting(), blind, streams=("gate", "crane"), wrist=at(WORKER_M))
    assert of_wrist(made) == Supervision("wrist", 7, True, "", ("gate",), 2)
    made.take_condition("gate", "no picture comes")
    assert of_wrist(made).reason == "gate: no picture comes; crane: it is not live"


def test_the_reasons_of_many_streams_still_fit_into_a_message() -> None:
    names = tuple(f"stream-{number}" for number in range(60))
    told = of_wrist(recipients(WRIST, streams=names, wrist=at(WORKER_M)))
    assert not told.supervised and 0 < len(told.reason) <= 500


@given(st.floats(-10.0, 10.0))
def test_time_alone_ends_supervision(later_s: float) -> None:
    made = recipients(WRIST, sighting(), wrist=at(WORKER_M))
    told = of_wrist(made, NOW_S + later_s)
    if later_s > 2.0:
        assert not told.supervised
    if 0.0 <= later_s <= 1.9:
        assert told.supervised


def test_who_is_told_of_everything_is_supervised_while_all_streams_watch() -> None:
    both = (sighting(), sighting("crane"))
    told = of_foreman(*both, streams=("gate", "crane"), everything=True)
    assert (told.supervised, told.streams, told.candidates) == (True, ("crane", "gate"), 0)
    lost = of_foreman(both[0], replace(both[1], is_live=False), streams=("gate", "crane"), everything=True)
    assert (lost.supervised, lost.reason, lost.streams) == (False, "crane: it is not live", ("gate",))


@pytest.mark.parametrize("lack", sorted(set(LACKS) - {"no track", "the machine's track", "not placed", "not judged"}))
def test_who_is_told_of_a_stream_needs_all_that_it_needs_to_warn(lack: str) -> None:
    seen, streams = (LACKS[lack][0](sighting()), sighting("crane")), ("gate", "crane")
    of_gate = recipients({"foreman": {"wearer": "nobody", "streams": ("gate",)}}, *seen, streams=streams)
    told = of_gate.supervision("foreman", 1, NOW_S)
    # Ground that is not watched is told by its share; no worker's place is asked for.
    assert told.supervised == (lack == "unwatched ground")
    assert told.supervised or told.reason.startswith("gate: ")
    of_crane = recipients({"foreman": {"wearer": "nobody", "streams": ("crane",)}}, *seen, streams=streams)
    assert of_crane.supervision("foreman", 1, NOW_S) == Supervision("foreman", 1, True, "", ("crane",))


def test_who_is_told_of_a_zone_is_supervised_while_somebody_watches_nearly_all_of_it() -> None:
    zone = {"zones": ("pit",)}
    full, most, little = (
        sighting(zones=(WatchedZone("pit", s, "blurred" if s < 1 else ""),)) for s in (1.0, 0.9, 0.89)
    )
    assert of_foreman(full, **zone).supervised and of_foreman(most, **zone).supervised
    assert of_foreman(little, **zone).reason == "pit: blurred"
    assert of_foreman(sighting(), **zone).reason == "pit: no stream watches"
    assert of_foreman(replace(full, is_live=False), **zone).reason == "pit: no stream watches"
    crane = replace(full, stream="crane")
    together = of_foreman(little, crane, streams=("gate", "crane"), **zone)
    assert together.supervised and "crane" in together.streams
    both = of_foreman(full, zones=("pit", "yard"))
    assert (both.supervised, both.reason) == (False, "yard: no stream watches")


def test_a_stream_whose_ground_nobody_judges_is_not_held_against_it() -> None:
    assert math.isnan(WatchedGround().share)
    assert of_foreman(sighting(watched=WatchedGround()), everything=True).supervised
    assert not of_foreman(everything=True).supervised
    assert of_foreman(sighting(ground=ground(frame_stated=False), is_placed=False), everything=True).supervised
