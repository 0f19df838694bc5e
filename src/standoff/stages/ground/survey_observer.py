"""Surveyed points as a landmark: what the picture that they were read from says of a camera that may move."""

from __future__ import annotations

import numpy as np

from standoff.core.errors import GroundError
from standoff.core.types import NoGroundMap
from standoff.stages.ground.camera_belief import FrameEvidence
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.surveyed_ground import SurveyedGround

NOT_YET = "the picture of the surveyed points has not come yet"
SURVEYED = "the surveyed points"
MISSED = "the picture of the surveyed points was not among the frames"

_SAME_TIME_S = 0.02
"""Half a frame of a film at 25 frames a second: a time read off a player is that of its picture."""


class SurveyObserver:
    """Gives the surveyed points in the one frame that they were read from.

    Args:
        survey: With the time of its picture; without one, of the stream's first picture.

    Attributes:
        survey: The points.
        missed: Why their picture will not come any more, or "".

    Raises:
        GroundError: The survey says where it is not to be trusted, which only a fixed camera's picture can show.
    """

    def __init__(self, survey: SurveyedGround) -> None:
        if survey.has_area:
            raise GroundError(
                expected="a survey without area_px, beside other things or with a time",
                found="area_px, which holds in the picture of a fixed camera only",
                fix="take area_px out of the survey file",
            )
        self.survey = survey
        self.reset()

    def reset(self) -> None:
        """Forget that the picture has come: another film begins."""
        self._pending = True
        self.missed = ""

    def observe(self, evidence: FrameEvidence) -> list[PointObservation] | NoGroundMap:
        """Return the surveyed points in the frame that they were read from; in all others, why there are none."""
        time_s, wanted_s = evidence.frame.time_s, self.survey.time_s
        if not self._pending:
            return NoGroundMap(self.missed)
        if wanted_s is not None and time_s < wanted_s - _SAME_TIME_S:
            return NoGroundMap(NOT_YET)
        self._pending = False
        if wanted_s is not None and time_s > wanted_s + _SAME_TIME_S:
            self.missed = f"{MISSED}: it is at {wanted_s:g} s, the next one at {time_s:.2f} s"
            return NoGroundMap(self.missed)
        points_px, sigma_px = self.survey.points_in(evidence.frame.size_px)
        points_m = self.survey.points_in_plane()
        return [PointObservation(SURVEYED, points_m, points_px, np.full(len(points_px), sigma_px))]
