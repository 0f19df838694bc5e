"""The ideal pinhole camera that covers a distorted picture, as the GPU wants it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.render.geometry import Instances

NEAR_M = 0.4
FAR_M = 5000.0


@dataclass(frozen=True, slots=True, eq=False)
class Frustum:
    """A pinhole picture: which part of the undistorted plane of a view is drawn.

    Attributes:
        view: Whose pose and camera matrix it uses.
        origin_px: Undistorted column and row of the drawn picture's top-left pixel; whole numbers, so that its
            pixel centres are those of the undistorted picture.
        size_px: Width and height.
    """

    view: View
    origin_px: tuple[int, int]
    size_px: tuple[int, int]

    def clip_from_offset(self) -> FloatArray:
        """Return the (4, 4) matrix from site offsets from the camera to clip space, row 0 at clip y = -1."""
        width, height = self.size_px
        pixels = self.view.camera.matrix @ self.view.site_to_camera
        # A pixel's centre lies half a pixel from its edge, where clip space begins.
        left, top = self.origin_px[0] - 0.5, self.origin_px[1] - 0.5
        forward = pixels[2]
        matrix = np.zeros((4, 4))
        matrix[0, :3] = (2.0 * (pixels[0] - left * forward) - width * forward) / width
        matrix[1, :3] = (2.0 * (pixels[1] - top * forward) - height * forward) / height
        matrix[2, :3] = forward * (FAR_M + NEAR_M) / (FAR_M - NEAR_M)
        matrix[2, 3] = -2.0 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
        matrix[3, :3] = forward
        return matrix

    def undistorted_from_drawn(self) -> FloatArray:
        """Return the (3, 3) offset from pixels of the drawn picture to undistorted pixels."""
        shift = np.eye(3)
        shift[:2, 2] = self.origin_px
        return shift

    def planes(self) -> FloatArray:
        """Return (5, 4) inward unit normals and distances (from the camera) of left, right, top, bottom, near."""
        clip = self.clip_from_offset()
        sides = np.stack([clip[3] + clip[0], clip[3] - clip[0], clip[3] + clip[1], clip[3] - clip[1]])
        near = np.array([*self.view.site_to_camera[2], -NEAR_M])
        planes = np.vstack([sides, near])
        unit: FloatArray = planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
        return unit

    def sees(
        self, centre_m: npt.NDArray[np.float32], radius_m: npt.NDArray[np.float32], smallest_px: float = 0.0
    ) -> npt.NDArray[np.bool_]:
        """Return (N,) which spheres touch the picture and are not smaller than a radius in pixels."""
        planes = self.planes().astype(np.float32)
        offset = centre_m - self.view.position_m.astype(np.float32)
        inside = (offset @ planes[:, :3].T + planes[:, 3] > -radius_m[:, None]).all(axis=1)
        away_m = np.sqrt((offset**2).sum(axis=1))
        large = radius_m * np.float32(self.view.camera.matrix[0, 0]) > smallest_px * away_m
        seen: npt.NDArray[np.bool_] = inside & large
        return seen

    def visible(self, instances: Instances, smallest_px: float = 0.35) -> Instances:
        """Return the instances that the picture can show, nearest first."""
        seen = self.sees(instances.centre_m, instances.radius_m, smallest_px)
        return instances[seen].nearest_first(self.view.position_m)

    def rays(self, steps: int) -> FloatArray:
        """Return (steps², 3) directions (forward component 1) through a grid over the picture, edges included."""
        x = np.linspace(self.origin_px[0] - 0.5, self.origin_px[0] + self.size_px[0] - 0.5, steps)
        y = np.linspace(self.origin_px[1] - 0.5, self.origin_px[1] + self.size_px[1] - 0.5, steps)
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        homogeneous = np.column_stack([grid, np.ones(len(grid))])
        rays: FloatArray = homogeneous @ (self.view.site_to_camera.T @ np.linalg.inv(self.view.camera.matrix)).T
        return rays
