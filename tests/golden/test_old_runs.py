"""Runs that earlier versions of standoff made are still read, with the numbers that they had.

In both a worker walks towards an excavator, and frame 20 shows nothing. `before_probability` was made at d0c1d73:
hazards went by distance, nobody judged which ground is watched. `before_whole_maps` was made at 918b2ca: frames held no
error of their map, and detections did not say who tells the time. Paths and the platform's name were shortened in
`run.json`. They are never made anew.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from standoff.clips import RunFolder, read_detections
from standoff.config import recorded_settings
from standoff.core.errors import ConfigError, DataError

HERE = Path(__file__).parent
RADII_M = 1.0 + 3.0
FRAMES, EMPTY = 34, 20


@pytest.fixture(params=["before_probability", "before_whole_maps"])
def old(request: pytest.FixtureRequest) -> RunFolder:
    return RunFolder(HERE / str(request.param))


def test_its_record_says_how_it_ended(old: RunFolder) -> None:
    record = old.record()
    assert record["status"] == "complete"
    assert record["counts"]["frames"] == FRAMES


def test_its_tables_hold_the_distances_that_were_measured(old: RunFolder) -> None:
    pairs = old.table("proximity", ("frame", "distance_m", "gap_m", "sigma_m", "measured"))
    assert pairs["measured"].all()
    np.testing.assert_allclose(pairs["distance_m"] - pairs["gap_m"], RADII_M)
    assert (np.diff(pairs["distance_m"]) < 0).mean() > 0.9  # He walks towards it.
    tracks = old.tracks(("frame", "class", "x_m", "y_m"))
    assert set(tracks["class"]) == {"worker", "excavator"}
    np.testing.assert_array_equal(np.unique(tracks["frame"]), np.arange(FRAMES))


def test_its_hazards_live_from_their_opening_to_their_close(old: RunFolder) -> None:
    events = [event for said in old.hazards().values() for event in said]
    assert len({event.hazard_id for event in events}) == 1
    assert [event.phase for event in events] == ["opened", *["updated"] * (len(events) - 2), "closed"]
    assert all(np.isclose(event.distance_m - event.gap_m, RADII_M) for event in events)


def test_probabilities_that_nobody_computed_are_unknown() -> None:
    events = RunFolder(HERE / "before_probability").hazards()
    assert all(np.isnan([event.breach_now, event.breach_ahead]).all() for said in events.values() for event in said)


def test_its_detections_can_be_replayed(old: RunFolder) -> None:
    recorded = read_detections(old.folder)
    assert recorded.size_px == (320, 240)
    assert recorded.detected.all()
    counts = [len(recorded.detections_at(row)) for row in range(FRAMES)]
    assert counts == [2] * EMPTY + [0] + [2] * (FRAMES - EMPTY - 1)


def test_what_it_never_wrote_is_asked_for_by_name(old: RunFolder) -> None:
    with pytest.raises(DataError, match="without map_covariance"):
        old.table("frames", ("frame", "map_covariance"))


def test_its_settings_are_read_or_refused_by_name() -> None:
    before, later = (RunFolder(HERE / name).record() for name in ("before_probability", "before_whole_maps"))
    assert recorded_settings(later, "run").locate.radius_m["worker"] == 1.0
    with pytest.raises(ConfigError, match=r"no setting 'start_s'; did you mean source\.start_s"):
        recorded_settings(before, "run")
