"""Cameras with Brown-Conrady or fisheye lenses: undistort and distort points.

Undistorted points are those of an ideal pinhole camera, whatever the lens; only what a fisheye shows less than 90
degrees off its axis has one.

Half-pixel convention, written down once: the centre of the top-left pixel is (0, 0), as in OpenCV.
Boxes `xyxy_px` use the same coordinates for their edges.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from standoff.core.distortion import (
    bent_by_brown,
    bent_by_fisheye,
    brown_by_k1,
    brown_fold_r2,
    fisheye_by_k1,
    fisheye_fold_r2,
    straightened_by_fisheye,
)
from standoff.core.homography import BoolArray, FloatArray

Lens = Literal["brown", "fisheye"]

COEFFICIENTS: Final[Mapping[Lens, int]] = {"brown": 5, "fisheye": 4}
"""How many numbers say how a lens bends."""

_STRONGEST = 1e9
"""No coefficient is larger, of the longest lens; from far larger ones numbers overflow."""

_UNDISTORT_ITERATIONS = 50
_UNDISTORT_TOLERANCE = 1e-12


@dataclass(frozen=True, slots=True)
class Camera:
    """A calibrated camera.

    Attributes:
        width_px: Width of the pictures that it was calibrated on.
        height_px: Their height.
        matrix: (3, 3) camera matrix: fx, fy, cx, cy in pixels, no skew.
        distortion: (5,) k1, k2, p1, p2, k3 of Brown and Conrady in OpenCV's order; of a fisheye (4,) k1, k2, k3, k4.
        lens: Whose coefficients these are: "brown", or "fisheye", the equidistant model of `cv2.fisheye`.
    """

    width_px: int
    height_px: int
    matrix: FloatArray
    distortion: FloatArray
    lens: Lens = "brown"

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=np.float64)
        distortion = np.array(self.distortion, dtype=np.float64).ravel()
        if self.lens not in COEFFICIENTS:
            raise ValueError(f"lens must be one of {', '.join(COEFFICIENTS)}, not {self.lens!r}")
        # Compiled loops tell the lenses apart by how many coefficients there are.
        wanted = (COEFFICIENTS[self.lens],)
        if matrix.shape != (3, 3) or distortion.shape != wanted:
            raise ValueError(f"matrix must be (3, 3), distortion {wanted}, not {matrix.shape} and {distortion.shape}")
        if not all(map(math.isfinite, [*matrix.ravel().tolist(), *distortion.tolist()])):
            raise ValueError("camera matrix and distortion must be finite")
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
            raise ValueError("focal lengths must be positive")
        if np.abs(distortion).max() > _STRONGEST:
            raise ValueError(f"distortion coefficients must be of a lens, below {_STRONGEST:g}")
        matrix.setflags(write=False)
        distortion.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "distortion", distortion)

    @property
    def bends(self) -> bool:
        """Whether the picture differs from a pinhole camera's."""
        return self.lens == "fisheye" or bool(self.distortion.any())

    def scaled_to(self, width_px: int, height_px: int) -> Camera:
        """Return the same camera for pictures of another size and the same field of view.

        Raises:
            ValueError: The aspect ratio differs by more than one per cent, so the field of view does too.
        """
        scale_x, scale_y = width_px / self.width_px, height_px / self.height_px
        if abs(scale_x / scale_y - 1.0) > 0.01:
            raise ValueError(
                f"the camera is calibrated for {self.width_px}x{self.height_px}, "
                f"the picture is {width_px}x{height_px}: another aspect ratio"
            )
        half_pixel = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
        to_new = np.linalg.inv(half_pixel) @ np.diag([scale_x, scale_y, 1.0]) @ half_pixel
        return Camera(width_px, height_px, to_new @ self.matrix, self.distortion, self.lens)

    def refocused(self, focal_factor: float, k1: float) -> Camera:
        """Return the same camera with both focal lengths times a factor and another first radial coefficient."""
        matrix, distortion = self.matrix.copy(), self.distortion.copy()
        matrix[0, 0] *= focal_factor
        matrix[1, 1] *= focal_factor
        distortion[0] = k1
        return Camera(self.width_px, self.height_px, matrix, distortion, self.lens)

    def _to_normalised(self, points_px: FloatArray) -> FloatArray:
        focal = np.array([self.matrix[0, 0], self.matrix[1, 1]])
        normalised: FloatArray = (np.asarray(points_px, dtype=np.float64).reshape(-1, 2) - self.matrix[:2, 2]) / focal
        return normalised

    def _to_pixels(self, normalised: FloatArray) -> FloatArray:
        points_px: FloatArray = normalised * np.array([self.matrix[0, 0], self.matrix[1, 1]]) + self.matrix[:2, 2]
        return points_px

    def distorted_with_jacobian(self, normalised: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bend directions as the lens does.

        Args:
            normalised: (N, 2) x / z and y / z in the camera frame.

        Returns:
            (N, 2) the same, distorted, and (N, 2, 2) their derivative.
        """
        bend = bent_by_fisheye if self.lens == "fisheye" else bent_by_brown
        return bend(normalised, self.distortion)

    def distorted_by_k1(self, normalised: FloatArray) -> FloatArray:
        """Return (N, 2) how directions as the lens bends them change with its first radial coefficient."""
        return fisheye_by_k1(normalised) if self.lens == "fisheye" else brown_by_k1(normalised)

    def _unfolded(self, normalised: FloatArray, jacobian: FloatArray) -> BoolArray:
        """Return (N,) whether the lens polynomial still grows from the centre outwards up to each point.

        Beyond its first fold the polynomial shows directions a second time that no lens puts there.

        Args:
            normalised: (N, 2) undistorted.
            jacobian: (N, 2, 2) of the distortion there.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            (xx, xy), (yx, yy) = jacobian.transpose(1, 2, 0)
            x, y = normalised.T
            grows = (xx * yy - xy * yx > 0) & (xx + yy > 0)
            unfolded: BoolArray = grows & (x * x + y * y < self.first_fold_r2())
        return unfolded

    def first_fold_r2(self) -> float:
        """Return the square of the undistorted radius at which the radial polynomial first turns back; inf if never."""
        fold_r2 = fisheye_fold_r2 if self.lens == "fisheye" else brown_fold_r2
        return fold_r2(self.distortion)

    def distort(self, points_px: FloatArray) -> FloatArray:
        """Move ideal pinhole pixels to where the lens puts them.

        Args:
            points_px: (N, 2), undistorted.

        Returns:
            (N, 2), as seen in the picture; NaN outside the field of view that the lens polynomial can describe.
        """
        if not self.bends:
            return _finite(points_px)
        normalised = self._to_normalised(points_px)
        with np.errstate(invalid="ignore", over="ignore"):
            distorted, jacobian = self.distorted_with_jacobian(normalised)
        distorted[~self._unfolded(normalised, jacobian)] = np.nan
        return self._to_pixels(distorted)

    def undistort(self, points_px: FloatArray) -> FloatArray:
        """Remove the lens distortion from picture points by Newton's method.

        Args:
            points_px: (N, 2), as seen in the picture.

        Returns:
            (N, 2) pixels of an ideal pinhole camera with the same matrix; NaN where the lens model has
            no inverse (a point outside the field of view that the lens polynomial can describe, or 90 degrees and
            more off the axis).
        """
        if not self.bends:
            return _finite(points_px)
        wanted = self._to_normalised(points_px)
        if self.lens == "fisheye":
            return self._to_pixels(straightened_by_fisheye(wanted, self.distortion, self.first_fold_r2()))
        estimate = wanted.copy()
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for _ in range(_UNDISTORT_ITERATIONS):
                distorted, jacobian = self.distorted_with_jacobian(estimate)
                error = distorted - wanted
                # NaN where nothing has an inverse.
                if not np.fmax.reduce(np.abs(error), axis=None, initial=0.0) >= _UNDISTORT_TOLERANCE:
                    break
                (xx, xy), (yx, yy) = jacobian.transpose(1, 2, 0)
                off_x, off_y = error.T
                determinant = xx * yy - xy * yx
                estimate[:, 0] -= (yy * off_x - xy * off_y) / determinant
                estimate[:, 1] -= (xx * off_y - yx * off_x) / determinant
            distorted, jacobian = self.distorted_with_jacobian(estimate)
            found = self._unfolded(estimate, jacobian) & (np.abs(distorted - wanted).max(axis=1, initial=0.0) < 1e-9)
        estimate[~found] = np.nan
        return self._to_pixels(estimate)


def _finite(points_px: FloatArray) -> FloatArray:
    """Return (N, 2) points, rows of NaN where one is not finite."""
    points_px = np.array(points_px, dtype=np.float64).reshape(-1, 2)
    points_px[~np.isfinite(points_px).all(axis=1)] = np.nan
    return points_px


DRONE_FIELD_DEG = 72.0
"""Horizontal field of view of a drone's main camera when nothing is known: most have 65 to 80."""


@dataclass(frozen=True, slots=True)
class RadialDistortion:
    """The lens's first radial distortion coefficient, as the motion of the picture tells it.

    Attributes:
        k1: Of a lens of this focal length.
        sigma: Its standard error.
        focal_px: k1 / focal_px**2 is what was told; the focal length itself is another matter.
    """

    k1: float
    sigma: float
    focal_px: float

    def since(self, earlier: RadialDistortion) -> RadialDistortion:
        """Return what was told since something less sure was, which is in this.

        >>> news = RadialDistortion(-0.1, 0.03, 900.0).since(RadialDistortion(-0.06, 0.05, 900.0))
        >>> round(news.k1, 4), round(news.sigma, 4)
        (-0.1225, 0.0375)
        """
        information, before = self.sigma**-2, earlier.sigma**-2
        new = information - before
        return RadialDistortion((self.k1 * information - earlier.k1 * before) / new, new**-0.5, self.focal_px)


@dataclass(frozen=True, slots=True)
class CameraPrior:
    """What is known of a camera before its pictures have been looked at.

    Attributes:
        camera: The most likely camera.
        focal_sigma: Standard error of the focal length, as a share of it.
        k1_sigma: Standard error of the first radial distortion coefficient.
        origin: Where this comes from, for people: "camera file", "EXIF", a drone's model, "a drone's usual lens".
    """

    camera: Camera
    focal_sigma: float
    k1_sigma: float
    origin: str

    @classmethod
    def calibrated(cls, camera: Camera) -> CameraPrior:
        """Return what a camera file says, taken to be good to a thousandth."""
        return cls(camera, focal_sigma=1e-3, k1_sigma=2e-3, origin="camera file")

    @classmethod
    def unknown(cls, width_px: int, height_px: int) -> CameraPrior:
        """Return what can be said of any drone's camera."""
        focal_px = max(width_px, height_px) / 2.0 / np.tan(np.deg2rad(DRONE_FIELD_DEG / 2.0))
        matrix = np.array(
            [[focal_px, 0.0, (width_px - 1) / 2.0], [0.0, focal_px, (height_px - 1) / 2.0], [0.0, 0.0, 1.0]]
        )
        camera = Camera(width_px, height_px, matrix, np.zeros(5))
        return cls(camera, focal_sigma=0.12, k1_sigma=0.06, origin="a drone's usual lens")

    def with_distortion(self, told: RadialDistortion) -> CameraPrior:
        """Return it after the motion of the picture has told of the radial distortion.

        Raises:
            ValueError: The lens is a fisheye, of which the motion's k1 says nothing.

        >>> prior = CameraPrior.unknown(1280, 720)
        >>> told = RadialDistortion(-0.1, prior.k1_sigma, float(prior.camera.matrix[0, 0]))
        >>> float(prior.with_distortion(told).camera.distortion[0])
        -0.05
        """
        if self.camera.lens == "fisheye":
            raise ValueError("the motion of the picture tells nothing of a fisheye")
        scale = (float(self.camera.matrix[0, 0]) / told.focal_px) ** 2
        own, heard = self.k1_sigma**-2, (told.sigma * scale) ** -2
        k1 = (own * float(self.camera.distortion[0]) + heard * told.k1 * scale) / (own + heard)
        camera = self.camera.refocused(1.0, k1)
        return CameraPrior(camera, self.focal_sigma, float((own + heard) ** -0.5), self.origin)

    def scaled_to(self, width_px: int, height_px: int) -> CameraPrior:
        """Return the same for pictures of another size and the same field of view.

        Raises:
            ValueError: The aspect ratio differs by more than one per cent.
        """
        return CameraPrior(self.camera.scaled_to(width_px, height_px), self.focal_sigma, self.k1_sigma, self.origin)
