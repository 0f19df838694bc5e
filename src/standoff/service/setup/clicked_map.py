"""The ground map straight from clicked corners, while a hand drags one of them: no edge is looked for."""

from __future__ import annotations

from typing import Final

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, View
from standoff.core.types import GroundMap
from standoff.stages.ground import PointObservation, belief_from_points, map_from_view

_CLICK_SIGMA_PX: Final = 2.0
"""How well a hand that moves puts a corner."""
_SIZE_SIGMA: Final = 0.005
"""Of the tape measure, as the reference method has it."""


def clicked_map(corners_px: FloatArray, corners_m: FloatArray, height_m: float, camera: CameraPrior) -> GroundMap:
    """Return the map of the ground below a reference's top.

    Args:
        corners_px: (4, 2) of the top as clicked, in the order of `corners_m`.
        corners_m: (4, 2) of the top, site frame.
        height_m: Of the top above the ground.
        camera: What is known of it, for pictures of this size.

    Raises:
        GroundError: No camera above the ground sees the top so.
    """
    top_m = np.column_stack([corners_m, np.zeros(len(corners_m))])
    sigma_px = np.full(len(top_m), _CLICK_SIGMA_PX)
    belief = belief_from_points(camera, PointObservation("corners", top_m, corners_px, sigma_px))
    seen = belief.state.view
    view = View(seen.camera, seen.position_m + np.array([0.0, 0.0, height_m]), seen.site_to_camera)
    return map_from_view(
        view,
        np.asarray(np.linalg.inv(belief.information[:CHANGES, :CHANGES]), dtype=np.float64),
        method="clicked corners",
        scale_m_per_px=float(np.sqrt(_area(corners_m) / _area(corners_px))),
        anchors_px=corners_px,
        size_sigma=_SIZE_SIGMA,
        middle_m=corners_m.mean(axis=0),
    )


def _area(ring: FloatArray) -> float:
    after = np.roll(ring, -1, axis=0)
    return float(abs((ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum()) / 2.0)
