"""A camera's view of a photograph's ground: the photograph is level ground, seen from anywhere.

The site frame has its origin in the middle of the photograph; north is the photograph's upper edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import shapely

from standoff.core.camera import Camera
from standoff.core.homography import BoolArray, FloatArray, apply, invert
from standoff.core.pose import View
from standoff.core.types import ImageArray, IntArray
from standoff.labels.pictures import load_upright
from standoff_sim.camera.flight import Still
from standoff_sim.composites.backgrounds import Background
from standoff_sim.solids.mesh import Float32Array

_PERSON_PX = (10.0, 100.0)
_STATURE_M, _DEPTH_M = 1.75, 0.5
_STEEP_SHARE = 0.35
_STEEP_DEG, _TILTED_DEG = (65.0, 90.0), (36.0, 65.0)
_STEEP_FIELDS_DEG, _TILTED_FIELDS_DEG = (45.0, 75.0), (28.0, 50.0)
_PHOTO_FIELD_DEG = 65.0
_LARGEST_ZOOM = 2.6
_SCALE_ERROR = 1.25
"""By which things may be too large or too small for the ground."""
_ANY_SCALE_PX_PER_M = (0.006, 0.02)
"""Of a photograph of unknown scale, as a share of its width."""
_FARTHEST_M = 110.0
ROUGHNESS_STEP_PX = 32
_LEAVES, _EVEN_SHARE, _LOOKS = 25.0, 0.4, 5
"""Roughness of what nobody stands on; the least share of other ground in a picture, and how often it is sought."""
_TRIES, _GROWTH = 60, 1.025
_DISTINCT_DEG = 14.0
"""The upper edge of the picture looks at least so far below the horizon."""
_OVERSIZE = 1.2
_LEAST_IGNORED_PX = 1.0
_INSIDE = 0.35
"""Share of a mark that must be in the picture; less is left to chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Framed:
    """A piece of a photograph as a camera sees it.

    Attributes:
        image: (H, W, 3) uint8 BGR.
        view: Of the camera; the ground is z = 0.
        zoom: Pixels of the picture for one of the photograph in the middle.
        shadow_deg: Where shadows fall, clockwise from north, or None.
        xyxy_px: (N, 4) what was marked in the photograph, inside the picture.
        class_id: (N,).
        ignored_px: (M, 4) places of which nothing is known.
    """

    image: ImageArray
    view: View
    zoom: float
    shadow_deg: float | None
    xyxy_px: FloatArray
    class_id: IntArray
    ignored_px: FloatArray


def frame(rng: np.random.Generator, background: Background, size_px: tuple[int, int]) -> Framed:
    """Look at a photograph's ground from somewhere.

    People shall be 10 to 100 px tall, any octave equally often, as far as the photograph is fine and wide enough.

    Raises:
        DataError: The file is not a picture.
    """
    photo = load_upright(background.path)
    if rng.random() < 0.5:
        photo, background = _mirrored(photo, background)
    photographed = _photograph_view(rng, background, photo.shape[1], photo.shape[0])
    rough = roughness(photo)
    for _ in range(_LOOKS):
        view, zoom = _draw_view(rng, photographed, size_px)
        onto = view.plane_to_pinhole() @ invert(photographed.plane_to_pinhole())
        if _even_share(rough, onto, size_px) > _EVEN_SHARE:
            break
    xyxy_px, inside = _carried(background.xyxy_px, onto, size_px)
    ignored_px, _ = _carried(background.ignored_px, onto, size_px)
    unknown_px = np.concatenate([ignored_px, xyxy_px[~inside]])
    # Outside they are NaN, and at the very edge nothing is left of them.
    is_there = (unknown_px[:, 2:] - unknown_px[:, :2] >= _LEAST_IGNORED_PX).all(axis=1)
    return Framed(
        _seen(photo, onto, zoom, size_px),
        view,
        zoom,
        background.shadow_deg,
        xyxy_px[inside],
        background.class_id[inside],
        unknown_px[is_there],
    )


