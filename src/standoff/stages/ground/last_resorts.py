"""What tells of the camera where no reference and no marker does: the drone's telemetry, the sizes of people."""

from __future__ import annotations

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.telemetry import Telemetry
from standoff.core.types import NoGroundMap
from standoff.stages.ground.camera_belief import CameraBelief, FrameEvidence
from standoff.stages.ground.params import FusedParams
from standoff.stages.ground.pose_map import length_sigma
from standoff.stages.ground.sizes_view import SizesView
from standoff.stages.ground.view_prior import telemetry_view

_WORSE = 1.5
"""Telemetry begins again when what was carried since has a standard error so many times its own."""


class LastResorts:
    """Telemetry and sizes of one stream.

    Args:
        prior: What is known of the lens, for pictures of this size.
        params: Which of them count.

    Attributes:
        most_people: That were measured by at once.
    """

    def __init__(self, prior: CameraPrior, params: FusedParams) -> None:
        self._params = params
        self._sizes = SizesView(prior)
        self._first: Telemetry | None = None
        self.most_people = 0

    def ask(self, evidence: FrameEvidence, belief: CameraBelief) -> list[str]:
        """Begin with what telemetry says where nothing as good is held; failing that, with the sizes of people.

        Args:
            evidence: The frame.
            belief: About the camera.

        Returns:
            Why neither tells anything.
        """
        reasons: list[str] = []
        for used, ask in ((self._params.telemetry, self._read_telemetry), (self._params.sizes, self._compare_sizes)):
            if used:
                reason = ask(evidence, belief)
                if reason is None:
                    return []
                reasons.append(reason)
        return reasons

    def _read_telemetry(self, evidence: FrameEvidence, belief: CameraBelief) -> str | None:
        """Return None where telemetry says all that is needed, or why it does not."""
        telemetry = evidence.frame.telemetry
        if telemetry is None:
            return ""
        own = belief.source == "telemetry"
        if own and evidence.held and belief.length_sigma <= _WORSE * belief.begun_sigma:
            return None
        self._first = telemetry if self._first is None else self._first
        read = telemetry_view(telemetry, self._first, belief.lens)
        if isinstance(read, NoGroundMap):
            return read.reason
        view, covariance = read
        if evidence.held and belief.by_landmark and length_sigma(view, covariance) >= belief.length_sigma:
            return None
        belief.begin_in_old_frame("telemetry", view, covariance, evidence)
        return None

    def _compare_sizes(self, evidence: FrameEvidence, belief: CameraBelief) -> str | None:
        """Begin with the sizes of people, or begin again where they tell more than before; otherwise say why not."""
        frame = evidence.frame
        telemetry = frame.telemetry if self._params.telemetry else None
        told = self._sizes.update(frame.time_s, evidence.detections, evidence.motion, telemetry)
        if isinstance(told, NoGroundMap):
            return None if evidence.held and belief.source == "sizes" else told.reason
        if told is None:
            return None if evidence.held else ""
        view, covariance = told
        if evidence.held and not _tells_more(view, covariance, belief):
            return None
        self.most_people = max(self.most_people, self._sizes.people)
        belief.begin_in_old_frame("sizes", view, covariance, evidence)
        return None


def _tells_more(view: View, covariance: FloatArray, belief: CameraBelief) -> bool:
    """Return whether another estimate is notably surer, or notably different: small changes only shake the map."""
    assert belief.now is not None
    height_m = belief.now.state.view.position_m[2]
    sigma = belief.length_sigma
    other = abs(float(np.log(view.position_m[2] / height_m))) > sigma / 2.0
    return length_sigma(view, covariance) < 0.9 * sigma or (other and belief.source == "sizes")
