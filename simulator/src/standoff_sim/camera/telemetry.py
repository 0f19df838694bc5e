"""A drone's flight data as it writes them beside a video: SubRip with one block a frame, DJI's bracketed dialect.

The errors are those of a drone without corrections from a base station: the true flight is in the clip's truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.movement.band_noise import BandNoise
from standoff_sim.scene.scene import Flight

_EQUATOR_M, _FLATTENING = 6_378_137.0, 1 / 298.257223563  # WGS84
DRIFT_BAND_HZ = (0.002, 0.02)
"""What GPS and barometer wander by within minutes."""
_FULL_FRAME_WIDTH_MM = 36.0


@dataclass(frozen=True, slots=True)
class Origin:
    """Where the site's origin is on the Earth, and when the clip was taken.

    Attributes:
        latitude_deg: WGS84.
        longitude_deg: WGS84.
        altitude_m: Of z = 0, where the drone took off.
        start: Local time of the first frame, as drones write it.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    start: datetime

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Origin:
        """Draw a place of inhabited latitudes and a working hour."""
        day = datetime(2024, 1, 1, 7, tzinfo=UTC) + timedelta(days=int(rng.integers(0, 366)))
        return cls(
            float(rng.uniform(20.0, 60.0) * rng.choice([-1.0, 1.0], p=[0.3, 0.7])),
            float(rng.uniform(-120.0, 140.0)),
            float(rng.uniform(0.0, 400.0)),
            day + timedelta(seconds=float(rng.uniform(0.0, 9 * 3600.0))),
        )

    def degrees(self, xy_m: FloatArray) -> tuple[float, float]:
        """Return latitude and longitude of a point, on the plane that touches the ellipsoid at the origin.

        Args:
            xy_m: (2,) site frame.
        """
        sine = np.sin(np.deg2rad(self.latitude_deg))
        squared = _FLATTENING * (2 - _FLATTENING)
        across_m = _EQUATOR_M / np.sqrt(1 - squared * sine**2)
        along_m = across_m * (1 - squared) / (1 - squared * sine**2)
        north_deg = np.rad2deg(xy_m[1] / along_m)
        east_deg = np.rad2deg(xy_m[0] / (across_m * np.cos(np.deg2rad(self.latitude_deg))))
        return float(self.latitude_deg + north_deg), float(self.longitude_deg + east_deg)


@dataclass(frozen=True, slots=True, eq=False)
class TelemetryErrors:
    """What the instruments are off by: constants and slow drifts.

    Attributes:
        position_m: (2,) of GPS, 0.5-1.5 m in any direction.
        position_drift_m: Of x and y.
        altitude_m: Of the barometer, 0.3-0.8 m up or down.
        altitude_drift_m: The same.
        heading_deg: Of the compass, 1-3 degrees to either side.
        pitch_deg: Of the gimbal, within 0.2 degrees.
        roll_deg: The same.
    """

    position_m: FloatArray
    position_drift_m: tuple[BandNoise, BandNoise]
    altitude_m: float
    altitude_drift_m: BandNoise
    heading_deg: float
    pitch_deg: float
    roll_deg: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TelemetryErrors:
        """Draw one flight's errors."""
        direction_rad = rng.uniform(0.0, 2 * np.pi)
        east, north = (BandNoise.draw(rng, DRIFT_BAND_HZ, 0.1) for _ in range(2))
        return cls(
            rng.uniform(0.6, 1.5) * np.array([np.cos(direction_rad), np.sin(direction_rad)]),
            (east, north),
            float(rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.8)),
            BandNoise.draw(rng, DRIFT_BAND_HZ, 0.05),
            float(rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 3.0)),
            float(rng.uniform(-0.2, 0.2)),
            float(rng.uniform(-0.2, 0.2)),
        )


@dataclass(frozen=True, slots=True)
class ShownSettings:
    """The camera's settings as the telemetry shows them."""

    iso: int = 100
    shutter_hz: float = 400.0
    f_number: float = 2.8
    colour_temperature_k: int = 5400


def write_telemetry(
    path: Path, flight: Flight, times_s: FloatArray, rng: np.random.Generator, settings: ShownSettings | None = None,
    *, origin: Origin | None = None,
) -> None:  # fmt: skip
    """Write one block a frame.

    Args:
        path: The file, usually `telemetry.srt`.
        flight: The true one.
        times_s: (N,) presentation times of the frames.
        rng: Decides on the errors, and before them on the place on Earth and the hour unless they are given.
        settings: Of the camera.
        origin: The place and the hour, where another drone has them already.
    """
    origin, errors = origin or Origin.draw(rng), TelemetryErrors.draw(rng)
    settings = settings or ShownSettings()
    ends_s = np.append(times_s[1:], times_s[-1] + (times_s[-1] - times_s[-2] if len(times_s) > 1 else 1 / 30))
    blocks = [
        _block(index + 1, (start_s, end_s), origin, _readings(flight.view(start_s), start_s, origin, errors), settings)
        for index, (start_s, end_s) in enumerate(zip(times_s.tolist(), ends_s.tolist(), strict=True))
    ]
    path.write_text("".join(blocks), encoding="utf-8")


