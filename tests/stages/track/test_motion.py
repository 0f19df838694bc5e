from __future__ import annotations

import cv2
import numpy as np
import pytest
import tolerances
from hypothesis import given
from hypothesis import strategies as st

from standoff.stages.track import TrackParams, motion

PARAMS = TrackParams()
FIELDS = ("box", "rate", "box_variance", "box_rate_covariance", "rate_variance")


def moving_rows(seed: int, count: int = 5) -> motion.MotionArray:
    rng = np.random.default_rng(seed)
    rows = np.zeros(count, motion.MOTION_FIELDS)
    motion.start(rows, rng.uniform(20.0, 200.0, (count, 4)), PARAMS)
    for _ in range(3):
        motion.predict(rows, rng.uniform(0.02, 0.3), PARAMS)
        seen = np.flatnonzero(rng.random(count) < 0.8)
        motion.correct(rows, seen, rows["box"][seen] + rng.normal(0.0, 3.0, (len(seen), 4)), PARAMS)
    return rows


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_one_long_step_is_two_short_ones(seed: int, first_s: float, second_s: float) -> None:
    at_once, in_two = moving_rows(seed), moving_rows(seed)
    motion.predict(at_once, first_s + second_s, PARAMS)
    motion.predict(in_two, first_s, PARAMS)
    motion.predict(in_two, second_s, PARAMS)
    for field in FIELDS:
        assert in_two[field] == pytest.approx(at_once[field], rel=tolerances.GEOMETRY_REL, abs=1e-12), field


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 60.0))
def test_a_predicted_box_never_turns_inside_out(seed: int, step_s: float) -> None:
    rows = moving_rows(seed)
    motion.predict(rows, step_s, PARAMS)
    assert (rows["box"][:, 2:] > 0).all()


def test_the_filter_agrees_with_opencv() -> None:
    rng = np.random.default_rng(3)
    size_px, rows = 40.0, np.zeros(1, motion.MOTION_FIELDS)
    motion.start(rows, np.array([[100.0, 50.0, size_px, size_px]]), PARAMS)
    peer = cv2.KalmanFilter(2, 1, 0, cv2.CV_64F)
    peer.measurementMatrix = np.array([[1.0, 0.0]])
    peer.measurementNoiseCov = np.array([[(PARAMS.box_noise * size_px) ** 2]])
    peer.statePost = np.array([[100.0], [0.0]])
    peer.errorCovPost = np.diag([(PARAMS.box_noise * size_px) ** 2, (PARAMS.start_speed * size_px) ** 2])
    for step_s in rng.uniform(0.01, 0.4, 20):
        peer.transitionMatrix = np.array([[1.0, step_s], [0.0, 1.0]])
        noise = np.array([[step_s**3 / 3, step_s**2 / 2], [step_s**2 / 2, step_s]])
        peer.processNoiseCov = (PARAMS.acceleration_noise * size_px) ** 2 * noise
        seen = np.array([[100.0 + rng.normal(0.0, 5.0), 50.0, size_px, size_px]])
        peer.predict()
        expected = peer.correct(seen[:, :1]).ravel()
        motion.predict(rows, step_s, PARAMS)
        motion.correct(rows, np.array([0]), seen, PARAMS)
        assert [rows["box"][0, 0], rows["rate"][0, 0]] == pytest.approx(expected, rel=tolerances.GEOMETRY_REL)
        variances = [[rows["box_variance"][0, 0], rows["box_rate_covariance"][0, 0]], [0, rows["rate_variance"][0, 0]]]
        assert np.triu(variances) == pytest.approx(np.triu(peer.errorCovPost), rel=tolerances.GEOMETRY_REL)


def test_edges_and_centres_are_the_same_boxes() -> None:
    boxes = np.random.default_rng(0).uniform(1.0, 90.0, (8, 4))
    assert motion.to_centre(motion.to_edges(boxes)) == pytest.approx(boxes)
