"""`moments.geojson`: where on the earth the worst moments of all films were, for a GIS."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from standoff.config import Settings, site_origin
from standoff.core.geographic import GeographicOrigin
from standoff.files.json_text import write_json
from standoff.scale.result import FilmResult, Moment

_DIGITS = 7
"""Of a degree: a centimetre."""


def write_moments(results: Sequence[FilmResult], path: Path, settings: Settings) -> bool:
    """Write the worst moments as points (RFC 7946, WGS 84), if the site has a place on the earth.

    Args:
        results: Of all films.
        path: The file.
        settings: Of all films: a survey in degrees says where the site is.

    Returns:
        Whether it was written: False where nothing says where on the earth the site is.

    Raises:
        OutputError: The file cannot be written.
        GroundError: The survey cannot be read.
    """
    origin = site_origin(settings)
    if origin is None:
        return False
    moments = [(one, moment) for one in results if one.found is not None for moment in one.found.worst]
    features = [_feature(one, moment, origin) for one, moment in moments if moment.place_m is not None]
    write_json(path, {"type": "FeatureCollection", "features": features})
    return True


def _feature(one: FilmResult, moment: Moment, origin: GeographicOrigin) -> dict[str, Any]:
    (lonlat_deg,) = origin.to_lonlat(np.array([moment.place_m])).round(_DIGITS).tolist()
    about = {"time_s": moment.time_s, "severity": moment.severity, "between": moment.between, "gap_m": moment.gap_m}
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": lonlat_deg},
        "properties": {"film": one.film.name, **about},
    }
