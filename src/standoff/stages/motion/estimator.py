"""How the picture of the ground moved since a keyframe."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from standoff.core import homography, protocols
from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, Detections, Frame, NoCameraMotion
from standoff.stages.motion.breaks import Breaks
from standoff.stages.motion.keyframe import Keyframe, Match
from standoff.stages.motion.lens import Lens
from standoff.stages.motion.movers import Movers
from standoff.stages.motion.params import MotionParams
from standoff.stages.motion.picture import FollowedPicture
from standoff.stages.motion.plane import relief_covariance
from standoff.stages.motion.self_calibration import SelfCalibration
from standoff.stages.motion.zoom import ZoomWatch

CUT = "the picture was cut"
ZOOMED = "the camera zoomed"
RESIZED = "the picture's size changed"
TURNED_BACK = "the clock went backwards"
TOO_LITTLE = "too little to follow"

_NEAREST_LEVELS, _NEAR_LEVELS, _FAR_LEVELS = 0, 1, 4
_NEAREST_PX = 1.0
"""Where the last picture's points were this near to where they were looked for, the next one's will be near enough."""

_HOME_EVERY_S = 0.5

_NOISE_STEP = 0.1
_LONGEST_STEP = 3.0
"""Times the last step that a gap may be filled with: beyond that it is a guess, and a look around is better."""


class MotionEstimator(protocols.CameraMotionEstimator):
    """Follow the picture of the ground from a fixed keyframe, and say why where that fails.

    Points spread over the picture are followed by Lucas-Kanade from the keyframe itself, not from frame to frame, so
    that errors do not add up; the motion so far says where to begin looking. Boxes of people and machines are left
    out, and the plane that most of the other points share is taken for the ground. A new keyframe is taken where the
    view has changed much; its own motion still refers to the old one. The stream's first keyframe is kept, and looked
    for again where the thread to it was torn: so a camera that stands still is known to stand where it stood.

    Args:
        params: Settings; None takes the defaults.
        camera: The lens, whose distortion is removed from the points first; None: it is learned from how the ground
            bends between keyframes, and removed as soon as it is sure.
    """

    def __init__(self, params: MotionParams | None = None, camera: Camera | None = None) -> None:
        self._params = params or MotionParams()
        self._given_camera = camera
        self._movers = Movers(self._params)
        self._zoom = ZoomWatch(self._params.zoom_rate)
        self.reset()

    def describe(self) -> dict[str, Any]:
        """Return everything that a record of the run should say about this stage."""
        return {
            "params": asdict(self._params),
            "lens_distortion_removed": self._given_camera is not None,
            "warnings": self._breaks.warnings,
        }

    def reset(self) -> None:
        """Forget everything: a new stream follows."""
        self._breaks = Breaks()
        self._forget()

    def _forget(self) -> None:
        self._lens = Lens(None, (0, 0))
        self._calibration: SelfCalibration | None = None
        self._noise_px = np.nan
        self._before: FollowedPicture | None = None
        self._before_movers_px = np.zeros((0, 4))
        self._shown_s = -np.inf
        self._movers.forget()
        self._key: Keyframe | None = None
        self._home: Keyframe | None = None
        self._astray, self._sought_s = False, -np.inf
        self._now: CameraMotion | NoCameraMotion = NoCameraMotion(TOO_LITTLE)
        self._pose, self._pose_s = np.eye(3), -np.inf
        self._step: FloatArray | None = None
        self._forget_step()

    def update(self, frame: Frame, detections: Detections) -> CameraMotion | NoCameraMotion:
        """Find how the picture moved since the keyframe.

        Args:
            frame: Frames in the order of their time.
            detections: Of this frame; empty where the detector rested.

        Returns:
            The motion since the keyframe that was in force when the frame came; of a first frame, since itself. Or why
            there is none: then the keyframe is kept for a while, but a picture that was cut or zoomed, or has another
            size or an earlier time, is itself the new keyframe, from which the next frame's motion counts.

        Raises:
            GroundError: The camera is not for pictures of this shape.
        """
        picture = FollowedPicture.of(frame, self._params.width_px)
        broken = self._broken_by(picture)
        if broken:
            self._forget()
        if self._before is None:
            self._lens = Lens(self._camera_for(frame.size_px), frame.size_px)
            if self._given_camera is None:
                self._calibration = SelfCalibration(frame.size_px)
        elif picture.repeats(self._before):
            self._shown_s = frame.time_s
            self._breaks.note(frame, "", repeated=True)
            return replace(self._now, repeated=True) if isinstance(self._now, CameraMotion) else self._now
        movers_px = self._movers.look(frame.time_s, detections, self._step)
        result = self._looked_at(picture, movers_px)
        if broken:
            result = NoCameraMotion(broken, broken=True)
        self._before, self._before_movers_px, self._shown_s = picture, movers_px, frame.time_s
        what = result.reason if isinstance(result, NoCameraMotion) and result.broken else ""
        self._breaks.note(frame, what, repeated=False)
        return result

    def _broken_by(self, picture: FollowedPicture) -> str:
        if self._before is None:
            return ""
        if picture.size_px != self._before.size_px:
            return RESIZED
        return TURNED_BACK if picture.time_s < self._shown_s else ""

    def _camera_for(self, size_px: tuple[int, int]) -> Camera | None:
        try:
            return None if self._given_camera is None else self._given_camera.scaled_to(*size_px)
        except ValueError as error:
            raise GroundError(
                expected="a camera file for pictures of this shape",
                found=str(error),
                fix="calibrate the camera at the shape that it films in, or leave the camera file out",
            ) from None

    def _looked_at(self, picture: FollowedPicture, movers_px: FloatArray) -> CameraMotion | NoCameraMotion:
        if self._key is None:
            self._begin(picture, movers_px)
            return self._now
        match = None if picture.is_blank() else self._home_match(picture, movers_px)
        match = match or (None if picture.is_blank() else self._match(self._key, picture, movers_px))
        if match is None:
            return self._lost(picture, movers_px)
        step, elapsed_s = match.plane.matrix @ homography.invert(self._pose), picture.time_s - self._pose_s
        self._movers.carry(step)
        self._step, self._step_s, self._surprise_px = step, elapsed_s, match.surprise_px
        if self._zoom.zooms(step, elapsed_s, picture.size_px):
            self._begin(picture, movers_px)
            return NoCameraMotion(ZOOMED, broken=True)
        worn_out = self._key.is_worn_out(match, np.array(picture.size_px) / 2.0)
        if worn_out:
            match = self._key.find_better(picture, match, movers_px)
            self._calibrate(match, picture)
        self._pose, self._pose_s = match.plane.matrix, picture.time_s
        # The keyframe may have been given up for a nearer one in the search.
        result = self._motion_since(self._key, self._pose, self._covariance(match))
        self._now = result
        if worn_out:
            self._renew(picture, movers_px)
        return result

    def _motion_since(self, key: Keyframe, pose: FloatArray, covariance: FloatArray) -> CameraMotion:
        distortion = None if self._calibration is None else self._calibration.told
        return CameraMotion(pose, covariance, key.picture.time_s, key.lens.camera, distortion=distortion)

    def _calibrate(self, match: Match, picture: FollowedPicture) -> None:
        """Learn of the lens, for the keyframes to come: points of one keyframe keep the lens that they began with."""
        if self._calibration is None:
            return
        followed_px = float(picture.full_per_small.mean())
        self._calibration.take(*match.seen_px, inlier_px=self._params.inlier_px * followed_px, followed_px=followed_px)
        self._lens = Lens(self._calibration.camera, picture.size_px)

    def _covariance(self, match: Match) -> FloatArray:
        """Return the covariance with the ground's relief; before noise can be told from it, all is noise."""
        if np.isfinite(match.noise_px):
            known = np.isfinite(self._noise_px)
            self._noise_px += _NOISE_STEP * (match.noise_px - self._noise_px) if known else 0.0
            self._noise_px = self._noise_px if known else match.noise_px
        if not np.isfinite(self._noise_px):
            return match.plane.covariance
        return match.plane.covariance + relief_covariance(match.plane, self._noise_px)

    def _match(self, key: Keyframe, picture: FollowedPicture, movers_px: FloatArray) -> Match | None:
        """Find the picture by the keyframe, or else by the picture before, which then becomes the keyframe."""
        elapsed_s = picture.time_s - self._pose_s
        ratio = elapsed_s / self._step_s if self._step_s > 0.0 else 1.0
        step = self._step if ratio <= _LONGEST_STEP else None
        expected = key.expect(self._pose, step, ratio)
        near = _NEAREST_LEVELS if self._surprise_px <= _NEAREST_PX else _NEAR_LEVELS
        match = key.find(picture, expected, movers_px, near) if step is not None else None
        match = match or key.find(picture, expected, movers_px, _FAR_LEVELS)
        before = self._before
        if match is not None or before is None or before is key.picture or before.time_s != self._pose_s:
            return match
        nearer = Keyframe(before, self._before_movers_px, self._lens, self._params)
        match = nearer.find(picture, nearer.expect(np.eye(3), step, ratio), movers_px, _FAR_LEVELS)
        if match is not None:
            self._key, self._pose = nearer, np.eye(3)
        return match

    def _home_match(self, picture: FollowedPicture, movers_px: FloatArray) -> Match | None:
        """Look for the first keyframe where it is not known how the present one lies to it."""
        if not self._astray or self._home is None or picture.time_s - self._sought_s < _HOME_EVERY_S:
            return None
        self._sought_s = picture.time_s
        match = self._home.find(picture, self._home.expect(np.eye(3), None, 1.0), movers_px, _FAR_LEVELS)
        if match is not None:
            # How the picture came here from the one before is not known; that it has just stood still is near enough.
            self._key, self._pose, self._astray = self._home, match.plane.matrix, False
        return match

    def _lost(self, picture: FollowedPicture, movers_px: FloatArray) -> NoCameraMotion:
        self._forget_step()
        before = self._before
        cut = before is not None and not picture.is_blank() and picture.likeness(before) < self._params.cut_likeness
        self._now = NoCameraMotion(CUT, broken=True) if cut else NoCameraMotion(TOO_LITTLE)
        result = self._now
        if cut or picture.time_s - self._pose_s > self._params.max_lost_s:
            self._begin(picture, movers_px)
        return result

    def _begin(self, picture: FollowedPicture, movers_px: FloatArray) -> None:
        """Start from a picture that nothing before is connected with."""
        self._key = None
        self._astray, self._sought_s = self._home is not None, picture.time_s
        self._now = NoCameraMotion(TOO_LITTLE)
        self._pose_s = picture.time_s
        self._renew(picture, movers_px)

    def _renew(self, picture: FollowedPicture, movers_px: FloatArray) -> None:
        """Take a picture for the keyframe, where it holds enough."""
        key = Keyframe(picture, movers_px, self._lens, self._params)
        if key.usable:
            self._key, self._pose = key, np.eye(3)
            self._home = self._home or key
            self._now = self._motion_since(key, np.eye(3), np.zeros((9, 9)))

    def _forget_step(self) -> None:
        self._step = None
        self._step_s = 0.0
        self._surprise_px = np.inf
        self._zoom.reset()
