"""The drone and its camera: where it hovers, circles or passes, how wind, hands and rotors shake it.

All shake is an explicit function of time: any frame can be made alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray, invert
from standoff.core.pose import View
from standoff_sim.clip.presets import FlightStyle
from standoff_sim.movement.band_noise import BandNoise
from standoff_sim.movement.motion import Key, eased
from standoff_sim.scene.scene import Flight

_BORDER_POINTS = 24
_LENS_ATTEMPTS = 100


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """Where the camera would be and look without any shake.

    Attributes:
        position_m: (3,) site frame.
        heading_deg: Clockwise from north.
        pitch_deg: Downwards from the horizon.
    """

    position_m: FloatArray
    heading_deg: float
    pitch_deg: float


class Route(Protocol):
    """A planned way."""

    def at(self, time_s: float) -> Aim:
        """Return the plan for a moment."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Straight:
    """Stay, or pass over with a constant velocity; the direction of view stays."""

    start: Aim
    velocity_mps: FloatArray

    def at(self, time_s: float) -> Aim:
        """Return the plan for a moment."""
        return Aim(self.start.position_m + time_s * self.velocity_mps, self.start.heading_deg, self.start.pitch_deg)


@dataclass(frozen=True, slots=True, eq=False)
class Circle:
    """Fly around a target and look at it.

    Attributes:
        target_m: (3,) in the middle of the picture.
        radius_m: Horizontal.
        start_deg: Heading at time 0.
        rate_dps: Clockwise from above.
    """

    target_m: FloatArray
    height_m: float
    radius_m: float
    start_deg: float
    rate_dps: float

    def at(self, time_s: float) -> Aim:
        """Return the plan for a moment."""
        heading_deg = self.start_deg + self.rate_dps * time_s
        ahead = _ahead(heading_deg)
        position_m = self.target_m - self.radius_m * ahead + np.array([0.0, 0.0, self.height_m])
        return Aim(position_m, heading_deg, float(np.rad2deg(np.arctan2(self.height_m, self.radius_m))))


@dataclass(frozen=True, slots=True, eq=False)
class Excursion:
    """Fly away with a fixed direction of view, wait there, come back.

    Attributes:
        start: At both ends.
        offset_m: (3,) of the far point.
        keys: Times with the share of the offset, 0 to 1.
    """

    start: Aim
    offset_m: FloatArray
    keys: tuple[Key, ...]

    def at(self, time_s: float) -> Aim:
        """Return the plan for a moment."""
        share = float(eased(np.array([time_s]), self.keys)[0])
        return Aim(self.start.position_m + share * self.offset_m, self.start.heading_deg, self.start.pitch_deg)


@dataclass(frozen=True, slots=True, eq=False)
class Still:
    """A camera that does not move; implements `standoff_sim.scene.scene.Flight`."""

    fixed: View

    @classmethod
    def over(
        cls, camera: Camera, target_xy_m: FloatArray, *, altitude_m: float, pitch_deg: float, heading_deg: float,
        roll_deg: float = 0.0,
    ) -> Still:  # fmt: skip
        """Look at a point of the plane z = 0 from an altitude; see `look_at`."""
        aim = look_at(np.array([*target_xy_m, 0.0]), altitude_m, pitch_deg, heading_deg)
        return cls(View.aimed(camera, aim.position_m, heading_deg=heading_deg, pitch_deg=pitch_deg, roll_deg=roll_deg))

    def view(self, time_s: float) -> View:
        """Return the same view at any time."""
        return self.fixed


