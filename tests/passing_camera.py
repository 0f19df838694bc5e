"""A camera that passes over drawn references: its place in each frame, its picture's motion, how far a map is off."""

from __future__ import annotations

import numpy as np
from drawn_solid import distance_and_sigma, lens, looking_at, motion_between

from standoff.core.pose import View
from standoff.core.types import CameraMotion, GroundMap, NoCameraMotion, NoGroundMap

CAMERA = lens(k1=-0.05)
FPS = 5.0
STILL = NoCameraMotion("not told")
PAIR_PX = np.array([[150.0, 300.0], [480.0, 120.0]])


def view(k: int = 0) -> View:
    start = looking_at(CAMERA, (-0.6, 1.6), away_m=12.0, heading_deg=25.0, pitch_deg=50.0)
    return start.changed(np.array([0.01, 0.02, -0.015, 0.5, -0.2, 0.1, 0.0, 0.0]) * k / FPS)


def motion(k: int) -> CameraMotion | NoCameraMotion:
    return STILL if k == 0 else motion_between(view(0), view(k), 0.0)


def seen(result: GroundMap | NoGroundMap) -> GroundMap:
    assert isinstance(result, GroundMap), result
    return result


def error_and_sigma(result: GroundMap | NoGroundMap, k: int) -> tuple[float, float]:
    """Return how far the distance of a pair of points is off in frame k, and its standard error; m."""
    length, sigma = distance_and_sigma(seen(result), PAIR_PX)
    one, other = view(k).to_plane(PAIR_PX)
    return abs(length - float(np.linalg.norm(other - one))), sigma
