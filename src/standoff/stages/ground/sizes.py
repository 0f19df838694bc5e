"""The ground from people's sizes alone: a weak observer that is always there.

Nobody tells how high the camera is, where it looks or what lens it has; but people are about as tall everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import CameraMotion, Detections, NoCameraMotion
from standoff.stages.ground.size_fit import Posterior, fit, poses
from standoff.stages.ground.size_window import MotionChain, SizeWindow

TOO_FEW = "too few people were seen standing at different places"
FISHEYE = "people's boxes through a fisheye lens do not tell their sizes; give a reference, a survey or markers"
NOT_A_PLANE = "the sizes of people do not fit one level ground"

_EVERY_S = 0.45
_LEAST_SCORE = 0.6
"""A box with this score is taken for a person: below, clutter is as frequent as people (the shipped detector)."""

_FEWEST_PLACES = 5
_FEWEST_STANDING, _WIDEST_SCATTER = 0.5, 0.3
_TURN_STEP = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class NoSizes:
    """People's sizes do not say where the camera is, and why. Falsy.

    Attributes:
        reason: A short clause, the same words for the same cause.
    """

    reason: str

    def __bool__(self) -> bool:
        return False


@dataclass(frozen=True, slots=True, eq=False)
class SizesEstimate:
    """Where the camera is by the sizes of people. Truthy.

    Attributes:
        view: Camera at (0, 0, its height above the ground), x to the right, y ahead along the ground.
        covariance: (8, 8) of a small rotation vector in the camera frame (site_to_camera becomes exp([v]x) times it),
            position in metres, log focal length, k1. Neither x nor y nor the direction ahead is uncertain: they say
            where this site frame is.
        time_s: Presentation timestamp of the picture whose view this is.
        people: How many people it rests on.
        boxes: How many boxes.
    """

    view: View
    covariance: FloatArray
    time_s: float
    people: int
    boxes: int

    def __post_init__(self) -> None:
        covariance = np.array(self.covariance, dtype=np.float64).reshape(8, 8)
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)

    def __bool__(self) -> bool:
        return True


class SizesEstimator:
    """Estimates the camera's height, pitch, roll and focal length from boxes of people.

    Args:
        prior: What is known of the camera.
    """

    def __init__(self, prior: CameraPrior) -> None:
        self._prior = prior
        self.reset()

    def reset(self) -> None:
        """Forget everything but the prior."""
        self._chain = MotionChain()
        self._window = SizeWindow(self._prior.camera)
        self._posterior: Posterior | None = None
        self._sampled_s = -np.inf
        self._answer: SizesEstimate | NoSizes = NoSizes(TOO_FEW)

    def update(
        self, time_s: float, detections: Detections, motion: CameraMotion | NoCameraMotion | None
    ) -> SizesEstimate | NoSizes:
        """Take one frame; it is to be called for each, and looks at boxes about twice a second.

        Args:
            time_s: Presentation timestamp, growing.
            detections: Of the frame; empty where the detector rested.
            motion: How the picture moved; None: the camera stands still. Where it is not known, all starts anew.

        Returns:
            The answer of the last frame whose boxes were looked at, or why there is none.
        """
        # Away from the middle of such a picture people lean and stretch: their boxes miss their heights by a third.
        if self._prior.camera.lens == "fisheye":
            return NoSizes(FISHEYE)
        moved = None if isinstance(motion, NoCameraMotion) else self._chain.follow(time_s, motion)
        if moved is None:
            self.reset()
            return self._answer
        people = detections[(detections.class_id == CLASS_BY_NAME["worker"].id) & (detections.score >= _LEAST_SCORE)]
        if len(people) == 0 or time_s - self._sampled_s < _EVERY_S:
            return self._answer
        self._sampled_s = time_s
        self._window.add(time_s, people.xyxy_px, moved)
        self._answer = self._estimate(time_s, moved)
        return self._answer

    def _estimate(self, time_s: float, moved: FloatArray) -> SizesEstimate | NoSizes:
        if self._window.places() < _FEWEST_PLACES:
            return NoSizes(TOO_FEW)
        rows = self._window.rows(moved)
        posterior = fit(rows, self._prior.focal_sigma, self._prior.k1_sigma, self._posterior)
        if posterior.standing < _FEWEST_STANDING or posterior.scatter > _WIDEST_SCATTER:
            self._posterior = None
            return NoSizes(NOT_A_PLANE)
        self._posterior = posterior
        view, covariance = _as_view(posterior, self._prior)
        return SizesEstimate(view, covariance, time_s, int(rows.person.max()) + 1, len(rows.person))


def _as_view(posterior: Posterior, prior: CameraPrior) -> tuple[View, FloatArray]:
    """Return the camera's pose and the (8, 8) covariance of its small changes."""
    mean = posterior.mean
    nearby = mean + np.concatenate([np.zeros((1, 5)), _TURN_STEP * np.eye(5)[:2]])
    rotation, position_m = (each[:, 0] for each in poses(nearby, np.eye(3)[None]))
    by_parameter = np.zeros((8, 5))
    for column in (0, 1):
        turn = rotation[1 + column] @ rotation[0].T / _TURN_STEP
        by_parameter[:3, column] = [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    by_parameter[:3] /= 2.0
    by_parameter[5, 2] = position_m[0, 2]
    by_parameter[6, 3] = by_parameter[7, 4] = 1.0
    camera = prior.camera.refocused(float(np.exp(mean[3])), float(prior.camera.distortion[0] + mean[4]))
    return View(camera, position_m[0], rotation[0]), by_parameter @ posterior.covariance @ by_parameter.T
