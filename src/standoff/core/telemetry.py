"""What a drone says of itself at one moment: how high, where it looks, where it is, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass

_WITH_SIGMA = (
    ("height_m", "height_sigma_m"),
    ("pitch_deg", "pitch_sigma_deg"),
    ("roll_deg", "roll_sigma_deg"),
    ("heading_deg", "heading_sigma_deg"),
    ("latitude_deg", "position_sigma_m"),
    ("longitude_deg", "position_sigma_m"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Telemetry:
    """A drone's own readings for one moment; NaN where the source does not say.

    The angles are those of the camera, not of the airframe, and as `standoff.core.pose.View.aimed` takes them.

    Attributes:
        time_s: Presentation timestamp that the readings are for.
        origin: Where they come from, for people: a file's name, "EXIF".
        height_m: Above the point of take-off, which is not always the height above the ground below.
        height_sigma_m: Its standard error.
        pitch_deg: Downwards from the horizon: 0 looks at it, 90 straight down.
        pitch_sigma_deg: Its standard error.
        roll_deg: Right side of the picture down is positive.
        roll_sigma_deg: Its standard error.
        heading_deg: Where the picture's upper edge points on the ground, clockwise from north.
        heading_sigma_deg: Its standard error.
        latitude_deg: WGS84; NaN together with the longitude.
        longitude_deg: WGS84.
        position_sigma_m: Standard error of the place, in each horizontal direction.
        altitude_m: Above the sea. From air pressure taken as standard on many drones, and then wrong by up to 100 m.
        focal_mm_35: Focal length in terms of 35 mm film.

    Raises:
        ValueError: A reading is out of its range, or has no standard error.
    """

    time_s: float
    origin: str
    height_m: float = math.nan
    height_sigma_m: float = math.nan
    pitch_deg: float = math.nan
    pitch_sigma_deg: float = math.nan
    roll_deg: float = math.nan
    roll_sigma_deg: float = math.nan
    heading_deg: float = math.nan
    heading_sigma_deg: float = math.nan
    latitude_deg: float = math.nan
    longitude_deg: float = math.nan
    position_sigma_m: float = math.nan
    altitude_m: float = math.nan
    focal_mm_35: float = math.nan

    def __post_init__(self) -> None:
        if not math.isfinite(self.time_s):
            raise ValueError("Telemetry.time_s must be finite")
        for name, sigma_name in _WITH_SIGMA:
            value, sigma = getattr(self, name), getattr(self, sigma_name)
            if math.isinf(value) or (math.isfinite(value) and not (math.isfinite(sigma) and sigma > 0)):
                raise ValueError(f"Telemetry.{name} must be finite with a positive {sigma_name}, or NaN")
        if math.isnan(self.latitude_deg) != math.isnan(self.longitude_deg):
            raise ValueError("Telemetry.latitude_deg and longitude_deg go together")
        if abs(self.latitude_deg) > 90.0 or abs(self.longitude_deg) > 180.0:
            raise ValueError("Telemetry.latitude_deg or longitude_deg is not on the Earth")
        if self.focal_mm_35 <= 0 or math.isinf(self.focal_mm_35) or math.isinf(self.altitude_m):
            raise ValueError("Telemetry.focal_mm_35 must be positive, altitude_m finite, or NaN")

    @property
    def has_attitude(self) -> bool:
        """Whether pitch, roll and heading are all known."""
        return math.isfinite(self.pitch_deg) and math.isfinite(self.roll_deg) and math.isfinite(self.heading_deg)

    @property
    def has_position(self) -> bool:
        """Whether latitude and longitude are known."""
        return math.isfinite(self.latitude_deg)
