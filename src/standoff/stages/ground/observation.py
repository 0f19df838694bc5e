"""What one look at the picture says about the camera's place: known points of the site and where they are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class PointObservation:
    """Points of the site that were seen in one frame.

    Attributes:
        name: What was seen, for people and for residuals: "marker 3".
        points_m: (N, 3) site frame.
        points_px: (N, 2) where they are in the picture, lens distortion included.
        sigma_px: (N,) standard error of each point's coordinates, the same for x and y. The errors of one
            observation's points may have a cause in common.
    """

    name: str
    points_m: FloatArray
    points_px: FloatArray
    sigma_px: FloatArray

    def __post_init__(self) -> None:
        count = len(self.points_m)
        for name, shape in {"points_m": (count, 3), "points_px": (count, 2), "sigma_px": (count,)}.items():
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise ValueError(f"PointObservation.{name} must be finite and of shape {shape}, not {array.shape}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if (self.sigma_px <= 0).any():
            raise ValueError("PointObservation.sigma_px must be positive")
