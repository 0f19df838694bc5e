"""What a source itself knows of its camera, put into pixels."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from standoff.core.camera import Camera, CameraPrior
from standoff.stages.frames.drone_cameras import FULL_FRAME_DIAGONAL_MM, DroneCamera, find_drone_camera

_TOLD_STILL_SIGMA = 0.03  # a whole number of millimetres around 24 (1.2 %), and the lens's tolerance
_TOLD_FILM_SIGMA = 0.06  # films are cut out of the sensor, and what is told does not follow
_GUESSED_SENSOR_SIGMA = 0.04  # between the focal lengths that a 16:9 picture has on sensors of 4:3 and of 3:2
_CALIBRATED_SIGMA = 0.005
_UNKNOWN_K1_SIGMA = 0.06
_SENSOR_ASPECTS = (4.0 / 3.0, 3.0 / 2.0)
_USUAL_ASPECT = 3.0 / 2.0


def focal_px(focal_mm_35: float, size_px: tuple[int, int], sensor_aspect: float) -> float:
    """Turn a focal length in terms of 35 mm film into pixels.

    The equivalent is one of diagonals: the sensor's against 43.27 mm. A picture of another shape than its sensor
    keeps the sensor's width, or its height where it is narrower.

    >>> round(focal_px(20.0, (4000, 2250), 4 / 3), 1)
    2311.3
    """
    long_px, short_px = max(size_px), min(size_px)
    if long_px / short_px >= sensor_aspect:
        diagonal_px = long_px * math.hypot(1.0, 1.0 / sensor_aspect)
    else:
        diagonal_px = short_px * math.hypot(1.0, sensor_aspect)
    return focal_mm_35 / FULL_FRAME_DIAGONAL_MM * diagonal_px


def _sensor_aspect(size_px: tuple[int, int], drone: DroneCamera | None) -> tuple[float, float]:
    """Return the sensor's width over height, and what a wrong guess of it does to the focal length."""
    if drone is not None:
        return drone.sensor_aspect, 0.0
    aspect = max(size_px) / min(size_px)
    for known in _SENSOR_ASPECTS:
        if abs(aspect / known - 1.0) < 0.01:
            return known, 0.0
    return _USUAL_ASPECT, _GUESSED_SENSOR_SIGMA


def _prior(
    size_px: tuple[int, int], focal: float, focal_sigma: float, drone: DroneCamera | None, origin: str
) -> CameraPrior:
    k1, k1_sigma = (0.0, _UNKNOWN_K1_SIGMA) if drone is None else drone.k1
    width_px, height_px = size_px
    matrix = np.array([[focal, 0.0, (width_px - 1) / 2.0], [0.0, focal, (height_px - 1) / 2.0], [0.0, 0.0, 1.0]])
    camera = Camera(width_px, height_px, matrix, np.array([k1, 0.0, 0.0, 0.0, 0.0]))
    return CameraPrior(camera, focal_sigma, k1_sigma, origin)


def calibrated_prior(size_px: tuple[int, int], focal: float, drone: DroneCamera | None, origin: str) -> CameraPrior:
    """Return the prior for a focal length that the maker has measured, in pixels of these pictures."""
    return _prior(size_px, focal, _CALIBRATED_SIGMA, drone, origin)


def told_prior(
    size_px: tuple[int, int], focal_mm_35: Iterable[float], drone: DroneCamera | None, origin: str, *, film: bool
) -> CameraPrior:
    """Return the prior for focal lengths that a source tells, in terms of 35 mm film.

    Args:
        size_px: (width, height) of the pictures.
        focal_mm_35: All that it tells; where they differ, the prior spans them.
        drone: Whose they are, if that is known.
        origin: Where they come from.
        film: Whether the pictures are a film.
    """
    told = np.array(list(focal_mm_35))
    usual = float(np.median(told))
    spread = float(max(told.max() - usual, usual - told.min())) / usual
    aspect, guessed = _sensor_aspect(size_px, drone)
    sigma = math.hypot(_TOLD_FILM_SIGMA if film else _TOLD_STILL_SIGMA, guessed, spread)
    return _prior(size_px, focal_px(usual, size_px, aspect), sigma, drone, origin)


def drone_prior(size_px: tuple[int, int], drone: DroneCamera, *, film: bool) -> CameraPrior:
    """Return the prior for a drone whose model is all that is known."""
    focal_mm_35 = drone.focal_mm_35 * (drone.film_factor if film else 1.0)
    focal = focal_px(focal_mm_35, size_px, drone.sensor_aspect)
    return _prior(size_px, focal, drone.film_sigma if film else drone.still_sigma, drone, drone.name)


def find_drone(names: Iterable[str]) -> DroneCamera | None:
    """Return the first drone that one of the names is of."""
    return next((drone for name in names if (drone := find_drone_camera(name)) is not None), None)
