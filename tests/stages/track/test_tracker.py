from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, NoCameraMotion, NoGroundMap, Tracks
from standoff.stages.track import Tracker, TrackParams

STILL = NoCameraMotion("not estimated")
UNMAPPED = NoGroundMap("not looked for")

WORKER = CLASS_BY_NAME["worker"].id
EXCAVATOR = CLASS_BY_NAME["excavator"].id
WHEEL_LOADER = CLASS_BY_NAME["wheel_loader"].id
REFERENCE = CLASS_BY_NAME["reference"].id


def see(*boxes: tuple[float, float, float, float], score: float = 0.9, class_id: int = WORKER) -> Detections:
    """Detections of one class and score."""
    count = len(boxes)
    return Detections(np.array(boxes), np.full(count, score), np.full(count, class_id))


def together(*parts: Detections) -> Detections:
    return Detections(
        np.concatenate([part.xyxy_px for part in parts]),
        np.concatenate([part.score for part in parts]),
        np.concatenate([part.class_id for part in parts]),
    )


def person(left: float, top: float = 100.0) -> tuple[float, float, float, float]:
    return left, top, left + 30.0, top + 75.0


def centres(tracks: Tracks) -> FloatArray:
    middle: FloatArray = (tracks.xyxy_px[:, :2] + tracks.xyxy_px[:, 2:]) / 2.0
    return middle


def test_the_first_frame_is_reported_at_once() -> None:
    tracks = Tracker().update(0.0, see(person(10), person(200)), STILL, UNMAPPED)
    assert len(tracks) == 2
    assert tracks.observed.all()
    assert (tracks.age_s == 0).all()


def test_a_later_arrival_is_reported_on_its_second_detection() -> None:
    tracker = Tracker()
    tracker.update(0.0, see(person(10)), STILL, UNMAPPED)
    assert len(tracker.update(0.1, see(person(10), person(200)), STILL, UNMAPPED)) == 1
    tracks = tracker.update(0.2, see(person(10), person(202)), STILL, UNMAPPED)
    assert len(tracks) == 2
    assert tracks.age_s == pytest.approx([0.2, 0.1])


def test_clutter_seen_once_is_never_reported() -> None:
    tracker = Tracker()
    tracker.update(0.0, see(person(10)), STILL, UNMAPPED)
    tracker.update(0.1, see(person(10), person(200)), STILL, UNMAPPED)
    tracker.update(0.2, see(person(10)), STILL, UNMAPPED)
    assert len(tracker.update(0.3, see(person(10), person(200)), STILL, UNMAPPED)) == 1


def test_an_unsure_detection_starts_nothing() -> None:
    tracker = Tracker()
    assert len(tracker.update(0.0, see(person(10), score=0.5), STILL, UNMAPPED)) == 0
    assert len(tracker.update(0.1, see(person(10), score=0.5), STILL, UNMAPPED)) == 0


def test_a_missed_track_coasts_marked_then_is_silent_then_ends() -> None:
    def misses(count: int) -> tuple[Tracker, list[int]]:
        tracker = Tracker(TrackParams(max_coast_s=0.5, max_lost_s=1.0))
        tracker.update(0.0, see(person(10)), STILL, UNMAPPED)
        missed = [tracker.update(index / 10, Detections.empty(), STILL, UNMAPPED) for index in range(1, count + 1)]
        assert not any(tracks.observed.any() for tracks in missed)
        return tracker, [len(tracks) for tracks in missed]

    tracker, reported = misses(9)
    assert reported == [1] * 5 + [0] * 4
    assert tracker.update(1.0, see(person(10)), STILL, UNMAPPED).track_id.tolist() == [1]
    tracker, _ = misses(11)
    tracker.update(1.2, see(person(10)), STILL, UNMAPPED)
    assert tracker.update(1.3, see(person(10)), STILL, UNMAPPED).track_id.tolist() == [2]


