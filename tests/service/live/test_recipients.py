"""Who is warned: whoever may be the one in danger, whoever asked for the place, and nobody else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from service.live.made_news import hazard
from service.live.made_sightings import (
    EXCAVATOR_M,
    NOW_S,
    WORKER_M,
    at,
    recipients,
    sighting,
    track,
)

from standoff.core.geographic import GeographicOrigin
from standoff.messages import DevicePosition, HazardNews
from standoff.service.live.recipients import Recipients

WORKER: dict[str, Any] = {"wearer": "worker"}
MACHINE: dict[str, Any] = {"wearer": "machine"}
ORIGIN = GeographicOrigin(8.5, 50.1, 50.1)


def told(made: Recipients, of: HazardNews | None = None) -> dict[str, str]:
    found = made.told_of(hazard() if of is None else of)
    assert len({one.device for one in found}) == len(found)
    return {one.device: one.because for one in found}


def test_each_device_is_told_for_its_own_reason() -> None:
    receivers = {
        "worker": WORKER,
        "operator": MACHINE,
        "passer": WORKER,
        "far": WORKER,
        "lost": WORKER,
        "zone": {"wearer": "nobody", "zones": ("pit",)},
        "stream": {"wearer": "nobody", "streams": ("gate",)},
        "other": {"wearer": "nobody", "streams": ("crane",)},
        "all": {"wearer": "nobody", "everything": True},
    }
    places = {"worker": at(WORKER_M), "operator": at(EXCAVATOR_M), "passer": at((20.0, 16.0)), "far": at((50.0, 30.0))}
    made = recipients(receivers, sighting(), streams=("gate", "crane"), origins=None, **places)
    always = {"worker": "position", "operator": "position", "passer": "near", "stream": "stream", "all": "everything"}
    assert told(made) == always
    assert told(made, hazard(zone="pit", rule="zone")) == always | {"zone": "zone"}
    assert told(made, hazard(track_ids=(7,))) == {"stream": "stream", "all": "everything"}
    assert told(made, hazard(stream="crane")) == {"other": "stream", "all": "everything"}
    assert told(made, hazard(session="s-0")) == {"stream": "stream", "all": "everything"}


def test_a_worker_is_no_machine_and_a_machine_no_worker() -> None:
    made = recipients({"a": WORKER, "b": MACHINE}, sighting(), a=at(EXCAVATOR_M), b=at(WORKER_M))
    assert told(made) == {"a": "near", "b": "near"}


def test_who_may_be_one_of_several_is_told_for_each_of_them() -> None:
    crowd = (track(1, "worker", (20.0, 10.0)), track(3, "worker", (20.8, 10.0)), track(4, "worker", (28.0, 10.0)))
    made = recipients({"wrist": WORKER}, sighting(tracks=crowd), wrist=at((20.4, 10.0), 0.5))
    assert made.supervision("wrist", 1, NOW_S).candidates == 2
    assert told(made, hazard(track_ids=(1, 2))) == told(made, hazard(track_ids=(3,))) == {"wrist": "position"}
    assert told(made, hazard(track_ids=(4,))) == {}


def test_two_streams_that_see_him_both_warn_him() -> None:
    other = sighting("crane", session="s-9", tracks=(track(5, "worker", WORKER_M),))
    made = recipients({"wrist": WORKER}, sighting(), other, streams=("gate", "crane"), wrist=at(WORKER_M))
    assert told(made) == {"wrist": "position"}
    assert told(made, hazard(stream="crane", session="s-9", track_ids=(5, 6))) == {"wrist": "position"}
    assert made.supervision("wrist", 1, NOW_S).streams == ("crane", "gate")


@given(st.floats(0.05, 3.0), st.floats(0.05, 3.0), st.floats(0.0, 6.28), st.floats(0.0, 1.0))
def test_he_is_taken_for_a_track_within_three_standard_errors_of_both_places(
    sigma_m: float, track_sigma_m: float, angle: float, share: float
) -> None:
    spread_m = float(np.hypot(np.hypot(sigma_m, 0.3), track_sigma_m))
    place = (20.0, 10.0)
    one = sighting(tracks=(track(1, "worker", place, track_sigma_m),), captured_s=NOW_S)
    for apart_m, is_his in ((share * 3.0 * spread_m, True), (3.1 * spread_m + share * 5.0, False)):
        moved = (place[0] + apart_m * float(np.cos(angle)), place[1] + apart_m * float(np.sin(angle)))
        made = recipients({"wrist": WORKER}, one, wrist=at(moved, sigma_m))
        assert (made.supervision("wrist", 1, NOW_S).candidates == 1) == is_his


def test_whom_he_was_taken_for_he_is_longer_than_he_is_newly_taken_for_somebody() -> None:
    made = recipients({"wrist": WORKER}, sighting(), wrist=at(WORKER_M))
    apart = (WORKER_M[0] + 0.519 * 3.5, WORKER_M[1])
    made.take_position("wrist", at(apart), NOW_S)
    made.match(NOW_S)
    assert told(made) == {"wrist": "position"}
    newly = recipients({"wrist": WORKER}, sighting(), wrist=at(apart))
    assert told(newly) == {"wrist": "near"}


def test_the_longer_ago_his_position_the_further_he_may_have_gone() -> None:
    apart = (WORKER_M[0] + 4.0, WORKER_M[1])
    fresh = recipients({"wrist": WORKER}, sighting(), wrist=at(apart, age_ms=0.0))
    older = recipients({"wrist": WORKER}, sighting(), wrist=at(apart, age_ms=2500.0))
    assert (told(fresh), told(older)) == ({"wrist": "near"}, {"wrist": "position"})


def test_a_position_that_is_too_old_is_none() -> None:
    for age_ms, reached in ((4900.0, {"wrist": "position"}), (5100.0, {})):
        made = recipients({"wrist": WORKER}, sighting(), wrist=at(WORKER_M, age_ms=age_ms))
        assert told(made) == reached
    made = recipients({"wrist": WORKER}, sighting(), wrist=at(WORKER_M))
    late = sighting(seen_s=NOW_S + 6.0, captured_s=NOW_S + 5.9)
    made.take_sighting(late)
    made.match(NOW_S + 6.0)
    assert told(made) == {}


def test_a_frame_that_is_too_old_tells_nothing_of_now() -> None:
    made = recipients({"wrist": WORKER}, sighting(seen_s=NOW_S - 2.1), wrist=at(WORKER_M))
    assert told(made) == {"wrist": "near"}


def test_a_satellite_position_is_placed_by_the_survey_of_each_stream() -> None:
    (longitude_deg, latitude_deg) = ORIGIN.to_lonlat(np.array([WORKER_M]))[0].tolist()
    place = DevicePosition(1.5, longitude_deg=longitude_deg, latitude_deg=latitude_deg)
    made = recipients({"wrist": WORKER}, sighting(), origins={"gate": ORIGIN}, wrist=place)
    assert told(made) == {"wrist": "position"}
    assert told(recipients({"wrist": WORKER}, sighting(), origins={"gate": None}, wrist=place)) == {}
    assert told(recipients({"wrist": WORKER}, sighting(), origins={}, wrist=place)) == {}


def test_places_of_devices_are_not_sought_in_a_map_that_nobody_placed() -> None:
    made = recipients({"wrist": WORKER}, sighting(is_placed=False), wrist=at(WORKER_M))
    assert made.supervision("wrist", 1, NOW_S).candidates == 0
    assert told(made) == {"wrist": "near"}


def test_near_is_near_one_of_the_hazards_tracks_by_what_his_position_allows() -> None:
    for apart_m, sigma_m, reached in ((7.9, 0.3, True), (9.5, 0.3, False), (9.5, 0.6, True)):
        made = recipients({"wrist": WORKER}, sighting(), wrist=at((WORKER_M[0] - apart_m, WORKER_M[1]), sigma_m))
        assert told(made) == ({"wrist": "near"} if reached else {})


def test_whoever_may_be_the_one_suspected_within_a_machines_reach_is_told() -> None:
    for apart_m, reached in ((14.0, True), (16.0, False)):
        place = at((EXCAVATOR_M[0], EXCAVATOR_M[1] + apart_m))
        made = recipients({"wrist": WORKER}, sighting(), wrist=place)
        machine = next(one for one in sighting().tracks if one.kind == "excavator")
        alone = hazard(track_ids=(machine.track_id,), classes=("excavator",), severity="unknown")
        assert told(made, alone) == ({"wrist": "near"} if reached else {})
        assert told(made) == {}


def test_who_has_a_track_of_his_own_is_not_told_of_those_near_him() -> None:
    own = replace(sighting(), tracks=(*sighting().tracks, track(3, "worker", (20.0, 16.0))))
    made = recipients({"wrist": WORKER}, own, wrist=at((20.0, 16.0)))
    assert told(made) == {}
    assert told(made, hazard(track_ids=(2, 3))) == {"wrist": "position"}


def test_what_is_known_outlives_a_change_of_settings() -> None:
    before = recipients({"wrist": WORKER, "gone": WORKER}, sighting(), wrist=at(WORKER_M), gone=at(WORKER_M))
    before.take_condition("gate", "")
    after = recipients({"wrist": WORKER, "new": WORKER})
    after.inherit(before)
    after.match(NOW_S)
    assert told(after) == {"wrist": "position"}
    assert after.devices == ("wrist", "new")
    elsewhere = recipients({"wrist": WORKER}, streams=("crane",))
    elsewhere.inherit(before)
    elsewhere.match(NOW_S)
    assert told(elsewhere) == {}


def test_a_device_that_nobody_knows_is_not_listened_to() -> None:
    made = recipients({"wrist": WORKER}, sighting())
    assert not made.take_position("other", at(WORKER_M), NOW_S)
    made.match(NOW_S)
    assert told(made) == {}
