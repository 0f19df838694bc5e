"""Points of known places as landmarks: they begin the belief about the camera, correct it, or contradict it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, View
from standoff.core.types import NoGroundMap
from standoff.stages.ground.camera_belief import STATED, CameraBelief, FrameEvidence, Source
from standoff.stages.ground.marker_fit import PointFit, agreeing, first_fit, fit_points
from standoff.stages.ground.marker_observer import NO_MARKER, MarkerObserver
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.pose_filter import Estimate
from standoff.stages.ground.solid import STATE
from standoff.stages.ground.survey_observer import SurveyObserver
from standoff.stages.ground.view_prior import (
    PriorRows,
    belief_of,
    carried_prior,
    level_prior,
    telemetry_prior,
    telemetry_view,
)

PointObserver = Callable[[FrameEvidence, View | None], Sequence[PointObservation] | NoGroundMap]
"""From a frame, and where the camera is about, to what is seen in it, or why nothing is."""

_TAPE_SIGMA_M = 0.02
"""Where a marker lies beside other things is known to so much; a single one says where the site frame is."""


@dataclass(frozen=True, slots=True)
class PointSource:
    """What is watched for, and how far it is trusted.

    Attributes:
        name: As the belief's source.
        place_sigma_m: Standard error of each coordinate of an observation's place; its points share it.
        patience_s: For how long it may contradict the belief before that is said.
    """

    name: Source
    place_sigma_m: float
    patience_s: float


class PointLandmarks:
    """Points of known places in one stream: printed markers, or a survey.

    Args:
        watch: Finds them.
        source: What they are.
        telemetry: Whether the drone's telemetry may help a first look.
        up: (3,) where the vertical points in the frame of the points, in which the ground is z = 0.
    """

    def __init__(self, watch: PointObserver, source: PointSource, *, telemetry: bool, up: FloatArray) -> None:
        self._watch, self._up = watch, up
        self._source = source
        self._telemetry = telemetry
        self.reset()

    @classmethod
    def of_markers(cls, observer: MarkerObserver, *, alone: bool, telemetry: bool, up: FloatArray) -> Self:
        """Watch for printed markers.

        Args:
            observer: Finds them.
            alone: Whether nothing else has a stated place.
            telemetry: Whether the drone's telemetry may help a first look.
            up: (3,) where the vertical points.
        """

        def watch(evidence: FrameEvidence, view: View | None) -> Sequence[PointObservation] | NoGroundMap:
            return observer.observe(evidence.gray, view, evidence.frame.time_s) or NoGroundMap(NO_MARKER)

        place_sigma_m = 0.0 if alone and len(observer.places) == 1 else _TAPE_SIGMA_M
        return cls(watch, PointSource("markers", place_sigma_m, patience_s=1.0), telemetry=telemetry, up=up)

    @classmethod
    def of_survey(cls, observer: SurveyObserver, *, telemetry: bool, up: FloatArray) -> Self:
        """Wait for the picture of a survey."""
        # The survey's own error is part of its points' errors in the picture.
        source = PointSource("survey", place_sigma_m=0.0, patience_s=0.0)
        return cls(lambda evidence, _: observer.observe(evidence), source, telemetry=telemetry, up=up)

    def reset(self) -> None:
        """Forget everything that the pictures have told."""
        self._refused_since_s: float | None = None

    def look(self, evidence: FrameEvidence, belief: CameraBelief) -> str:
        """Take in the points that are seen.

        Args:
            evidence: The frame.
            belief: About the camera; begun or corrected here.

        Returns:
            Why none was taken in, or "".
        """
        # Places in another site frame, that of a reference without a stated place, cannot be compared with these.
        comparable = evidence.held and belief.by_landmark and belief.frame_of == STATED
        now = belief.now if comparable else None
        seen = self._watch(evidence, None if now is None else now.state.view)
        if isinstance(seen, NoGroundMap):
            self._refused_since_s = None
            return seen.reason
        if now is not None:
            if self._took(now, seen, evidence, belief) or not self._refused(evidence.frame.time_s):
                return ""
            if belief.source != self._source.name:
                self._warn(seen, evidence, belief)
                return ""
        fit = first_fit(seen, belief.lens.camera, self._first_prior(evidence, belief), self._source.place_sigma_m)
        if isinstance(fit, NoGroundMap):
            return fit.reason
        belief.begin(self._source.name, belief_of(fit.view, fit.covariance), evidence, frame_of=STATED)
        self._note(fit, evidence)
        return ""

    def _took(
        self, now: Estimate, seen: Sequence[PointObservation], evidence: FrameEvidence, belief: CameraBelief
    ) -> bool:
        """Take in what agrees with the belief; return whether anything did."""
        view, of_view, place_sigma_m = now.state.view, slice(0, CHANGES), self._source.place_sigma_m
        believed = agreeing(view, now.total[of_view, of_view], seen, place_sigma_m)
        inverse = np.asarray(np.linalg.inv(now.covariance[of_view, of_view]), dtype=np.float64)
        fit = fit_points(view, believed, carried_prior(view, inverse), place_sigma_m) if believed else None
        if fit is None:
            return False
        information = np.zeros((STATE, STATE))
        information[of_view, of_view] = fit.information
        # A reference's height follows from where the camera is.
        change = now.covariance[:, of_view] @ inverse @ fit.view.change_from(view)
        belief.correct(now.state.changed(change), information, self._source.name, evidence)
        self._note(fit, evidence)
        return True

    def _note(self, fit: PointFit, evidence: FrameEvidence) -> None:
        self._refused_since_s = None
        evidence.anchors_px += [one.points_px for one in fit.used]

    def _refused(self, time_s: float) -> bool:
        """Return whether for long enough nothing has agreed with the belief."""
        if self._refused_since_s is None:
            self._refused_since_s = time_s
        return time_s - self._refused_since_s >= self._source.patience_s

    def _first_prior(self, evidence: FrameEvidence, belief: CameraBelief) -> PriorRows:
        """Return what is known of the view when the first point comes into sight."""
        telemetry = evidence.frame.telemetry
        if self._telemetry and telemetry is not None:
            read = telemetry_view(telemetry, telemetry, belief.lens, frame_is_free=True)
            if not isinstance(read, NoGroundMap):
                return telemetry_prior(*read)
        return level_prior(belief.lens, self._up)

    def _warn(self, seen: Sequence[PointObservation], evidence: FrameEvidence, belief: CameraBelief) -> None:
        names = " and ".join(one.name for one in seen)
        verb = "lie" if len(seen) > 1 or names.endswith("points") else "lies"
        trusted = belief.keeper or ("the survey" if belief.source == "survey" else "the first marker")
        # Once for all of a kind: which of them are in sight changes from frame to frame.
        belief.warnings.setdefault(
            self._source.name,
            f"{names} {verb} elsewhere than stated, from {evidence.text} on: {trusted} is trusted, it was seen first",
        )