def test_a_track_is_kept_as_long_as_it_may_coast() -> None:
    tracker = Tracker(TrackParams(max_coast_s=3.0, max_lost_s=1.0))
    tracker.update(0.0, see(person(10)), STILL, UNMAPPED)
    assert len(tracker.update(2.0, Detections.empty(), STILL, UNMAPPED)) == 1


def test_a_coasting_box_moves_on_at_the_velocity_seen() -> None:
    tracker = Tracker()
    for index in range(30):
        tracks = tracker.update(index / 10, see(person(10 + 3 * index)), STILL, UNMAPPED)
    before = centres(tracks)
    assert centres(tracker.coast(3.4, STILL)) - before == pytest.approx(np.array([[15.0, 0.0]]), abs=0.1)


def test_a_rest_of_the_detector_is_not_a_miss() -> None:
    tracker = Tracker(TrackParams(max_coast_s=0.5, max_lost_s=0.5))
    tracker.update(0.0, see(person(10), person(200)), STILL, UNMAPPED)
    for index in range(1, 20):
        tracks = tracker.coast(index / 10, STILL)
        assert tracks.track_id.tolist() == [1, 2]
        assert not tracks.observed.any()
    tracks = tracker.update(2.0, see(person(11)), STILL, UNMAPPED)
    assert tracks.track_id.tolist() == [1]
    assert tracks.observed.all()


@examples(12)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(-40.0, 40.0),
    st.sampled_from([0.0, 0.3]),
    st.integers(2, 4),
)
def test_speed_does_not_change_when_frames_are_dropped(seed: int, speed_px_s: float, jitter: float, every: int) -> None:
    rng = np.random.default_rng(seed)
    times_s = np.arange(121) / 20 + rng.uniform(0.0, jitter / 20, 121)

    def learned_speed_px_s(chosen_s: FloatArray) -> float:
        tracker = Tracker()
        for time_s in chosen_s:
            tracks = tracker.update(time_s, see(person(500.0 + speed_px_s * time_s)), STILL, UNMAPPED)
        assert tracks.track_id.tolist() == [1]
        moved = centres(tracker.coast(chosen_s[-1] + 0.5, STILL)) - centres(tracks)
        return float(moved[0, 0] / 0.5)

    assert learned_speed_px_s(times_s) == pytest.approx(speed_px_s, abs=0.2)
    assert learned_speed_px_s(times_s[::every]) == pytest.approx(speed_px_s, abs=0.2)


def test_ids_are_never_used_again_not_even_after_a_reset() -> None:
    tracker = Tracker(TrackParams(max_coast_s=0.0, max_lost_s=0.0))
    seen: list[int] = []
    for stream in range(3):
        for index in range(6):
            left = 10.0 if index % 2 else 400.0
            seen += tracker.update(index / 10, see(person(left + 20 * stream)), STILL, UNMAPPED).track_id.tolist()
        tracker.reset()
    assert len(seen) == len(set(seen)) == 3
    assert seen == sorted(seen)


def test_a_reset_stream_begins_like_a_new_one() -> None:
    tracker = Tracker()
    tracker.update(5.0, see(person(10)), STILL, UNMAPPED)
    tracker.reset()
    assert tracker.update(0.0, see(person(10)), STILL, UNMAPPED).track_id.tolist() == [2]


def test_streams_do_not_know_each_other() -> None:
    alone, beside, other = Tracker(), Tracker(), Tracker()
    for index in range(10):
        boxes = see(person(10 + index), person(300 - 2 * index))
        other.update(index / 10, see(person(50 * index)), STILL, UNMAPPED)
        if index == 5:
            other.reset()
        expected, found = (
            alone.update(index / 10, boxes, STILL, UNMAPPED),
            beside.update(index / 10, boxes, STILL, UNMAPPED),
        )
        assert np.array_equal(expected.track_id, found.track_id)
        assert np.array_equal(expected.xyxy_px, found.xyxy_px)


