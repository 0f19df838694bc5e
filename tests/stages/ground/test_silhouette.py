from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import tolerances

from standoff.core.camera import Camera
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import View
from standoff.stages.ground import ReferenceShape
from standoff.stages.ground.silhouette import silhouettes
from standoff.stages.ground.solid import SolidState, facing_sides

CAMERA = Camera(1920, 1080, np.array([[1370.0, 0, 960.0], [0, 1370.0, 540.0], [0, 0, 1]]), np.zeros(5))
SHAPE = ReferenceShape.square(2.89)
HEIGHT_M = 0.42


def mixed_outline_px(state: SolidState, lower: BoolArray) -> FloatArray:
    """Return the corners of the four lines of which some are edges of the base."""
    lines = []
    for (start, end), low in zip(pairwise([*SHAPE.corners_m, SHAPE.corners_m[0]]), lower, strict=True):
        height_m = 0.0 if low else state.height_m
        ends_px = state.view.project_pinhole(np.array([[*start, height_m], [*end, height_m]]))
        start_px, end_px = np.column_stack([ends_px, np.ones(2)])
        lines.append(np.cross(start_px, end_px))
    corners = np.array([np.cross(lines[k - 1], lines[k]) for k in range(4)])
    return np.asarray(corners[:, :2] / corners[:, 2:])


@pytest.mark.parametrize("heading_deg", [-35.0, 10.0, 50.0])
def test_an_outline_that_is_partly_the_base_still_gives_the_camera(heading_deg: float) -> None:
    heading = np.deg2rad(heading_deg)
    position_m = np.array([1.4 - 20.0 * np.sin(heading), 1.4 - 20.0 * np.cos(heading), 23.0])
    true = SolidState(View.aimed(CAMERA, position_m, heading_deg=heading_deg, pitch_deg=48.0), HEIGHT_M)
    facing = facing_sides(SHAPE, true.view)
    assert facing.any()
    outline_px = mixed_outline_px(true, facing)
    # What the search begins from: all four sides taken for the top's, so somewhat too near.
    start = SolidState(View(CAMERA, position_m + np.array([0.1, 0.2, -0.4]), true.view.site_to_camera), HEIGHT_M)
    found = list(silhouettes(start, outline_px, SHAPE))
    off_m = [np.linalg.norm(state.view.position_m - position_m) for state in found]
    assert min(off_m) < tolerances.FITTED_M
    assert len(found) <= 2 ** facing.sum() - 1
