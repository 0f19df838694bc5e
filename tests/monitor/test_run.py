from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from standoff.core import protocols
from standoff.core.errors import SourceError, SourceTruncated
from standoff.core.types import (
    CameraMotion,
    Detections,
    Frame,
    GroundMap,
    NoCameraMotion,
    NoGroundMap,
)
from standoff.monitor import Monitor, Run
from standoff.stages.frames import frame_from_array, open_source
from standoff.stages.ground import Unmapped
from standoff.stages.hazard import HazardMonitor
from standoff.stages.locate import Locator
from standoff.stages.motion import MotionEstimator
from standoff.stages.proximity import ProximityMeter
from standoff.stages.track import Tracker
from standoff.stages.watched import GroundWatcher
from standoff.testing import DrawnFilm, MemorySink


class TwoWalkers(protocols.Detector):
    """A detector that sees a worker and an excavator, always at the same places."""

    def __init__(self) -> None:
        self.calls = 0

    def detect(self, frame: Frame) -> Detections:
        self.calls += 1
        return Detections(
            np.array([[20.0, 20.0, 30.0, 50.0], [60.0, 20.0, 90.0, 50.0]]), np.array([0.9, 0.9]), np.array([0, 1])
        )


class MetreGround(protocols.Ground):
    """Ten pixels are a metre, everywhere."""

    def update(
        self, frame: Frame, detections: Detections, motion: CameraMotion | NoCameraMotion
    ) -> GroundMap | NoGroundMap:
        matrix = np.diag([0.1, 0.1, 1.0])
        return GroundMap(matrix, np.zeros((9, 9)), frame.size_px, "test", 0.1)


class Film(DrawnFilm):
    """Black pictures, ten a second, of which the film says that they are dark; it can break."""

    def __init__(self, count: int, broken_after: int | None = None) -> None:
        broken = SourceTruncated(expected="10 frames", found=str(broken_after), fix="copy the file again")
        black = np.zeros((100, 120, 3), np.uint8)
        super().__init__([black] * count, fails_after=broken_after, error=broken)

    def describe(self) -> Mapping[str, Any]:
        return {**super().describe(), "warnings": ["dark"]}


def monitor(*, detect_every: int = 1, mapped: bool = True) -> Monitor:
    return Monitor(
        detector=TwoWalkers(),
        motion=MotionEstimator(),
        ground=MetreGround() if mapped else Unmapped(),
        tracker=Tracker(),
        locator=Locator(),
        watcher=GroundWatcher(),
        proximity=ProximityMeter(),
        hazard=HazardMonitor(),
        detect_every=detect_every,
    )


def run_of(
    count: int, *sinks: MemorySink, broken_after: int | None = None, detect_every: int = 1, mapped: bool = True
) -> Run:
    named = {f"sink{number}": sink for number, sink in enumerate(sinks)}
    return Run(Film(count, broken_after), monitor(detect_every=detect_every, mapped=mapped), named)


def test_a_pair_is_measured_in_metres_from_foot_to_foot() -> None:
    results = list(run_of(10))
    distances = results[-1].proximities.distance_m
    assert distances == pytest.approx([5.0])


def test_every_frame_reaches_every_sink_with_the_time_of_each_stage() -> None:
    memory = MemorySink()
    results = list(run_of(5, memory))
    assert (
        [result.frame.index for result in memory.results] == [result.frame.index for result in results] == [*range(5)]
    )
    stages = {"frames", "detect", "motion", "ground", "track", "locate", "watched"}
    stages |= {"proximity", "hazard", "sinks.sink0"}
    assert set(results[0].stage_ms) == stages
    assert memory.outcomes[0].status == "complete"


def test_tracks_coast_and_say_so_while_the_detector_rests() -> None:
    monitored = run_of(9, detect_every=3)
    results = list(monitored)
    assert isinstance(monitored.monitor.detector, TwoWalkers)
    assert monitored.monitor.detector.calls == 3
    assert [result.detected for result in results] == [True, False, False] * 3
    for result in results[3:]:
        assert len(result.tracks) == 2
        assert (result.tracks.observed == result.detected).all()


