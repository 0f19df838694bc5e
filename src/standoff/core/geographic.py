"""Longitude and latitude as metres on a site."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from standoff.core.homography import FloatArray

_SEMI_MAJOR_M = 6378137.0
_ECCENTRICITY_2 = 0.00669437999014

DEGREES: Final = "degrees of longitude and latitude"
_SITE_SPAN: Final = 0.05
"""Five kilometres in degrees, fifty metres in kilometres; as metres, five centimetres, which is no site."""
_LOCAL_KM: Final = 1.0
"""Kilometres of one site are counted from somewhere near it; a degree off both the equator and Greenwich is sea."""
_SHORTEST_KM: Final = 0.003
"""In degrees, 300 m."""
_FARTHEST_M: Final = 2.1e7
"""Half around the earth: no projection's coordinates are larger."""


@dataclass(frozen=True, slots=True)
class GeographicOrigin:
    """Where on the earth (WGS 84) a site frame with x east and y north begins.

    Attributes:
        longitude_deg: Of the origin, east.
        latitude_deg: Of the origin, north.
        middle_latitude_deg: Where the plane touches the ellipsoid.
    """

    longitude_deg: float
    latitude_deg: float
    middle_latitude_deg: float

    @classmethod
    def of(cls, lonlat_deg: FloatArray) -> Self:
        """Return the frame that begins at the first of some places (N, 2) of a site and touches in their middle."""
        longitude_deg, latitude_deg = lonlat_deg[0].tolist()
        return cls(longitude_deg, latitude_deg, float(lonlat_deg[:, 1].mean()))

    def to_metres(self, lonlat_deg: FloatArray) -> FloatArray:
        """Turn longitudes and latitudes (N, 2) into metres (N, 2) east and north of the origin.

        On the plane that touches the ellipsoid: within a kilometre it is right to a millimetre or so of that plane;
        heights, 300 m for 0.005 %, play no part.

        Source:
            Radii of curvature of the ellipsoid in the meridian and across it; Snyder, Map Projections: A Working
            Manual (1987), equations 4-18 and 4-20.
        """
        offset_deg = lonlat_deg - np.array([self.longitude_deg, self.latitude_deg])
        # A site on the antimeridian is one site.
        offset_deg[:, 0] = (offset_deg[:, 0] + 180.0) % 360.0 - 180.0
        places_m: FloatArray = np.deg2rad(offset_deg) * self._metres_a_radian()
        return places_m

    def to_lonlat(self, places_m: FloatArray) -> FloatArray:
        """Turn metres (N, 2) east and north of the origin into longitudes and latitudes (N, 2), as exactly."""
        lonlat_deg: FloatArray = np.rad2deg(places_m / self._metres_a_radian())
        lonlat_deg += np.array([self.longitude_deg, self.latitude_deg])
        lonlat_deg[:, 0] = (lonlat_deg[:, 0] + 180.0) % 360.0 - 180.0
        return lonlat_deg

    def _metres_a_radian(self) -> FloatArray:
        """Return how many metres a radian of longitude and one of latitude are, where the plane touches."""
        latitude = np.deg2rad(self.middle_latitude_deg)
        w = np.sqrt(1.0 - _ECCENTRICITY_2 * np.sin(latitude) ** 2)
        across_m, along_m = _SEMI_MAJOR_M / w, _SEMI_MAJOR_M * (1.0 - _ECCENTRICITY_2) / w**3
        return np.array([across_m * np.cos(latitude), along_m])


def east_north_m(lonlat_deg: FloatArray) -> FloatArray:
    """Turn longitudes and latitudes (WGS 84) of one site into metres east and north of the first of them.

    Args:
        lonlat_deg: (N, 2) longitude east and latitude north, degrees; N >= 1.

    Returns:
        (N, 2) metres.

    >>> east_north_m(np.array([[8.0, 50.0], [8.001, 50.0], [8.0, 50.001]])).round(2)
    array([[  0.  ,   0.  ],
           [ 71.7 ,   0.  ],
           [  0.  , 111.23]])
    """
    return GeographicOrigin.of(lonlat_deg).to_metres(lonlat_deg)


def likely_unit(places: FloatArray) -> str:
    """Tell in what coordinates (N, 2) that are said to be metres more likely are; "" where they can be metres.

    >>> likely_unit(np.array([[8.5, 50.1], [8.5002, 50.1001]])), likely_unit(np.array([[0.0, 0], [9, 4]]))
    ('degrees of longitude and latitude', '')
    >>> likely_unit(np.array([[0.0, 0.0], [0.03, 0.02]]))
    'kilometres'
    """
    if len(places) < 2:
        return ""
    largest = np.abs(places).max(axis=0)
    span = float(np.ptp(places, axis=0).max())
    if span < _SITE_SPAN:
        are_km = (largest < _LOCAL_KM).all() and span > _SHORTEST_KM
        return "kilometres" if are_km or (largest > 180.0).any() else DEGREES
    if largest.max() > _FARTHEST_M:
        # A kilometre is 90 000 of the one, 100 000 of the other.
        return "degrees times 10^7, or centimetres of a map" if largest.max() <= 1.8e9 else "millimetres of a map"
    return ""
