"""An upright prism on rough ground, seen by a camera whose place and lens are known exactly."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.map_error import map_jacobian
from standoff.core.pose import View
from standoff.core.types import CameraMotion, GroundMap, ImageArray
from standoff.stages.ground import ReferenceShape
from standoff.stages.ground.solid import SolidState

SIZE_PX = (640, 360)
MOTION_PX = 0.05
"""How well the drawn motions say that they know where the ground's points went."""

_GROUND, _TOP, _SIDES, _SHADOW, _SAND = 95.0, 195.0, (150.0, 60.0, 165.0, 130.0), 45.0, 110.0
_SUBPIXELS = 4
_MARGIN_PX = 12
_ROUGHNESS = cv2.GaussianBlur(np.random.default_rng(5).normal(0.0, 12.0, SIZE_PX[::-1]), (0, 0), 2.0)


def lens(focal_px: float = 460.0, k1: float = 0.0, size_px: tuple[int, int] = SIZE_PX) -> Camera:
    width, height = size_px
    matrix = np.array([[focal_px, 0.0, (width - 1) / 2], [0.0, focal_px, (height - 1) / 2], [0.0, 0.0, 1.0]])
    return Camera(width, height, matrix, np.array([k1, 0.0, 0.0, 0.0, 0.0]))


def looking_at(
    camera: Camera, target_m: Sequence[float], *, away_m: float, heading_deg: float, pitch_deg: float
) -> View:
    """Return a level camera that has a ground point in the middle of its picture."""
    aimed = View.aimed(camera, np.zeros(3), heading_deg=heading_deg, pitch_deg=pitch_deg)
    return View(camera, np.array([*target_m, 0.0]) - away_m * aimed.site_to_camera[2], aimed.site_to_camera)


def random_state(rng: np.random.Generator, shape: ReferenceShape, camera: Camera, height_m: float) -> SolidState:
    """Look at a shape of some metres so that it is about 100 px wide."""
    target = shape.corners_m.mean(axis=0) + rng.uniform(-1.0, 1.0, 2)
    view = looking_at(
        camera,
        target.tolist(),
        away_m=float(rng.uniform(10.0, 14.0)),
        heading_deg=float(rng.uniform(0.0, 360.0)),
        pitch_deg=float(rng.uniform(35.0, 65.0)),
    )
    return SolidState(view, height_m)


def top_px(shape: ReferenceShape, state: SolidState) -> FloatArray:
    return state.view.project(np.column_stack([shape.corners_m, np.full(len(shape.corners_m), state.height_m)]))


def base_px(shape: ReferenceShape, state: SolidState) -> FloatArray:
    return state.view.project(np.column_stack([shape.corners_m, np.zeros(len(shape.corners_m))]))


def box_around(shape: ReferenceShape, state: SolidState, margin_px: float = 4.0) -> FloatArray:
    corners = np.concatenate([top_px(shape, state), base_px(shape, state)])
    return np.concatenate([corners.min(axis=0) - margin_px, corners.max(axis=0) + margin_px])


def drawn(
    shape: ReferenceShape,
    state: SolidState,
    *,
    seed: int = 0,
    noise: float = 1.5,
    sun_m: tuple[float, float] | None = None,
    sanded_side: int | None = None,
    solid: bool = True,
    dusk: bool = False,
) -> ImageArray:
    """Draw ground, shadow, sides, top and sand, each pixel the mean of sixteen rays, then blur and noise.

    Args:
        shape: Of the prism's top and base.
        state: Camera and height.
        seed: Of the noise.
        noise: Grey levels.
        sun_m: Where the shadow of the top's corners falls, from the corners of the base.
        sanded_side: A side with sand heaped against it up to the top.
        solid: Whether there is anything but ground.
        dusk: The sides are as dark as the ground.
    """
    faces = [_faces(shape, state, sun_m, sanded_side, (_GROUND,) if dusk else _SIDES)] if solid else []
    return _photographed(faces, state.view, seed, noise)


def drawn_solids(
    solids: Sequence[tuple[ReferenceShape, SolidState]], view: View, *, seed: int = 0, noise: float = 1.5
) -> ImageArray:
    """Draw several that do not hide each other, as `drawn`."""
    return _photographed([_faces(shape, state, None, None, _SIDES) for shape, state in solids], view, seed, noise)


def _photographed(solids: Sequence[list[tuple[FloatArray, float]]], view: View, seed: int, noise: float) -> ImageArray:
    grey = _GROUND + _ROUGHNESS
    for faces in solids:
        _paint(grey, view, faces)
    grey = cv2.GaussianBlur(grey, (0, 0), 0.7)
    grey += np.random.default_rng(seed).normal(0.0, noise, grey.shape)
    return np.asarray(np.clip(np.rint(grey), 0, 255), dtype=np.uint8)


