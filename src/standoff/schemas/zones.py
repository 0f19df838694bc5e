"""The zones of a run, as they were used, as JSON Schema."""

from __future__ import annotations

from typing import Any, Final

from standoff.core.zones import ZONE_KINDS

_CORNER: Final = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2, "unit": "m"}
_RING: Final = {"type": "array", "items": _CORNER, "minItems": 4, "description": "ends where it begins"}
_POLYGON: Final = {"type": "array", "items": _RING, "minItems": 1, "description": "outer ring, then holes"}


def zones_schema() -> dict[str, Any]:
    """Return what the zones are: GeoJSON (RFC 7946), but for its unit, which is metres of the site frame."""
    kind = {"enum": [*ZONE_KINDS]}
    properties = {"type": "object", "properties": {"name": {"type": "string"}, "kind": kind}}
    coordinates = {"type": "array", "items": _POLYGON, "minItems": 1}
    geometry = {"type": "object", "properties": {"type": {"const": "MultiPolygon"}, "coordinates": coordinates}}
    feature = {"type": {"const": "Feature"}, "properties": properties, "geometry": geometry}
    for one in (properties, geometry):
        one["required"] = [*one["properties"]]
    features = {"type": "array", "items": {"type": "object", "properties": feature, "required": [*feature]}}
    whole = {"type": {"const": "FeatureCollection"}, "unit": {"const": "m, site frame"}, "features": features}
    return {"type": "object", "properties": whole, "required": [*whole]}