def roughness(photo: ImageArray) -> Float32Array:
    """Return how uneven the brightness of a photograph (H, W, 3) is in each square of `ROUGHNESS_STEP_PX`."""
    grey = cv2.resize(cv2.cvtColor(photo, cv2.COLOR_BGR2GRAY), None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    fine = np.abs(cv2.Laplacian(grey, cv2.CV_32F))
    scale = 4.0 / ROUGHNESS_STEP_PX
    return np.asarray(cv2.resize(fine, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _even_share(rough: Float32Array, onto: FloatArray, size_px: tuple[int, int]) -> float:
    """Return the share of a picture, a photograph through a homography, that is ground and not leaves."""
    step = ROUGHNESS_STEP_PX
    small_px = size_px[0] // step, size_px[1] // step
    to_small = np.diag([1.0 / step, 1.0 / step, 1.0]) @ onto @ np.diag([step, step, 1.0])
    seen = cv2.warpPerspective(rough, to_small, small_px, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return float((seen < _LEAVES).mean())


def _mirrored(photo: ImageArray, background: Background) -> tuple[ImageArray, Background]:
    def flipped(xyxy_px: FloatArray) -> FloatArray:
        return np.column_stack([last - xyxy_px[:, 2], xyxy_px[:, 1], last - xyxy_px[:, 0], xyxy_px[:, 3]])

    last = photo.shape[1] - 1
    shadow_deg = None if background.shadow_deg is None else -background.shadow_deg
    flipped_background = replace(
        background,
        xyxy_px=flipped(background.xyxy_px),
        ignored_px=flipped(background.ignored_px),
        shadow_deg=shadow_deg,
    )
    return np.ascontiguousarray(photo[:, ::-1]), flipped_background


def _photograph_view(rng: np.random.Generator, background: Background, width_px: int, height_px: int) -> View:
    """Return how the photograph was taken, as far as that is known."""
    px_per_m = background.px_per_m
    if px_per_m is None:
        low, high = np.log(_ANY_SCALE_PX_PER_M)
        px_per_m = width_px * float(np.exp(rng.uniform(low, high)))
    px_per_m *= _SCALE_ERROR ** float(rng.uniform(-1.0, 1.0))
    camera = _pinhole(width_px, height_px, width_px / 2 / np.tan(np.deg2rad(_PHOTO_FIELD_DEG / 2)))
    return _over(camera, np.zeros(2), camera.matrix[0, 0] / px_per_m, background.pitch_deg, 0.0)


def _pinhole(width_px: int, height_px: int, focal_px: float) -> Camera:
    matrix = np.array([[focal_px, 0.0, (width_px - 1) / 2], [0.0, focal_px, (height_px - 1) / 2], [0.0, 0.0, 1.0]])
    return Camera(width_px, height_px, matrix, np.zeros(5))


def _over(
    camera: Camera, xy_m: FloatArray, away_m: float, pitch_deg: float, heading_deg: float, roll_deg: float = 0.0
) -> View:
    altitude_m = away_m * float(np.sin(np.deg2rad(pitch_deg)))
    return Still.over(
        camera, xy_m, altitude_m=altitude_m, pitch_deg=pitch_deg, heading_deg=heading_deg, roll_deg=roll_deg
    ).fixed


def _draw_view(rng: np.random.Generator, photographed: View, size_px: tuple[int, int]) -> tuple[View, float]:
    """Draw a view that shows nothing beyond the photograph's edges, and its zoom."""
    straight_down = photographed.site_to_camera[2, 2] < -np.cos(np.deg2rad(10.0))
    propose = _look_down if straight_down else _look_closer
    person_px = float(np.exp(rng.uniform(*np.log(_PERSON_PX))))
    for attempt in range(_TRIES):
        view, zoom = propose(rng, photographed, size_px, person_px * _GROWTH**attempt)
        if zoom <= _LARGEST_ZOOM and _covers(photographed, view):
            return view, zoom
    return _whole(photographed, size_px)


def _look_down(
    rng: np.random.Generator, photographed: View, size_px: tuple[int, int], person_px: float
) -> tuple[View, float]:
    """Look at ground that was photographed from straight above, from any direction: it is flat."""
    steep = rng.random() < _STEEP_SHARE
    pitch_deg = float(rng.uniform(*(_STEEP_DEG if steep else _TILTED_DEG)))
    field_deg = float(rng.uniform(*(_STEEP_FIELDS_DEG if steep else _TILTED_FIELDS_DEG)))
    px_per_m = person_px / _person_m(pitch_deg)
    here = _photo_scale(photographed)
    px_per_m = min(px_per_m, 0.98 * _LARGEST_ZOOM * here)
    focal_px = min(size_px[0] / 2 / np.tan(np.deg2rad(field_deg / 2)), _FARTHEST_M * px_per_m)
    centre_px = rng.uniform(0.15, 0.85, 2) * [photographed.camera.width_px, photographed.camera.height_px]
    xy_m = photographed.to_plane(centre_px[None])[0]
    # marks are boxes along the photograph's edges: another turn would make them wider than what they mark
    heading_deg = float(90.0 * rng.integers(4) + rng.normal(0.0, 3.0))
    camera = _pinhole(*size_px, focal_px)
    roll_deg = float(rng.normal(0.0, 1.0))
    return _over(camera, xy_m, focal_px / px_per_m, pitch_deg, heading_deg, roll_deg), px_per_m / here


def _look_closer(
    rng: np.random.Generator, photographed: View, size_px: tuple[int, int], person_px: float
) -> tuple[View, float]:
    """Take a piece of an oblique photograph: what stands on the ground stays upright."""
    lens = photographed.camera
    centre_px = rng.uniform(0.1, 0.9, 2) * [lens.width_px, lens.height_px]
    down = max(-float(photographed.rays(centre_px[None])[0, 2]), 0.05)
    focal_px = person_px / _person_m(float(np.rad2deg(np.arcsin(down)))) * float(photographed.position_m[2]) / down
    zoom = focal_px / float(lens.matrix[0, 0])
    camera = _pinhole(*size_px, focal_px)
    matrix = camera.matrix.copy()
    matrix[:2, 2] -= zoom * (centre_px - lens.matrix[:2, 2])
    return replace(photographed, camera=replace(camera, matrix=matrix)), zoom


def _person_m(pitch_deg: float) -> float:
    """Return how tall a person looks from a pitch, in metres across the line of sight."""
    pitch_rad = np.deg2rad(pitch_deg)
    return float(_STATURE_M * np.cos(pitch_rad) + _DEPTH_M * np.sin(pitch_rad))


def _photo_scale(photographed: View) -> float:
    """Return pixels a metre in the middle of a photograph."""
    away_m = -photographed.position_m[2] / photographed.site_to_camera[2, 2]
    return float(photographed.camera.matrix[0, 0] / away_m)


def _whole(photographed: View, size_px: tuple[int, int]) -> tuple[View, float]:
    """Show the middle of the photograph, as much as fits into the picture's shape."""
    lens = photographed.camera
    zoom = 1.01 * max(size_px[0] / lens.width_px, size_px[1] / lens.height_px)
    camera = _pinhole(*size_px, zoom * float(lens.matrix[0, 0]))
    return replace(photographed, camera=camera), zoom


def _covers(photographed: View, view: View) -> bool:
    """Return whether the whole picture shows the photograph's ground, well below the horizon."""
    width_px, height_px = view.camera.width_px, view.camera.height_px
    corners_px = np.array([[0, 0], [width_px - 1, 0], [width_px - 1, height_px - 1], [0, height_px - 1]], dtype=float)
    if view.rays(corners_px)[:, 2].max() > -np.sin(np.deg2rad(_DISTINCT_DEG)):
        return False
    xy_m = view.to_plane(corners_px)
    at_px = photographed.project(np.column_stack([xy_m, np.zeros(4)]))
    size = np.array([photographed.camera.width_px, photographed.camera.height_px])
    return bool(((at_px >= 0.0) & (at_px <= size - 1)).all())


def _seen(photo: ImageArray, onto: FloatArray, zoom: float, size_px: tuple[int, int]) -> ImageArray:
    """Return the picture (H, W, 3) of a photograph through a homography, made smaller first where that smooths."""
    shrink = _OVERSIZE * zoom
    if shrink < 1.0:
        old_px = np.array(photo.shape[1::-1])
        photo = cv2.resize(photo, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
        scale = old_px / np.array(photo.shape[1::-1])
        larger = np.diag([*scale, 1.0])
        larger[:2, 2] = (scale - 1.0) / 2
        onto = onto @ larger
    interpolation = cv2.INTER_CUBIC if zoom > 1.0 else cv2.INTER_LINEAR
    return np.asarray(
        cv2.warpPerspective(photo, onto, size_px, flags=interpolation, borderMode=cv2.BORDER_REFLECT_101),
        dtype=np.uint8,
    )


def _carried(xyxy_px: FloatArray, onto: FloatArray, size_px: tuple[int, int]) -> tuple[FloatArray, BoolArray]:
    """Return the marks (N, 4) in the picture, cut at its edges, NaN outside of it, and (N,) which are mostly inside."""
    if not len(xyxy_px):
        return np.empty((0, 4)), np.empty(0, dtype=bool)
    corners, _ = apply(onto, xyxy_px[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 2))
    corners = corners.reshape(-1, 4, 2)
    cut, inside = np.full((len(corners), 4), np.nan), np.zeros(len(corners), dtype=bool)
    ahead = ~np.isnan(corners).any(axis=(1, 2))
    outlines = shapely.polygons(corners[ahead])
    seen = shapely.intersection(outlines, shapely.box(-0.5, -0.5, size_px[0] - 0.5, size_px[1] - 0.5))
    cut[ahead], inside[ahead] = shapely.bounds(seen), shapely.area(seen) >= _INSIDE * shapely.area(outlines)
    return cut, inside
