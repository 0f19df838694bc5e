"""Ground map from a reference object of known shape: the paper's rectification (section 5.1)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from standoff.core import homography, protocols
from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, ImageArray, NoCameraMotion, NoGroundMap
from standoff.stages.ground.basis import BETTER, reference_basis
from standoff.stages.ground.box_follower import BoxFollower, moved_box
from standoff.stages.ground.correspondence import camera_misfit_px, turn_from_before
from standoff.stages.ground.outline import OutlineFinder
from standoff.stages.ground.params import ReferenceParams
from standoff.stages.ground.quadrilateral import ORDERS, Quadrilateral
from standoff.stages.ground.reference_box import NOT_SEEN, GivenPlace, detected_box
from standoff.stages.ground.shape import ReferenceShape

LOST = "the reference is lost"
IMPLAUSIBLE = "no camera could see the reference like this"
AMBIGUOUS = "which corner is which cannot be told"

_FOLLOWED_MARGIN, _FOLLOWED_MARGIN_PX = 0.06, 4.0
_UNMOVED = 0.2
"""An outline found without following the box may have moved by this share of its shortest side."""

_LOOSE = 2.0
"""Corners before their refinement may be twice as far off."""


class ReferenceGround(protocols.Ground):
    """Finds the reference object in each frame and maps the picture to metres with it.

    Where to look comes from the detector's `reference` class, or from a box given for one frame; on frames without
    a detection the last box is followed. Which corner is which is settled by what a real camera could see, by the
    hint `first_corner_px`, and then by the frame before. For a shape that can be turned onto itself (a square)
    corner 0 starts as the one at the picture's bottom left.

    Args:
        shape: The reference's true shape, of four corners; it defines the site frame.
        params: Settings.
        place: What the operator said of where it is.
        camera: Calibrated camera; its lens distortion is removed from edge points before lines are fitted.

    Raises:
        GroundError: The shape has other than four corners.
    """

    def __init__(
        self,
        shape: ReferenceShape,
        params: ReferenceParams | None = None,
        *,
        place: GivenPlace | None = None,
        camera: Camera | None = None,
    ) -> None:
        self._shape = shape
        self._params = params if params is not None else ReferenceParams(method="oriented")
        if len(shape.corners_m) != 4:
            raise GroundError(
                expected=f"a reference of four corners for the method {self._params.method}",
                found=f"one of {len(shape.corners_m)}",
                fix="use the method fused or refined",
            )
        self._given = place if place is not None else GivenPlace()
        self._given_camera = camera
        self._camera = camera
        self._size_px: tuple[int, int] | None = None
        self._finder: OutlineFinder | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the stream."""
        self._follower = BoxFollower()
        self._box: FloatArray | None = None
        self._corners: FloatArray | None = None
        self._hint = self._given.first_corner_px
        self._known_s = -np.inf
        self._outlined = False
        self._corners_told = len(self._shape.turns_onto_itself()) == 1 or self._hint is not None

    def describe(self) -> dict[str, Any]:
        """Return everything that a record of the run should say about this stage."""
        return {
            "kind": "reference",
            "basis": reference_basis(self._shape),
            "better": BETTER["reference"],
            "corners_m": self._shape.corners_m.tolist(),
            "params": asdict(self._params),
            **self._given.describe(),
            "lens_distortion_removed": self._given_camera is not None,
        }

    def update(
        self, frame: Frame, detections: Detections, motion: CameraMotion | NoCameraMotion
    ) -> GroundMap | NoGroundMap:
        """Map one frame.

        Args:
            frame: Frames in the order of their time.
            detections: Of this frame; empty where the detector rested.
            motion: Plays no part.

        Returns:
            The map from undistorted pixels to metres, observed in this frame, or why there is none.

        Raises:
            GroundError: The box or the camera does not fit the pictures.
        """
        finder = self._finder_for(frame.size_px)
        gray = frame.picture.gray()
        box = self._where(frame.time_s, gray, detections)
        if isinstance(box, NoGroundMap):
            return self._unmoved(finder, gray, frame) or box
        self._box = box
        self._follower.start(gray, box)
        self._outlined = False
        outline = finder.find(gray, box)
        if isinstance(outline, NoGroundMap):
            return outline
        turn = self._turn(outline.corners_px, frame.time_s)
        if isinstance(turn, NoGroundMap):
            return turn
        return self._accept(outline, turn, frame, gray)

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Make sure that box and camera fit pictures of a size (width, height), before the first frame.

        Raises:
            GroundError: They do not.
        """
        self._finder_for(size_px)

    def _unmoved(self, finder: OutlineFinder, gray: ImageArray, frame: Frame) -> GroundMap | None:
        """Look where the reference was last: plain ground gives optical flow nothing to hold on to.

        Only an outline that has hardly moved is believed, because nothing else tells that it is the same object.
        """
        if self._box is None or self._corners is None or frame.time_s - self._known_s > self._params.memory_s:
            return None
        outline = finder.find(gray, self._box)
        if isinstance(outline, NoGroundMap):
            return None
        turn = turn_from_before(outline.corners_px, self._corners)
        corners_px = outline.corners_px[ORDERS[turn]]
        sides_px = np.linalg.norm(corners_px[ORDERS[1]] - corners_px, axis=1)
        moved_px = np.linalg.norm(corners_px - self._corners, axis=1)
        misfit, limit = self._misfit(outline.corners_px)
        if moved_px.max() > _UNMOVED * sides_px.min() or misfit[turn] > limit:
            return None
        return self._accept(outline, turn, frame, gray)

    def _finder_for(self, size_px: tuple[int, int]) -> OutlineFinder:
        if self._finder is None or self._size_px != size_px:
            width, height = size_px
            self._given.check_size(size_px)
            if self._given_camera is not None:
                self._camera = camera_for(self._given_camera, width, height)
            self._size_px = size_px
            self._finder = OutlineFinder(self._params, self._camera, self._could_be_reference)
        return self._finder

    def _where(self, time_s: float, gray: ImageArray, detections: Detections) -> FloatArray | NoGroundMap:
        detected = self._detected_box(time_s, detections) if self._given.box_xyxy_px is None else None
        if self._box is None:
            if self._given.box_xyxy_px is not None:
                return self._given.box_at(time_s)
            return detected if detected is not None else NoGroundMap(NOT_SEEN)
        if detected is not None and self._outlined:
            return detected
        followed = self._followed_box(time_s, gray, self._box)
        return detected if detected is not None else followed

    def _followed_box(self, time_s: float, gray: ImageArray, box: FloatArray) -> FloatArray | NoGroundMap:
        """Carry the box, the last known corners and the hint along with the picture."""
        motion = self._follower.follow(gray)
        if motion is None:
            return NoGroundMap(LOST)
        if self._corners is not None:
            self._corners = self._corners @ motion[:, :2].T + motion[:, 2]
        if self._hint is not None:
            self._hint = motion[:, :2] @ self._hint + motion[:, 2]
        self._known_s = time_s
        return moved_box(motion, box)

    def _detected_box(self, time_s: float, detections: Detections) -> FloatArray | None:
        """Return the surest detection; while the last box is fresh, of those near it."""
        fresh = self._box is not None and time_s - self._known_s <= self._params.memory_s
        return detected_box(detections, self._params.min_score, self._box if fresh else None)

    def _misfit(self, corners_px: FloatArray) -> tuple[FloatArray, float]:
        """Return the misfit of each cyclic order and the largest that is believed, both in px."""
        assert self._size_px is not None
        sides_px = np.linalg.norm(corners_px[ORDERS[1]] - corners_px, axis=1)
        limit = max(self._params.plausible_px, self._params.plausible_share * float(sides_px.mean()))
        misfit = camera_misfit_px(corners_px, self._shape, self._size_px, self._params.focal_widths, self._camera)
        return misfit, limit

    def _could_be_reference(self, corners_px: FloatArray) -> bool:
        misfit, limit = self._misfit(corners_px)
        return float(misfit.min()) <= _LOOSE * limit

    def _turn(self, corners_px: FloatArray, time_s: float) -> int | NoGroundMap:
        """Return k where corner 0 of the shape is corner k of the picture."""
        misfit, limit = self._misfit(corners_px)
        plausible = misfit <= limit
        if not plausible.any():
            return NoGroundMap(IMPLAUSIBLE)
        told = self._told_turn(corners_px, time_s)
        if told is not None:
            return told if plausible[told] else NoGroundMap(IMPLAUSIBLE)
        best = int(misfit.argmin())
        same = [(best + turn) % 4 for turn in self._shape.turns_onto_itself()]
        if plausible.sum() > plausible[same].sum():
            return NoGroundMap(AMBIGUOUS)
        self._corners_told &= len(same) == 1
        if self._corners is not None:
            stale = turn_from_before(corners_px, self._corners)
            return stale if stale in same else best
        up_right_px: list[float] = (corners_px[:, 0] - corners_px[:, 1]).tolist()
        return min(same, key=up_right_px.__getitem__)

    def _told_turn(self, corners_px: FloatArray, time_s: float) -> int | None:
        if self._corners is not None and time_s - self._known_s <= self._params.memory_s:
            return turn_from_before(corners_px, self._corners)
        if self._hint is not None:
            hint = self._hint if self._camera is None else self._camera.undistort(self._hint)[0]
            return int(np.linalg.norm(corners_px - hint, axis=1).argmin())
        return None

    def _map(self, outline: Quadrilateral, turn: int, size_px: tuple[int, int]) -> GroundMap:
        corners_px = outline.corners_px[ORDERS[turn]]
        matrix = homography.fit(corners_px, self._shape.corners_m)
        covariance_px2 = outline.covariance_px2[ORDERS[turn]]
        return GroundMap(
            image_to_ground=matrix,
            covariance=homography.fit_covariance(matrix, corners_px, covariance_px2),
            image_size_px=size_px,
            method=f"reference:{self._params.method}",
            scale_m_per_px=rectified_scale_m_per_px(corners_px, self._shape),
            anchors_px=corners_px if self._camera is None else self._camera.distort(corners_px),
            camera=self._camera,
            frame_stated=self._corners_told,
        )

    def _accept(self, outline: Quadrilateral, turn: int, frame: Frame, gray: ImageArray) -> GroundMap:
        """Make the frame's map of an outline that is believed, and remember it for the frames to come."""
        ground = self._map(outline, turn, frame.size_px)
        self._remember(ground, outline.corners_px[ORDERS[turn]], frame.time_s, gray)
        return ground

    def _remember(self, ground: GroundMap, corners_px: FloatArray, time_s: float, gray: ImageArray) -> None:
        self._corners, self._known_s, self._hint, self._outlined = corners_px, time_s, None, True
        low, high = ground.anchors_px.min(axis=0), ground.anchors_px.max(axis=0)
        margin = _FOLLOWED_MARGIN * float((high - low).max()) + _FOLLOWED_MARGIN_PX
        self._box = np.concatenate([low - margin, high + margin])
        self._follower.start(gray, self._box)


