"""What is believed of the camera from frame to frame: predicted by motion, corrected by observations.

The belief is held at the motion's keyframe and carried from there to each frame, never from frame to frame: the error
of following the picture does not add up, and each frame's observation improves the keyframe. Frames that follow each
other see the same edges with the same stains and the same light: the observations of `_SAME_S` count as one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, NoCameraMotion
from standoff.stages.ground.carry import carry, since
from standoff.stages.ground.lasting_errors import LastingErrors
from standoff.stages.ground.solid import HEIGHT, STATE, SolidState
from standoff.stages.ground.solid_fit import Belief

_SAME_S, _SAME_UNSURE_S = 0.5, 4.0
"""The second while the lens is unsure: errors of edges are then taken for the lens's, the same in each frame."""

LASTING_SHARE, _LASTING_UNSURE_SHARE = 0.3, 1.0
"""Of one observation's variance so much is there in each and never averages out."""

_SURE_FOCAL_SIGMA = 0.02
_GUESSED_HEIGHT_SIGMA_M = 0.12
"""A height read off the picture may be that of a shadow's edge: it is never surer than this."""

_FLIGHT_MPS, _FLIGHT_RADPS = 5.0, 0.6
"""How fast a drone may move and turn while nothing tells how."""

_TIME_SLACK_S = 1e-6


@dataclass(frozen=True, eq=False)
class Estimate:
    """The state at one time.

    Attributes:
        state: Most likely.
        covariance: (9, 9) of what averages out.
        lasting: (9, 9) covariance of what does not.
    """

    state: SolidState
    covariance: FloatArray
    lasting: FloatArray

    @cached_property
    def total(self) -> FloatArray:
        """(9, 9) covariance of everything."""
        return self.covariance + self.lasting

    @cached_property
    def information(self) -> FloatArray:
        """(9, 9) inverse of `covariance`."""
        return _inverse(self.covariance)

    def belief(self) -> Belief:
        """Return it as a prior for a fit."""
        return Belief(self.state, self.information)


_Keyframe = tuple[Estimate | None, float, CameraMotion | NoCameraMotion]
"""A belief, when it was held, and the motion of the picture until then."""


