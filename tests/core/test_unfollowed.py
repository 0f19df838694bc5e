from __future__ import annotations

import numpy as np
import pytest

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.types import Detections, Tracks
from standoff.core.unfollowed import are_many, unfollowed

BOX = (100.0, 100.0, 130.0, 180.0)


def tracks_on(box: tuple[float, float, float, float], name: str = "worker") -> Tracks:
    return Tracks(
        track_id=np.array([1]),
        xyxy_px=np.array([box]),
        score=np.array([0.9]),
        class_id=np.array([CLASS_BY_NAME[name].id]),
        observed=np.array([True]),
        age_s=np.zeros(1),
    )


def detected(name: str = "worker", score: float = 0.9) -> Detections:
    return Detections(np.array([BOX]), np.array([score]), np.array([CLASS_BY_NAME[name].id]))


@pytest.mark.parametrize(
    ("detections", "tracks", "expected"),
    [
        (detected(), tracks_on(BOX), [False]),
        (detected(), tracks_on((104.0, 96.0, 136.0, 181.0)), [False]),
        (detected(), tracks_on((160.0, 100.0, 190.0, 180.0)), [True]),
        (detected(), tracks_on(BOX, "excavator"), [True]),
        (detected("dump_truck"), tracks_on(BOX, "excavator"), [False]),
        (detected(), Tracks.empty(), [True]),
        (detected(score=0.59), Tracks.empty(), []),
        (detected("reference"), Tracks.empty(), []),
        (Detections.empty(), tracks_on(BOX), []),
    ],
)
def test_a_sure_person_or_machine_in_no_track_of_its_kind_is_unfollowed(
    detections: Detections, tracks: Tracks, expected: list[bool]
) -> None:
    assert unfollowed(detections, tracks).tolist() == expected


def test_what_clutter_leaves_behind_is_not_many() -> None:
    assert not are_many(0, 0)
    assert not are_many(3, 3)
    assert not are_many(250, 1000)
    assert are_many(4, 4)
    assert are_many(251, 1000)
