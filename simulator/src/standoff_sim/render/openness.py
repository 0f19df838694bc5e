"""Ambient occlusion: how much of the sky each pixel's surroundings hide, from the depth of the id pass."""

from __future__ import annotations

from typing import Any

import numpy as np

from standoff_sim.render.context import build_program, set_uniforms
from standoff_sim.render.frustum import FAR_M, NEAR_M, Frustum
from standoff_sim.render.targets import OPENNESS_STEP_PX, Targets


class OpennessPass:
    """Draws at reduced size, then smooths."""

    def __init__(self, context: Any) -> None:  # noqa: ANN401
        self._context = context
        self._rough, self._smooth = (
            context.vertex_array(build_program(context, ("fullscreen.vert",), (fragment,)), [])
            for fragment in ("openness.frag", "smooth.frag")
        )

    def draw(self, targets: Targets, frustum: Frustum) -> None:
        """Fill `targets.smooth` from `targets.depth`."""
        self._context.enable_only(self._context.NOTHING)
        matrix = frustum.view.camera.matrix
        values = {
            "depth": 0,
            "camera_from_pixel": np.linalg.inv(matrix) @ frustum.undistorted_from_drawn(),
            "depth_range": (NEAR_M, FAR_M, float(OPENNESS_STEP_PX), float(matrix[0, 0])),
        }
        set_uniforms(self._rough.program, values)
        targets.rough_pass.use()
        targets.depth.use(0)
        self._rough.render(vertices=3)
        set_uniforms(self._smooth.program, {"rough": 0})
        targets.smooth_pass.use()
        targets.rough.use(0)
        self._smooth.render(vertices=3)
