"""What one stream believes of its camera: where it is, by what that is known, and in which site frame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from standoff.core.camera import Camera, CameraPrior, RadialDistortion
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, LENS, View
from standoff.core.types import CameraMotion, Detections, Frame, ImageArray, Luma, NoCameraMotion
from standoff.stages.ground.pose_filter import LASTING_SHARE, Estimate, PoseFilter
from standoff.stages.ground.pose_map import length_sigma
from standoff.stages.ground.solid import STATE, SolidState
from standoff.stages.ground.solid_fit import Belief
from standoff.stages.ground.view_prior import belief_of, in_frame_of

Source = Literal["reference", "survey", "markers", "telemetry", "sizes"]
LANDMARKS: tuple[Source, ...] = ("reference", "survey", "markers")
STATED = "stated"
"""The site frame that references and markers of stated places share."""

_NEWS = 0.9
"""What the motion tells of the lens is heard again when its error has become so many times as large."""


@dataclass(eq=False)
class FrameEvidence:
    """One frame, and what has been learned about it so far.

    Attributes:
        frame: The frame.
        detections: Of it.
        motion: Of the picture since the keyframe.
        held: Whether motion, or something seen in this frame, tells where the camera is now.
        anchors_px: (N, 2) each: what was seen to measure by.
    """

    frame: Frame
    detections: Detections
    motion: CameraMotion | NoCameraMotion
    held: bool = False
    anchors_px: list[FloatArray] = field(default_factory=list)

    @cached_property
    def gray(self) -> ImageArray:
        """(H, W) the whole picture."""
        return self.frame.picture.gray()

    @cached_property
    def luma(self) -> Luma:
        """The picture by parts."""
        return self.frame.picture.luma()

    @property
    def text(self) -> str:
        """When it is, for people."""
        return f"frame {self.frame.index} ({self.frame.time_s:.2f} s)"


class CameraBelief:
    """The belief about one camera.

    Args:
        prior: What is known of the lens, for pictures of this size.

    Attributes:
        source: What it rests on; None: there is none.
        keeper: Name of the reference whose height is the belief's; "" where it has none.
        frame_of: Whose the site frame is; it goes on where the belief begins again.
        site_frame: Counts the site frames up; positions in different ones cannot be compared.
        warnings: What contradicted it, each said once.
    """

    def __init__(self, prior: CameraPrior) -> None:
        self._prior = prior
        self._heard: RadialDistortion | None = None
        self.frame_of = ""
        self.site_frame = -1
        self.warnings: dict[str, str] = {}
        self.restart()

    def restart(self) -> None:
        """Forget where the camera is."""
        self._filter = PoseFilter()
        self.source: Source | None = None
        self.keeper = ""
        self.begun_sigma = np.inf

    @property
    def now(self) -> Estimate | None:
        """What is believed in the frame that was predicted last; None before the start."""
        return self._filter.now

    @property
    def observed_s(self) -> float:
        """When an observation was last taken in; minus infinity before the first."""
        return self._filter.observed_s

    @property
    def by_landmark(self) -> bool:
        """Whether it rests on references, surveyed points or markers."""
        return self.source in LANDMARKS

    @property
    def length_sigma(self) -> float:
        """Relative standard error of lengths in the middle of the picture now; infinite before the start."""
        now = self.now
        return np.inf if now is None else length_sigma(now.state.view, now.total[:CHANGES, :CHANGES])

    @property
    def lens(self) -> CameraPrior:
        """What is known of the lens, by landmarks too."""
        now = self.now
        if now is None or not self.by_landmark:
            return self._prior
        focal_sigma, k1_sigma = np.sqrt(np.diag(now.total))[LENS]
        return CameraPrior(now.state.view.camera, float(focal_sigma), float(k1_sigma), self._prior.origin)

    def doubt_lens(self, camera: Camera) -> None:
        """Take the lens that something of known size was seen through for likely, whatever was stated."""
        self._prior = replace(CameraPrior.unknown(camera.width_px, camera.height_px), camera=camera)

    def predict(self, evidence: FrameEvidence) -> None:
        """Carry the belief to a frame by motion, and learn from it of the lens; the view is then held."""
        evidence.held = self._filter.predict(evidence.frame.time_s, evidence.motion)
        told = evidence.motion.distortion if isinstance(evidence.motion, CameraMotion) else None
        # What the motion tells is the k1 of another kind of lens than a fisheye.
        if told is None or self._prior.camera.lens == "fisheye":
            return
        if self._heard is None or told.sigma < _NEWS * self._heard.sigma:
            self._hear(told)

    def _hear(self, told: RadialDistortion) -> None:
        """Take in what the motion has told of the lens since it was heard last."""
        news = told if self._heard is None else told.since(self._heard)
        self._heard = told
        self._prior = self._prior.with_distortion(news)
        now = self.now
        if now is None:
            return
        camera = now.state.view.camera
        ratio = news.focal_px / float(camera.matrix[0, 0])
        own_k1 = float(camera.distortion[0]) * ratio**2
        # k1 as told goes with the square of the focal length that a lens of the same bend would have.
        gradient = np.zeros(STATE)
        gradient[LENS] = -2.0 * own_k1, ratio**2
        self._filter.correct_lens(gradient, news.k1 - own_k1, news.sigma)

    def correct(self, state: SolidState, information: FloatArray, by: str, evidence: FrameEvidence) -> None:
        """Take in an observation, as `PoseFilter.correct`; the view is then held."""
        self._filter.correct(state, information, by)
        evidence.held = True

    def begin(
        self,
        source: Source,
        belief: Belief,
        evidence: FrameEvidence,
        *,
        frame_of: str,
        keeper: str = "",
        height_known: bool = True,
        doubt: FloatArray | None = None,
    ) -> None:
        """Begin, or begin again; the view is then held.

        Args:
            source: What the belief rests on.
            belief: About the camera, in the site frame.
            evidence: The frame.
            frame_of: Whose the site frame is.
            keeper: Name of the reference whose height is the belief's.
            height_known: Whether that was measured by hand.
            doubt: (9, 9) covariance that no further look takes away.
        """
        lasting_share = None if keeper else LASTING_SHARE
        by = keeper or source
        self._filter.start(
            belief,
            evidence.frame.time_s,
            evidence.motion,
            height_known=height_known,
            lasting_share=lasting_share,
            by=by,
            doubt=doubt,
        )
        if frame_of != self.frame_of:
            self.site_frame += 1
        self.source, self.keeper, self.frame_of = source, keeper, frame_of
        evidence.held = True
        self.begun_sigma = self.length_sigma

    def begin_in_old_frame(self, source: Source, view: View, covariance: FloatArray, evidence: FrameEvidence) -> None:
        """Begin with a view in whose frame nothing is marked on the ground: the frame so far goes on, if there is one.

        Args:
            source: What it rests on.
            view: The camera.
            covariance: (8, 8) of a change of it.
            evidence: The frame.
        """
        frame_of: str = source
        if self.now is not None:
            frame_of = self.frame_of
            if source != frame_of:
                view = in_frame_of(view, self.now.state.view)
        self.begin(source, belief_of(view, covariance), evidence, frame_of=frame_of)