def gimbal_angles_deg(view: View) -> tuple[float, float, float]:
    """Return yaw, pitch and roll as drones write them.

    Yaw is clockwise from north, -180 to 180; pitch is 0 at the horizon and -90 straight down; roll is positive when the
    right side of the picture is down. Straight down, all turning is yaw.
    """
    right, down, forward = view.site_to_camera
    pitch_deg = np.rad2deg(np.arcsin(np.clip(forward[2], -1.0, 1.0)))
    if np.hypot(forward[0], forward[1]) < 1e-9:
        return float(np.rad2deg(np.arctan2(-right[1], right[0]))), float(pitch_deg), 0.0
    # beyond straight down the picture's upper edge, not its middle, tells where the camera is heading
    ahead = forward if down[2] <= 0 else -forward
    pitch_deg = pitch_deg if down[2] <= 0 else -180.0 - pitch_deg
    yaw_rad = np.arctan2(ahead[0], ahead[1])
    level = np.array([np.cos(yaw_rad), -np.sin(yaw_rad), 0.0])
    roll_rad = np.arctan2(right @ np.cross(forward, level), right @ level)
    return float(np.rad2deg(yaw_rad)), float(pitch_deg), float(np.rad2deg(roll_rad))


def _readings(view: View, time_s: float, origin: Origin, errors: TelemetryErrors) -> dict[str, str]:
    """Return what the instruments show, as text."""
    drift_m = np.array([noise.at(time_s) for noise in errors.position_drift_m])
    latitude_deg, longitude_deg = origin.degrees(view.position_m[:2] + errors.position_m + drift_m)
    height_m = view.position_m[2] + errors.altitude_m + errors.altitude_drift_m.at(time_s)
    yaw_deg, pitch_deg, roll_deg = gimbal_angles_deg(view)
    yaw_deg = (yaw_deg + errors.heading_deg + 180.0) % 360.0 - 180.0
    focal_mm = view.camera.matrix[0, 0] / view.camera.width_px * _FULL_FRAME_WIDTH_MM
    return {
        "focal_len": f"{focal_mm:.2f}",
        "latitude": f"{latitude_deg:.6f}",
        "longitude": f"{longitude_deg:.6f}",
        "rel_alt": f"{height_m:.3f}",
        "abs_alt": f"{height_m + origin.altitude_m:.3f}",
        "gb_yaw": f"{yaw_deg:.1f}",
        "gb_pitch": f"{pitch_deg + errors.pitch_deg:.1f}",
        "gb_roll": f"{roll_deg + errors.roll_deg:.1f}",
    }


def _block(
    count: int, span_s: tuple[float, float], origin: Origin, shown: dict[str, str], settings: ShownSettings
) -> str:
    start_ms, end_ms = (round(1000 * time_s) for time_s in span_s)
    moment = origin.start + timedelta(seconds=span_s[0])
    return (
        f"{count}\n{_clock(start_ms)} --> {_clock(end_ms)}\n"
        f'<font size="28">FrameCnt: {count}, DiffTime: {end_ms - start_ms}ms\n'
        f"{moment:%Y-%m-%d %H:%M:%S}.{moment.microsecond // 1000:03d}\n"
        f"[iso: {settings.iso}] [shutter: 1/{settings.shutter_hz:.1f}] [fnum: {settings.f_number}] [ev: 0] "
        f"[color_md: default] [focal_len: {shown['focal_len']}] "
        f"[latitude: {shown['latitude']}] [longitude: {shown['longitude']}] "
        f"[rel_alt: {shown['rel_alt']} abs_alt: {shown['abs_alt']}] [ct: {settings.colour_temperature_k}] "
        f"[gb_yaw: {shown['gb_yaw']} gb_pitch: {shown['gb_pitch']} gb_roll: {shown['gb_roll']}] </font>\n\n"
    )


def _clock(time_ms: int) -> str:
    """Write a time as SubRip does.

    >>> _clock(3_723_045)
    '01:02:03,045'
    """
    seconds, milliseconds = divmod(time_ms, 1000)
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:02d}:{minutes:02d}:{seconds:02d},{milliseconds:03d}"
