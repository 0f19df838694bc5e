"""Where a pixel stands on the ground, or why that is not known."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.relief import Relief


@dataclass(frozen=True, slots=True, eq=False)
class NoGroundMap:
    """There is no ground map for this frame, and why. Falsy.

    Attributes:
        reason: A short clause, the same words for the same cause, so that causes can be counted.
    """

    reason: str

    def __bool__(self) -> bool:
        return False


@dataclass(frozen=True, slots=True, eq=False)
class GroundMap:
    """Where a pixel stands on the ground, and how sure that is. Truthy.

    Attributes:
        image_to_ground: (3, 3) signed homography from *undistorted* pixels to metres in the site frame
            (x east, y north; or x along the reference's first edge, y to its left seen from above);
            its denominator is positive in front of the camera.
        covariance: (10, 10) of its entries, row by row, for the matrix as scaled here, and of the lens's k1; (9, 9) of
            the entries alone where the lens is taken as it is.
        image_size_px: (width, height) of the pictures that it is for.
        valid_px: (V, 2) polygon in undistorted pixels outside which it is not trusted; V = 0: no limit
            but the horizon.
        method: How it was found ("surveyed", "reference:paper", ...).
        scale_m_per_px: Eq. 6's scale, reference_m / reference_px on the paper's rectified plane.
        anchors_px: (A, 2) the points, as seen in the picture, that fixed it, for drawing.
        camera: The lens whose distortion is removed from points first; None: points are used as they are.
        age_s: Seconds since it was last observed; 0 when observed in this frame.
        site_frame: Counts the stream's site frames up: where something better begins to tell the ground, places may be
            counted from elsewhere, and those of different frames cannot be compared.
        frame_stated: Whether somebody stated where the site frame lies (surveyed points, markers, a reference whose
            first corner is told), so that places of a plan can be found in it.
        relief: How far the ground lies off the map's plane, where its heights were surveyed; None: nobody did.
    """

    image_to_ground: FloatArray
    covariance: FloatArray
    image_size_px: tuple[int, int]
    method: str
    scale_m_per_px: float
    valid_px: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    anchors_px: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    camera: Camera | None = None
    age_s: float = 0.0
    site_frame: int = 0
    frame_stated: bool = False
    relief: Relief | None = None

    def __post_init__(self) -> None:
        covariance = np.zeros((10, 10))
        given = np.asarray(self.covariance, dtype=np.float64)
        if given.shape not in {(9, 9), (10, 10)}:
            raise ValueError(f"GroundMap.covariance must be (9, 9) or (10, 10), not {given.shape}")
        covariance[: len(given), : len(given)] = given
        object.__setattr__(self, "covariance", covariance)
        shapes = {"image_to_ground": (3, 3), "covariance": (10, 10), "valid_px": (-1, 2), "anchors_px": (-1, 2)}
        for name, shape in shapes.items():
            array = np.array(getattr(self, name), dtype=np.float64).reshape(shape)
            if not np.isfinite(array).all():
                raise ValueError(f"GroundMap.{name} must be finite")
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __bool__(self) -> bool:
        return True

    def undistorted(self, points_px: FloatArray) -> FloatArray:
        """Return (N, 2) picture points without the lens distortion; NaN where the lens has no inverse."""
        points_px = np.asarray(points_px, dtype=np.float64).reshape(-1, 2)
        return points_px if self.camera is None else self.camera.undistort(points_px)

    def to_ground(self, points_px: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Map (N, 2) picture points to (N, 2) metres; NaN and False beyond the horizon."""
        return homography.apply(self.image_to_ground, self.undistorted(points_px))

    def to_image(self, points_m: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Map (N, 2) metres to (N, 2) distorted picture points; NaN behind the camera and where no lens sees."""
        points_px, valid = homography.apply(homography.invert(self.image_to_ground), points_m)
        if self.camera is not None:
            points_px = self.camera.distort(points_px)
        return points_px, valid & np.isfinite(points_px).all(axis=1)
