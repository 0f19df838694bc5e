"""Take boxes along when the camera moves: where they would be had everything stood still."""

from __future__ import annotations

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray
from standoff.stages.track.motion import MotionArray

_STEP_PX = 1.0
_ALONG_X, _ALONG_Y = np.array([_STEP_PX, 0.0]), np.array([0.0, _STEP_PX])


def carry(rows: MotionArray, step: FloatArray, camera: Camera | None) -> None:
    """Move rows in place with the picture of the ground.

    The centre goes where the ground behind it goes; the velocity is turned and scaled as the picture is there, so that
    it goes on meaning motion over the ground; width and height are scaled alike, because boxes stay upright. Rows
    whose centre leaves the plane's visible side, or the lens, stay as they are.

    Args:
        rows: (N,) structured, fields `standoff.stages.track.motion.MOTION_FIELDS`.
        step: (3, 3) homography of the ground from the frame before to this one.
        camera: The lens without whose distortion `step` is to be read; None: pixels as seen.
    """
    centre = rows["box"][:, :2]
    probes = np.concatenate([centre, centre + _ALONG_X, centre + _ALONG_Y])
    ideal_px = probes if camera is None else camera.undistort(probes)
    moved, valid = homography.apply(step, ideal_px)
    moved = moved if camera is None else camera.distort(moved)
    valid &= np.isfinite(moved).all(axis=1)
    here, right, below = moved.reshape(3, -1, 2)
    jacobian = np.stack([right - here, below - here], axis=2) / _STEP_PX
    which = np.flatnonzero(valid.reshape(3, -1).all(axis=0))
    _move(rows, which, here[which], jacobian[which])


def _move(rows: MotionArray, which: IntArray, centre: FloatArray, jacobian: FloatArray) -> None:
    """Move rows `which` (K,) to `centre` (K, 2), their state by `jacobian` (K, 2, 2)."""
    moved = rows[which]
    scale = np.sqrt(np.abs(np.linalg.det(jacobian)))[:, None]
    moved["box"][:, :2] = centre
    moved["box"][:, 2:] *= scale
    rate: FloatArray = moved["rate"]
    rate[:, :2] = np.einsum("nij,nj->ni", jacobian, rate[:, :2])
    rate[:, 2:] *= scale
    # Variances along the picture's axes only are kept: a turn mixes them, and what it correlates is dropped.
    mixing = jacobian**2
    for name in ("box_variance", "box_rate_covariance", "rate_variance"):
        variance: FloatArray = moved[name]
        variance[:, :2] = np.einsum("nij,nj->ni", mixing, variance[:, :2])
        variance[:, 2:] *= scale**2
    rows[which] = moved
