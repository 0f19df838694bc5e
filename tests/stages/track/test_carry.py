"""A camera that turns and flies over people who stand and walk."""

from __future__ import annotations

import numpy as np
import pytest
import tolerances
from drawn_ground import lens, view

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, Detections, NoCameraMotion, NoGroundMap
from standoff.stages.track import Tracker

FPS = 5.0
LENS = lens()
UNKNOWN = NoCameraMotion("not estimated")
UNMAPPED = NoGroundMap("not looked for")
PEOPLE_M = np.array([[-3.0, 1.0], [-1.0, -1.5], [0.5, 2.0], [2.0, -1.0], [3.0, 1.5]])
WALK_MPS = np.array([[0.0, 0.0], [0.0, 0.0], [1.2, 0.0], [0.0, -1.0], [-1.0, 0.6]])


def flown(time_s: float, camera: Camera = LENS) -> FloatArray:
    """Return ground_to_image, turning by 30 degrees and moving by 4 m a second."""
    return view(camera, (4.0 * time_s, 0.0), 14.0, 25.0, 30.0 * time_s)


def feet_px(time_s: float, camera: Camera = LENS) -> FloatArray:
    ideal, valid = homography.apply(flown(time_s, camera), PEOPLE_M + WALK_MPS * time_s)
    assert valid.all()
    return camera.distort(ideal)


def boxes(time_s: float, camera: Camera = LENS) -> Detections:
    centre = feet_px(time_s, camera)
    half = np.array([8.0, 16.0])
    count = len(centre)
    return Detections(np.concatenate([centre - half, centre + half], axis=1), np.full(count, 0.9), np.zeros(count, int))


def motion(index: int, camera: Camera | None = None, key: int = 0) -> CameraMotion:
    """Return the true motion since frame `key`."""
    shot = camera or LENS
    matrix = flown(index / FPS, shot) @ homography.invert(flown(key / FPS, shot))
    return CameraMotion(matrix, np.zeros((9, 9)), key / FPS, camera)


def ids(tracker: Tracker, motions: list[CameraMotion | NoCameraMotion]) -> set[int]:
    found: set[int] = set()
    for index, step in enumerate(motions):
        found |= set(tracker.update(index / FPS, boxes(index / FPS), step, UNMAPPED).track_id.tolist())
    return found


def test_a_turning_camera_loses_nobody() -> None:
    assert ids(Tracker(), [motion(index) for index in range(15)]) == {1, 2, 3, 4, 5}


def test_without_the_motion_it_would() -> None:
    assert len(ids(Tracker(), [UNKNOWN] * 15)) > 5


def test_a_new_keyframe_every_fourth_frame_changes_nothing() -> None:
    once, often = Tracker(), Tracker()
    for index in range(15):
        key = max(index - 1, 0) // 4 * 4
        first = once.update(index / FPS, boxes(index / FPS), motion(index), UNMAPPED)
        second = often.update(index / FPS, boxes(index / FPS), motion(index, key=key), UNMAPPED)
        assert (first.track_id == second.track_id).all()
        assert first.xyxy_px == pytest.approx(second.xyxy_px, abs=1e-6)


@pytest.mark.parametrize("camera", [None, lens(420.0, (-0.15, 0.03, 0.001, -0.001, 0.0))])
def test_boxes_coast_over_the_ground_and_not_over_the_picture(camera: Camera | None) -> None:
    tracker, shot = Tracker(), camera or LENS
    for index in range(12):
        tracker.update(index / FPS, boxes(index / FPS, shot), motion(index, camera), UNMAPPED)
    for index in range(12, 15):
        tracks = tracker.coast(index / FPS, motion(index, camera))
    centres = (tracks.xyxy_px[:, :2] + tracks.xyxy_px[:, 2:]) / 2.0
    apart = np.linalg.norm(centres - feet_px(14 / FPS, shot), axis=1)
    assert apart.max() < tolerances.COASTED_PX


def test_a_motion_after_a_loss_is_not_applied_to_frames_that_it_does_not_span() -> None:
    plain, tracker = Tracker(), Tracker()
    motions: list[CameraMotion | NoCameraMotion] = [UNKNOWN, UNKNOWN, motion(2), UNKNOWN]
    for index, step in enumerate(motions):
        first = plain.update(index / FPS, boxes(0.0), UNKNOWN, UNMAPPED)
        second = tracker.update(index / FPS, boxes(0.0), step, UNMAPPED)
        assert (first.xyxy_px == second.xyxy_px).all()
