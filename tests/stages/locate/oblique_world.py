"""A camera 30 m above flat ground that looks down at an angle: exact truth, projected by OpenCV."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap, Tracks

SIZE_PX = (1920, 1080)
MATRIX = np.array([[1500.0, 0.0, 959.5], [0.0, 1500.0, 539.5], [0.0, 0.0, 1.0]])
HEIGHT_M = 30.0
PITCH_DEG = 40.0


def _pose() -> tuple[FloatArray, FloatArray]:
    """Return rotation (3, 3) and translation (3,) from the site (x east, y north, z up) to the camera."""
    sine, cosine = np.sin(np.radians(PITCH_DEG)), np.cos(np.radians(PITCH_DEG))
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, -sine, -cosine], [0.0, cosine, -sine]])
    return rotation, -rotation @ np.array([0.0, 0.0, HEIGHT_M])


def seen_px(xy_m: FloatArray, distortion: FloatArray | None = None) -> FloatArray:
    """Project (N, 2) ground points in front of the camera into the picture."""
    return space_px(np.column_stack([xy_m, np.zeros(len(xy_m))]), distortion)


def space_px(points: FloatArray, distortion: FloatArray | None = None) -> FloatArray:
    """Project (N, 3) points in front of the camera into the picture."""
    rotation, translation = _pose()
    lens = np.zeros(5) if distortion is None else distortion
    projected, _ = cv2.projectPoints(points, cv2.Rodrigues(rotation)[0], translation, MATRIX, lens)
    return np.asarray(projected, dtype=np.float64).reshape(-1, 2)


def ground_map(
    *,
    covariance: FloatArray | None = None,
    valid_px: FloatArray | None = None,
    distortion: FloatArray | None = None,
    scale_m_per_px: float = 0.02,
) -> GroundMap:
    """Return the exact map of this camera."""
    rotation, translation = _pose()
    ground_to_image = MATRIX @ np.column_stack([rotation[:, 0], rotation[:, 1], translation])
    image_to_ground = homography.invert(ground_to_image)
    return GroundMap(
        image_to_ground=image_to_ground / np.linalg.norm(image_to_ground),
        covariance=np.zeros((9, 9)) if covariance is None else covariance,
        image_size_px=SIZE_PX,
        method="exact",
        scale_m_per_px=scale_m_per_px,
        valid_px=np.zeros((0, 2)) if valid_px is None else valid_px,
        camera=None if distortion is None else Camera(*SIZE_PX, MATRIX, distortion),
    )


def standing(foot_px: FloatArray, *, width_px: float = 20.0, height_px: float = 50.0) -> FloatArray:
    """Return (N, 4) boxes whose bottom centre is at the given points."""
    half = np.array([width_px / 2.0, 0.0])
    return np.column_stack([foot_px - half - [0.0, height_px], foot_px + half])


def tracks_of(
    boxes: FloatArray,
    *,
    track_id: list[int] | None = None,
    class_id: list[int] | None = None,
    observed: list[bool] | None = None,
) -> Tracks:
    """Return observed workers with ids 1, 2 ... unless told otherwise."""
    count = len(boxes)
    return Tracks(
        track_id=np.array(track_id or range(1, count + 1), dtype=np.int64),
        xyxy_px=boxes,
        score=np.ones(count),
        class_id=np.array(class_id or [0] * count, dtype=np.int64),
        observed=np.array(observed or [True] * count, dtype=np.bool_),
        age_s=np.zeros(count),
    )
