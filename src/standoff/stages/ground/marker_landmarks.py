"""Printed markers as landmarks: they begin the belief about the camera, correct it, or contradict it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from standoff.core.pose import CHANGES
from standoff.core.types import NoGroundMap
from standoff.stages.ground.camera_belief import STATED, CameraBelief, Moment
from standoff.stages.ground.marker_fit import PointFit, agreeing, first_fit, fit_points
from standoff.stages.ground.marker_observer import MarkerObserver
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.pose_filter import Estimate
from standoff.stages.ground.solid import STATE
from standoff.stages.ground.view_prior import (
    PriorRows,
    belief_of,
    carried_prior,
    level_prior,
    telemetry_prior,
    telemetry_view,
)

NO_MARKER = "no marker has been seen"

_PLACE_SIGMA_M = 0.02
"""Of a marker beside other things: where it lies is measured with a tape. A single one says where the site frame is."""

_MAX_REFUSED_S = 1.0


class MarkerLandmarks:
    """The markers of one stream.

    Args:
        observer: Finds them in pictures.
        alone: Whether nothing else has a stated place.
        telemetry: Whether the drone's telemetry may help a first look.
    """

    def __init__(self, observer: MarkerObserver, *, alone: bool, telemetry: bool) -> None:
        self._observer = observer
        self._telemetry = telemetry
        self._place_sigma_m = 0.0 if alone and len(observer.places) == 1 else _PLACE_SIGMA_M
        self.places = observer.places
        self.reset()

    def reset(self) -> None:
        """Forget everything that the pictures have told."""
        self._observer.reset()
        self._refused_since_s: float | None = None

    def look(self, moment: Moment, belief: CameraBelief) -> str:
        """Take in the markers in the picture.

        Args:
            moment: The frame.
            belief: About the camera; begun or corrected here.

        Returns:
            Why none was taken in, or "".
        """
        now = belief.now if moment.held and belief.by_landmark else None
        seen = self._observer.observe(moment.gray, None if now is None else now.state.view, moment.frame.time_s)
        if not seen:
            self._refused_since_s = None
            return NO_MARKER
        if now is not None:
            if self._took(now, seen, moment, belief) or not self._refused(moment.frame.time_s):
                return ""
            if belief.keeper:
                _warn(seen, moment, belief)
                return ""
        fit = first_fit(seen, belief.lens.camera, self._first_prior(moment, belief), self._place_sigma_m)
        if isinstance(fit, NoGroundMap):
            return fit.reason
        belief.begin("markers", belief_of(fit.view, fit.covariance), moment, frame_of=STATED)
        self._note(fit, moment)
        return ""

    def _took(self, now: Estimate, seen: Sequence[PointObservation], moment: Moment, belief: CameraBelief) -> bool:
        """Take in what agrees with the belief; return whether anything did."""
        view, of_view = now.state.view, slice(0, CHANGES)
        believed = agreeing(view, now.total[of_view, of_view], seen, self._place_sigma_m)
        inverse = np.asarray(np.linalg.inv(now.covariance[of_view, of_view]), dtype=np.float64)
        fit = fit_points(view, believed, carried_prior(view, inverse), self._place_sigma_m) if believed else None
        if fit is None:
            return False
        information = np.zeros((STATE, STATE))
        information[of_view, of_view] = fit.information
        # A reference's height follows from where the camera is.
        change = now.covariance[:, of_view] @ inverse @ fit.view.change_from(view)
        belief.correct(now.state.changed(change), information, "markers", moment)
        self._note(fit, moment)
        return True

    def _note(self, fit: PointFit, moment: Moment) -> None:
        self._refused_since_s = None
        moment.anchors_px += [one.points_px for one in fit.used]

    def _refused(self, time_s: float) -> bool:
        """Return whether for a while no marker has agreed with the belief."""
        if self._refused_since_s is None:
            self._refused_since_s = time_s
        return time_s - self._refused_since_s >= _MAX_REFUSED_S

    def _first_prior(self, moment: Moment, belief: CameraBelief) -> PriorRows:
        """Return what is known of the view when the first marker comes into sight."""
        telemetry = moment.frame.telemetry
        if self._telemetry and telemetry is not None:
            read = telemetry_view(telemetry, telemetry, belief.lens, frame_is_free=True)
            if not isinstance(read, NoGroundMap):
                return telemetry_prior(*read)
        return level_prior(belief.lens)


def _warn(seen: Sequence[PointObservation], moment: Moment, belief: CameraBelief) -> None:
    names = " and ".join(one.name for one in seen)
    verb = "lies" if len(seen) == 1 else "lie"
    belief.warnings.setdefault(
        "markers",
        f"{names} {verb} elsewhere than stated, from {moment.text} on: {belief.keeper} is trusted, it was seen first",
    )
