"""A survey of a camera that should not move, and the watch over whether it does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from standoff.core import homography, protocols
from standoff.core.homography import FloatArray
from standoff.core.protocols import AnyGround, AnyMotion
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, NoGroundMap
from standoff.stages.ground.surveyed_ground import SurveyedGround

MOVED = "the camera has moved since the survey"
OUT_OF_SIGHT = "the background of the survey is out of sight"

_STILL_SHARE, _STILL_PX = 0.0015, 1.5
"""Of the picture's width, and pixels at least: about what a click is off, and more than what following adds to a still
picture, coarsely coded."""

_MOST_SHARE = 0.25
"""The picture may have moved by this share of its width: beyond, the map would be a guess at what is no more in it."""

_SURE_SHARE = 0.003
"""Of the picture's width: the standard error up to which a motion carries the map."""

_PATIENCE_S = 1.0
_GRID = np.array([(x, y) for y in (0.3, 0.6, 0.9) for x in (0.1, 0.5, 0.9)])
"""Where motion is looked at, in shares of the picture: the ground is rather in its lower part."""


@dataclass(frozen=True, slots=True, eq=False)
class _Moved:
    """How the picture of a time lies to the first one: (3, 3) from the first, and (9, 9) covariance of its entries."""

    time_s: float
    matrix: FloatArray
    covariance: FloatArray

    def then(self, time_s: float, motion: CameraMotion) -> _Moved:
        """Return the same of a later time, by the motion from this one's picture."""
        by_motion = np.kron(np.eye(3), self.matrix.T)
        by_this = np.kron(motion.keyframe_to_image, np.eye(3))
        covariance = by_motion @ motion.covariance @ by_motion.T + by_this @ self.covariance @ by_this.T
        return _Moved(time_s, motion.keyframe_to_image @ self.matrix, covariance)

    def displacement_px(self, size_px: tuple[int, int]) -> tuple[float, float]:
        """Return the furthest that a place in pictures of a size has gone, and the largest standard error of that."""
        places_px = _GRID * np.array(size_px)
        moved_px, visible = homography.apply(self.matrix, places_px)
        if not visible.all():
            return np.inf, np.inf
        jacobian = homography.parameter_jacobian(self.matrix, places_px)
        variance_px2 = np.einsum("nij,jk,nik->n", jacobian, self.covariance, jacobian)
        return float(np.linalg.norm(moved_px - places_px, axis=1).max()), float(np.sqrt(variance_px2.max()))


