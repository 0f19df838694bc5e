"""Survey files: image points with their positions on the ground, as YAML.

    image_size_px: [768, 576]          # of the picture that the points were read from
    points:                            # four or more, not on a line, spread over the ground that matters
      - {name: kerb, px: [412.0, 310.5], m: [0.0, 0.0], z_m: 102.31}   # z_m: optional height
      - {name: manhole, px: [120.0, 400.0], m: [-4.2, 3.1]}
      - ...
    camera: camera.yaml                # optional: removes lens distortion; relative to this file
    area_px: [[0, 200], [767, 200], [767, 575], [0, 575]]   # optional: where the map is to be trusted
    point_sigma_px: 1.0                # optional: how well a point was read, one coordinate
    time_s: 0.0                        # where the camera moves: when the picture was taken, by the film's clock

Where three or more points that are not on a line have a height `z_m`, metres upwards from any level, the ground is the
plane through these heights, sloping as it may; distances stay horizontal.

A point has either `m`, or `lonlat: [8.543210, 50.123456]`: degrees of longitude and latitude (WGS 84), which become
metres east and north of the first point.

Pixels: the centre of the top-left pixel is (0, 0), x right, y down. Metres: x east, y north, or any other
right-handed axes seen from above. Names are optional and only serve messages.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.geographic import GeographicOrigin, likely_unit
from standoff.core.homography import FloatArray
from standoff.stages.ground.camera_file import load_camera
from standoff.stages.ground.surveyed_ground import SurveyedGround
from standoff.stages.ground.yaml_file import check_keys, numbers, read_mapping

_WHAT = "a survey file"
_KEYS = ("image_size_px", "points", "camera", "area_px", "point_sigma_px", "time_s")


def load_survey(path: Path | str, *, camera: Camera | None = None) -> SurveyedGround:
    """Read a survey file and fit its map.

    Args:
        path: YAML as at this module's head.
        camera: The lens; replaces the file's own.

    Raises:
        GroundError: The file is not a survey, or its points do not define a map.
    """
    path = Path(path)
    content = read_mapping(path, _WHAT)
    check_keys(content, _KEYS, str(path))
    points = _points(content, path)
    points_m, origin = _points_m(points, path)
    if camera is None and content.get("camera") is not None:
        camera = load_camera(path.parent / str(content["camera"]))
    if "image_size_px" not in content:
        fix = "add the width and height of the picture that the points were read from"
        raise GroundError(expected="image_size_px in a survey file", found=f"{path} without it", fix=fix)
    width_px, height_px = numbers(content["image_size_px"], (2,), f"image_size_px in {path}")
    area_px = np.zeros((0, 2))
    if content.get("area_px") is not None:
        area_px = numbers(content["area_px"], (-1, 2), f"area_px in {path}")
    time_s = content.get("time_s")
    sigma_px = numbers(content.get("point_sigma_px", 1.0), (), f"point_sigma_px in {path}")
    ground = SurveyedGround(
        [numbers(point.get("px"), (2,), f"px of {name!r} in {path}") for name, point in points.items()],
        points_m,
        (int(width_px), int(height_px)),
        heights_m=_heights_m(points, path),
        names=tuple(points),
        camera=camera,
        area_px=area_px,
        point_sigma_px=float(sigma_px),
        time_s=None if time_s is None else float(numbers(time_s, (), f"time_s in {path}")),
        origin=origin,
    )
    if ground.is_mirrored and any("lonlat" in point for point in points.values()):
        raise GroundError(
            expected="lonlat: [longitude, latitude]", found=f"places that mirror the picture in {path}",
            fix="write the longitude first",
        )  # fmt: skip
    return ground


def _points_m(points: Mapping[str, Mapping[str, Any]], path: Path) -> tuple[FloatArray, GeographicOrigin | None]:
    """Return (N, 2) the points' places, and where on the earth their frame begins if they are told in degrees."""
    units = {unit for point in points.values() for unit in ("m", "lonlat") if unit in point}
    if len(units) > 1:
        fix = "write all points in one of them"
        raise GroundError(expected="points in m or in lonlat", found=f"both in {path}", fix=fix)
    unit = units.pop() if units else "m"
    rows = [numbers(point.get(unit), (2,), f"{unit} of {name!r} in {path}") for name, point in points.items()]
    places = np.array(rows, dtype=np.float64).reshape(-1, 2)
    if unit == "lonlat":
        outside = (np.abs(places) > np.array([180.0, 90.0])).any(axis=1)
        if outside.any():
            found = f"{places[outside][0].tolist()} in {path}"
            raise GroundError(expected="degrees [longitude, latitude]", found=found, fix="correct lonlat")
        if not len(places):
            return places, None
        origin = GeographicOrigin.of(places)
        return origin.to_metres(places), origin
    if unit := likely_unit(places):
        span_m = float(np.ptp(places, axis=0).max())
        size = f"{span_m:.2g} m" if span_m < 1.0 else f"{span_m:.0f} m, up to {np.abs(places).max():.0f} m off zero"
        raise GroundError(
            expected="m in metres",
            found=f"points that all lie within {size} in {path}, probably {unit}",
            fix="write metres, or lonlat: [longitude, latitude] in degrees in place of m",
        )
    return places, None


def _heights_m(points: Mapping[str, Mapping[str, Any]], path: Path) -> FloatArray:
    """Return (N,) the points' heights, NaN where there is none."""
    heights = [
        float(numbers(point["z_m"], (), f"z_m of {name!r} in {path}")) if "z_m" in point else np.nan
        for name, point in points.items()
    ]
    return np.array(heights, dtype=np.float64)


def _points(content: Mapping[str, Any], path: Path) -> dict[str, Mapping[str, Any]]:
    rows = content.get("points")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        fix = "write each as {name: kerb, px: [x, y], m: [x, y]}"
        raise GroundError(expected="a list of points", found=f"none in {path}", fix=fix)
    points: dict[str, Mapping[str, Any]] = {}
    for number, row in enumerate(rows, start=1):
        name = str(row.get("name", f"point {number}"))
        check_keys(row, ("name", "px", "m", "lonlat", "z_m"), f"{name!r} in {path}")
        if name in points:
            raise GroundError(expected="distinct names", found=f"{name!r} twice in {path}", fix="rename one")
        points[name] = row
    return points
