"""Zones as GeoJSON: what people draw on a plan or in a GIS, read strictly, and written as it was used.

    {"type": "FeatureCollection", "features": [
      {"type": "Feature",
       "properties": {"name": "pit", "kind": "no_go"},        # no_go, machine_only or crossing
       "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]]}}]}

Geometries are Polygon and MultiPolygon, with holes; each ring ends where it begins. Coordinates are metres of the site
frame, or degrees of longitude and latitude (WGS 84), as GIS programs write them, where the site frame has a place on
the earth. A third number, the height, is not used; other properties and members are passed over.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from standoff.core.errors import ConfigError
from standoff.core.geographic import DEGREES, GeographicOrigin, likely_unit
from standoff.core.homography import FloatArray
from standoff.core.zones import ZONE_KINDS, Ring, Zone
from standoff.files.json_text import read_json, write_json
from standoff.files.rings import faults_of

_WHAT: Final = "zones, a GeoJSON FeatureCollection of polygons"
_DEGREES: Final = ("CRS84", "EPSG::4326", "EPSG:4326")
"""How the end of an old file's `crs` names WGS 84."""
_MOST_CORNERS: Final = 1000
_MOST_ZONES: Final = 200
_FURTHEST_M: Final = 1e8
"""Beyond, squares of metres lose their millimetres; no plan counts from so far."""
_SITE_M: Final = 20e3
"""Longitude and latitude in the wrong order lie further away."""
_LONGEST_NAME: Final = 60
_FIX: Final = "correct the file"


def read_zones(path: Path, origin: GeographicOrigin | None = None) -> tuple[Zone, ...]:
    """Read the zones of a site.

    Args:
        path: A GeoJSON file as at this module's head.
        origin: Where on the earth the site frame begins; None: nobody said, and degrees are refused.

    Raises:
        ConfigError: It cannot be read, or says something else; in one line.
    """
    content = _mapping(read_json(path, _WHAT, ConfigError), f"{path}")
    if content.get("type") != "FeatureCollection":
        raise _refused(_WHAT, f"{path}: type {_short(content.get('type'))}", "put the polygons in a FeatureCollection")
    features = content.get("features")
    if not isinstance(features, list) or not 0 < len(features) <= _MOST_ZONES:
        found = f"{len(features)} features" if isinstance(features, list) else "no list of features"
        raise _refused(f"1 to {_MOST_ZONES} features", f"{path}: {found}", "draw a polygon, or leave the setting out")
    drawn = [_Drawn.of(feature, f"feature {number} of {path}") for number, feature in enumerate(features, start=1)]
    names = [one.name for one in drawn]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise _refused("distinct names", f"{twice!r} twice in {path}", "rename one")
    in_degrees = _is_in_degrees(content, [one.corners for one in drawn], path, origin)
    return tuple(one.zone(origin if in_degrees else None) for one in drawn)


def write_zones(path: Path, zones: tuple[Zone, ...]) -> None:
    """Write zones as `read_zones` reads them, in metres of the site frame; whole or not at all.

    Raises:
        OutputError: The file cannot be written.
    """
    features = [
        {
            "type": "Feature",
            "properties": {"name": zone.name, "kind": zone.kind},
            "geometry": {
                "type": "MultiPolygon",
                "coordinates": [[*map(_closed, rings)] for rings in zone.polygons_m],
            },
        }
        for zone in zones
    ]
    write_json(path, {"type": "FeatureCollection", "unit": "m, site frame", "features": features})


class _Drawn:
    """One feature, as it was drawn.

    Args:
        name: Of the zone.
        kind: Of the zone.
        polygons: Rings of each, in the file's unit.
        where: It stands, for messages.
    """

    def __init__(self, name: str, kind: str, polygons: list[list[Ring]], where: str) -> None:
        self.name, self._kind, self._polygons, self._where = name, kind, polygons, where

    @classmethod
    def of(cls, feature: object, where: str) -> _Drawn:
        """Read a feature.

        Raises:
            ConfigError: It is none.
        """
        content = _mapping(feature, where)
        if content.get("type") != "Feature":
            raise _refused("a Feature", f"type {_short(content.get('type'))} in {where}", _FIX)
        properties = _mapping(content.get("properties"), f"the properties of {where}")
        name = _name(properties.get("name"), where)
        where = f"{name!r}, {where}"
        kind = properties.get("kind")
        if kind not in ZONE_KINDS:
            raise _refused(f"a kind, {', '.join(ZONE_KINDS)}", f"{_short(kind)} in {where}", "correct properties.kind")
        geometry = _mapping(content.get("geometry"), f"the geometry of {where}")
        form, coordinates = geometry.get("type"), geometry.get("coordinates")
        if form not in ("Polygon", "MultiPolygon"):
            raise _refused("a Polygon or MultiPolygon", f"{_short(form)} in {where}", "draw an area")
        polygons = _list([coordinates] if form == "Polygon" else coordinates, "polygons", where)
        rings = [[_ring(ring, where) for ring in _list(polygon, "rings", where)] for polygon in polygons]
        corners = sum(len(ring) for polygon in rings for ring in polygon)
        if corners > _MOST_CORNERS:
            raise _refused(f"at most {_MOST_CORNERS} corners", f"{corners} in {where}", "simplify the polygon")
        return cls(name, str(kind), rings, where)

    @property
    def corners(self) -> FloatArray:
        """(N, 2) all of them, in the file's unit."""
        return np.concatenate([ring for polygon in self._polygons for ring in polygon])

    def zone(self, origin: GeographicOrigin | None) -> Zone:
        """Return the zone in metres of the site frame.

        Args:
            origin: Where that begins, for a file in degrees; None: it is in metres.

        Raises:
            ConfigError: Its polygons are none.
        """
        polygons = self._polygons
        if origin is not None:
            polygons = [[origin.to_metres(ring) for ring in polygon] for polygon in polygons]
        fault = faults_of(polygons)
        if fault:
            raise _refused("polygons whose sides do not cross", f"{fault} in {self._where}", "draw it again")
        kind = next(kind for kind in ZONE_KINDS if kind == self._kind)
        return Zone(self.name, kind, polygons)


