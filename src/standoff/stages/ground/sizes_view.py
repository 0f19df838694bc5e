"""How far the sizes of people may be trusted, alone and with a height from elsewhere."""

from __future__ import annotations

from collections import deque

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.classes import Role, class_ids
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.telemetry import Telemetry
from standoff.core.types import CameraMotion, Detections, NoCameraMotion, NoGroundMap
from standoff.stages.ground.sizes import SizesEstimate, SizesEstimator

FEW_PEOPLE = "too few people at once to measure by their sizes"
CONTRADICTION = "the drone's height and the sizes of people contradict each other"

_LEAST_SCORE = 0.6
_FEWEST_PEOPLE, _FEWEST_WITH_HEIGHT = 5, 3
_REMEMBERED_S = 30.0

_INFLATION = 1.5
_CLUTTER_SIGMA = 0.12
"""Clutter that passes for people makes them look smaller than they are, and the estimate does not know."""

_TERRAIN_M = 1.0
_CONTRADICTION_SIGMAS = 3.0


class SizesView:
    """Estimates the view from people's sizes, and believes it only where enough of them were seen at once.

    Args:
        prior: What is known of the camera.
    """

    def __init__(self, prior: CameraPrior) -> None:
        self._estimator = SizesEstimator(prior)
        self._counts: deque[tuple[float, int]] = deque()
        self.people = 0

    def update(
        self, time_s: float, detections: Detections, motion: CameraMotion | NoCameraMotion, telemetry: Telemetry | None
    ) -> tuple[View, FloatArray] | NoGroundMap | None:
        """Take one frame; returns view and (8, 8) covariance, or why there is none, or None: nothing new."""
        people = np.isin(detections.class_id, class_ids(Role.PERSON)) & (detections.score >= _LEAST_SCORE)
        self._counts.append((time_s, int(people.sum())))
        while time_s - self._counts[0][0] > _REMEMBERED_S:
            self._counts.popleft()
        # Names change when somebody is lost from sight; those in one picture are different people for certain.
        self.people = max(count for _, count in self._counts)
        estimate = self._estimator.update(time_s, detections, motion)
        if not isinstance(estimate, SizesEstimate):
            return NoGroundMap(estimate.reason)
        has_height = telemetry is not None and np.isfinite(telemetry.height_m)
        if min(self.people, estimate.people) < (_FEWEST_WITH_HEIGHT if has_height else _FEWEST_PEOPLE):
            return NoGroundMap(FEW_PEOPLE)
        if estimate.time_s != time_s:
            return None
        covariance = _INFLATION**2 * estimate.covariance
        covariance[5, 5] += (_CLUTTER_SIGMA * estimate.view.position_m[2]) ** 2
        if telemetry is None or not has_height:
            return estimate.view, covariance
        return _at_height(estimate.view, covariance, telemetry)


def _at_height(view: View, covariance: FloatArray, telemetry: Telemetry) -> tuple[View, FloatArray] | NoGroundMap:
    """Return the view given the height above the ground as well."""
    variance = telemetry.height_sigma_m**2 + _TERRAIN_M**2
    off_m = telemetry.height_m - float(view.position_m[2])
    if abs(off_m) > _CONTRADICTION_SIGMAS * np.sqrt(covariance[5, 5] + variance):
        return NoGroundMap(CONTRADICTION)
    gain = covariance[:, 5] / (covariance[5, 5] + variance)
    changed = view.changed(gain * off_m)
    return changed, covariance - np.outer(gain, covariance[5])
