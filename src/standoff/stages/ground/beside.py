"""What the drone's telemetry adds to a camera found by something of known size, and whether it contradicts that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.pose import CHANGES
from standoff.core.telemetry import Telemetry
from standoff.core.types import NoGroundMap
from standoff.stages.ground.solid_fit import Belief
from standoff.stages.ground.view_prior import in_frame_of, telemetry_view

_MOST_CHI2 = 27.9
"""Five readings (height, pitch, roll, and what they say of the lens) exceed it four times in a hundred thousand."""

_NOT_TOLD_DEG = 90.0
_FREE_LENS = 10.0
"""Telemetry's own word on the lens is in the belief already."""


def with_telemetry(belief: Belief, telemetry: Telemetry) -> tuple[Belief, str]:
    """Correct a belief about the camera by what its drone says of height and angles.

    Args:
        belief: In any site frame over the same ground.
        telemetry: Of the same moment. Without angles its height counts alone.

    Returns:
        The belief, and "" or how the two contradict each other; then the belief is as it was.
    """
    view = belief.state.view
    roll_deg, pitch_deg = float(np.rad2deg(view.roll_rad)), float(np.rad2deg(view.pitch_rad))
    said = telemetry
    if not telemetry.has_attitude:
        said = replace(
            telemetry,
            pitch_deg=pitch_deg,
            roll_deg=roll_deg,
            heading_deg=0.0,
            pitch_sigma_deg=_NOT_TOLD_DEG,
            roll_sigma_deg=_NOT_TOLD_DEG,
            heading_sigma_deg=_NOT_TOLD_DEG,
        )
    lens = CameraPrior(view.camera, _FREE_LENS, _FREE_LENS, "")
    read = telemetry_view(said, said, lens, frame_is_free=True)
    if isinstance(read, NoGroundMap):
        return belief, ""
    told, spread = read
    before = np.linalg.inv(belief.information)
    off = in_frame_of(told, view).change_from(view)
    both = before[:CHANGES, :CHANGES] + spread
    if off @ np.linalg.solve(both, off) > _MOST_CHI2:
        return belief, _contradiction(telemetry, float(view.position_m[2]), pitch_deg)
    gain = before[:, :CHANGES] @ np.linalg.inv(both)
    after = before - gain @ before[:CHANGES]
    return Belief(belief.state.changed(gain @ off), np.asarray(np.linalg.inv((after + after.T) / 2.0))), ""


def _contradiction(telemetry: Telemetry, height_m: float, pitch_deg: float) -> str:
    said = f"a height of {telemetry.height_m:.1f} m"
    seen = f"{height_m:.1f} m"
    if telemetry.has_attitude:
        said, seen = f"{said} and a pitch of {telemetry.pitch_deg:.0f} degrees", f"{seen} and {pitch_deg:.0f} degrees"
    return f"the telemetry says {said}, the picture {seen}"
