"""The lens's radial distortion, from how the picture of the ground bends while the camera flies over it."""

from __future__ import annotations

from typing import Final

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera, CameraPrior, RadialDistortion
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray
from standoff.stages.motion.lens import Lens
from standoff.stages.motion.plane import fit_plane

_LEAST_MOTION: Final = 0.015
"""In the picture's width: where points moved less, on average, the errors of following them bend the picture more."""

_ROUNDS: Final = 4
_STEP: Final = 1e-3
_CONVERGED: Final = 2e-4
_MOST: Final = 0.45
"""No drone's lens is bent more; beyond it, the model folds."""

_BLOCKS: Final = (8, 6)
_MARGIN: Final = 3.5
"""Times the standard error that residuals by blocks tell: relief bends a picture, too, over more than a block."""

_MODEL_SIGMA: Final = 0.02
"""What k1 alone cannot say of a lens."""

_SURE_SIGMA: Final = 0.035
"""From here on the distortion is removed from the points that are followed."""

_PARAMETERS: Final = 9


class SelfCalibration:
    """What the motion of the ground has told of one stream's lens.

    Each pair of keyframes that lie far enough apart tells the radial distortion under which the motion between them is
    that of a plane. What several tell is put together; what k1 alone cannot say remains.

    Args:
        size_px: (width, height) of the frames.
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        self._size_px = size_px
        self._usual = CameraPrior.unknown(*size_px).camera
        self._sum, self._information = 0.0, 0.0

    @property
    def told(self) -> RadialDistortion | None:
        """The radial distortion; None: nothing was told yet."""
        if not self._information:
            return None
        sigma = float(np.hypot(self._information**-0.5, _MODEL_SIGMA))
        return RadialDistortion(self._sum / self._information, sigma, float(self._usual.matrix[0, 0]))

    @property
    def camera(self) -> Camera | None:
        """A usual lens with the distortion that was told; None: it is not sure enough yet."""
        told = self.told
        return self._usual.refocused(1.0, told.k1) if told is not None and told.sigma <= _SURE_SIGMA else None

    def take(self, source_px: FloatArray, target_px: FloatArray, *, inlier_px: float, followed_px: float) -> None:
        """Take in where points of one picture are in another.

        Args:
            source_px: (N, 2) as seen in the one, with distortion.
            target_px: (N, 2) as seen in the other.
            inlier_px: How far a point of the ground's plane may be off.
            followed_px: Size of one pixel of the picture in which the points were followed.
        """
        if float(np.linalg.norm(target_px - source_px, axis=1).mean()) < _LEAST_MOTION * self._size_px[0]:
            return
        found = self._fit(source_px, target_px, inlier_px, followed_px)
        if found is not None:
            k1, sigma = found
            self._sum += k1 / sigma**2
            self._information += 1.0 / sigma**2

    def _fit(
        self, source_px: FloatArray, target_px: FloatArray, inlier_px: float, followed_px: float
    ) -> tuple[float, float] | None:
        """Return k1 and its standard error, or None where the points do not move like a plane's under any lens."""
        k1, sigma = self.told.k1 if self.told is not None else 0.0, np.inf
        for _ in range(_ROUNDS):
            step = self._step(k1, source_px, target_px, inlier_px, followed_px)
            if step is None or abs(k1 + step[0]) > _MOST:
                return None
            k1, sigma = k1 + step[0], step[1]
            if abs(step[0]) < _CONVERGED:
                break
        return k1, sigma

    def _step(
        self, k1: float, source_px: FloatArray, target_px: FloatArray, inlier_px: float, followed_px: float
    ) -> tuple[float, float] | None:
        """Return by how much k1 should change so that one plane explains the motion best, and how sure that is."""
        both_px = np.concatenate([source_px, target_px])
        both = self._undistorted(both_px, k1)
        by_k1 = (self._undistorted(both_px, k1 + _STEP) - both) / _STEP
        source, target = np.split(both, 2)
        source_by_k1, target_by_k1 = np.split(by_k1, 2)
        known = np.isfinite(np.column_stack([source, target, source_by_k1, target_by_k1])).all(axis=1)
        plane = fit_plane(
            source[known],
            target[known],
            trusted=np.ones(np.count_nonzero(known), dtype=np.bool_),
            inlier_px=inlier_px,
            followed_px=followed_px,
        )
        if plane is None:
            return None
        kept = np.flatnonzero(known)[plane.inlier]
        by_matrix = homography.parameter_jacobian(plane.matrix, source[kept]).reshape(-1, 2, 9)[:, :, :8]
        moved = (homography.point_jacobian(plane.matrix, source[kept]) @ source_by_k1[kept][:, :, None])[:, :, 0]
        # A residual is target less moved source.
        rows = np.concatenate([by_matrix, (moved - target_by_k1[kept])[:, :, None]], axis=2)
        if rows.size < 4 * _PARAMETERS**2:
            return None
        return _last_parameter(rows, plane.residual_px[plane.inlier], self._block(source_px[kept]))

    def _undistorted(self, points_px: FloatArray, k1: float) -> FloatArray:
        return Lens(self._usual.refocused(1.0, k1), self._size_px).undistorted(points_px)

    def _block(self, points_px: FloatArray) -> IntArray:
        cell = np.clip(points_px / np.array(self._size_px) * _BLOCKS, 0, np.array(_BLOCKS) - 1).astype(np.int64)
        return np.asarray(cell[:, 1] * _BLOCKS[0] + cell[:, 0])


def _last_parameter(rows: FloatArray, residual: FloatArray, block: IntArray) -> tuple[float, float] | None:
    """Solve for the last of several parameters; errors within a block may go together (a sandwich estimate).

    Args:
        rows: (N, 2, P) how residuals fall with the parameters.
        residual: (N, 2).
        block: (N,) numbers.

    Returns:
        The parameter and its standard error, with a margin.
    """
    scale = np.sqrt((rows**2).sum(axis=(0, 1)))
    if not scale.all():
        return None
    rows = rows / scale
    flat = rows.reshape(-1, rows.shape[2])
    inverse = np.asarray(np.linalg.pinv(flat.T @ flat), dtype=np.float64)
    each = np.einsum("nip,ni->np", rows, residual)
    numbers, member = np.unique(block, return_inverse=True)
    if len(numbers) <= _PARAMETERS:
        return None
    summed = np.zeros((len(numbers), rows.shape[2]))
    np.add.at(summed, member, each)
    covariance = inverse @ (summed.T @ summed) @ inverse * len(numbers) / (len(numbers) - _PARAMETERS)
    step = (inverse @ each.sum(axis=0))[-1] / scale[-1]
    return float(step), _MARGIN * float(np.sqrt(covariance[-1, -1])) / float(scale[-1])
