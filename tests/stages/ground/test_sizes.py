from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tolerances import CLEAN_CROWD_LOG, GEOMETRY_REL, SIZES_COVERED
from walking_crowd import HEIGHT_PX, WIDTH_PX, Crowd, body_points, box_of, drone_camera, random_crowd

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import CameraMotion, Detections, NoCameraMotion
from standoff.stages.ground.sizes import NOT_A_PLANE, TOO_FEW, NoSizes, SizesEstimate, SizesEstimator

_PRIOR = CameraPrior.unknown(WIDTH_PX, HEIGHT_PX)


def _people(boxes: FloatArray, order: FloatArray | None = None) -> Detections:
    boxes = boxes if order is None else boxes[np.asarray(order, dtype=np.int64)]
    return Detections(boxes, np.ones(len(boxes)), np.zeros(len(boxes), dtype=np.int64))


def _estimate(crowd: Crowd, prior: CameraPrior = _PRIOR) -> SizesEstimate:
    estimator = SizesEstimator(prior)
    answer: SizesEstimate | NoSizes = NoSizes("")
    for time_s, boxes in crowd.pictures:
        answer = estimator.update(time_s, _people(boxes), None)
    assert isinstance(answer, SizesEstimate)
    return answer


def _changed(view: View, change: FloatArray) -> View:
    """Move a view by the eight small numbers that the covariance is of."""
    rotation = Rotation.from_rotvec(change[:3]).as_matrix() @ view.site_to_camera
    camera = view.camera.refocused(float(np.exp(change[6])), float(view.camera.distortion[0] + change[7]))
    return View(camera, view.position_m + change[3:6], rotation)


def _log_distances(view: View, pairs_px: FloatArray) -> FloatArray:
    first_m, second_m = view.to_plane(pairs_px[0]), view.to_plane(pairs_px[1])
    distances: FloatArray = np.log(np.linalg.norm(first_m - second_m, axis=1))
    return distances


def _pairs_px(view: View, seed: int) -> FloatArray:
    """Return (2, N, 2) pairs of pixels whose ground is 3 to 30 m apart and within 100 m."""
    pixels = np.random.default_rng(seed).uniform([60.0, 36.0], [WIDTH_PX - 60.0, HEIGHT_PX - 36.0], (2, 3000, 2))
    ground_m = view.to_plane(pixels.reshape(-1, 2)).reshape(2, -1, 2)
    apart_m = np.linalg.norm(ground_m[0] - ground_m[1], axis=1)
    near = (np.linalg.norm(ground_m, axis=2) < 100.0).all(axis=0) & (apart_m > 3.0) & (apart_m < 30.0)
    return pixels[:, near][:, :100]


