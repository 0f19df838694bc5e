"""Whether a reference object can look as it does through the lens that somebody stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import LENS
from standoff.core.types import ImageArray, Luma
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid_choice import Found
from standoff.stages.ground.solid_fit import Belief, fit_solid
from standoff.stages.ground.solid_search import HeightPrior, search_solid

_FOCAL = LENS.start
_STATED_SIGMA, _FREE_SIGMA = 0.03, 0.4
_LEAST_LOG, _SIGMAS = np.log(1.12), 4.0
"""A focal length so far from the stated one, and so sure, is not the stated one."""

_FIT_PX = 8.0
_STEP_SIGMA, _STEPS, _SETTLED = 0.08, 8, 2e-3
"""The focal length goes step by step: all at once, the edges would be lost on the way."""


def found_with_another_lens(
    gray: ImageArray, box_xyxy_px: FloatArray, shape: ReferenceShape, camera: CameraPrior, height: HeightPrior
) -> str:
    """Say with which focal length a reference can be found that cannot with the stated one; "" if with none.

    Args:
        gray: (H, W).
        box_xyxy_px: (4,) about where the reference is.
        shape: Its.
        camera: The stated lens.
        height: What is known of the reference's height.
    """
    if camera.focal_sigma > _STATED_SIGMA:
        return ""
    found = search_solid(gray, box_xyxy_px, shape, replace(camera, focal_sigma=_FREE_SIGMA), height)
    return _contradiction(found.belief(), camera) if isinstance(found, Found) else ""


def refitted_lens(gray: Luma, shape: ReferenceShape, found: Belief, camera: CameraPrior) -> tuple[Belief, str]:
    """Fit a reference that was found by a stated lens again with a free focal length.

    Args:
        gray: The picture.
        shape: Of the reference.
        found: By the stated lens.
        camera: That lens.

    Returns:
        What is believed now, and "" or why that is not what was found: the stated lens cannot be.
    """
    if camera.focal_sigma > _STATED_SIGMA:
        return found, ""
    height_sigma_m = float(np.sqrt(np.linalg.inv(found.information)[-1, -1]))
    sigma = np.array([1.0] * 3 + [100.0] * 3 + [_STEP_SIGMA, camera.k1_sigma, height_sigma_m])
    free = np.diag(1.0 / sigma**2)
    state, information = found.state, found.information
    for _ in range(_STEPS):
        fit = fit_solid(gray, shape, Belief(state, free), _FIT_PX)
        if fit is None:
            return found, ""
        changed = abs(fit.state.change_from(state)[_FOCAL])
        state, information = fit.state, fit.information
        if changed < _SETTLED:
            break
    # What is believed of the focal length now comes from the picture alone.
    free[_FOCAL, _FOCAL] = _FREE_SIGMA**-2
    refitted = Belief(state, free + information)
    text = _contradiction(refitted, camera)
    return (refitted, text) if text else (found, "")


def _contradiction(free: Belief, camera: CameraPrior) -> str:
    log_ratio = float(np.log(free.state.view.camera.matrix[0, 0] / camera.camera.matrix[0, 0]))
    sigma = float(np.sqrt(np.linalg.inv(free.information)[_FOCAL, _FOCAL]))
    if abs(log_ratio) < max(_LEAST_LOG, _SIGMAS * sigma):
        return ""
    return (
        f"the focal length of the {camera.origin} does not fit the picture: one {np.exp(log_ratio):.2g} times as long "
        "would; is it of another camera, zoom or recording mode?"
    )