def rectified_scale_m_per_px(corners_px: FloatArray, shape: ReferenceShape) -> float:
    """Return Eq. 6's reference_m / reference_px.

    The paper does not say how large its rectified picture is. Here the rectified plane is the one on which the
    reference keeps the perimeter in px that it has in the picture; for a square each side is then the mean side.

    Args:
        corners_px: (N, 2) undistorted.
        shape: The true shape.

    Source:
        Paper, section 5.1, Eq. 6.

    >>> square_px = np.array([[0.0, 0.0], [0.0, 100.0], [100.0, 100.0], [100.0, 0.0]])
    >>> round(rectified_scale_m_per_px(square_px, ReferenceShape.square(2.89)), 6)
    0.0289
    """
    perimeter_px = float(np.linalg.norm(np.roll(corners_px, -1, axis=0) - corners_px, axis=1).sum())
    return float(shape.sides_m.sum()) / perimeter_px


def camera_for(camera: Camera, width: int, height: int) -> Camera:
    """Return the camera for pictures of a size.

    Raises:
        GroundError: It is calibrated for pictures of another shape.
    """
    try:
        return camera.scaled_to(width, height)
    except ValueError as error:
        raise GroundError(
            expected=f"a camera calibrated for pictures of {width}x{height} or the same shape",
            found=f"one for {camera.width_px}x{camera.height_px}",
            fix="calibrate with pictures from the same camera mode as the video",
        ) from error
