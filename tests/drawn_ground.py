"""A bright shape on rough ground, seen by a pinhole camera with a lens: pictures with exactly known geometry."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import Frame, ImageArray, Luma
from standoff.stages.frames.pictures import halved

SIZE_PX = (480, 360)
_ROUGHNESS = cv2.GaussianBlur(np.random.default_rng(5).normal(0.0, 60.0, (512, 512)), (0, 0), 2.0)
_ROUGHNESS_STEP_M = 0.03
_SUBPIXELS = 3


@dataclass(frozen=True)
class GrayPicture:
    """A picture that is only ever asked for its luma here."""

    pixels: ImageArray

    @property
    def width_px(self) -> int:
        return int(self.pixels.shape[1])

    @property
    def height_px(self) -> int:
        return int(self.pixels.shape[0])

    def bgr(self) -> ImageArray:
        return np.repeat(self.pixels[..., None], 3, axis=2)

    def resized_bgr(self, width_px: int, height_px: int) -> ImageArray:
        return np.asarray(cv2.resize(self.bgr(), (width_px, height_px)), dtype=np.uint8)

    def gray(self) -> ImageArray:
        return self.pixels

    def luma(self) -> Luma:
        return self.pixels

    def halved_gray(self, times: int) -> ImageArray:
        return halved(self.pixels, times)


def frame(gray: ImageArray, time_s: float = 0.0) -> Frame:
    return Frame("drawn", round(time_s * 30), time_s, GrayPicture(gray))


def lens(focal_px: float = 420.0, distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)) -> Camera:
    width, height = SIZE_PX
    matrix = np.array([[focal_px, 0.0, (width - 1) / 2], [0.0, focal_px, (height - 1) / 2], [0.0, 0.0, 1.0]])
    return Camera(width, height, matrix, np.array(distortion))


def view(camera: Camera, target_m: tuple[float, float], away_m: float, tilt_deg: float, yaw_deg: float) -> FloatArray:
    """Return ground_to_image of a camera `away_m` from a ground point, tilted from straight down, turned by yaw."""
    tilt, yaw = np.radians([tilt_deg, yaw_deg])
    forward = np.array([np.sin(tilt) * np.sin(yaw), np.sin(tilt) * np.cos(yaw), -np.cos(tilt)])
    right = np.array([np.cos(yaw), -np.sin(yaw), 0.0])
    rotation = np.stack([right, np.cross(forward, right), forward])
    position = np.array([*target_m, 0.0]) - away_m * forward
    ground_to_image = camera.matrix @ np.column_stack([rotation[:, 0], rotation[:, 1], -rotation @ position])
    return homography.signed(ground_to_image, np.array(target_m))


def picture(ground_to_image: FloatArray, corners_m: FloatArray, camera: Camera, noise: float = 1.5) -> ImageArray:
    """Draw the convex polygon `corners_m` (counter-clockwise from above); each pixel is the mean of nine rays."""
    width, height = SIZE_PX
    steps = (np.arange(_SUBPIXELS) + 0.5) / _SUBPIXELS - 0.5
    x = (np.arange(width)[:, None] + steps).ravel()
    y = (np.arange(height)[:, None] + steps).ravel()
    rays = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    if camera.bends:
        rays = camera.undistort(rays)
    ground, seen = homography.apply(homography.invert(ground_to_image), rays)
    ground = np.where(seen[:, None], ground, 1e6)
    sides = np.roll(corners_m, -1, axis=0) - corners_m
    inside = np.ones(len(ground), dtype=bool)
    for corner, side in zip(corners_m, sides, strict=True):
        inside &= side[0] * (ground[:, 1] - corner[1]) - side[1] * (ground[:, 0] - corner[0]) > 0
    column, row = np.floor(ground / _ROUGHNESS_STEP_M).astype(np.int64).T % 512
    shade = np.where(inside, 190.0 + 0.3 * _ROUGHNESS[row, column], 90.0 + _ROUGHNESS[row, column])
    grid = shade.reshape(height, _SUBPIXELS, width, _SUBPIXELS).mean(axis=(1, 3))
    grid += np.random.default_rng(0).normal(0.0, noise, grid.shape)
    return np.asarray(np.clip(np.rint(grid), 0, 255), dtype=np.uint8)


def box_around(
    ground_to_image: FloatArray, corners_m: FloatArray, camera: Camera, margin_px: float = 6.0
) -> FloatArray:
    corners_px = camera.distort(homography.apply(ground_to_image, corners_m)[0])
    return np.concatenate([corners_px.min(axis=0) - margin_px, corners_px.max(axis=0) + margin_px])
