from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.types import Detections
from standoff.stages.detect.suppression import join_cut, suppress


def _random_detections(seed: int, count: int) -> Detections:
    random = np.random.default_rng(seed)
    corner = random.uniform(0, 60, (count, 2))
    xyxy_px = np.concatenate([corner, corner + random.uniform(10, 40, (count, 2))], axis=1)
    return Detections(xyxy_px, random.uniform(0.01, 1, count), random.integers(0, 3, count))


@given(st.integers(0, 10**6), st.integers(1, 60), st.sampled_from([0.1, 0.45, 0.8]))
def test_suppression_keeps_what_opencv_keeps_class_by_class(seed: int, count: int, iou: float) -> None:
    detections = _random_detections(seed, count)
    expected: set[float] = set()
    for class_id in range(3):
        own = detections[detections.class_id == class_id]
        xywh = np.concatenate([own.xyxy_px[:, :2], own.xyxy_px[:, 2:] - own.xyxy_px[:, :2]], axis=1)
        kept = cv2.dnn.NMSBoxes(xywh.tolist(), own.score.tolist(), 0.0, iou)
        expected |= set(own.score[np.asarray(kept, dtype=np.int64)])
    kept_scores = suppress(detections, iou, 1000).score
    assert set(kept_scores) == expected
    assert (np.diff(kept_scores) <= 0).all()


Box = tuple[float, float, float, float]


def _detections(boxes: list[Box], score: list[float], class_id: list[int]) -> Detections:
    return Detections(np.array(boxes), np.array(score), np.array(class_id, dtype=np.int64))


def test_suppression_keeps_the_surest_up_to_the_limit() -> None:
    detections = _detections([(0, 0, 9, 9), (20, 0, 29, 9), (40, 0, 49, 9)], [0.2, 0.9, 0.5], [0, 0, 0])
    np.testing.assert_array_equal(suppress(detections, 0.45, 2).score, [0.9, 0.5])


def test_suppressing_nothing_gives_nothing() -> None:
    assert len(suppress(Detections.empty(), 0.45, 10)) == 0


WHOLE = (10.0, 10.0, 110.0, 60.0)
LEFT_PIECE = (10.0, 12.0, 70.0, 59.0)
RIGHT_PIECE = (50.0, 10.0, 110.0, 60.0)


def test_a_whole_box_takes_in_its_pieces_and_their_score() -> None:
    pieces = _detections([LEFT_PIECE, WHOLE, RIGHT_PIECE], [0.9, 0.3, 0.8], [1, 1, 1])
    joined = join_cut(pieces, np.array([True, False, True]), 0.6)
    np.testing.assert_array_equal(joined.xyxy_px, [WHOLE])
    assert joined.score[0] == 0.9


def test_two_pieces_without_a_whole_become_one_box() -> None:
    left, right = (10.0, 12.0, 80.0, 59.0), (35.0, 10.0, 110.0, 60.0)
    joined = join_cut(_detections([left, right], [0.4, 0.8], [1, 1]), np.array([True, True]), 0.6)
    np.testing.assert_array_equal(joined.xyxy_px, [WHOLE])
    assert joined.score[0] == 0.8


@pytest.mark.parametrize(
    ("cut", "classes"),
    [
        pytest.param((False, False), [0, 0], id="a worker in front of another, both whole"),
        pytest.param((True, False), [0, 0], id="only the larger one is cut"),
        pytest.param((False, True), [1, 0], id="a cut worker in front of a machine"),
    ],
)
def test_what_is_no_piece_of_the_larger_box_stays(cut: tuple[bool, bool], classes: list[int]) -> None:
    boxes = _detections([WHOLE, (20.0, 20.0, 40.0, 50.0)], [0.9, 0.8], classes)
    assert len(join_cut(boxes, np.array(cut), 0.6)) == 2


def test_a_piece_that_hardly_overlaps_stays() -> None:
    boxes = _detections([WHOLE, (100.0, 10.0, 140.0, 60.0)], [0.9, 0.8], [0, 0])
    assert len(join_cut(boxes, np.array([False, True]), 0.6)) == 2


def test_joining_nothing_gives_nothing() -> None:
    assert len(join_cut(Detections.empty(), np.zeros(0, np.bool_), 0.6)) == 0
