"""Ground that slopes, exactly known, as an exact camera sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import View


@dataclass(frozen=True)
class SlopingSite:
    """A camera over a plane with waves on it.

    Attributes:
        view: The camera, in the site frame.
        rise: (2,) of the plane a metre, east and north.
        waves_m: Their height.
    """

    view: View
    rise: FloatArray
    waves_m: float

    def heights_m(self, xy_m: FloatArray) -> FloatArray:
        """Return (N,) how high the ground is at (N, 2) places."""
        waves = np.sin(xy_m[:, 0] / 2.3 + 0.7) * np.cos(xy_m[:, 1] / 3.1 - 0.4)
        heights: FloatArray = 102.0 + xy_m @ self.rise + self.waves_m * np.sqrt(2.0) * waves
        return heights

    def seen_px(self, xy_m: FloatArray) -> FloatArray:
        """Return (N, 2) where the ground at (N, 2) places is in the picture."""
        return self.view.project(np.column_stack([xy_m, self.heights_m(xy_m)]))


def sloping_site(seed: int, *, slope_deg: float, waves_m: float = 0.0, k1: float = 0.0) -> SlopingSite:
    """Draw a camera 14 to 22 m above the middle of a slope that falls to anywhere."""
    rng = np.random.default_rng([seed, 71])
    matrix = np.array([[1050.0, 0.0, 639.5], [0.0, 1050.0, 359.5], [0.0, 0.0, 1.0]])
    camera = Camera(1280, 720, matrix, np.array([k1, 0.0, 0.0, 0.0, 0.0]))
    towards = rng.uniform(0.0, 2.0 * np.pi)
    rise = np.tan(np.deg2rad(slope_deg)) * np.array([np.cos(towards), np.sin(towards)])
    pitch_deg, above_m = rng.uniform(40.0, 60.0), rng.uniform(14.0, 22.0)
    away_m = above_m / np.tan(np.deg2rad(pitch_deg))
    position_m = np.array([0.0, -away_m, 102.0 + above_m])
    return SlopingSite(View.aimed(camera, position_m, heading_deg=0.0, pitch_deg=pitch_deg), rise, waves_m)


def places_m(seed: int, count: int, half_m: float = 5.0) -> FloatArray:
    """Return (N, 2) places on the ground, no three nearly on a line: on two rings about the middle."""
    rng = np.random.default_rng([seed, 72])
    angles = 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count + rng.uniform(0.0, np.pi)
    radii = half_m * np.where(np.arange(count) % 2, 1.0, 0.7)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