@pytest.mark.parametrize(("near_m", "calls"), [(None, 3), (-20.0, 3), (0.0, 9)])
def test_a_pair_that_is_near_is_looked_at_in_every_frame(near_m: float | None, calls: int) -> None:
    monitored = run_of(9, detect_every=3)
    monitored.monitor.detect_near_m = near_m
    results = list(monitored)
    assert isinstance(monitored.monitor.detector, TwoWalkers)
    assert np.isfinite(results[-1].proximities.gap_m).all()
    assert monitored.monitor.detector.calls == calls


def test_a_pair_that_is_not_measured_is_looked_at_in_every_frame() -> None:
    monitored = run_of(9, detect_every=3, mapped=False)
    monitored.monitor.detect_near_m = 1.0
    assert [result.detected for result in monitored] == [True] * 9


class Weary(TwoWalkers):
    """A detector that rests on every other frame, of its own accord."""

    def rests(self, frame: Frame) -> bool:
        return frame.index % 2 == 1


def test_tracks_coast_where_the_detector_itself_rests() -> None:
    monitored = run_of(9)
    monitored.monitor.detector = Weary()
    results = list(monitored)
    assert [result.detected for result in results] == [frame % 2 == 0 for frame in range(9)]
    assert monitored.monitor.detector.calls == 5
    assert not any(result.tracks.observed.any() for result in results[1::2])


def test_without_a_map_every_pair_is_there_and_none_is_measured() -> None:
    results = list(run_of(10, mapped=False))
    assert len(results[-1].proximities) == 1
    assert np.isnan(results[-1].proximities.distance_m).all()
    unknown = [event for result in results for event in result.hazards]
    assert unknown and {event.severity for event in unknown} == {"unknown"}


def test_a_sink_that_fails_is_left_out_and_the_others_go_on() -> None:
    broken, healthy = MemorySink(fails_at=2), MemorySink()
    monitored = run_of(6, broken, healthy)
    assert len(list(monitored)) == 6
    assert len(healthy.results) == 6
    assert len(broken.results) == 2
    assert "no space left" in healthy.outcomes[0].sink_errors["sink0"]
    assert len(broken.outcomes) == 1


def test_a_source_that_breaks_closes_the_sinks_as_failed_and_keeps_what_was_done() -> None:
    memory = MemorySink()
    with pytest.raises(SourceTruncated):
        list(run_of(10, memory, broken_after=4))
    assert len(memory.results) == 4
    assert memory.outcomes[0].status == "failed"
    assert "expected 10 frames, found 4" in memory.outcomes[0].message


def test_stopping_early_closes_the_sinks_as_interrupted() -> None:
    memory = MemorySink()
    results = iter(run_of(10, memory))
    next(results)
    results.close()
    assert memory.outcomes[0].status == "interrupted"


def test_hazards_still_open_at_the_end_are_closed_in_the_outcome() -> None:
    memory = MemorySink()
    opened = {event.hazard_id for result in run_of(30, memory) for event in result.hazards}
    closed = {event.hazard_id for event in memory.outcomes[0].hazards if event.phase == "closed"}
    assert opened and closed == opened


def test_what_the_source_says_at_the_end_is_what_the_sinks_hear() -> None:
    memory = MemorySink()
    ran = run_of(7, memory)
    assert len(list(ran)) == 7
    (outcome,) = memory.outcomes
    assert outcome.about["source"]["shown"] == 7
    assert outcome.about["warnings"][0] == "dark"
    assert outcome.counts.rows["frames"] == 7
    assert isinstance(ran.source, Film) and ran.source.is_closed


def test_what_is_open_is_in_every_result() -> None:
    open_ids: set[str] = set()
    for result in run_of(30):
        open_ids |= {event.hazard_id for event in result.hazards}
        assert {event.hazard_id for event in result.open_hazards.latest} == open_ids
    assert open_ids


