"""What the drone's telemetry adds to a camera found by something of known size, and whether it contradicts that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES
from standoff.core.telemetry import Telemetry
from standoff.core.types import NoGroundMap
from standoff.stages.ground.solid_fit import Belief
from standoff.stages.ground.view_prior import in_frame_of, telemetry_view

_MOST_CHI2 = 27.9
"""Five readings (height, pitch, roll, and what they say of the lens) exceed it four times in a hundred thousand."""

_LIKELY_CHI2 = 11.1
"""They exceed it once in twenty times."""

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
    compared = _compared(belief, telemetry)
    if compared is None:
        return belief, ""
    off, spread = compared
    before = np.linalg.inv(belief.information)
    both = before[:CHANGES, :CHANGES] + spread
    if off @ np.linalg.solve(both, off) > _MOST_CHI2:
        return belief, _contradiction(belief, telemetry)
    gain = before[:, :CHANGES] @ np.linalg.inv(both)
    after = before - gain @ before[:CHANGES]
    return Belief(belief.state.changed(gain @ off), np.asarray(np.linalg.inv((after + after.T) / 2.0))), ""


def agrees_with_telemetry(belief: Belief, telemetry: Telemetry) -> bool:
    """Return whether telemetry speaks for a belief rather than for another one."""
    compared = _compared(belief, telemetry)
    if compared is None:
        return True
    off, spread = compared
    both = np.linalg.inv(belief.information)[:CHANGES, :CHANGES] + spread
    return bool(off @ np.linalg.solve(both, off) <= _LIKELY_CHI2)


def _compared(belief: Belief, telemetry: Telemetry) -> tuple[FloatArray, FloatArray] | None:
    """Return (8,) the change from a belief to what telemetry says, and (8, 8) its errors; None: it says nothing."""
    view = belief.state.view
    said = telemetry
    if not telemetry.has_attitude:
        said = replace(
            telemetry,
            pitch_deg=float(np.rad2deg(view.pitch_rad)),
            roll_deg=float(np.rad2deg(view.roll_rad)),
            heading_deg=0.0,
            pitch_sigma_deg=_NOT_TOLD_DEG,
            roll_sigma_deg=_NOT_TOLD_DEG,
            heading_sigma_deg=_NOT_TOLD_DEG,
        )
    lens = CameraPrior(view.camera, _FREE_LENS, _FREE_LENS, "")
    read = telemetry_view(said, said, lens, frame_is_free=True)
    if isinstance(read, NoGroundMap):
        return None
    told, spread = read
    return in_frame_of(told, view).change_from(view), spread


def _contradiction(belief: Belief, telemetry: Telemetry) -> str:
    view = belief.state.view
    said = f"a height of {telemetry.height_m:.1f} m"
    seen = f"{view.position_m[2]:.1f} m"
    if telemetry.has_attitude:
        said = f"{said} and a pitch of {telemetry.pitch_deg:.0f} degrees"
        seen = f"{seen} and {np.rad2deg(view.pitch_rad):.0f} degrees"
    return f"the telemetry says {said}, the picture {seen}"
