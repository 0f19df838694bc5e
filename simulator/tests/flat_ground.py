"""A level, even ground, a camera and a light for tests of the renderer."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.scene.scene import Light
from standoff_sim.solids.mesh import Float32Array

SUN = (0.8, 0.76, 0.7)
SKY = (0.2, 0.24, 0.3)


class FlatGround:
    """A plane at one height, 120 m wide, of one colour."""

    def __init__(self, height_m: float = 0.0, level: int = 150) -> None:
        self.origin_xy_m: FloatArray = np.array([-60.0, -60.0])
        self.cell_m = 1.0
        self.height_m: Float32Array = np.full((121, 121), height_m, np.float32)
        self.albedo: npt.NDArray[np.uint8] = np.full((64, 64, 3), level, np.uint8)
        self.wetness: npt.NDArray[np.uint8] = np.zeros((64, 64), np.uint8)

    def height_at(self, xy_m: FloatArray) -> FloatArray:
        """Return (N,) the one height."""
        return np.full(len(xy_m), float(self.height_m[0, 0]))


def light(elevation_deg: float = 45.0, azimuth_deg: float = 90.0, sun: tuple[float, float, float] = SUN) -> Light:
    """Return a clear day with the sun at a place in the sky."""
    elevation, azimuth = np.deg2rad([elevation_deg, azimuth_deg])
    to_sun = np.array([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])
    return Light(to_sun, sun, SKY, (0.1, 0.08, 0.06), 0.01, 0.0, (0.6, 0.65, 0.7))


def camera(width_px: int = 320, height_px: int = 240, distortion: tuple[float, ...] = (0.0,) * 5) -> Camera:
    """Return a camera whose picture is as wide as its focal length is long, its principal point off the middle."""
    matrix = np.array([[width_px, 0.0, width_px / 2 + 3.3], [0.0, width_px, height_px / 2 - 2.2], [0.0, 0.0, 1.0]])
    return Camera(width_px, height_px, matrix, np.array(distortion))


def view(
    lens: Camera, height_m: float = 20.0, pitch_deg: float = 60.0, heading_deg: float = 0.0, roll_deg: float = 0.0
) -> View:
    """Look at the site's origin from a height."""
    heading, pitch = np.deg2rad([heading_deg, pitch_deg])
    back_m = height_m / np.tan(pitch)
    position = np.array([-back_m * np.sin(heading), -back_m * np.cos(heading), height_m])
    return View.aimed(lens, position, heading_deg=heading_deg, pitch_deg=pitch_deg, roll_deg=roll_deg)
