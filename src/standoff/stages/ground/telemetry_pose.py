"""Where a drone's telemetry puts the camera, and how sure that is: the last resort where nothing else measures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.telemetry import Telemetry
from standoff.core.types import NoGroundMap

_EQUATOR_M, _FLATTENING = 6_378_137.0, 1.0 / 298.257223563  # WGS84


@dataclass(frozen=True, slots=True, eq=False)
class TelemetryPose:
    """A view with its errors.

    Attributes:
        view: Site frame: x east, y north, origin on the ground below the drone at its first reading, as high as the
            point of take-off.
        covariance: (6, 6) of a rotation vector in the camera's frame (rad), site_to_camera being
            exp(rotation vector) times the view's, then of the position (m).
    """

    view: View
    covariance: FloatArray

    def __post_init__(self) -> None:
        covariance = np.array(self.covariance, dtype=np.float64)
        if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
            raise ValueError(f"covariance must be finite and (6, 6), not {covariance.shape}")
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)


def offset_m(first: Telemetry, now: Telemetry) -> FloatArray:
    """Return (2,) metres east and north from the first place to this one, on the plane that touches the first.

    >>> from standoff.core.telemetry import Telemetry
    >>> first = Telemetry(0.0, "", latitude_deg=45.0, longitude_deg=9.0, position_sigma_m=1.5)
    >>> now = Telemetry(1.0, "", latitude_deg=45.001, longitude_deg=9.0, position_sigma_m=1.5)
    >>> offset_m(first, now).round(1).tolist()
    [0.0, 111.1]
    """
    latitude = math.radians(first.latitude_deg)
    squared = _FLATTENING * (2.0 - _FLATTENING)
    across_m = _EQUATOR_M / math.sqrt(1.0 - squared * math.sin(latitude) ** 2)
    along_m = across_m * (1.0 - squared) / (1.0 - squared * math.sin(latitude) ** 2)
    east_deg = (now.longitude_deg - first.longitude_deg + 180.0) % 360.0 - 180.0
    north_deg = now.latitude_deg - first.latitude_deg
    return np.array([across_m * math.cos(latitude) * math.radians(east_deg), along_m * math.radians(north_deg)])


def view_from_telemetry(
    now: Telemetry, camera: Camera, *, first: Telemetry | None = None
) -> TelemetryPose | NoGroundMap:
    """Put the camera where the telemetry says, over ground as high as the point of take-off.

    Args:
        now: The readings of the moment.
        camera: Lens and picture size. Its own uncertainty is not in the covariance.
        first: The readings below which the site's origin lies; None: these ones.

    Returns:
        The pose; or why there is none: a reading is missing, or the drone is not above the ground.
    """
    first = now if first is None else first
    if not now.has_attitude:
        return NoGroundMap("telemetry without the camera's angles")
    if not math.isfinite(now.height_m):
        return NoGroundMap("telemetry without a height above take-off")
    if now.height_m <= now.height_sigma_m:
        return NoGroundMap("the drone is not above the ground, its telemetry says")
    if not (now.has_position and first.has_position):
        return NoGroundMap("telemetry without a place")
    view = View.aimed(
        camera,
        np.array([*offset_m(first, now), now.height_m]),
        heading_deg=now.heading_deg,
        pitch_deg=now.pitch_deg,
        roll_deg=now.roll_deg,
    )
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = _rotation_covariance(view, now)
    covariance[3:, 3:] = np.diag([now.position_sigma_m, now.position_sigma_m, now.height_sigma_m]) ** 2
    return TelemetryPose(view, covariance)


def _rotation_covariance(view: View, telemetry: Telemetry) -> FloatArray:
    """Return (3, 3), rad^2, camera frame.

    Each instrument's error turns the camera about an axis: the compass about the vertical, pitch about the level
    right-hand side, roll about the line of sight. A gimbal rolls about a level axis, and close to straight down that
    tilts the picture sideways, which no error of the three written angles does: so roll acts about the picture's level
    forward direction as well, by as much of it as the line of sight lacks.
    """
    heading, pitch = math.radians(telemetry.heading_deg), math.radians(telemetry.pitch_deg)
    right = np.array([math.cos(heading), -math.sin(heading), 0.0])
    sight = view.site_to_camera[2]
    below = np.cross(sight, right)
    axes = np.stack([np.array([0.0, 0.0, 1.0]), right, sight, math.sin(pitch) * below])
    sigmas_deg = [
        telemetry.heading_sigma_deg, telemetry.pitch_sigma_deg, telemetry.roll_sigma_deg, telemetry.roll_sigma_deg,
    ]  # fmt: skip
    turned = np.deg2rad(sigmas_deg)[:, None] * (axes @ view.site_to_camera.T)
    covariance: FloatArray = turned.T @ turned
    return covariance