class PoseFilter:
    """One stream's belief. `predict` comes first in each frame, then at most one `correct` by each observer."""

    def __init__(self) -> None:
        self._key: Estimate | None = None
        self._key_s = 0.0
        self._now: Estimate | None = None
        self._now_s = 0.0
        self._by_key = np.eye(STATE)
        self._motion: CameraMotion | NoCameraMotion = NoCameraMotion("not yet")
        self._key_motion: CameraMotion | NoCameraMotion = self._motion
        self._before_lost: _Keyframe | None = None
        self._lost: tuple[Estimate, float] | None = None
        self._observed_s: dict[str, float] = {}
        self._lasting = LastingErrors()
        self._same_s, self._lasting_share = _SAME_S, LASTING_SHARE
        self._doubt = np.zeros((STATE, STATE))

    @property
    def now(self) -> Estimate | None:
        """What is believed in the frame that was predicted last; None before the start."""
        return self._now

    @property
    def observed_s(self) -> float:
        """When an observation was last taken in; minus infinity before the first."""
        return max(self._observed_s.values(), default=-np.inf)

    def start(
        self,
        belief: Belief,
        time_s: float,
        motion: CameraMotion | NoCameraMotion,
        *,
        height_known: bool = True,
        lasting_share: float | None = None,
        by: str = "",
        doubt: FloatArray | None = None,
    ) -> None:
        """Begin, or begin again, with a belief about this frame.

        Args:
            belief: What is known now.
            time_s: Of the frame.
            motion: Of this frame, from which those of later ones are counted.
            height_known: Whether the solid's height was measured by hand.
            lasting_share: Of the belief's covariance, what is there in every frame and never averages out; None: what
                edges of a reference leave, more of it while the lens is unsure.
            by: Whose observation it is.
            doubt: (9, 9) covariance that no look takes away, because looks alike have two explanations.
        """
        self._motion = motion
        covariance = _inverse(belief.information)
        lens_sure = covariance[6, 6] < _SURE_FOCAL_SIGMA**2
        self._doubt = np.zeros((STATE, STATE)) if doubt is None else doubt
        if not height_known:
            # The top is where it is seen: a higher solid puts the ground lower and the camera higher above it.
            together = np.zeros(STATE)
            together[[5, HEIGHT]] = _GUESSED_HEIGHT_SIGMA_M
            self._doubt = self._doubt + np.outer(together, together)
        self._same_s = _SAME_S if lens_sure else _SAME_UNSURE_S
        self._lasting_share = LASTING_SHARE if lens_sure else _LASTING_UNSURE_SHARE
        if lasting_share is not None:
            self._lasting_share = lasting_share
        lasting = self._lasting_share * covariance + self._doubt
        self._lost = None
        self._now = Estimate(belief.state, covariance, lasting)
        self._now_s = time_s
        self._observed_s = {by: time_s}
        self._by_key = np.eye(STATE)
        self._lasting.begin(by, lasting)
        self._rekey()

    def predict(self, time_s: float, motion: CameraMotion | NoCameraMotion) -> bool:
        """Carry the belief to a frame.

        Returns:
            Whether motion carried it; if not, all that is known is that a drone flies so fast at most.
        """
        if self._key is None or self._now is None:
            self._motion = motion
            return False
        since_key = self._since_key(motion)
        carried = None if since_key is None else carry(self._key.state.view, since_key, self._now.state.view)
        self._motion = motion
        if carried is None:
            # The keyframe's belief is kept: a later frame may be followed from there again.
            self._drift(time_s)
            self._now_s = time_s
            return False
        self._lost = None
        self._by_key = carried.by_key
        self._now = Estimate(
            SolidState(carried.view, self._key.state.height_m),
            carried.by_key @ self._key.covariance @ carried.by_key.T + carried.added,
            carried.by_key @ self._key.lasting @ carried.by_key.T,
        )
        self._now_s = time_s
        return True

    def correct(self, state: SolidState, information: FloatArray, by: str = "") -> None:
        """Take in an observation of this frame.

        Args:
            state: The most likely one given prediction and observation together, the observation at full weight.
            information: (9, 9) that the observation adds at full weight.
            by: Whose it is: those of one observer that follow each other have much in common, those of others do not.
        """
        assert self._key is not None and self._now is not None, "predicted first"
        if self._lost is not None:
            given_up = self._key, self._key_s, self._key_motion
            self._rekey()
            # The next frame may be followed from there again, and not from this one.
            self._before_lost = given_up
        assert self._key is not None and self._now is not None
        since_s = self._now_s - self._observed_s.get(by, -np.inf)
        fresh = min(max(since_s / self._same_s, 0.0), 1.0)
        before = self._now.information
        pull = (before + information) @ state.change_from(self._now.state)
        self._offer_lasting(before, information, by)
        self._absorb(before, fresh * information, fresh * pull)
        self._observed_s[by] = self._now_s
        self._lost = None

    def correct_lens(self, gradient: FloatArray, off: float, sigma: float) -> None:
        """Take in what a number that depends on the lens was found to be, independently of everything before.

        Args:
            gradient: (9,) of the number by a change of the state.
            off: By how much it is more than the state says.
            sigma: Its standard error.
        """
        assert self._now is not None, "predicted first"
        weighted = gradient / sigma**2
        self._absorb(self._now.information, np.outer(gradient, weighted), weighted * off)

    def _absorb(self, before: FloatArray, information: FloatArray, pull: FloatArray) -> None:
        """Correct this frame's belief and the keyframe's.

        Args:
            before: (9, 9) information of this frame's belief.
            information: (9, 9) that is added.
            pull: (9,) what the added information makes of its own deviations.
        """
        assert self._key is not None and self._now is not None
        covariance = _inverse(before + information)
        change = covariance @ pull
        gain = self._key.covariance @ self._by_key.T @ before
        key_covariance = self._key.covariance + gain @ (covariance - self._now.covariance) @ gain.T
        lasting = self._lasting.total()
        self._key = Estimate(self._key.state.changed(gain @ change), (key_covariance + key_covariance.T) / 2.0, lasting)
        self._now = Estimate(self._now.state.changed(change), covariance, self._by_key @ lasting @ self._by_key.T)

    def _offer_lasting(self, before: FloatArray, information: FloatArray, by: str) -> None:
        """Note what of an observation's error is in all others of its kind.

        What was known of the lens before the first picture belongs to an observation by itself.
        """
        assert self._now is not None
        alone = information + np.diag(1.0 / np.maximum(np.diag(self._now.covariance), 1e-12)) * np.array(
            [0.0] * 6 + [1.0] * 3
        )
        try:
            lasting = self._lasting_share * np.linalg.inv(alone + 1e-6 * before) + self._doubt
            back = _inverse(self._by_key)
        except np.linalg.LinAlgError:
            return
        self._lasting.offer(by, back @ lasting @ back.T)

    def _since_key(self, motion: CameraMotion | NoCameraMotion) -> CameraMotion | None:
        """Return the motion since the frame at which the belief is held, which need not be the motion's keyframe."""
        if isinstance(motion, NoCameraMotion):
            return None
        if _same_time(motion.keyframe_s, self._now_s) and not _same_time(self._key_s, self._now_s):
            self._rekey()
        since_key = self._since(self._key_s, self._key_motion, motion)
        if since_key is None and self._before_lost is not None:
            key, key_s, key_motion = self._before_lost
            since_key = self._since(key_s, key_motion, motion)
            if since_key is not None:
                self._key, self._key_s, self._key_motion = key, key_s, key_motion
        return since_key

    @staticmethod
    def _since(key_s: float, key_motion: CameraMotion | NoCameraMotion, motion: CameraMotion) -> CameraMotion | None:
        """Return the motion since one frame, by what is known of how the picture moved until then and until now."""
        if _same_time(motion.keyframe_s, key_s):
            return motion
        if isinstance(key_motion, CameraMotion) and _same_time(motion.keyframe_s, key_motion.keyframe_s):
            return since(key_motion, motion)
        return None

    def _rekey(self) -> None:
        self._key, self._key_s, self._key_motion = self._now, self._now_s, self._motion
        self._lasting.carry(self._by_key)
        self._by_key = np.eye(STATE)
        self._before_lost = None

    def _drift(self, time_s: float) -> None:
        """Let the belief widen, from when the picture was lost on, as fast as a drone may move."""
        assert self._now is not None
        if self._lost is None:
            self._lost = self._now, self._now_s
        estimate, lost_s = self._lost
        sigma = np.array([_FLIGHT_RADPS] * 3 + [_FLIGHT_MPS] * 3 + [0.0] * 3) * max(time_s - lost_s, 0.0)
        self._now = Estimate(estimate.state, estimate.covariance + np.diag(sigma**2), estimate.lasting)


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _same_time(first_s: float, second_s: float) -> bool:
    return abs(first_s - second_s) <= _TIME_SLACK_S