@dataclass(frozen=True, slots=True, eq=False)
class Shake:
    """What is added to the plan.

    Attributes:
        position_m: Noises of x, y, z.
        heading_deg: Noises that add up.
        pitch_deg: The same.
        roll_deg: The same.
    """

    position_m: tuple[BandNoise, BandNoise, BandNoise]
    heading_deg: tuple[BandNoise, ...]
    pitch_deg: tuple[BandNoise, ...]
    roll_deg: tuple[BandNoise, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ShakenFlight:
    """A planned way with shake; implements `standoff_sim.scene.scene.Flight`.

    Attributes:
        camera: Lens and picture size.
        route: The plan.
        shake: Added to it.
    """

    camera: Camera
    route: Route
    shake: Shake

    def view(self, time_s: float) -> View:
        """Return where the camera is and looks at a moment."""
        aim = self.route.at(time_s)
        return View.aimed(
            self.camera,
            aim.position_m + np.array([noise.at(time_s) for noise in self.shake.position_m]),
            heading_deg=aim.heading_deg + _total(self.shake.heading_deg, time_s),
            pitch_deg=aim.pitch_deg + _total(self.shake.pitch_deg, time_s),
            roll_deg=_total(self.shake.roll_deg, time_s),
        )


def _total(noises: Sequence[BandNoise], time_s: float) -> float:
    return sum(noise.at(time_s) for noise in noises)


def _ahead(heading_deg: float) -> FloatArray:
    heading_rad = np.deg2rad(heading_deg)
    return np.array([np.sin(heading_rad), np.cos(heading_rad), 0.0])


def look_at(target_m: FloatArray, altitude_m: float, pitch_deg: float, heading_deg: float) -> Aim:
    """Return the place at a height above a target from which it is in the middle of the picture.

    Args:
        target_m: (3,) site frame.
        altitude_m: Above the target.
        pitch_deg: Downwards from the horizon, above 0.
        heading_deg: Clockwise from north.
    """
    back_m = altitude_m / np.tan(np.deg2rad(pitch_deg))
    return Aim(target_m - back_m * _ahead(heading_deg) + np.array([0.0, 0.0, altitude_m]), heading_deg, pitch_deg)


def make_flight(
    rng: np.random.Generator, style: FlightStyle, camera: Camera, *, target_xy_m: FloatArray, altitude_m: float,
    pitch_deg: float, heading_deg: float, duration_s: float,
) -> ShakenFlight:  # fmt: skip
    """Draw a flight.

    Args:
        rng: Decides on speeds, directions and shake.
        style: `hover` holds a place by GPS; `orbit` circles the target at 1.5-3 m/s; `pass` flies straight at 2-5 m/s
            and has the target in the middle half-way; `away` leaves the target sideways until it is out of the
            picture and comes back; `hand` is a camera held by hand.
        camera: Lens and picture size.
        target_xy_m: (2,) in the middle of the picture, on the plane z = 0.
        altitude_m: Above that plane.
        pitch_deg: Of the gimbal, downwards from the horizon.
        heading_deg: Of the picture's upper edge, clockwise from north.
        duration_s: Of the clip.
    """
    aim = look_at(np.array([*target_xy_m, 0.0]), altitude_m, pitch_deg, heading_deg)
    if style == "hand":
        return ShakenFlight(camera, Straight(aim, np.zeros(3)), _hand_shake(rng))
    route: Route
    if style == "orbit":
        radius_m = altitude_m / np.tan(np.deg2rad(pitch_deg))
        rate_dps = rng.choice([-1.0, 1.0]) * np.rad2deg(rng.uniform(1.5, 3.0) / max(radius_m, 8.0))
        route = Circle(np.array([*target_xy_m, 0.0]), altitude_m, radius_m, heading_deg, float(rate_dps))
    elif style == "pass":
        velocity_mps = _ahead(heading_deg + rng.normal(0.0, 20.0)) * rng.uniform(2.0, 5.0)
        start = Aim(aim.position_m - velocity_mps * duration_s / 2, heading_deg, pitch_deg)
        route = Straight(start, velocity_mps)
    elif style == "away":
        side = _ahead(heading_deg + rng.choice([-90.0, 90.0]))
        offset_m = side * _half_width_m(camera, altitude_m, pitch_deg) * rng.uniform(1.5, 1.8)
        keys = tuple((share * duration_s, value) for share, value in ((0.1, 0.0), (0.45, 1.0), (0.55, 1.0), (0.9, 0.0)))
        route = Excursion(aim, offset_m, keys)
    else:
        route = Straight(aim, np.zeros(3))
    return ShakenFlight(camera, route, _drone_shake(rng))


def _half_width_m(camera: Camera, altitude_m: float, pitch_deg: float) -> float:
    """Return half the width of the ground that is seen, half-way up the picture."""
    distance_m = altitude_m / np.sin(np.deg2rad(pitch_deg))
    return float(distance_m * camera.width_px / 2 / camera.matrix[0, 0])


def _hand_shake(rng: np.random.Generator) -> Shake:
    """Draw sway of some centimetres and some tenths of a degree, and a hand's tremor at 6-12 Hz."""
    sway_m = rng.uniform(0.015, 0.04)
    turn_deg, tremor_deg = rng.uniform(0.25, 0.6), rng.uniform(0.008, 0.02)
    heading, pitch, roll = (
        (BandNoise.draw(rng, (0.15, 2.0), turn_deg * share), BandNoise.draw(rng, (6.0, 12.0), tremor_deg))
        for share in (1.0, 0.8, 0.6)
    )
    x, y, z = (BandNoise.draw(rng, (0.15, 1.5), sway_m) for _ in range(3))
    return Shake((x, y, z), heading, pitch, roll)


def _drone_shake(rng: np.random.Generator) -> Shake:
    """Draw wander by wind (0.1-0.5 Hz, 5-30 cm), what the gimbal leaves of tilting, and the rotors' vibration."""
    wander_m, remainder_deg, vibration_deg = rng.uniform([0.03, 0.03, 0.008], [0.09, 0.09, 0.02])
    heading, pitch, roll = (
        (
            BandNoise.draw(rng, (0.1, 1.5), remainder_deg * share),
            BandNoise.draw(rng, (5.0, 20.0), vibration_deg * share),
        )
        for share in (1.0, 0.7, 1.0)
    )
    x, y, z = (BandNoise.draw(rng, (0.1, 0.5), wander_m * share) for share in (1.0, 1.0, 0.6))
    return Shake((x, y, z), heading, pitch, roll)


def blur_homography(flight: Flight, time_s: float, exposure_s: float, plane_z_m: float) -> FloatArray:
    """Return how the picture of a horizontal plane moves during an exposure.

    Args:
        flight: The camera's way.
        time_s: When the exposure begins.
        exposure_s: How long it lasts.
        plane_z_m: Height of the plane.

    Returns:
        (3, 3) from undistorted pixels at `time_s` to undistorted pixels one exposure later; the last entry is 1.
    """
    now, later = flight.view(time_s), flight.view(time_s + exposure_s)
    moved = later.plane_to_pinhole(plane_z_m) @ invert(now.plane_to_pinhole(plane_z_m))
    homography: FloatArray = moved / moved[2, 2]
    return homography


def drone_camera(width_px: int, height_px: int, hfov_deg: float, rng: np.random.Generator) -> Camera:
    """Draw a drone's camera: a slightly distorting lens, its axis a little off the picture's middle.

    Args:
        width_px: Of the picture.
        height_px: Of the picture.
        hfov_deg: Horizontal field of view without distortion; drones have 60-84.
        rng: Decides.

    Returns:
        A camera whose distortion can be undone all over the picture, and some way beyond.
    """
    focal_px = width_px / 2 / np.tan(np.deg2rad(hfov_deg / 2))
    for _ in range(_LENS_ATTEMPTS):
        centre_px = np.array([width_px, height_px]) * rng.normal(0.5, 0.004, 2) - 0.5
        aspect = 1.0 + rng.normal(0.0, 5e-4)
        matrix = np.array([[focal_px, 0.0, centre_px[0]], [0.0, focal_px * aspect, centre_px[1]], [0.0, 0.0, 1.0]])
        distortion = np.array([rng.uniform(-0.14, 0.05), rng.uniform(-0.02, 0.05), *rng.normal(0.0, 4e-4, 2), 0.0])
        camera = Camera(width_px, height_px, matrix, distortion)
        if np.isfinite(camera.undistort(_border(width_px, height_px))).all():
            return camera
    return Camera(width_px, height_px, matrix, np.zeros(5))


def _border(width_px: int, height_px: int) -> FloatArray:
    """Return points on a frame a tenth wider and higher than the picture."""
    share = np.linspace(-0.05, 1.05, _BORDER_POINTS)
    low, high = np.full(_BORDER_POINTS, -0.05), np.full(_BORDER_POINTS, 1.05)
    sides = [(share, low), (share, high), (low, share), (high, share)]
    return np.concatenate([np.column_stack(side) for side in sides]) * [width_px, height_px]