def _is_in_degrees(
    content: Mapping[str, Any], drawn: list[FloatArray], path: Path, origin: GeographicOrigin | None
) -> bool:
    """Tell whether the file is in degrees; refuse what cannot be told, or turned into metres."""
    stated = _stated_degrees(content.get("crs"), path)
    if not stated and not all(likely_unit(corners) == DEGREES for corners in drawn):
        return False
    corners = np.concatenate(drawn)
    if (np.abs(corners) > np.array([180.0, 90.0])).any():
        raise _refused("degrees [longitude, latitude]", f"{corners[0].tolist()} in {path}", "correct the coordinates")
    if origin is None:
        found = f"degrees of longitude and latitude in {path}" + ("" if stated else ", or areas of a few centimetres")
        fix = "write metres of the site frame, or survey the ground by points with lonlat"
        raise _refused("zones in metres, where nobody said where on the earth the site is", found, fix)
    away_m = float(np.linalg.norm(origin.to_metres(corners), axis=1).max())
    if away_m > _SITE_M:
        fix = "write longitude first, then latitude"
        raise _refused("zones on the site that was surveyed", f"places {away_m / 1e3:.0f} km away in {path}", fix)
    return True


def _stated_degrees(crs: object, path: Path) -> bool:
    """Tell whether the `crs` of an old GeoJSON file says WGS 84."""
    if crs is None:
        return False
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if isinstance(name, str) and name.endswith(_DEGREES):
        return True
    # Metres of a national grid are not those of the site.
    fix = "export it in WGS 84, or write metres of the site frame without crs"
    raise _refused("zones in metres of the site frame or in WGS 84", f"crs {_short(name or crs)} in {path}", fix)


def _name(name: object, where: str) -> str:
    if isinstance(name, int) and not isinstance(name, bool):
        name = str(name)
    if not isinstance(name, str) or not name.strip():
        raise _refused("a name", f"{_short(name)} in {where}", "write it in properties.name")
    name = name.strip()
    if not name.isprintable() or len(name) > _LONGEST_NAME:
        raise _refused(f"a name of at most {_LONGEST_NAME} letters", f"{_short(name)} in {where}", "shorten it")
    return name


def _ring(ring: object, where: str) -> Ring:
    """Return (V, 2) the corners of a ring, the first one not repeated, none twice in a row."""
    places = np.array([_place(one, where) for one in _list(ring, "places", where)])
    if len(places) < 4 or (places[0] != places[-1]).any():
        ends = f"{len(places)} places from {places[0].tolist()} to {places[-1].tolist()}"
        raise _refused("rings of four places or more that end where they begin", f"{ends} in {where}", "close it")
    moves = (np.diff(places, axis=0) != 0).any(axis=1)
    return np.asarray(places[:-1][moves])


def _place(place: object, where: str) -> tuple[float, float]:
    numbers = [one for one in place if _is_number(one)] if isinstance(place, list) else []
    if not isinstance(place, list) or len(numbers) != len(place) or len(place) not in (2, 3):
        raise _refused("places of two numbers, or three", f"{_short(place)} in {where}", _FIX)
    x, y = numbers[:2]
    if not (abs(x) <= _FURTHEST_M and abs(y) <= _FURTHEST_M):
        raise _refused("finite coordinates", f"{_short(place)} in {where}", _FIX)
    return float(x), float(y)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _list(value: object, what: str, where: str) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise _refused(f"a list of {what}", f"{_short(value)} in {where}", _FIX)
    return value


def _mapping(value: object, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise _refused("an object of names and values", f"{_short(value)} for {where}", _FIX)
    return value


def _closed(ring_m: Ring) -> FloatArray:
    return np.concatenate([ring_m, ring_m[:1]])


def _short(value: object) -> str:
    return "nothing" if value is None else f"{value!r:.60}"


def _refused(expected: str, found: str, fix: str) -> ConfigError:
    return ConfigError(expected=expected, found=found, fix=fix)
