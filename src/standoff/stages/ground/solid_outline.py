"""Where a solid of four corners would have to be for a quadrilateral of the picture to be its outline."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.stages.ground.quadrilateral import ORDERS
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.silhouette import silhouettes
from standoff.stages.ground.solid import SolidState

_REPROJECTION_PX, _REPROJECTION_SHARE = 2.0, 0.08
_MAX_ROLL_RAD = np.deg2rad(30.0)
_MIN_PITCH_RAD = np.deg2rad(5.0)


def states_of(
    outline: FloatArray, shape: ReferenceShape, camera: Camera, heights_m: tuple[float, ...]
) -> Iterator[SolidState]:
    """Give every state at which the top or the base of the solid has this outline.

    Args:
        outline: (4, 2) undistorted, any corner first.
        shape: Of four corners.
        camera: Lens and picture size.
        heights_m: Of the solid, to be tried.
    """
    limit_px = max(_REPROJECTION_PX, _REPROJECTION_SHARE * float(np.linalg.norm(outline[1] - outline[0])))
    turns = shape.turns_onto_itself()
    for order in ORDERS[: 4 // len(turns)]:
        for view in _views(outline[order], shape, camera, limit_px):
            for height_m in heights_m:
                for level_m in {height_m, 0.0}:
                    lifted = View(camera, view.position_m + np.array([0.0, 0.0, level_m]), view.site_to_camera)
                    yield SolidState(lifted, height_m)


def mixed_states(state: SolidState, shape: ReferenceShape) -> Iterator[SolidState]:
    """Give the states in which some sides of an outline taken for the top's are the lower edges of these sides."""
    outline_px = state.view.project_pinhole(
        np.column_stack([shape.corners_m, np.full(len(shape.corners_m), state.height_m)])
    )
    if np.isfinite(outline_px).all() and state.height_m > 0:
        yield from silhouettes(state, outline_px, shape)


def _views(corners_px: FloatArray, shape: ReferenceShape, camera: Camera, limit_px: float) -> Iterator[View]:
    """Give the views from above, nearly level, from which the shape at z = 0 has these corners."""
    places = np.column_stack([shape.corners_m, np.zeros(len(shape.corners_m))])
    middle = places.mean(axis=0)
    found, turns, shifts, errors = cv2.solvePnPGeneric(
        places - middle, corners_px[:, None], camera.matrix, None, flags=cv2.SOLVEPNP_IPPE
    )
    for k in range(found):
        if float(np.ravel(errors[k])[0]) > limit_px:
            continue
        rotation = cv2.Rodrigues(turns[k])[0]
        left, _, right = np.linalg.svd(rotation)
        rotation = left @ right
        view = View(camera, middle - rotation.T @ shifts[k].ravel(), rotation)
        if view.position_m[2] > 0 and abs(view.roll_rad) < _MAX_ROLL_RAD and view.pitch_rad > _MIN_PITCH_RAD:
            yield view