def test_hazards_of_a_stream_that_was_lost_become_unknown_and_are_not_closed() -> None:
    memory = MemorySink()
    with pytest.raises(SourceTruncated):
        list(run_of(30, memory, broken_after=20))
    opened = {event.hazard_id for result in memory.results for event in result.hazards}
    last = {event.hazard_id: event.phase for event in memory.outcomes[0].hazards}
    assert opened and last == dict.fromkeys(opened, "unknown")
    assert {event.reason for event in memory.outcomes[0].hazards} == {memory.outcomes[0].message}


def test_a_camera_that_is_silent_makes_everything_unknown_within_a_second() -> None:
    watched = monitor()
    for frame in Film(20).frames():
        result = watched.step(frame)
    (pair,) = result.open_hazards.by_pair().values()
    assert pair.phase != "unknown"
    told = [watched.tick(2.0 + step / 10, "no picture arrives") for step in range(11)]
    assert told[-1].open_hazards.by_pair()[pair.track_ids[0], pair.track_ids[1]].phase == "unknown"
    (of_stream,) = told[-1].open_hazards.of_stream()
    assert of_stream.reason == "no picture arrives"
    assert watched.counts.rows["frames"] == 20
    again = watched.step(frame_from_array(np.zeros((100, 120, 3), np.uint8), index=20, time_s=3.2))
    assert again.ground and len(again.tracks)


def test_a_camera_that_never_told_anything_is_unknown_too() -> None:
    silence = monitor().tick(5.0, "no picture arrives", "gate")
    assert (silence.stream_id, [event.rule for event in silence.hazards]) == ("gate", ["measurement"])


@pytest.mark.parametrize("detect_every", [1, 3])
@pytest.mark.parametrize("near_m", [None, 0.0])
def test_overlapping_changes_nothing_but_the_time_it_takes(detect_every: int, near_m: float | None) -> None:
    kept = []
    for overlaps in (False, True):
        memory, watched = MemorySink(), monitor(detect_every=detect_every)
        watched.detect_near_m = near_m
        yielded = list(Run(Film(25), watched, {"memory": memory}, overlaps=overlaps))
        assert [result.frame.index for result in yielded] == [result.frame.index for result in memory.results]
        kept.append(memory)
    for one, other in zip(kept[0].results, kept[1].results, strict=True):
        assert (one.frame.index, one.detected, len(one.hazards)) == (
            other.frame.index,
            other.detected,
            len(other.hazards),
        )
        for part in ("tracks", "positions", "proximities"):
            for column, values in getattr(one, part).columns().items():
                np.testing.assert_array_equal(values, getattr(other, part).columns()[column], err_msg=column)
    assert [one.outcomes[0].status for one in kept] == ["complete"] * 2


def test_what_breaks_ahead_is_told_in_its_turn() -> None:
    memory = MemorySink()
    film = Film(10, broken_after=4)
    with pytest.raises(SourceTruncated):
        list(Run(film, monitor(), {"memory": memory}, overlaps=True))
    assert [result.frame.index for result in memory.results] == [0, 1, 2, 3]
    assert (memory.outcomes[0].status, film.is_closed) == ("failed", True)


def test_a_run_that_is_stopped_while_it_looks_ahead_writes_what_it_began_and_ends() -> None:
    memory, film = MemorySink(), Film(1000)
    results = iter(Run(film, monitor(), {"memory": memory}, overlaps=True))
    for _ in range(3):
        last = next(results)
    results.close()
    assert memory.outcomes[0].status == "interrupted" and film.is_closed
    written = [result.frame.index for result in memory.results]
    assert written == [*range(len(written))] and last.frame.index < len(written) <= last.frame.index + 2
    assert film.shown < 10


@pytest.mark.parametrize("overlaps", [False, True])
def test_a_source_that_cannot_be_opened_fails_the_run_and_every_sink_hears_of_it(
    overlaps: bool, tmp_path: Path
) -> None:
    memory = MemorySink()
    run = Run(open_source(tmp_path / "away.mp4"), monitor(), {"memory": memory}, overlaps=overlaps)
    with pytest.raises(SourceError, match="found nothing at"):
        list(run)
    (outcome,) = memory.outcomes
    assert (outcome.status, memory.results) == ("failed", []) and "away.mp4" in outcome.message