@examples(30)
@given(st.permutations(range(5)))
def test_the_order_of_detections_does_not_matter(order: list[int]) -> None:
    boxes = Detections(
        np.array([person(70.0 * k) for k in range(5)]), np.array([0.95, 0.9, 0.8, 0.7, 0.3]), np.zeros(5, np.int64)
    )
    sorted_tracker, shuffled_tracker = Tracker(), Tracker()
    for index in range(3):
        expected = sorted_tracker.update(index / 10, boxes, STILL, UNMAPPED)
        found = shuffled_tracker.update(index / 10, boxes[np.array(order)], STILL, UNMAPPED)
        assert np.array_equal(expected.track_id, found.track_id)
        assert np.array_equal(expected.xyxy_px, found.xyxy_px)


def test_flicker_between_machine_classes_does_not_end_a_track() -> None:
    tracker = Tracker()
    box = (100.0, 100.0, 220.0, 190.0)
    for index, (class_id, score) in enumerate(
        [(EXCAVATOR, 0.9), (EXCAVATOR, 0.8), (WHEEL_LOADER, 0.95), (EXCAVATOR, 0.7), (WHEEL_LOADER, 0.6)]
    ):
        tracks = tracker.update(index / 10, see(box, score=score, class_id=class_id), STILL, UNMAPPED)
        assert tracks.track_id.tolist() == [1]
        assert tracks.class_id.tolist() == [EXCAVATOR]


def test_a_wrong_first_class_is_outvoted() -> None:
    tracker = Tracker()
    box = (100.0, 100.0, 220.0, 190.0)
    tracker.update(0.0, see(box, class_id=EXCAVATOR), STILL, UNMAPPED)
    tracker.update(0.1, see(box, class_id=WHEEL_LOADER), STILL, UNMAPPED)
    assert tracker.update(0.2, see(box, class_id=WHEEL_LOADER), STILL, UNMAPPED).class_id.tolist() == [WHEEL_LOADER]


def test_one_machine_under_two_classes_is_one_track() -> None:
    tracker = Tracker()
    for index in range(3):
        tracks = tracker.update(
            index / 10,
            together(
                see((100, 100, 220, 190), class_id=EXCAVATOR),
                see((102, 101, 221, 188), class_id=WHEEL_LOADER, score=0.8),
            ),
            STILL,
            UNMAPPED,
        )
        assert tracks.track_id.tolist() == [1]
        assert tracks.class_id.tolist() == [EXCAVATOR]


def test_two_workers_almost_in_one_place_are_two_tracks() -> None:
    assert len(Tracker().update(0.0, see((10, 10, 40, 85), (12, 11, 42, 86)), STILL, UNMAPPED)) == 2


def test_the_same_class_is_preferred_between_two_machines() -> None:
    tracker = Tracker()
    first, second = (100.0, 100.0, 220.0, 190.0), (160.0, 100.0, 280.0, 190.0)
    tracker.update(
        0.0, together(see(first, class_id=EXCAVATOR), see(second, class_id=WHEEL_LOADER, score=0.8)), STILL, UNMAPPED
    )
    between = (130.0, 100.0, 250.0, 190.0)
    tracks = tracker.update(0.1, see(between, class_id=WHEEL_LOADER), STILL, UNMAPPED)
    assert tracks.observed.tolist() == [False, True]


def test_a_worker_never_continues_a_machine() -> None:
    tracker = Tracker()
    box = (100.0, 100.0, 160.0, 200.0)
    tracker.update(0.0, see(box, class_id=EXCAVATOR), STILL, UNMAPPED)
    tracker.update(0.1, see(box, class_id=WORKER), STILL, UNMAPPED)
    tracks = tracker.update(0.2, see(box, class_id=WORKER), STILL, UNMAPPED)
    assert tracks.class_id.tolist() == [EXCAVATOR, WORKER]
    assert tracks.observed.tolist() == [False, True]


def test_reference_objects_are_not_tracked() -> None:
    tracker = Tracker()
    assert len(tracker.update(0.0, see((10, 10, 90, 60), class_id=REFERENCE), STILL, UNMAPPED)) == 0


def test_an_unsure_detection_carries_a_track_on() -> None:
    tracker = Tracker()
    tracker.update(0.0, see(person(10)), STILL, UNMAPPED)
    tracks = tracker.update(0.1, see(person(12), score=0.2), STILL, UNMAPPED)
    assert tracks.observed.tolist() == [True]
    assert tracks.score.tolist() == [0.2]


