"""How far off a drone's instruments are, as standard errors, from what their makers publish."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from standoff.core.telemetry import Telemetry


@dataclass(frozen=True, slots=True)
class InstrumentErrors:
    """Standard errors of one kind of drone.

    Attributes:
        position_m: Of GPS, in each horizontal direction.
        height_m: Of the barometer, drift since take-off included.
        height_share: Of the height as well: air that is 6 degrees from standard reads 2 per cent long or short.
        pitch_deg: Of the gimbal against the true horizon.
        roll_deg: The same.
        heading_deg: Of the compass beside motors and steel.
    """

    position_m: float
    height_m: float
    height_share: float
    pitch_deg: float
    roll_deg: float
    heading_deg: float


# DJI's specifications give hovering to 0.5 m (vertical) and 1.5 m (horizontal) for all models listed in
# `drone_cameras`; operators see 2 m between landings of long flights. Gimbals vibrate by 0.005 to 0.02 degrees only:
# what remains is the inertial unit's idea of the vertical, a few tenths of a degree on calibrated survey drones.
PROFESSIONAL = InstrumentErrors(
    position_m=1.5, height_m=0.8, height_share=0.02, pitch_deg=0.5, roll_deg=0.5, heading_deg=4.0
)
"""Of drones that are made for surveying and inspection."""

CONSUMER = InstrumentErrors(
    position_m=1.5, height_m=0.8, height_share=0.02, pitch_deg=1.0, roll_deg=0.5, heading_deg=5.0
)
"""Of all others."""


def telemetry_of(
    readings: Mapping[str, float], time_s: float, origin: str, errors: InstrumentErrors
) -> Telemetry:  # fmt: skip
    """Put standard errors to readings.

    Args:
        readings: By field of `Telemetry`; absent or NaN: not known.
        time_s: The moment.
        origin: Where they come from.
        errors: Of the drone.
    """
    known = {name: value for name, value in readings.items() if math.isfinite(value)}
    sigmas = {
        "height_m": ("height_sigma_m", math.hypot(errors.height_m, errors.height_share * known.get("height_m", 0.0))),
        "pitch_deg": ("pitch_sigma_deg", errors.pitch_deg),
        "roll_deg": ("roll_sigma_deg", errors.roll_deg),
        "heading_deg": ("heading_sigma_deg", errors.heading_deg),
        "latitude_deg": ("position_sigma_m", errors.position_m),
    }
    return Telemetry(time_s, origin, **known, **{sigmas[name][0]: sigmas[name][1] for name in known if name in sigmas})
