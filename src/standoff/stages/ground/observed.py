"""The ground map from whatever tells it: printed markers, the drone's telemetry, the sizes of people."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, LENS, View
from standoff.core.telemetry import Telemetry
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, NoCameraMotion, NoGroundMap
from standoff.stages.ground.basis import BETTER, HELP, expectation, lens_text, markers_basis
from standoff.stages.ground.marker_fit import PointFit, agreeing, first_fit, fit_points
from standoff.stages.ground.marker_observer import MarkerObserver
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.params import ObservedParams
from standoff.stages.ground.pose_filter import LASTING_SHARE, PoseFilter
from standoff.stages.ground.pose_map import length_sigma, map_from_view, middle_scale_m_per_px
from standoff.stages.ground.prior_for import prior_for
from standoff.stages.ground.sizes_view import SizesView
from standoff.stages.ground.solid import STATE, SolidState
from standoff.stages.ground.view_prior import (
    PriorRows,
    belief_of,
    carried_prior,
    in_frame_of,
    level_prior,
    telemetry_prior,
    telemetry_view,
)

Source = Literal["markers", "telemetry", "sizes"]

NOT_SURE = "lengths on the ground are not sure enough"
NO_MARKER = "no marker has been seen"

_PLACE_SIGMA_M = 0.02
"""Of a marker among several: where it lies is measured with a tape. A single one says where the site frame is."""

_MAX_REFUSED_S = 1.0
_WORSE = 1.5
"""A source begins again when what was carried since has a standard error so many times its own."""


class ObservedGround:
    """Follows one camera over the ground by what there is, best first.

    1. Markers of known size and place. They define the site frame.
    2. Telemetry with the camera's angles: x east, y north, the origin below the drone's first place. Its errors last:
       more readings do not make it surer.
    3. The sizes of people, with the drone's height where that is known: x to the right of the picture, y ahead, the
       origin below the camera.

    A better source takes the place of a worse one; between looks the motion of the picture carries the map. Where a
    marker comes into sight for the first time, the site frame becomes the marker's.

    Args:
        markers: What watches for the markers; None: there are none.
        camera: What is known of the camera; None: a drone's usual lens.
        params: Settings.

    Raises:
        GroundError: The camera does not fit the pictures (`check_size`, `update`).
    """

    def __init__(
        self,
        markers: MarkerObserver | None = None,
        *,
        camera: CameraPrior | None = None,
        params: ObservedParams | None = None,
    ) -> None:
        self._markers = markers
        self._given_camera = camera
        self._params = params if params is not None else ObservedParams()
        self._place_sigma_m = _PLACE_SIGMA_M if markers is not None and len(markers.places) > 1 else 0.0
        self._size_px: tuple[int, int] | None = None
        self.reset()

    def reset(self) -> None:
        """Forget everything that the pictures have told."""
        if self._markers is not None:
            self._markers.reset()
        self._filter = PoseFilter()
        self._camera: CameraPrior | None = None
        self._sizes: SizesView | None = None
        self._source: Source | None = None
        self._begun_sigma = np.inf
        self._first: Telemetry | None = None
        self._refused_since_s: float | None = None
        self._anchors_px: FloatArray = np.zeros((0, 2))
        self._maps: Counter[Source] = Counter()
        self._sigmas: dict[Source, float] = defaultdict(float)
        self._most_people = 0
        self._why_none = ""

    @property
    def description(self) -> dict[str, Any]:
        """Everything that a record of the run should say about this stage; more once frames have been seen."""
        camera = self._camera if self._camera is not None else self._given_camera
        return {
            "method": "observed",
            "basis": self.basis,
            "better": self._better,
            "markers": [] if self._markers is None else [place.marker_id for place in self._markers.places],
            "params": asdict(self._params),
            "camera": None if camera is None else camera.origin,
            "lens_distortion_removed": True,
        }

    @property
    def basis(self) -> str:
        """What the metres of the frames so far rest on, for people."""
        if not self._maps:
            return f"nothing: {self._why_none}" if self._why_none else "not known before the first frame"
        texts = [f"{self._text(source)}: {self._expected(source)}" for source, _ in self._maps.most_common()]
        return "; ".join(texts)

    def _text(self, source: Source) -> str:
        if source == "markers":
            assert self._markers is not None
            return f"{markers_basis(self._markers.places)}, {lens_text(self._camera)}"
        return "the drone's telemetry" if source == "telemetry" else f"the height of {self._most_people} people"

    def _expected(self, source: Source) -> str:
        share = f" in {self._maps[source]} of {self._maps.total()} frames with a map" if len(self._maps) > 1 else ""
        return expectation(self._sigmas[source] / self._maps[source]) + share

    @property
    def _better(self) -> str:
        return BETTER[self._maps.most_common(1)[0][0]] if self._maps else HELP

    def check_size(self, size_px: tuple[int, int]) -> None:
        """Make sure that the camera fits pictures of a size (width, height), before the first frame.

        Raises:
            GroundError: It does not.
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
            GroundError: The camera does not fit the pictures.
        """
        self._prior_for(frame.size_px)
        moment = _Moment(frame, detections, motion, self._carry(frame.time_s, motion))
        self._anchors_px = np.zeros((0, 2))
        reasons: list[str] = []
        mapped = moment.carried
        for look in (self._look_at_markers, self._read_telemetry, self._compare_sizes):
            reason = look(moment)
            if reason is None:
                mapped = True
                break
            reasons += [reason] if reason else []
        result = self._map(frame.time_s) if mapped else NoGroundMap("; ".join([*reasons, HELP]))
        if isinstance(result, NoGroundMap):
            self._why_none = result.reason
        return result

    def _prior_for(self, size_px: tuple[int, int]) -> CameraPrior:
        if self._camera is None or self._size_px != size_px:
            camera = prior_for(self._given_camera, size_px)
            self._filter, self._source = PoseFilter(), None
            self._camera, self._sizes, self._size_px = camera, SizesView(camera), size_px
        return self._camera

    def _carry(self, time_s: float, motion: CameraMotion | NoCameraMotion) -> bool:
        """Carry the belief to this frame; while nothing tells how the picture moved, it waits where it was."""
        if self._filter.now is None or isinstance(motion, NoCameraMotion):
            return False
        return self._filter.predict(time_s, motion)

    def _look_at_markers(self, moment: _Moment) -> str | None:
        """Take in the markers in the picture; None: the frame needs nothing else, or why it does."""
        if self._markers is None:
            return ""
        now = self._filter.now
        followed = moment.carried and self._source == "markers" and now is not None
        guess = now.state.view if followed and now is not None else None
        seen = self._markers.observe(moment.frame.picture.gray(), guess, moment.frame.time_s)
        if not seen:
            self._refused_since_s = None
            return None if followed and self.length_sigma <= self._params.max_scale_sigma else NO_MARKER
        if followed and not self._contradicted(seen, moment.frame.time_s):
            return None
        fit = first_fit(seen, self._lens().camera, self._start_prior(moment), self._place_sigma_m)
        if isinstance(fit, NoGroundMap):
            return fit.reason
        self._begin("markers", fit.view, fit.covariance, moment)
        self._noted(fit)
        return None

    def _contradicted(self, seen: Sequence[PointObservation], time_s: float) -> bool:
        """Take in what agrees with the belief; return whether for a while nothing has."""
        now = self._filter.now
        assert now is not None
        view, total = now.state.view, now.total[:CHANGES, :CHANGES]
        believed = agreeing(view, total, seen, self._place_sigma_m)
        before = np.asarray(np.linalg.inv(now.covariance), dtype=np.float64)
        prior = carried_prior(view, before[:CHANGES, :CHANGES])
        fit = fit_points(view, believed, prior, self._place_sigma_m) if believed else None
        if fit is None:
            if self._refused_since_s is None:
                self._refused_since_s = time_s
            return time_s - self._refused_since_s >= _MAX_REFUSED_S
        information = np.zeros((STATE, STATE))
        information[:CHANGES, :CHANGES] = fit.information
        self._filter.correct(SolidState(fit.view, 0.0), information)
        self._noted(fit)
        return False

    def _noted(self, fit: PointFit) -> None:
        self._refused_since_s = None
        self._anchors_px = np.concatenate([one.points_px for one in fit.used])

    def _start_prior(self, moment: _Moment) -> PriorRows:
        """Return what is known of the view when the first marker comes into sight."""
        lens, telemetry = self._lens(), moment.frame.telemetry
        if self._params.telemetry and telemetry is not None:
            read = telemetry_view(telemetry, telemetry, lens, frame_is_free=True)
            if not isinstance(read, NoGroundMap):
                return telemetry_prior(*read)
        return level_prior(lens)

    def _lens(self) -> CameraPrior:
        """Return what is known of the lens, by markers too."""
        assert self._camera is not None
        now = self._filter.now
        if now is None or self._source != "markers":
            return self._camera
        focal_sigma, k1_sigma = np.sqrt(np.diag(now.total))[LENS]
        return CameraPrior(now.state.view.camera, float(focal_sigma), float(k1_sigma), self._camera.origin)

    def _read_telemetry(self, moment: _Moment) -> str | None:
        """Begin with what the drone says where nothing better, or nothing as good, is carried."""
        telemetry = moment.frame.telemetry
        if not self._params.telemetry or telemetry is None:
            return ""
        own = self._source == "telemetry"
        if own and moment.carried and self.length_sigma <= _WORSE * self._begun_sigma:
            return None
        self._first = telemetry if self._first is None else self._first
        read = telemetry_view(telemetry, self._first, self._lens())
        if isinstance(read, NoGroundMap):
            return read.reason
        view, covariance = read
        if moment.carried and self._source == "markers" and length_sigma(view, covariance) >= self.length_sigma:
            return None
        if self._filter.now is not None and not own:
            view = in_frame_of(view, self._filter.now.state.view)
        self._begin("telemetry", view, covariance, moment)
        return None

    def _compare_sizes(self, moment: _Moment) -> str | None:
        """Begin with the sizes of people, or begin again where they tell more than before."""
        if not self._params.sizes or self._sizes is None:
            return ""
        frame = moment.frame
        told = self._sizes.update(
            frame.time_s, moment.detections, moment.motion, frame.telemetry if self._params.telemetry else None
        )
        if isinstance(told, NoGroundMap):
            return None if moment.carried and self._source == "sizes" else told.reason
        if told is None:
            return None if moment.carried else ""
        view, covariance = told
        now = self._filter.now
        if now is not None:
            if moment.carried and not self._tells_more(view, covariance):
                return None
            view = in_frame_of(view, now.state.view)
        self._most_people = max(self._most_people, self._sizes.people)
        self._begin("sizes", view, covariance, moment)
        return None

    def _tells_more(self, view: View, covariance: FloatArray) -> bool:
        """Return whether another estimate is notably surer, or notably different: small changes only shake the map."""
        assert self._filter.now is not None
        height_m = self._filter.now.state.view.position_m[2]
        sigma = self.length_sigma
        other = abs(float(np.log(view.position_m[2] / height_m))) > sigma / 2.0
        return length_sigma(view, covariance) < 0.9 * sigma or (other and self._source == "sizes")

    def _begin(self, source: Source, view: View, covariance: FloatArray, moment: _Moment) -> None:
        self._filter.start(belief_of(view, covariance), moment.frame.time_s, moment.motion, lasting_share=LASTING_SHARE)
        self._source, self._refused_since_s = source, None
        self._begun_sigma = self.length_sigma

    @property
    def length_sigma(self) -> float:
        """Relative standard error of lengths in the middle of the picture now; infinite before the first map."""
        now = self._filter.now
        return np.inf if now is None else length_sigma(now.state.view, now.total[:CHANGES, :CHANGES])

    def _map(self, time_s: float) -> GroundMap | NoGroundMap:
        now, sigma = self._filter.now, self.length_sigma
        assert now is not None and self._source is not None
        if not sigma <= self._params.max_scale_sigma:
            return NoGroundMap(f"{NOT_SURE}; {HELP}")
        self._maps[self._source] += 1
        self._sigmas[self._source] += sigma
        by_markers = self._source == "markers" and self._markers is not None
        middle_m = self._markers.places[0].corners_m[:, :2].mean(axis=0) if by_markers and self._markers else None
        return map_from_view(
            now.state.view,
            now.total[:CHANGES, :CHANGES],
            method=self._source,
            scale_m_per_px=middle_scale_m_per_px(now.state.view),
            anchors_px=self._anchors_px,
            age_s=max(time_s - self._filter.observed_s, 0.0),
            size_sigma=self._params.size_sigma if by_markers else 0.0,
            middle_m=middle_m,
        )


@dataclass(frozen=True, slots=True)
class _Moment:
    """One frame, and whether the belief was carried to it."""

    frame: Frame
    detections: Detections
    motion: CameraMotion | NoCameraMotion
    carried: bool
