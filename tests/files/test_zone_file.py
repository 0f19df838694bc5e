"""Zones as people draw them: what is right becomes polygons in metres, what is wrong one line."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated

from standoff.core.errors import ConfigError
from standoff.core.geographic import GeographicOrigin
from standoff.core.homography import FloatArray
from standoff.core.zones import Zone
from standoff.files.rings import faults_of
from standoff.files.zone_file import read_zones, write_zones

SQUARE = [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]
HOLE = [[1, 1], [1, 2], [2, 2], [2, 1], [1, 1]]
ISLE = [[20, 0], [24, 0], [24, 4], [20, 0]]
FRANKFURT = GeographicOrigin(8.5, 50.1, 50.1)


def feature(name: object = "pit", kind: object = "no_go", form: str = "Polygon", coordinates: Any = (SQUARE,)) -> Any:
    geometry = {"type": form, "coordinates": coordinates}
    return {"type": "Feature", "properties": {"name": name, "kind": kind, "fid": 7}, "geometry": geometry}


def collection(*features: Any, **members: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features), **members}


def read(folder: Path, content: object, origin: GeographicOrigin | None = None) -> tuple[Zone, ...]:
    path = folder / "zones.geojson"
    path.write_text(json.dumps(content), encoding="utf-8")
    return read_zones(path, origin)


def as_shapely(polygons: Any) -> shapely.MultiPolygon:
    return shapely.MultiPolygon([(polygon[0], polygon[1:]) for polygon in polygons])


def test_polygons_with_holes_and_several_parts_are_zones_of_the_same_area(tmp_path: Path) -> None:
    parts = [[SQUARE, HOLE], [ISLE]]
    pit, gate = read(tmp_path, collection(feature(), feature("gate", "crossing", "MultiPolygon", parts)))
    assert [(zone.name, zone.kind) for zone in (pit, gate)] == [("pit", "no_go"), ("gate", "crossing")]
    points = np.random.default_rng(0).uniform(-3.0, 27.0, (500, 2))
    for zone, drawn in ((pit, [[SQUARE]]), (gate, parts)):
        peer = as_shapely(drawn)
        assert zone.contains(points).tolist() == [bool(shapely.contains_xy(peer, x, y)) for x, y in points]
        gaps_m, _ = zone.gap_m(points)
        expected = shapely.distance(peer.boundary, shapely.points(points))
        np.testing.assert_allclose(gaps_m, np.where(zone.contains(points), -expected, expected), atol=1e-9)


def test_heights_and_members_that_nobody_asked_for_are_passed_over(tmp_path: Path) -> None:
    raised = [[[*place, 101.5] for place in SQUARE]]
    plain = read(tmp_path, collection(feature()))
    content = collection(feature(7, coordinates=raised), bbox=[0, 0, 6, 4], crs=None)
    (zone,) = read(tmp_path, content)
    assert zone.name == "7"
    np.testing.assert_array_equal(zone.outline_m, plain[0].outline_m)


def test_what_is_written_is_read_back_as_it_was(tmp_path: Path) -> None:
    parts = [[SQUARE, HOLE], [ISLE]]
    zones = read(tmp_path, collection(feature("a"), feature("b", "machine_only", "MultiPolygon", parts)))
    write_zones(tmp_path / "again.geojson", zones)
    again = read_zones(tmp_path / "again.geojson")
    assert [(zone.name, zone.kind) for zone in again] == [(zone.name, zone.kind) for zone in zones]
    for zone, other in zip(zones, again, strict=True):
        np.testing.assert_array_equal(zone.outline_m, other.outline_m)


def degrees(corners_m: Any) -> list[list[float]]:
    """Return places as degrees, by the usual series for the lengths of a degree."""
    phi = np.deg2rad(50.1)
    east_m = 111412.84 * np.cos(phi) - 93.5 * np.cos(3 * phi) + 0.118 * np.cos(5 * phi)
    north_m = 111132.92 - 559.82 * np.cos(2 * phi) + 1.175 * np.cos(4 * phi) - 0.0023 * np.cos(6 * phi)
    return [[8.5 + x / east_m, 50.1 + y / north_m] for x, y in corners_m]


@pytest.mark.parametrize("crs", [None, "urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:EPSG::4326"])
def test_degrees_become_metres_of_a_site_whose_place_on_the_earth_is_known(tmp_path: Path, crs: str | None) -> None:
    members = {"crs": {"type": "name", "properties": {"name": crs}}} if crs else {}
    (zone,) = read(tmp_path, collection(feature(coordinates=[degrees(SQUARE)]), **members), FRANKFURT)
    np.testing.assert_allclose(zone.rings_m[0], np.array(SQUARE[:-1]), atol=1e-4)


def test_degrees_are_refused_where_nobody_said_where_the_site_is(tmp_path: Path) -> None:
    for members in ({}, {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}}):
        with pytest.raises(ConfigError, match=r"degrees of longitude and latitude in .*points with lonlat"):
            read(tmp_path, collection(feature(coordinates=[degrees(SQUARE)]), **members))


def test_latitude_before_longitude_is_refused(tmp_path: Path) -> None:
    swapped = [[y, x] for x, y in degrees(SQUARE)]
    with pytest.raises(ConfigError, match=r"km away in .* Write longitude first"):
        read(tmp_path, collection(feature(coordinates=[swapped])), FRANKFURT)


def test_a_file_that_is_wrong_gets_one_line_that_says_how(tmp_path: Path) -> None:
    bowtie = [[0, 0], [4, 4], [4, 0], [0, 4], [0, 0]]
    spike = [[0, 0], [4, 0], [4, 4], [9, 4], [4, 4], [0, 4], [0, 0]]
    far_hole = [[30, 1], [31, 1], [31, 2], [30, 1]]
    grid = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}
    wrong: list[tuple[Any, str]] = [
        ([], "an object of names and values"),
        ({"type": "Feature"}, "type 'Feature'"),
        (collection(), "0 features"),
        ({"type": "FeatureCollection"}, "no list of features"),
        (collection({"type": "Polygon"}), "a Feature, found type 'Polygon' in feature 1"),
        (collection(feature(name=None)), "a name, found nothing in feature 1"),
        (collection(feature(name=" ")), "a name, found ' ' in feature 1"),
        (collection(feature(name=True)), "a name, found True"),
        (collection(feature(name="a\nb")), "at most 60 letters"),
        (collection(feature(), feature()), "'pit' twice"),
        (collection(feature(kind="nogo")), "no_go, machine_only, crossing, found 'nogo' in 'pit'"),
        (collection(feature(kind=["no_go"])), "found ['no_go'] in 'pit'"),
        (collection(feature(form="LineString")), "a Polygon or MultiPolygon, found 'LineString'"),
        (collection({**feature(), "geometry": None}), "nothing for the geometry of 'pit'"),
        (collection(feature(coordinates=[])), "a list of rings"),
        (collection(feature(coordinates=[[]])), "a list of places"),
        (collection(feature(coordinates=[SQUARE[:-1]])), "end where they begin"),
        (collection(feature(coordinates=[[[0, 0], [1, 1], [0, 0]]])), "four places or more"),
        (collection(feature(coordinates=[[[0, 0], [5, 5], [5, 5], [0, 0]]])), "without an area"),
        (collection(feature(coordinates=[[[0], *SQUARE[1:]]])), "two numbers, or three, found [0]"),
        (collection(feature(coordinates=[[[0, "a"], *SQUARE[1:]]])), "two numbers, or three"),
        (collection(feature(coordinates=[[[0, 1e300], *SQUARE[1:]]])), "finite coordinates"),
        (collection(feature(coordinates=[bowtie])), "crosses or touches itself"),
        (collection(feature(coordinates=[spike])), "crosses or touches itself"),
        (collection(feature(coordinates=[SQUARE, far_hole])), "a hole outside its polygon"),
        (collection(feature(coordinates=[SQUARE, [[5, 1], [8, 1], [8, 2], [5, 1]]])), "rings that cross each other"),
        (collection(feature(coordinates=[SQUARE, HOLE, HOLE])), "a hole in a hole"),
        (collection(feature(form="MultiPolygon", coordinates=[[SQUARE], [HOLE]])), "a polygon in another"),
        (collection(feature(), crs=grid), "crs 'urn:ogc:def:crs:EPSG::25832'"),
        (collection(feature(), crs="EPSG:25832"), "crs 'EPSG:25832'"),
    ]
    for content, message in wrong:
        with pytest.raises(ConfigError) as caught:
            read(tmp_path, content)
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_polygon_in_the_hole_of_another_is_no_fault() -> None:
    outer, hole, isle = (np.array([[-r, -r], [r, -r], [r, r], [-r, r]], dtype=float) for r in (9.0, 6.0, 3.0))
    assert faults_of([[outer, hole], [isle]]) == ""


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=3, max_size=9))
@examples(150)
def test_a_ring_has_a_fault_where_shapely_finds_it_invalid(corners: list[tuple[int, int]]) -> None:
    ring: FloatArray = np.array([one for k, one in enumerate(corners) if one != corners[k - 1]], dtype=np.float64)
    peer = shapely.Polygon(ring) if len(ring) > 2 else None
    assert (faults_of([[ring]]) == "") == (peer is not None and shapely.is_valid(peer) and peer.area > 0.01)


_VALID = json.dumps(
    collection(feature("a"), feature("ü", "crossing", "MultiPolygon", [[SQUARE, HOLE], [ISLE]])), ensure_ascii=False
).encode()


@examples(200)
@given(mutated(st.just(_VALID)))
def test_a_damaged_file_is_zones_or_one_line(content: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "zones.geojson"
        path.write_bytes(content)
        for origin in (None, FRANKFURT):
            try:
                zones = read_zones(path, origin)
            except ConfigError as error:
                assert "\n" not in str(error)
            else:
                assert all(np.isfinite(zone.outline_m).all() for zone in zones)
