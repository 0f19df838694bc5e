"""A clear picture of much that has edges, and a camera over flat ground."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap, ImageArray

SIZE_PX = (1280, 720)
FOCAL_PX = 1100.0


def site_picture(seed: int, size_px: tuple[int, int] = SIZE_PX) -> ImageArray:
    """Return (H, W) grey shapes on grey ground, edges anti-aliased."""
    rng = np.random.default_rng(seed)
    width_px, height_px = size_px
    picture = np.full((height_px, width_px), 110, dtype=np.uint8)
    for _ in range(400):
        middle = rng.uniform((0, 0), size_px)
        shape = cv2.boxPoints((middle.tolist(), rng.uniform(20, 90, 2).tolist(), rng.uniform(0, 180)))
        cv2.fillConvexPoly(picture, shape.round().astype(np.int32), int(rng.integers(20, 230)), cv2.LINE_AA)
    return picture


def camera(altitude_m: float, pitch_deg: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return matrix, rotation and translation, site frame to camera, of one that looks north and down."""
    pitch = np.radians(pitch_deg)
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, -np.sin(pitch), -np.cos(pitch)], [0.0, np.cos(pitch), -np.sin(pitch)]])
    matrix = np.array(
        [[FOCAL_PX, 0.0, (SIZE_PX[0] - 1) / 2.0], [0.0, FOCAL_PX, (SIZE_PX[1] - 1) / 2.0], [0.0, 0.0, 1.0]]
    )
    return matrix, rotation, -rotation @ np.array([0.0, 0.0, altitude_m])


def ground_map(
    altitude_m: float = 20.0,
    pitch_deg: float = 45.0,
    covariance: FloatArray | None = None,
    lens: Camera | None = None,
    valid_px: FloatArray | None = None,
) -> GroundMap:
    """Return the exact map of the ground that such a camera sees, with an error that somebody states."""
    matrix, rotation, translation = camera(altitude_m, pitch_deg)
    to_ground = np.asarray(np.linalg.inv(matrix @ np.column_stack([rotation[:, :2], translation])), dtype=np.float64)
    ahead = np.sign(to_ground[2] @ np.array([SIZE_PX[0] / 2.0, SIZE_PX[1], 1.0]))
    to_ground *= float(ahead) / float(np.linalg.norm(to_ground))
    return GroundMap(
        to_ground,
        np.zeros((9, 9)) if covariance is None else covariance,
        SIZE_PX,
        "drawn",
        0.05,
        valid_px=np.zeros((0, 2)) if valid_px is None else valid_px,
        camera=lens,
    )