def test_unsure_detections_alone_do_not_keep_a_ghost_alive() -> None:
    tracker = Tracker(TrackParams(max_unsure_s=1.0))
    tracker.update(0.0, see(person(10)), STILL, UNMAPPED)
    alive = [len(tracker.update(index / 10, see(person(10), score=0.2), STILL, UNMAPPED)) for index in range(1, 15)]
    assert alive == [1] * 10 + [0] * 4


def test_a_track_does_not_jump_to_a_sure_neighbour_while_its_own_person_is_half_hidden() -> None:
    tracker = Tracker()
    tracker.update(0.0, see(person(100)), STILL, UNMAPPED)
    tracks = tracker.update(0.1, together(see(person(115), score=0.95), see(person(101), score=0.3)), STILL, UNMAPPED)
    assert tracks.track_id.tolist() == [1]
    assert tracks.score.tolist() == [0.3]


def test_two_people_who_cross_keep_their_ids() -> None:
    tracker = Tracker()
    first = tracker.update(0.0, see(person(100), person(300, top=110)), STILL, UNMAPPED)
    for index in range(1, 41):
        last = tracker.update(
            index / 10, see(person(100 + 5 * index), person(300 - 5 * index, top=110)), STILL, UNMAPPED
        )
    assert np.array_equal(first.track_id, last.track_id)
    assert centres(first)[:, 0].argsort().tolist() == centres(last)[:, 0].argsort().tolist()[::-1]


def test_a_fast_walker_is_followed_at_two_frames_a_second() -> None:
    tracker = Tracker()
    for index in range(8):
        tracks = tracker.update(index / 2, see(person(100 + 28 * index)), STILL, UNMAPPED)
    assert tracks.track_id.tolist() == [1]


@pytest.mark.parametrize("time_s", [0.9, -1.0, float("nan"), float("inf")])
def test_time_must_not_go_backwards(time_s: float) -> None:
    tracker = Tracker()
    tracker.update(1.0, see(person(10)), STILL, UNMAPPED)
    with pytest.raises(ValueError, match=r"expected a time not before 1\.0 s, found .* s; call reset\(\)"):
        tracker.update(time_s, see(person(10)), STILL, UNMAPPED)
    with pytest.raises(ValueError, match="expected a time not before"):
        tracker.coast(time_s, STILL)
    assert tracker.update(1.1, see(person(10)), STILL, UNMAPPED).track_id.tolist() == [1]


def test_two_pictures_of_the_same_time_do_no_harm() -> None:
    tracker = Tracker()
    tracker.update(1.0, see(person(10)), STILL, UNMAPPED)
    assert tracker.update(1.0, see(person(10)), STILL, UNMAPPED).track_id.tolist() == [1]


def test_boxes_without_area_leave_finite_tracks() -> None:
    tracker = Tracker()
    for index in range(4):
        tracks = tracker.update(index / 10, see((10, 10, 10, 10), (50, 50, 50, 90)), STILL, UNMAPPED)
        assert np.isfinite(tracks.xyxy_px).all()


def test_nothing_seen_gives_no_tracks() -> None:
    tracker = Tracker()
    assert len(tracker.update(0.0, Detections.empty(), STILL, UNMAPPED)) == 0
    assert len(tracker.coast(0.1, STILL)) == 0


def test_every_detection_confirms_when_one_is_enough() -> None:
    tracker = Tracker(TrackParams(confirm_hits=1))
    tracker.update(0.0, Detections.empty(), STILL, UNMAPPED)
    assert len(tracker.update(0.1, see(person(10)), STILL, UNMAPPED)) == 1


@pytest.mark.parametrize("scores", [{"low_score": 0.5, "high_score": 0.4}, {"start_score": 0.3, "high_score": 0.4}])
def test_scores_out_of_order_are_refused(scores: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"_score \(0\.\d\) must not"):
        TrackParams(**scores)  # type: ignore[arg-type]
