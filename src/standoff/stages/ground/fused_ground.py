"""The ground map from all that tells it: one belief about the camera, carried by motion, corrected by what is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from standoff.core import homography, protocols
from standoff.core.camera import CameraPrior
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, NoCameraMotion, NoGroundMap
from standoff.stages.ground.basis import HELP, BasisTally
from standoff.stages.ground.camera_belief import STATED, CameraBelief, FrameEvidence
from standoff.stages.ground.last_resorts import LastResorts
from standoff.stages.ground.marker_observer import MarkerObserver
from standoff.stages.ground.params import FusedParams
from standoff.stages.ground.plane_frame import LEVEL_DEG, laid_marker, laid_reference, map_in_site
from standoff.stages.ground.point_landmarks import PointLandmarks
from standoff.stages.ground.pose_filter import Estimate
from standoff.stages.ground.pose_map import map_from_view, middle_scale_m_per_px
from standoff.stages.ground.reference import rectified_scale_m_per_px
from standoff.stages.ground.reference_landmarks import ReferenceLandmarks
from standoff.stages.ground.solid_observer import Reference, SolidObserver
from standoff.stages.ground.survey_observer import SurveyObserver
from standoff.stages.ground.surveyed_ground import SurveyedGround

NOT_SURE = "lengths on the ground are not sure enough"
UNSURE = "the reference has been out of sight too long"


class FusedGround(protocols.Ground):
    """Follows one camera over the ground by what there is, best first.

    1. Surveyed points, in the picture that they were read from; reference objects and markers, of known size. The
       survey, or else the first reference, says where the site frame is; markers and references whose places are
       stated share it; another reference stands wherever it is seen: it tells how high the camera is and how it
       looks, not where.
    2. Telemetry with the camera's angles, where nothing else has been seen: x east, y north, the origin below the
       drone's first place. Its errors last: more readings do not make it surer. Beside a reference or a marker it adds
       what it says of height and angles, unless that cannot be.
    3. The sizes of people, with the drone's height where that is known: x to the right of the picture, y ahead, the
       origin below the camera.

    A better source takes the place of a worse one; between looks the motion of the picture carries the map.

    Args:
        references: Reference objects, the most important one first.
        markers: What watches for printed markers; None: there are none.
        survey: Points read from one picture of this camera, which may move; None: there are none. Where its heights
            are of ground that slopes, telemetry and sizes, which know level ground only, are not asked.
        camera: What is known of the camera; None: a drone's usual lens.
        params: Settings.
        remember: Whether frames know of those before them; False takes each by itself.

    Raises:
        GroundError: The survey has an area; camera, survey or a box does not fit the pictures (`prepare`,
            `update`).
    """

    def __init__(
        self,
        references: Sequence[Reference] = (),
        markers: MarkerObserver | None = None,
        *,
        survey: SurveyedGround | None = None,
        camera: CameraPrior | None = None,
        params: FusedParams | None = None,
        remember: bool = True,
    ) -> None:
        self._params = params if params is not None else FusedParams()
        self._plane = None if survey is None else survey.plane
        if self._plane is not None:
            references = [laid_reference(one, self._plane) for one in references]
            markers = None if markers is None else markers.at([laid_marker(p, self._plane) for p in markers.places])
            if self._plane.slope_deg > LEVEL_DEG:
                self._params = replace(self._params, telemetry=False, sizes=False)
        self._given_references = tuple(references)
        self._given_camera = camera
        self._remember = remember
        telemetry = self._params.telemetry
        self._references = ReferenceLandmarks(references, telemetry=telemetry, remember=remember)
        self._markers, self._survey = markers, None if survey is None else SurveyObserver(survey)
        self._survey_points = self._marker_points = None
        if self._survey is not None:
            self._survey_points = PointLandmarks.of_survey(self._survey, telemetry=telemetry, up=self._up)
        if markers is not None:
            alone = not references and survey is None
            self._marker_points = PointLandmarks.of_markers(markers, alone=alone, telemetry=telemetry, up=self._up)
        self._size_px: tuple[int, int] | None = None
        self._camera: CameraPrior | None = None
        self._begin_stream(None)

    def reset(self) -> None:
        """Forget everything that the pictures have told."""
        self._size_px = self._camera = None
        self._forget_pictures()
        self._begin_stream(None)

    def _forget_pictures(self) -> None:
        self._references.reset()
        for one in (self._markers, self._survey, self._marker_points, self._survey_points):
            if one is not None:
                one.reset()

    def _begin_stream(self, camera: CameraPrior | None) -> None:
        prior = camera if camera is not None else CameraPrior.unknown(1, 1)
        self._belief = CameraBelief(prior)
        self._last_resorts = LastResorts(prior, self._params)
        self._tally = BasisTally(
            [one.shape for one in self._given_references],
            () if self._markers is None else self._markers.places,
            0 if self._survey is None else len(self._survey.survey.points_m),
        )

    def describe(self) -> dict[str, Any]:
        """Return everything that a record of the run should say about this stage; more once frames have been seen."""
        camera = self._camera if self._camera is not None else self._given_camera
        return {
            "method": self._method,
            "basis": self._tally.text(camera),
            "better": self._tally.better,
            "references": [one.describe() for one in self._given_references],
            "survey": None if self._survey is None else self._survey.survey.describe(),
            "markers": [] if self._markers is None else [place.marker_id for place in self._markers.places],
            "params": asdict(self._params),
            "camera": None if camera is None else camera.origin,
            "lens_distortion_removed": True,
            "warnings": [*self._survey_warnings, *self._references.never_seen, *self._belief.warnings.values()],
        }

    @property
    def _up(self) -> FloatArray:
        """(3,) where the vertical points in the frame in which the ground is z = 0."""
        return np.array([0.0, 0.0, 1.0]) if self._plane is None else self._plane.plane_to_site[2]

    @property
    def _survey_warnings(self) -> list[str]:
        if self._survey is None:
            return []
        missed = [self._survey.missed] if self._survey.missed else []
        return [*self._survey.survey.describe()["warnings"], *missed]

    @property
    def _method(self) -> str:
        return "fused" if self._remember else "refined"

    @property
    def length_sigma(self) -> float:
        """Relative standard error of lengths in the middle of the picture now; infinite before the first map."""
        return self._belief.length_sigma

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Make sure that boxes and camera fit pictures of a size (width, height), before the first frame.

        Raises:
            GroundError: They do not.
        """
        if self._size_px == size_px:
            return
        for reference in self._given_references:
            reference.place.check_size(size_px)
        if self._survey is not None:
            self._survey.survey.prepare(size_px)
        camera = _prior_for(self._given_camera, size_px)
        self._forget_pictures()
        self._camera, self._size_px = camera, size_px
        self._begin_stream(camera)

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
            GroundError: A box or the camera does not fit the pictures.
        """
        self.prepare(frame.size_px)
        belief, evidence = self._belief, FrameEvidence(frame, detections, motion)
        if not self._remember:
            belief.restart()
        belief.predict(evidence)
        reasons = []
        if self._survey_points is not None:
            reasons.append(self._look_at(self._survey_points, evidence))
        reasons += self._references.look(evidence, belief)
        if self._marker_points is not None:
            reasons.append(self._look_at(self._marker_points, evidence))
        if not (belief.by_landmark and evidence.held and self._sure):
            reasons += self._last_resorts.ask(evidence, belief)
            self._tally.most_people = self._last_resorts.most_people
        result = self._map(evidence) if evidence.held else self._no_map(reasons)
        if isinstance(result, NoGroundMap):
            self._tally.why_none = result.reason
        return result

    def _look_at(self, points: PointLandmarks, evidence: FrameEvidence) -> str:
        """Take in points that are seen; return why none was taken in, or ""."""
        site_frame = self._belief.site_frame
        reason = points.look(evidence, self._belief)
        if self._belief.site_frame != site_frame:
            self._references.forget_places()
        return reason

    def _no_map(self, reasons: Sequence[str]) -> NoGroundMap:
        told = [] if self._given_references else [HELP]
        return NoGroundMap("; ".join(dict.fromkeys(filter(None, [*reasons, *told]))))

    @property
    def _keeper(self) -> SolidObserver | None:
        return self._references.keeper(self._belief)

    @property
    def _sure(self) -> bool:
        """Whether lengths are sure enough for a map."""
        now, keeper = self._belief.now, self._keeper
        if now is None or keeper is None:
            return self._belief.length_sigma <= self._params.max_scale_sigma
        scale_sigma = float(np.sqrt(now.total[5, 5])) / max(float(now.state.view.position_m[2]), 1e-3)
        return scale_sigma <= keeper.reference.params.max_scale_sigma

    def _map(self, evidence: FrameEvidence) -> GroundMap | NoGroundMap:
        belief, keeper = self._belief, self._keeper
        now, source = belief.now, belief.source
        assert now is not None and source is not None
        if not self._sure:
            return NoGroundMap(UNSURE if keeper is not None else f"{NOT_SURE}; {HELP}")
        self._tally.count(source, belief.length_sigma)
        size_sigma, middle_m = self._measured_by(keeper)
        ground = map_from_view(
            now.state.view,
            now.total[:CHANGES, :CHANGES],
            method=self._method if keeper is not None else source,
            scale_m_per_px=_scale_m_per_px(now, keeper),
            anchors_px=_anchors_px(evidence, now, keeper),
            age_s=max(evidence.frame.time_s - belief.observed_s, 0.0),
            size_sigma=size_sigma,
            middle_m=middle_m,
            site_frame=belief.site_frame,
            frame_stated=belief.frame_of == STATED and self._references.corners_told,
        )
        return map_in_site(ground, self._plane) if self._plane is not None and belief.frame_of == STATED else ground

    def _measured_by(self, keeper: SolidObserver | None) -> tuple[float, FloatArray | None]:
        """Return the relative error of the lengths that all others come from, and (2,) the place that it leaves."""
        if keeper is not None:
            return keeper.reference.params.size_sigma, keeper.reference.middle_m
        if self._belief.source == "markers" and self._markers is not None:
            return self._params.size_sigma, self._markers.places[0].corners_m[:, :2].mean(axis=0)
        return 0.0, None


def _anchors_px(evidence: FrameEvidence, now: Estimate, keeper: SolidObserver | None) -> FloatArray:
    """Return (A, 2) what was seen to measure by, or where the reference should be that is hidden."""
    if keeper is not None and not evidence.anchors_px:
        hidden_px = keeper.outline_px(now.state)
        return hidden_px if np.isfinite(hidden_px).all() else np.zeros((0, 2))
    return np.concatenate([np.zeros((0, 2)), *evidence.anchors_px])


def _scale_m_per_px(now: Estimate, keeper: SolidObserver | None) -> float:
    """Return Eq. 6's scale by the reference, or in the middle of the picture where there is none in sight."""
    view = now.state.view
    if keeper is None:
        return middle_scale_m_per_px(view)
    straight_px = keeper.straight_outline_px(view, now.state.height_m)
    if np.isfinite(straight_px).all():
        return rectified_scale_m_per_px(straight_px, keeper.reference.shape)
    middle_px = np.array([[view.camera.width_px / 2.0, view.camera.height_px / 2.0]])
    jacobian = homography.point_jacobian(homography.invert(view.plane_to_pinhole()), middle_px)[0]
    return float(np.sqrt(abs(np.linalg.det(jacobian))))


def _prior_for(given: CameraPrior | None, size_px: tuple[int, int]) -> CameraPrior:
    """Return what is known of the camera for pictures of a size (width, height); None given: a drone's usual lens.

    Raises:
        GroundError: The camera is known for pictures of another shape.
    """
    try:
        return CameraPrior.unknown(*size_px) if given is None else given.scaled_to(*size_px)
    except ValueError as error:
        raise GroundError(
            expected="pictures of the shape that the camera was calibrated for",
            found=str(error),
            fix="calibrate with pictures from the same camera mode as the video",
        ) from error