def _faces(
    shape: ReferenceShape,
    state: SolidState,
    sun_m: tuple[float, float] | None,
    sanded_side: int | None,
    greys: Sequence[float],
) -> list[tuple[FloatArray, float]]:
    """Return convex polygons (N, 3) of the site and their grey levels, of sides in turn, what is behind first."""
    base = np.column_stack([shape.corners_m, np.zeros(len(shape.corners_m))])
    top = base + np.array([0.0, 0.0, state.height_m])
    count = len(base)
    following = np.roll(np.arange(count), -1)
    faces: list[tuple[FloatArray, float]] = []
    if sun_m is not None:
        shadow = np.concatenate([shape.corners_m, shape.corners_m + sun_m])
        hull = cv2.convexHull(shadow.astype(np.float32))[:, 0].astype(np.float64)
        faces.append((np.column_stack([hull, np.zeros(len(hull))]), _SHADOW))
    along = base[following] - base
    for side in range(count):
        outward = np.array([along[side, 1], -along[side, 0]])
        if (state.view.position_m[:2] - base[side, :2]) @ outward > 0:
            corners = np.stack([base[side], base[following[side]], top[following[side]], top[side]])
            faces.append((corners, greys[side % len(greys)]))
    faces.append((top, _TOP))
    if sanded_side is not None:
        start, end = base[sanded_side], base[following[sanded_side]]
        outward = np.array([end[1] - start[1], start[0] - end[0], 0.0]) / np.linalg.norm(end - start) * 1.5
        up, over = np.array([0.0, 0.0, state.height_m]), 0.1 * (end - start)
        faces.append((np.stack([start - over + outward, end + over + outward, end + up, start + up]), _SAND))
    return faces


def _paint(grey: FloatArray, view: View, faces: list[tuple[FloatArray, float]]) -> None:
    """Paint convex polygons over a picture, in place, one over the other."""
    around = view.project(np.concatenate([polygon for polygon, _ in faces]))
    height, width = grey.shape
    left, top = np.maximum(np.floor(around.min(axis=0)).astype(int) - _MARGIN_PX, 0)
    right, bottom = np.minimum(np.ceil(around.max(axis=0)).astype(int) + _MARGIN_PX, (width, height))
    columns, rows = np.meshgrid(np.arange(left, right), np.arange(top, bottom))
    rays = view.camera.undistort(np.column_stack([columns.ravel(), rows.ravel()])).reshape(*columns.shape, 2)
    down, across = np.gradient(rays, axis=0), np.gradient(rays, axis=1)
    steps = (np.arange(_SUBPIXELS) + 0.5) / _SUBPIXELS - 0.5
    for polygon, shade in faces:
        corners = view.project_pinhole(polygon)
        nearby = (rays > corners.min(axis=0) - 2.0).all(axis=2) & (rays < corners.max(axis=0) + 2.0).all(axis=2)
        covered = np.zeros(int(nearby.sum()))
        for step_y in steps:
            for step_x in steps:
                covered += _within(rays[nearby] + step_x * across[nearby] + step_y * down[nearby], corners)
        part = grey[top:bottom, left:right]
        roughness = 0.3 * _ROUGHNESS[top:bottom, left:right]
        part[nearby] += covered / _SUBPIXELS**2 * (shade + roughness[nearby] - part[nearby])


def _within(points: FloatArray, corners: FloatArray) -> BoolArray:
    sides = np.roll(corners, -1, axis=0) - corners
    turns = [
        side[0] * (points[..., 1] - corner[1]) - side[1] * (points[..., 0] - corner[0])
        for corner, side in zip(corners, sides, strict=True)
    ]
    return np.asarray((np.min(turns, axis=0) > 0) | (np.max(turns, axis=0) < 0))


def motion_between(then: View, now: View, keyframe_s: float, sigma_px: float = MOTION_PX) -> CameraMotion:
    """Return how the ground's picture moved between two views, exactly, and known to so many px."""
    forth = now.plane_to_pinhole() @ homography.invert(then.plane_to_pinhole())
    forth = forth / np.linalg.norm(forth)
    width, height = then.camera.width_px, then.camera.height_px
    x, y = np.meshgrid(np.linspace(0.1, 0.9, 3) * width, np.linspace(0.2, 0.9, 3) * height)
    seen = np.column_stack([x.ravel(), y.ravel()])
    covariance = homography.fit_covariance(forth, seen, np.broadcast_to(np.eye(2) * sigma_px**2, (len(seen), 2, 2)))
    return CameraMotion(forth, covariance, keyframe_s, then.camera)


def distance_and_sigma(ground: GroundMap, pair_px: FloatArray) -> tuple[float, float]:
    """Return the distance in metres of two picture points (2, 2) and the standard error that the map gives it."""
    straight = ground.undistorted(pair_px)
    (one, other), valid = homography.apply(ground.image_to_ground, straight)
    assert valid.all()
    apart = other - one
    length = float(np.linalg.norm(apart))
    jacobian = map_jacobian(ground, straight)
    gradient = apart / length @ (jacobian[1] - jacobian[0])
    return length, float(np.sqrt(gradient @ ground.covariance @ gradient))
