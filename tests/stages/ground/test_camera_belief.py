"""What the belief about a camera learns of the lens from the motion of the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drawn_ground import frame
from drawn_solid import drawn, lens, looking_at, motion_between

from standoff.core.camera import CameraPrior, RadialDistortion
from standoff.core.homography import FloatArray
from standoff.core.pose import LENS, View
from standoff.core.types import CameraMotion, Detections
from standoff.stages.ground import ReferenceShape
from standoff.stages.ground.camera_belief import CameraBelief, FrameEvidence
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.solid_fit import Belief

CAMERA = lens(k1=-0.02)
FOCAL_PX = float(CAMERA.matrix[0, 0])
VIEW = looking_at(CAMERA, (1.0, 1.0), away_m=12.0, heading_deg=20.0, pitch_deg=50.0)
STATE = SolidState(VIEW, 0.4)
PICTURE = drawn(ReferenceShape.square(2.5), STATE)


def _begun(focal_sigma: float = 0.1, k1_sigma: float = 0.06) -> CameraBelief:
    belief = CameraBelief(CameraPrior(CAMERA, focal_sigma, k1_sigma, "a drone's usual lens"))
    sigma = np.array([0.01, 0.01, 0.01, 0.3, 0.3, 0.3, focal_sigma, k1_sigma, 0.02])
    evidence = FrameEvidence(frame(PICTURE, 0.0), Detections.empty(), _still(0.0))
    belief.predict(evidence)
    belief.begin("reference", Belief(STATE, np.diag(sigma**-2.0)), evidence, frame_of="it", keeper="it")
    return belief


def _still(time_s: float, told: RadialDistortion | None = None) -> CameraMotion:
    moved: View = VIEW
    return replace(motion_between(VIEW, moved, 0.0), distortion=told)


def _heard(belief: CameraBelief, *told: RadialDistortion | None) -> CameraBelief:
    for k, one in enumerate(told, start=1):
        belief.predict(FrameEvidence(frame(PICTURE, 0.2 * k), Detections.empty(), _still(0.2 * k, one)))
    return belief


def _lens(belief: CameraBelief) -> tuple[float, FloatArray]:
    now = belief.now
    assert now is not None
    return float(now.state.view.camera.distortion[0]), np.sqrt(np.diag(now.covariance))[LENS]


@pytest.mark.parametrize("focal_px", [FOCAL_PX, 2.0 * FOCAL_PX])
def test_what_the_motion_tells_is_put_together_with_what_was_known(focal_px: float) -> None:
    scale = (focal_px / FOCAL_PX) ** 2
    told = RadialDistortion(-0.12 * scale, 0.03 * scale, focal_px)
    k1, sigma = _lens(_heard(_begun(focal_sigma=1e-4), told))
    weight = 0.06**2 / (0.06**2 + 0.03**2)
    assert k1 == pytest.approx(-0.02 - 0.10 * weight, rel=1e-3)
    assert sigma[1] == pytest.approx((0.06**-2 + 0.03**-2) ** -0.5, rel=1e-3)


def test_what_is_told_again_is_not_heard_again() -> None:
    told = RadialDistortion(-0.12, 0.03, FOCAL_PX)
    once, often = _lens(_heard(_begun(), told)), _lens(_heard(_begun(), told, told, None, told))
    assert often[0] == pytest.approx(once[0])
    np.testing.assert_allclose(often[1], once[1])


def test_what_is_told_bit_by_bit_is_what_is_told_at_once() -> None:
    first, last = RadialDistortion(-0.06, 0.05, FOCAL_PX), RadialDistortion(-0.12, 0.02, FOCAL_PX)
    once, twice = _lens(_heard(_begun(focal_sigma=1e-4), last)), _lens(_heard(_begun(focal_sigma=1e-4), first, last))
    assert twice[0] == pytest.approx(once[0], abs=1e-5)
    np.testing.assert_allclose(twice[1], once[1], rtol=1e-4)


def test_a_reference_is_searched_for_with_what_the_motion_has_told() -> None:
    belief = CameraBelief(CameraPrior(CAMERA, 0.1, 0.06, "a drone's usual lens"))
    belief.predict(
        FrameEvidence(frame(PICTURE, 0.0), Detections.empty(), _still(0.0, RadialDistortion(-0.12, 0.03, FOCAL_PX)))
    )
    assert belief.lens.k1_sigma < 0.03
    assert -0.12 < belief.lens.camera.distortion[0] < -0.09