class FixedCamera(protocols.Ground):
    """Gives a survey's map while the camera stands as it was surveyed, and carries it along where it moved a little.

    The camera is taken to stand as surveyed in the first frame. From then on the picture's motion tells how far it
    went. While that is less than a survey's own error, the map is the survey's; what is more carries the map, as long
    as it is sure and most of what was surveyed is still in the picture; otherwise there is no map. Where the background
    is hidden, the map holds for a second, and is back once the background is found again; after a cut or a zoom it does
    not hold. Where the picture never shows enough to tell, the map holds, and a warning says so.

    Args:
        survey: The points.
    """

    def __init__(self, survey: SurveyedGround) -> None:
        self.survey = survey
        self.reset()

    def reset(self) -> None:
        """Forget the pictures: another stream of the same camera, as it was surveyed, follows."""
        self._first: _Moved | None = None
        self._size_px = (0, 0)
        self._key: _Moved | None = None
        self._last: _Moved | None = None
        self._known_s = -np.inf
        self._watched = self._unwatched = self._broken = self._has_moved = False
        self._most_px = 0.0

    def describe(self) -> dict[str, Any]:
        """Return the survey's, and what was seen of the camera."""
        warnings = list(self.survey.describe()["warnings"])
        if self._has_moved:
            warnings.append(f"{MOVED}, by up to {self._most_px:.0f} px" if self._most_px > 0.0 else MOVED)
        if self._unwatched and not self._watched:
            warnings.append("the picture shows too little to tell whether the camera still stands as it was surveyed")
        return {**self.survey.describe(), "warnings": warnings}

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Make sure that pictures of a size (width, height) have the survey's shape, before the first frame.

        Raises:
            GroundError: They do not.
        """
        self.survey.prepare(size_px)

    def update(self, frame: Frame, detections: Detections, motion: AnyMotion) -> AnyGround:
        """Return the map of the camera as it stands in a frame, or why there is none."""
        surveyed = self.survey.update(frame, detections, motion)
        if self._first is None:
            self._first = self._last = _unmoved(frame)
            self._size_px, self._known_s = frame.size_px, frame.time_s
            return surveyed
        self._last = self._follow(frame, motion)
        if isinstance(surveyed, NoGroundMap):
            return surveyed
        if self._last is not None:
            self._known_s, self._watched, self._broken = frame.time_s, True, False
            return self._carried(surveyed, self._last, motion)
        self._broken |= frame.size_px != self._size_px or isinstance(motion, CameraMotion) or motion.broken
        if self._broken:
            self._has_moved = True
            return NoGroundMap(MOVED)
        if not self._watched:
            self._unwatched = True
            self._first = self._last = _unmoved(frame)
            return surveyed
        unseen_s = frame.time_s - self._known_s
        return replace(surveyed, age_s=unseen_s) if unseen_s <= _PATIENCE_S else NoGroundMap(OUT_OF_SIGHT)

    def _follow(self, frame: Frame, motion: AnyMotion) -> _Moved | None:
        """Return how a frame lies to the first one; None where that is not known."""
        if not isinstance(motion, CameraMotion) or frame.size_px != self._size_px:
            return None
        for known in (self._key, self._last, self._first):
            if known is not None and known.time_s == motion.keyframe_s:
                self._key = known
                return known.then(frame.time_s, motion)
        return None

    def _carried(self, surveyed: GroundMap, moved: _Moved, motion: AnyMotion) -> AnyGround:
        """Return the survey's map as the picture has moved by now."""
        width_px = surveyed.image_size_px[0]
        moved_px, sigma_px = moved.displacement_px(surveyed.image_size_px)
        if moved_px <= max(_STILL_PX, _STILL_SHARE * width_px):
            return surveyed
        self._has_moved, self._most_px = True, max(self._most_px, moved_px)
        # Motion of points as they are seen does not move points that are freed from distortion.
        same_lens = isinstance(motion, CameraMotion) and (motion.camera is None) == (surveyed.camera is None)
        if not same_lens or moved_px > _MOST_SHARE * width_px or sigma_px > _SURE_SHARE * width_px:
            return NoGroundMap(MOVED)
        return _carried_map(surveyed, moved)


def _unmoved(frame: Frame) -> _Moved:
    return _Moved(frame.time_s, np.eye(3), np.zeros((9, 9)))


def _carried_map(surveyed: GroundMap, moved: _Moved) -> GroundMap:
    back = homography.invert(moved.matrix)
    matrix = surveyed.image_to_ground @ back
    by_map, by_motion = np.kron(np.eye(3), back.T), -np.kron(matrix, back.T)
    covariance = surveyed.covariance.copy()
    covariance[:9] = by_map @ covariance[:9]
    covariance[:, :9] = covariance[:, :9] @ by_map.T
    covariance[:9, :9] += by_motion @ moved.covariance @ by_motion.T
    valid_px, _ = homography.apply(moved.matrix, surveyed.valid_px)
    anchors_px, _ = homography.apply(moved.matrix, surveyed.undistorted(surveyed.anchors_px))
    if surveyed.camera is not None:
        anchors_px = surveyed.camera.distort(anchors_px)
    return replace(
        surveyed,
        image_to_ground=matrix,
        covariance=covariance,
        valid_px=valid_px,
        anchors_px=anchors_px[np.isfinite(anchors_px).all(axis=1)],
    )
