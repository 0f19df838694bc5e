"""Outlines of a solid that are part top and part base: where a near side is as bright as the top, its edge is lost.

Concrete in the sun shows its outline against the ground and hardly an edge between its top and a sunny side. The
quadrilateral that the picture has is then made of far edges of the top and near edges of the base.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import POSE, View
from standoff.stages.ground.projection import project_with_jacobians
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import SolidState, facing_sides

_ROUNDS = 5
_MAX_CHANGE = np.array([0.2, 0.2, 0.2, 10.0, 10.0, 10.0])
_SHARES = np.array([0.1, 0.5, 0.9])


def silhouettes(state: SolidState, outline_px: FloatArray, shape: ReferenceShape) -> Iterator[SolidState]:
    """Give the states in which some sides of an outline are edges of the base, and the others of the top.

    Args:
        state: In which all are the top's.
        outline_px: (N, 2) corners in the shape's order, undistorted.
        shape: Of the reference.
    """
    facing = np.flatnonzero(facing_sides(shape, state.view))
    for choice in product((False, True), repeat=len(facing)):
        if any(choice):
            lower = np.zeros(len(outline_px), dtype=np.bool_)
            lower[facing] = choice
            fitted = _fitted(state, outline_px, shape, lower)
            if fitted is not None:
                yield fitted


def _fitted(state: SolidState, outline_px: FloatArray, shape: ReferenceShape, lower: BoolArray) -> SolidState | None:
    """Return the state whose edges lie on the sides of the outline, by least squares; None where it goes astray."""
    camera = state.view.camera
    pinhole = Camera(camera.width_px, camera.height_px, camera.matrix, np.zeros(5))
    view = View(pinhole, state.view.position_m, state.view.site_to_camera)
    along_px = np.roll(outline_px, -1, axis=0) - outline_px
    normal = np.column_stack([-along_px[:, 1], along_px[:, 0]]) / np.linalg.norm(along_px, axis=1)[:, None]
    along_m = np.roll(shape.corners_m, -1, axis=0) - shape.corners_m
    xy_m = (shape.corners_m[:, None] + _SHARES[:, None] * along_m[:, None]).reshape(-1, 2)
    side = np.repeat(np.arange(len(outline_px)), len(_SHARES))
    points_m = np.column_stack([xy_m, np.where(lower, 0.0, state.height_m)[side]])
    for _ in range(_ROUNDS):
        points_px, by_view, _ = project_with_jacobians(view, points_m)
        off_px = ((outline_px[side] - points_px) * normal[side]).sum(axis=1)
        rows = np.einsum("ni,nij->nj", normal[side], by_view[:, :, POSE])
        if not (np.isfinite(off_px).all() and np.isfinite(rows).all()):
            return None
        step = np.clip(np.linalg.lstsq(rows, off_px, rcond=None)[0], -_MAX_CHANGE, _MAX_CHANGE)
        view = view.changed(np.append(step, [0.0, 0.0]))
    if view.position_m[2] <= state.height_m or not facing_sides(shape, view)[lower].all():
        return None
    return SolidState(View(camera, view.position_m, view.site_to_camera), state.height_m)
