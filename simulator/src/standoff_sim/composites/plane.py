"""Level ground; implements `standoff_sim.scene.scene.Ground`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff_sim.solids.mesh import Colour, Float32Array

_HALF_M, _CELL_M = 400.0, 200.0


class Plane:
    """The plane z = 0.

    Args:
        code: sRGB of the ground, 0 to 255.
        dust: sRGB of the soil that dirt on things comes from.

    Attributes:
        linear: (3,) linear red, green, blue of the ground.
    """

    def __init__(self, code: Colour, dust: Colour) -> None:
        samples = int(2 * _HALF_M / _CELL_M) + 1
        self.linear: FloatArray = (np.clip(np.array(code), 1.0, 255.0) / 255.0) ** 2.2
        self.origin_xy_m: FloatArray = np.full(2, -_HALF_M)
        self.cell_m = _CELL_M
        self.height_m: Float32Array = np.zeros((samples, samples), np.float32)
        self.albedo: npt.NDArray[np.uint8] = np.tile(np.array(dust).round().astype(np.uint8), (8, 8, 1))
        self.wetness: npt.NDArray[np.uint8] = np.zeros((8, 8), np.uint8)

    def height_at(self, xy_m: FloatArray) -> FloatArray:
        """Return (N,) zeros."""
        return np.zeros(len(xy_m))
