"""What devices send: plain JSON, so that the smallest can."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval, MaxLen, MinLen


@dataclass(frozen=True, slots=True)
class DevicePosition:
    """Where a device is: in the site frame (UWB), or by longitude and latitude (GNSS).

    Attributes:
        sigma_m: Standard error of the place, in each horizontal direction.
        x_m: Site frame; goes with y_m.
        y_m: Site frame.
        longitude_deg: WGS 84; goes with latitude_deg.
        latitude_deg: WGS 84.
        age_ms: How old the measurement is as it is sent.
    """

    sigma_m: Annotated[float, Interval(gt=0, le=1000)]
    x_m: Annotated[float, Interval(ge=-1e7, le=1e7)] | None = None
    y_m: Annotated[float, Interval(ge=-1e7, le=1e7)] | None = None
    longitude_deg: Annotated[float, Interval(ge=-180, le=180)] | None = None
    latitude_deg: Annotated[float, Interval(ge=-90, le=90)] | None = None
    age_ms: Annotated[float, Interval(ge=0, le=1e9)] = 0.0

    def __post_init__(self) -> None:
        in_site = (self.x_m is not None, self.y_m is not None)
        on_earth = (self.longitude_deg is not None, self.latitude_deg is not None)
        if sorted([in_site, on_earth]) != [(False, False), (True, True)]:
            raise ValueError("give x_m and y_m, or longitude_deg and latitude_deg")

    @property
    def in_site_frame(self) -> bool:
        """Whether the place is in the site frame already."""
        return self.x_m is not None


@dataclass(frozen=True, slots=True)
class Acknowledgement:
    """Somebody has taken note of a hazard.

    Attributes:
        hazard_id: Of the hazard.
    """

    hazard_id: Annotated[str, MinLen(1), MaxLen(64)]


@dataclass(frozen=True, slots=True)
class Echo:
    """A device has shown an alert: so the way to the wrist is measured without clocks that agree.

    Attributes:
        id: Of the alert.
        held_ms: From its arrival at the device to the moment at which it was shown.
    """

    id: Annotated[str, MinLen(1), MaxLen(200)]
    held_ms: Annotated[float, Interval(ge=0, le=1e9)]