def _errors(estimate: SizesEstimate, view: View, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the log errors of distances through the estimate, and their standard errors by its covariance."""
    pairs_px = _pairs_px(view, seed)
    error = _log_distances(estimate.view, pairs_px) - _log_distances(view, pairs_px)
    steps = 1e-4 * np.eye(8)
    forth = np.array([_log_distances(_changed(estimate.view, step), pairs_px) for step in steps])
    back = np.array([_log_distances(_changed(estimate.view, -step), pairs_px) for step in steps])
    slope = (forth - back).T / 2e-4
    return error, np.sqrt(np.einsum("na,ab,nb->n", slope, estimate.covariance, slope))


@pytest.mark.parametrize("seed", [1, 4])
def test_people_of_the_usual_size_give_the_camera_its_height(seed: int) -> None:
    crowd = random_crowd(seed, clean=True, people=12)
    error, _ = _errors(_estimate(crowd, CameraPrior.calibrated(drone_camera())), crowd.view, seed)
    assert abs(np.median(error)) < CLEAN_CROWD_LOG


@pytest.mark.live
def test_what_the_sizes_claim_to_know_they_know() -> None:
    inside, off = [], []
    for seed in range(40):
        crowd = random_crowd(seed)
        error, sigma = _errors(_estimate(crowd), crowd.view, seed)
        inside.append(np.mean(np.abs(error) < 1.96 * sigma))
        off.append(abs(np.expm1(np.median(error))))
    assert np.mean(inside) > SIZES_COVERED
    assert np.median(off) < 0.12  # the figure


def test_a_covariance_knows_nothing_of_where_the_site_frame_is() -> None:
    estimate = _estimate(random_crowd(3))
    np.testing.assert_array_equal(estimate.view.position_m[:2], 0.0)
    np.testing.assert_allclose(estimate.covariance, estimate.covariance.T)
    assert (np.linalg.eigvalsh(estimate.covariance) > -GEOMETRY_REL).all()
    assert estimate.view.site_to_camera[2, 0] == pytest.approx(0.0, abs=GEOMETRY_REL)
    # By how much a small rotation vector turns the direction ahead to the right.
    turn = np.append(np.cross([0.0, 0.0, 1.0], estimate.view.site_to_camera[:, 0]), np.zeros(5))
    np.testing.assert_allclose(estimate.covariance @ turn, 0.0, atol=1e-6)


def test_the_order_of_boxes_does_not_matter() -> None:
    crowd = random_crowd(5)
    shuffled = Crowd(crowd.view, [(time_s, boxes[::-1].copy()) for time_s, boxes in crowd.pictures])
    first, second = _estimate(crowd), _estimate(shuffled)
    np.testing.assert_allclose(first.view.position_m, second.view.position_m, rtol=1e-6)
    np.testing.assert_allclose(first.covariance, second.covariance, rtol=1e-4, atol=1e-8)


def test_more_people_say_more() -> None:
    for seed in range(2):
        few, many = (_estimate(random_crowd(seed, clean=True, people=people)) for people in (6, 12))
        assert many.people > few.people
        assert many.covariance[5, 5] / many.view.position_m[2] ** 2 < few.covariance[5, 5] / few.view.position_m[2] ** 2


def test_a_crew_s_stature_does_not_average_out() -> None:
    crowd = random_crowd(6, clean=True, people=12)
    _, sigma = _errors(_estimate(crowd), crowd.view, 6)
    assert np.median(sigma) > 0.03


def test_a_moving_camera_says_where_it_is_now() -> None:
    crowd = random_crowd(2, clean=True, people=12)
    rng = np.random.default_rng(2)
    view, estimator = crowd.view, SizesEstimator(CameraPrior.calibrated(crowd.view.camera))
    pitch_deg = np.rad2deg(np.arcsin(-view.site_to_camera[2, 2]))
    standing_m = view.to_plane(rng.uniform([300.0, 200.0], [WIDTH_PX - 300.0, HEIGHT_PX - 200.0], (14, 2)))
    answer: SizesEstimate | NoSizes = NoSizes("")
    for step in range(15):
        place_m = view.position_m + np.array([0.2, 0.1, 0.15]) * step
        now = View.aimed(view.camera, place_m, heading_deg=0.5 * step, pitch_deg=pitch_deg + 0.2 * step)
        moved = now.plane_to_pinhole() @ np.linalg.inv(view.plane_to_pinhole())
        bodies_m = [body_points(1.75, 1.35) + np.append(xy_m, 0.0) for xy_m in standing_m]
        boxes = [box for box in (box_of(now, body_m) for body_m in bodies_m) if box is not None]
        motion = CameraMotion(moved, np.zeros((9, 9)), keyframe_s=0.0, camera=view.camera)
        answer = estimator.update(0.5 * step, _people(np.array(boxes)), motion)
    assert isinstance(answer, SizesEstimate)
    assert answer.people <= 14
    assert abs(np.log(answer.view.position_m[2] / now.position_m[2])) < CLEAN_CROWD_LOG
    assert abs(np.rad2deg(np.arcsin(-answer.view.site_to_camera[2, 2])) - (pitch_deg + 0.2 * step)) < 3.0


def test_all_starts_anew_where_nobody_knows_how_the_camera_moved() -> None:
    estimator = SizesEstimator(_PRIOR)
    for time_s, boxes in random_crowd(1).pictures:
        estimator.update(time_s, _people(boxes), None)
    answer = estimator.update(20.0, _people(np.zeros((0, 4))), NoCameraMotion("no ground in view"))
    assert not answer
    assert isinstance(answer, NoSizes)
    assert answer.reason == TOO_FEW


def test_one_person_who_stands_still_is_not_enough() -> None:
    estimator = SizesEstimator(_PRIOR)
    for step in range(20):
        answer = estimator.update(0.5 * step, _people(np.array([[600.0, 300.0, 620.0, 350.0]])), None)
    assert isinstance(answer, NoSizes)
    assert answer.reason == TOO_FEW


def test_sizes_without_sense_are_refused() -> None:
    rng = np.random.default_rng(0)
    estimator = SizesEstimator(_PRIOR)
    for step in range(10):
        middle = rng.uniform([100.0, 100.0], [1100.0, 600.0], (12, 2))
        half = np.exp(rng.uniform(np.log(5.0), np.log(90.0), (12, 2)))
        answer = estimator.update(0.5 * step, _people(np.hstack([middle - half, middle + half])), None)
    assert isinstance(answer, NoSizes)
    assert answer.reason == NOT_A_PLANE
