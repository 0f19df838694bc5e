from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, Detections, NoCameraMotion, NoGroundMap, Tracks
from standoff.stages.track import Tracker, TrackParams

STILL = NoCameraMotion("not estimated")
UNMAPPED = NoGroundMap("not looked for")
_SIZE_PX = np.array([60.0, 40.0])
_AT = np.array([0.3, -0.2])
"""Where the point lies from the middle of the box, in its sides: by no edge and by no middle."""


def _seen(centre_px: FloatArray, foot_px: FloatArray | None, sigma_px: float = 2.0) -> Detections:
    box = np.concatenate([centre_px - _SIZE_PX / 2, centre_px + _SIZE_PX / 2])[None]
    plain = Detections(box, np.array([0.9]), np.array([1]))
    if foot_px is None:
        return plain
    return replace(plain, foot_px=foot_px[None], foot_covariance_px2=sigma_px**2 * np.eye(2)[None])


def _foot(centre_px: FloatArray) -> FloatArray:
    foot_px: FloatArray = centre_px + _AT * _SIZE_PX
    return foot_px


@pytest.mark.parametrize("seed", range(4))
def test_a_steady_point_goes_along_with_its_box_and_keeps_its_error(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, speed = rng.uniform(100, 300, 2), rng.uniform(-20, 20, 2)
    tracker = Tracker()
    for frame in range(40):
        centre = start + speed * frame / 10
        tracks = tracker.update(frame / 10, _seen(centre, _foot(centre)), STILL, UNMAPPED)
    np.testing.assert_allclose(tracks.foot_px[0], _foot(centre), atol=0.5)
    # Errors of one frame are those of the next: the mean of many is no surer than one.
    np.testing.assert_allclose(np.sqrt(np.diag(tracks.foot_covariance_px2[0])), 2.0, rtol=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_noise_is_smoothed_and_surer_points_weigh_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centre = np.array([200.0, 150.0])
    sigmas_px = rng.choice([1.0, 12.0], 60)
    raw, smooth = [], []
    tracker = Tracker()
    for frame, sigma_px in enumerate(sigmas_px.tolist()):
        foot_px = _foot(centre) + rng.normal(0.0, sigma_px, 2)
        tracks = tracker.update(frame / 25, _seen(centre, foot_px, sigma_px), STILL, UNMAPPED)
        raw.append(foot_px - _foot(centre))
        smooth.append(tracks.foot_px[0] - _foot(centre))
    assert np.std(smooth[20:]) < 0.3 * np.std(raw[20:])


def test_a_point_that_moves_in_its_box_is_followed_within_its_memory() -> None:
    centre = np.array([200.0, 150.0])
    tracker = Tracker(TrackParams(foot_memory_s=0.4))
    for frame in range(80):
        at = _foot(centre) + np.array([20.0 if frame >= 40 else 0.0, 0.0])
        tracks = tracker.update(frame / 25, _seen(centre, at), STILL, UNMAPPED)
    np.testing.assert_allclose(tracks.foot_px[0], at, atol=1.0)


def test_it_goes_on_with_the_box_while_nobody_looks_and_where_the_camera_turns() -> None:
    centre = np.array([200.0, 150.0])
    tracker = Tracker()
    for frame in range(3):
        tracker.update(frame / 10, _seen(centre, _foot(centre)), STILL, UNMAPPED)
    shifted = CameraMotion(np.array([[1.0, 0, 30.0], [0, 1, -10.0], [0, 0, 1]]), np.zeros((9, 9)), 0.2)
    tracks: Tracks = tracker.coast(0.3, shifted)
    np.testing.assert_allclose(tracks.foot_px[0], _foot(centre) + np.array([30.0, -10.0]), atol=1e-6)
    assert not tracks.observed[0]


def test_detections_without_points_leave_what_was_seen_and_make_none_up() -> None:
    centre = np.array([200.0, 150.0])
    tracker = Tracker()
    assert np.isnan(tracker.update(0.0, _seen(centre, None), STILL, UNMAPPED).foot_px).all()
    tracker.update(0.1, _seen(centre, _foot(centre)), STILL, UNMAPPED)
    tracks = tracker.update(0.2, _seen(centre, None), STILL, UNMAPPED)
    np.testing.assert_allclose(tracks.foot_px[0], _foot(centre), atol=1e-6)
    assert np.isfinite(tracks.foot_covariance_px2).all()
