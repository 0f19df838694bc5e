"""The ground map from a solid reference object, carried by the motion of the picture while it is hidden."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from standoff.core import homography
from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, Luma, NoCameraMotion, NoGroundMap
from standoff.stages.ground.basis import BETTER_REFERENCE, lens_text, reference_basis
from standoff.stages.ground.params import ReferenceParams
from standoff.stages.ground.pose_filter import PoseFilter
from standoff.stages.ground.pose_map import map_from_view
from standoff.stages.ground.prior_for import prior_for
from standoff.stages.ground.projection import project, project_with_jacobians
from standoff.stages.ground.reference import rectified_scale_m_per_px
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import HEIGHT, SolidState
from standoff.stages.ground.solid_fit import fit_solid
from standoff.stages.ground.solid_search import Found, HeightPrior, search_solid
from standoff.stages.ground.turned import turned_like
from standoff.stages.ground.where import NOT_SEEN, GivenPlace, detected_box

UNSURE = "the reference has been out of sight too long"

_LEAST_REACH_PX, _MOST_REACH_PX = 5.0, 8.0
_REACH_SIGMAS = 4.0
_MIN_SUPPORT = 0.4
"""Of the outline that should show, so much must be seen for the reference to count as seen in a frame."""

_GATE_PX, _GATE_SIGMAS = 1.0, 4.0
_SEARCH_AGAIN_S = 0.19
_MAX_REFUSED_S = 1.0
"""When what is seen has contradicted what is predicted for so long, the search begins again."""


class FusedGround:
    """Follows one camera over the ground by a reference object of known shape.

    Args:
        shape: The reference's true outline; it defines the site frame.
        params: Settings.
        height_m: Of the reference's top above the ground; None: unknown, estimated where its base can be seen.
        place: What the operator said of where it is.
        camera: What is known of the camera; None: a drone's usual lens.
        remember: Whether frames know of those before them; False takes each by itself.

    Raises:
        GroundError: The camera does not fit the pictures (`check_size`, `update`).
    """

    def __init__(
        self,
        shape: ReferenceShape,
        params: ReferenceParams | None = None,
        *,
        height_m: float | None = None,
        place: GivenPlace | None = None,
        camera: CameraPrior | None = None,
        remember: bool = True,
    ) -> None:
        self._shape = shape
        self._params = params if params is not None else ReferenceParams()
        self._given_height_m = height_m
        self._place = place if place is not None else GivenPlace()
        self._given_camera = camera
        self._remember = remember
        self._size_px: tuple[int, int] | None = None
        self._camera: CameraPrior | None = None
        self.reset()

    def reset(self) -> None:
        """Forget everything that the pictures have told."""
        self._filter = PoseFilter()
        self._height = (
            HeightPrior.unknown() if self._given_height_m is None else HeightPrior.known(self._given_height_m)
        )
        self._camera = None
        self._last: SolidState | None = None
        self._box: FloatArray | None = None
        self._refused_since_s: float | None = None
        self._failed: tuple[float, NoGroundMap] | None = None

    @property
    def description(self) -> dict[str, Any]:
        """Everything that a record of the run should say about this stage."""
        camera = self._camera if self._camera is not None else self._given_camera
        return {
            "method": self._method,
            "basis": f"{reference_basis(self._shape)}, {lens_text(camera)}",
            "better": BETTER_REFERENCE,
            "corners_m": self._shape.corners_m.tolist(),
            "height_m": self._given_height_m,
            "params": asdict(self._params),
            **self._place.describe(),
            "camera": None if camera is None else camera.origin,
            "lens_distortion_removed": True,
        }

    @property
    def _method(self) -> str:
        return "fused" if self._remember else "refined"

    def check_size(self, size_px: tuple[int, int]) -> None:
        """Make sure that box and camera fit pictures of a size (width, height), before the first frame.

        Raises:
            GroundError: They do not.
        """
        self._prior_for(size_px)

    def update(
        self, frame: Frame, detections: Detections, motion: CameraMotion | NoCameraMotion
    ) -> GroundMap | NoGroundMap:
        """Map one frame.

        Args:
            frame: Frames in the order of their time.
            detections: Of this frame; empty where the detector rested.
            motion: Of the picture since the keyframe.

        Returns:
            The map from undistorted pixels to metres on the ground, or why there is none.

        Raises:
            GroundError: The box or the camera does not fit the pictures.
        """
        self._prior_for(frame.size_px)
        if not self._remember:
            self._filter = PoseFilter()
        carried = self._filter.predict(frame.time_s, motion)
        self._carry_box(carried)
        seen = self._filter.now is not None and self._look(frame.picture.luma(), carried)
        if not seen:
            reason = self._search(frame, detections, motion, carried)
            if isinstance(reason, NoGroundMap):
                return reason
        return self._map(frame)

    def _prior_for(self, size_px: tuple[int, int]) -> CameraPrior:
        if self._camera is None or self._size_px != size_px:
            self.reset()
            self._place.check_size(size_px)
            self._camera = prior_for(self._given_camera, size_px)
            self._size_px = size_px
        return self._camera

    def _look(self, gray: Luma, carried: bool) -> bool:
        """Look for the reference where it should be; return whether it was seen there and believed."""
        now = self._filter.now
        assert now is not None
        sigma_px = self._outline_sigma_px(now.state, now.total)
        if not (np.isfinite(sigma_px) and (carried or sigma_px < _MOST_REACH_PX)):
            return False
        reach_px = float(np.clip(_REACH_SIGMAS * sigma_px + 1.0, _LEAST_REACH_PX, _MOST_REACH_PX))
        fit = fit_solid(gray, self._shape, now.belief(), reach_px)
        if fit is None or fit.seen_share(len(self._shape.corners_m)) < _MIN_SUPPORT:
            return False
        moved_px = np.linalg.norm(self._outline_px(fit.state) - self._outline_px(now.state), axis=1)
        if not moved_px.max() <= _GATE_PX + _GATE_SIGMAS * sigma_px:
            return False
        self._filter.correct(fit.state, fit.information)
        self._noted(self._filter.now.state if self._filter.now is not None else fit.state)
        return True

    def _search(
        self,
        frame: Frame,
        detections: Detections,
        motion: CameraMotion | NoCameraMotion,
        carried: bool,
    ) -> NoGroundMap | None:
        """Find the reference anew where it is known or detected to be; None where there is something to map with."""
        time_s = frame.time_s
        box = self._box_now(time_s, detections)
        if isinstance(box, NoGroundMap):
            return None if carried else box
        if carried and not self._contradicted(box, time_s):
            return None
        if self._failed is not None and 0.0 <= time_s - self._failed[0] < _SEARCH_AGAIN_S:
            return None if carried else self._failed[1]
        camera, height = self._known()
        found = search_solid(frame.picture.gray(), box, self._shape, camera, height)
        if isinstance(found, NoGroundMap):
            # A search costs as much as many frames, and the next frame looks much like this one.
            self._failed = (time_s, found) if self._remember else None
            return None if carried else found
        self._failed = None
        self._begin(found, time_s, motion)
        return None

    def _contradicted(self, box: FloatArray, time_s: float) -> bool:
        """Return whether the reference has for a while been seen only elsewhere than where it is believed to be."""
        middle = None if self._box is None else (self._box[:2] + self._box[2:]) / 2.0
        if middle is None or ((middle >= box[:2]) & (middle <= box[2:])).all():
            self._refused_since_s = None
            return False
        if self._refused_since_s is None:
            self._refused_since_s = time_s
        return time_s - self._refused_since_s >= _MAX_REFUSED_S

    def _begin(self, found: Found, time_s: float, motion: CameraMotion | NoCameraMotion) -> None:
        belief = found.belief()
        belief = turned_like(belief, self._shape, last=self._last, corner_px=self._hint())
        self._filter.start(belief, time_s, motion, height_known=self._given_height_m is not None)
        self._refused_since_s = None
        self._noted(belief.state)

    def _hint(self) -> FloatArray | None:
        return self._place.first_corner_px if self._last is None else None

    def _noted(self, state: SolidState) -> None:
        self._last = state
        outline = self._outline_px(state)
        if np.isfinite(outline).all():
            self._box = np.concatenate([outline.min(axis=0), outline.max(axis=0)])

    def _known(self) -> tuple[CameraPrior, HeightPrior]:
        """Return what earlier frames have told of the lens and of the height."""
        camera = self._prior_for(self._size_px) if self._size_px is not None else None
        assert camera is not None
        now = self._filter.now
        if now is None or not self._remember:
            return camera, self._height
        sigma = np.sqrt(np.diag(now.total))
        learned = CameraPrior(now.state.view.camera, float(sigma[6]), float(sigma[7]), camera.origin)
        height = HeightPrior(now.state.height_m, float(sigma[HEIGHT]), (now.state.height_m,))
        return learned, height

    def _box_now(self, time_s: float, detections: Detections) -> FloatArray | NoGroundMap:
        if self._place.box_xyxy_px is not None:
            return self._place.box_at(time_s) if self._box is None else self._box
        near = None if self._box is None else detected_box(detections, self._params.min_score, self._box)
        detected = near if near is not None else detected_box(detections, self._params.min_score)
        return NoGroundMap(NOT_SEEN) if detected is None else detected

    def _carry_box(self, carried: bool) -> None:
        now = self._filter.now
        if carried and now is not None:
            outline = self._outline_px(now.state)
            if np.isfinite(outline).all():
                self._box = np.concatenate([outline.min(axis=0), outline.max(axis=0)])

    def _outline_px(self, state: SolidState) -> FloatArray:
        """Return (4, 2) the upper corners in the picture."""
        return project(state.view, self._corners_m(state))

    def _corners_m(self, state: SolidState) -> FloatArray:
        return np.column_stack([self._shape.corners_m, np.full(len(self._shape.corners_m), state.height_m)])

    def _outline_sigma_px(self, state: SolidState, covariance: FloatArray) -> float:
        """Return the standard error of where the upper corners should be, the worst of them."""
        _, by_view, by_point = project_with_jacobians(state.view, self._corners_m(state))
        jacobian = np.concatenate([by_view, by_point[:, :, 2:]], axis=2)
        variance = np.einsum("nij,jk,nik->ni", jacobian, covariance, jacobian)
        return float(np.sqrt(variance.max())) if np.isfinite(variance).all() else np.inf

    def _map(self, frame: Frame) -> GroundMap | NoGroundMap:
        now = self._filter.now
        assert now is not None
        covariance = now.total[:CHANGES, :CHANGES]
        scale_sigma = float(np.sqrt(covariance[5, 5])) / max(float(now.state.view.position_m[2]), 1e-3)
        if not scale_sigma <= self._params.max_scale_sigma:
            return NoGroundMap(UNSURE)
        outline = self._outline_px(now.state)
        straight = now.state.view.project_pinhole(self._corners_m(now.state))
        scale = rectified_scale_m_per_px(straight, self._shape) if np.isfinite(straight).all() else _scale(now.state)
        return map_from_view(
            now.state.view,
            covariance,
            method=self._method,
            scale_m_per_px=scale,
            anchors_px=outline if np.isfinite(outline).all() else np.zeros((0, 2)),
            age_s=max(frame.time_s - self._filter.observed_s, 0.0),
            size_sigma=self._params.size_sigma,
            middle_m=self._shape.corners_m.mean(axis=0),
        )


def _scale(state: SolidState) -> float:
    """Return metres per pixel in the middle of the picture, where the reference itself cannot be seen."""
    camera = state.view.camera
    middle = np.array([[camera.width_px / 2.0, camera.height_px / 2.0]])
    jacobian = homography.point_jacobian(homography.invert(state.view.plane_to_pinhole()), middle)[0]
    return float(np.sqrt(abs(np.linalg.det(jacobian))))
