"""Follows one reference object through a stream: looks where it should be, and searches where it may be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from standoff.core.boxes import areas_px2, shared_px2
from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import Detections, ImageArray, Luma, NoGroundMap, Picture
from standoff.stages.ground.corner_order import turned_like
from standoff.stages.ground.params import ReferenceParams
from standoff.stages.ground.placement import Placement, Through
from standoff.stages.ground.pose_filter import Estimate
from standoff.stages.ground.projection import project, project_with_jacobians
from standoff.stages.ground.reference_box import NOT_SEEN, GivenPlace, detected_box
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import HEIGHT, SolidState
from standoff.stages.ground.solid_choice import Found
from standoff.stages.ground.solid_fit import Belief, fit_solid
from standoff.stages.ground.solid_foot import with_foot
from standoff.stages.ground.solid_search import HeightPrior, search_solid

_LEAST_REACH_PX, _MOST_REACH_PX = 5.0, 8.0
_REACH_SIGMAS = 4.0
_MIN_SUPPORT = 0.4
"""So much of the outline that should show must be seen for the reference to count as seen in a frame."""

_GATE_PX, _GATE_SIGMAS = 1.0, 4.0
_SEARCH_AGAIN_S, _LOOK_ELSEWHERE_S = 0.19, 1.0
"""A search costs as much as many frames, and the next frame looks much like this one; much more so while motion or
another thing carries the map anyway."""

_MAX_REFUSED_S = 1.0
"""When a reference that can be seen has contradicted what is predicted for so long, it is searched for again."""

_LEAST_FILLED = 0.65
"""What is found in a detector's box covers so much of it, or it is something else in the box."""

_MOST_ELSEWHERE = 0.5
"""Of a detector's box, so much at most may lie beside where the reference is believed to be: its sides do."""

NOT_DUE = "the reference is searched for a few times a second only"
NOT_FILLED = "what has the reference's shape fills only a part of its box"


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """A reference object, as its owner describes it.

    Attributes:
        shape: Its true outline.
        height_m: Of its top above the ground; None: unknown, estimated where its base can be seen.
        place: What the operator said of where it is in the picture.
        params: Settings.
        place_known: Whether the shape's corners are places of the site; if not, it stands wherever it is seen.
    """

    shape: ReferenceShape
    height_m: float | None = None
    place: GivenPlace = field(default_factory=GivenPlace)
    params: ReferenceParams = field(default_factory=ReferenceParams)
    place_known: bool = True

    @property
    def middle_m(self) -> FloatArray:
        """(2,) its own frame."""
        return np.asarray(self.shape.corners_m.mean(axis=0))

    def describe(self) -> dict[str, Any]:
        """Return what a record of the run should say."""
        return {
            "corners_m": self.shape.corners_m.tolist(),
            "height_m": self.height_m,
            "place_known": self.place_known,
            **self.place.describe(),
        }


class SolidObserver:
    """One reference object in one stream.

    Attributes:
        reference: As given.
        name: For people.
        height: What is known of its height.
        placement: Where it stands on the site; None: not known yet.
        stands_still: Whether that is certain; if not, it was learned through the belief about the camera.
        corners_told: Whether it is certain which corner is which: the shape tells, or the operator did and it was
            followed since.

    Args:
        reference: Which.
        name: For people.
        remember: Whether a search may say that the one before it in the stream was enough.
    """

    def __init__(self, reference: Reference, name: str, *, remember: bool = True) -> None:
        self.reference = reference
        self.name = name
        self._remember = remember
        self.reset()

    def reset(self) -> None:
        """Forget everything that the pictures have told."""
        known = self.reference.place_known
        self.placement: Placement | None = Placement.identity() if known else None
        self.stands_still = known
        given_m = self.reference.height_m
        self.height = HeightPrior.unknown() if given_m is None else HeightPrior.known(given_m)
        self.corners_told = not self._looks_the_same_turned or self.reference.place.first_corner_px is not None
        self._last: SolidState | None = None
        self._last_s = -np.inf
        self._box: FloatArray | None = None
        self._refused_since_s: float | None = None
        self._searched: tuple[float, NoGroundMap] | None = None

    @property
    def _looks_the_same_turned(self) -> bool:
        return len(self.reference.shape.turns_onto_itself()) > 1

    @property
    def box(self) -> FloatArray | None:
        """(4,) where it was seen last, or is carried to."""
        return self._box

    @property
    def was_seen(self) -> bool:
        """Whether any frame has shown it."""
        return self._last is not None

    @property
    def located(self) -> bool:
        """Whether it has been seen, or the operator said where it is."""
        return self._box is not None or self.reference.place.box_xyxy_px is not None

    def carry(self, now: Estimate, time_s: float, *, keeps_height: bool) -> None:
        """Take along where it is in the picture, and how it is turned."""
        if self._box is not None and self.placement is not None:
            own = self._state(now, self.placement, keeps_height=keeps_height)
            if self._last is not None:
                self._last, self._last_s = own, time_s
            self._note_outline(own)

    def look(
        self,
        gray: Luma,
        now: Estimate,
        *,
        held: bool,
        keeps_height: bool,
        found: SolidState | None = None,
    ) -> tuple[SolidState, FloatArray] | None:
        """Look for it where it should be.

        Args:
            gray: The picture.
            now: What is believed of the camera on the site.
            held: Whether motion or another thing tells where the camera is in this frame.
            keeps_height: Whether the belief's height is this reference's.
            found: Where a search found it and it is believed to be (its own frame); None: where `now` puts it.

        Returns:
            The most likely state of the camera on the site and (9, 9) the information that the look adds; None where
            the reference was not seen, or not believed.
        """
        if self.placement is None:
            return None
        through = None if keeps_height else self.through(now, self.placement, place_known=self.stands_still)
        belief = now.belief() if through is None else through.belief
        covariance = now.total if through is None else through.placed_covariance
        sigma_px = self._outline_sigma_px(belief.state, covariance)
        if found is None and not (np.isfinite(sigma_px) and (held or sigma_px < _MOST_REACH_PX)):
            return None
        reach_px = _LEAST_REACH_PX
        if found is None:
            reach_px = float(np.clip(_REACH_SIGMAS * sigma_px + 1.0, _LEAST_REACH_PX, _MOST_REACH_PX))
        fit = fit_solid(gray, self.reference.shape, belief, reach_px, start=found)
        if fit is None or fit.seen_share(len(self.reference.shape.corners_m)) < _MIN_SUPPORT:
            return None
        moved_px = np.linalg.norm(self.outline_px(fit.state) - self.outline_px(belief.state), axis=1)
        if found is None and not moved_px.max() <= _GATE_PX + _GATE_SIGMAS * sigma_px:
            return None
        return (fit.state, fit.information) if through is None else through.seen(fit)

    def through(self, now: Estimate, placement: Placement, *, place_known: bool) -> Through:
        """Return a belief about the camera on the site as it is in the frame of this reference, put somewhere."""
        height = self.height
        return Through(now, placement, height.height_m, height.sigma_m, place_known=place_known)

    def place_sigma_m(self, now: Estimate) -> float:
        """Return how well a belief about the camera tells where on the site this reference is seen to stand."""
        if self.placement is None:
            return np.inf
        through = self.through(now, self.placement, place_known=True)
        sigma_px = self._outline_sigma_px(through.belief.state, through.placed_covariance)
        around_px = np.linalg.norm(np.diff(self.outline_px(through.belief.state), axis=0), axis=1)
        around_m = np.linalg.norm(np.diff(self.reference.shape.corners_m, axis=0), axis=1)
        return float(sigma_px * (around_m / around_px).max()) if np.isfinite(around_px).all() else np.inf

    def search(
        self,
        gray: ImageArray,
        picture: Picture,
        time_s: float,
        detections: Detections,
        camera: CameraPrior,
        *,
        held: bool,
        taken: Sequence[FloatArray],
        agrees: Callable[[Belief], bool] | None,
    ) -> Found | NoGroundMap:
        """Search for it where the operator or the detector says that it is.

        Args:
            gray: (H, W).
            picture: The same in colour, for the height where that was not measured.
            time_s: Of the frame.
            detections: Of this frame.
            camera: What is known of the lens.
            held: Whether there is a map anyway; then it is searched for if it is new, or not where it should be.
            taken: (4,) each: boxes of other references.
            agrees: Decides between two ways to see it; None: nothing does.

        Returns:
            It in its own frame, or why it was not found.
        """
        box = self.box_now(time_s, detections, taken)
        if isinstance(box, NoGroundMap):
            return box
        if held and self._last is not None and not self._refused(time_s):
            return NoGroundMap(NOT_DUE)
        again_s = _LOOK_ELSEWHERE_S if held else _SEARCH_AGAIN_S
        if self._remember and self._searched is not None and 0.0 <= time_s - self._searched[0] < again_s:
            return self._searched[1]
        found = search_solid(gray, box, self.reference.shape, camera, self.height, agrees)
        if isinstance(found, Found) and self.reference.height_m is None:
            found = with_foot(found, gray, picture.bgr(), self.reference.shape)
        if isinstance(found, Found) and not self._fills(found.fit.state, box):
            found = NoGroundMap(NOT_FILLED)
        self._searched = (time_s, NoGroundMap(NOT_DUE) if isinstance(found, Found) else found)
        return found

    def is_elsewhere(self, time_s: float, detections: Detections) -> bool:
        """Return whether it is now detected only elsewhere than where it is believed to be."""
        box = self.box_now(time_s, detections, ())
        if self._box is None or isinstance(box, NoGroundMap):
            return False
        middle = (self._box[:2] + self._box[2:]) / 2.0
        beside = 1.0 - _covered(box, self._box) > _MOST_ELSEWHERE
        return beside or not bool(((middle >= box[:2]) & (middle <= box[2:])).all())

    def _fills(self, own: SolidState, box: FloatArray) -> bool:
        """Return whether a solid covers a detector's box; an operator's may be drawn wide."""
        if self.reference.place.box_xyxy_px is not None:
            return True
        shape = self.reference.shape
        corners_m = np.concatenate([shape.at_height(own.height_m), shape.at_height(0.0)])
        corners_px = project(own.view, corners_m)
        around = np.concatenate([corners_px.min(axis=0), corners_px.max(axis=0)])
        return _covered(box, around) >= _LEAST_FILLED

    def belief(self, found: Found, time_s: float) -> Belief:
        """Return what was found, as a belief in its own frame, with the corners named as before.

        Args:
            found: By a search.
            time_s: Of the frame.
        """
        forgotten = self._last is not None and time_s - self._last_s > self.reference.params.memory_s
        if forgotten and self._looks_the_same_turned:
            # The camera may have turned since.
            self.corners_told = False
        hint_px = self.reference.place.first_corner_px if self._last is None else None
        return turned_like(found.belief(), self.reference.shape, last=self._last, corner_px=hint_px)

    def stands(self, placement: Placement) -> None:
        """Take note of where on the site it was found to stand; from now on it tells scale and tilt, not places."""
        self.placement, self.stands_still = placement, False

    def defines_frame(self) -> None:
        """Let its own frame be the site's."""
        self.placement, self.stands_still = Placement.identity(), True

    def forget_place(self) -> None:
        """Forget where it stands, unless that is stated: the site frame is another one now."""
        self.placement = Placement.identity() if self.reference.place_known else None
        self.stands_still = self.reference.place_known

    def note(self, own: SolidState, time_s: float) -> FloatArray:
        """Take note of where it was seen (its own frame); return (N, 2) the upper corners, none where out of sight."""
        self._last, self._last_s = own, time_s
        self._refused_since_s = None
        return self._note_outline(own)

    def note_seen(self, now: Estimate, time_s: float, *, keeps_height: bool) -> FloatArray:
        """Take note that it was seen where it is believed to be; return as `note`."""
        assert self.placement is not None, "it was seen"
        return self.note(self._state(now, self.placement, keeps_height=keeps_height), time_s)

    def is_in(self, box_xyxy_px: FloatArray) -> None:
        """Take note of the box (4,) that shows it."""
        self._box = box_xyxy_px

    def remember_height(self, now: Estimate) -> None:
        """Take over what the belief, which keeps another height from now on, knew of this one's."""
        sigma_m = float(np.sqrt(now.total[HEIGHT, HEIGHT]))
        self.height = HeightPrior(now.state.height_m, sigma_m, (now.state.height_m,))

    def outline_px(self, own: SolidState) -> FloatArray:
        """Return (N, 2) the upper corners in the picture."""
        return project(own.view, self._corners_m(own))

    def straight_outline_px(self, view: View, height_m: float) -> FloatArray:
        """Return (N, 2) the upper corners, without lens distortion, in a view of its own frame."""
        return view.project_pinhole(self._corners_m(SolidState(view, height_m)))

    def _state(self, now: Estimate, placement: Placement, *, keeps_height: bool) -> SolidState:
        height_m = now.state.height_m if keeps_height else self.height.height_m
        return SolidState(placement.own_view(now.state.view), height_m)

    def _note_outline(self, own: SolidState) -> FloatArray:
        outline = self.outline_px(own)
        if not np.isfinite(outline).all():
            return np.zeros((0, 2))
        self._box = np.concatenate([outline.min(axis=0), outline.max(axis=0)])
        return outline

    def _corners_m(self, own: SolidState) -> FloatArray:
        return self.reference.shape.at_height(own.height_m)

    def _outline_sigma_px(self, own: SolidState, covariance: FloatArray) -> float:
        """Return the standard error of where the upper corners should be, the worst of them."""
        _, by_view, by_point = project_with_jacobians(own.view, self._corners_m(own))
        jacobian = np.concatenate([by_view, by_point[:, :, 2:]], axis=2)
        variance = np.einsum("nij,jk,nik->ni", jacobian, covariance, jacobian)
        return float(np.sqrt(variance.max())) if np.isfinite(variance).all() else np.inf

    def _refused(self, time_s: float) -> bool:
        """Return whether it has for a while been detected, but not seen where it is believed to be."""
        if self._refused_since_s is None:
            self._refused_since_s = time_s
        return time_s - self._refused_since_s >= _MAX_REFUSED_S

    def box_now(self, time_s: float, detections: Detections, taken: Sequence[FloatArray]) -> FloatArray | NoGroundMap:
        """Return the box (4,) that the operator or the detector gives for it, or why there is none."""
        place = self.reference.place
        if place.box_xyxy_px is not None:
            return place.box_at(time_s) if self._box is None else self._box
        least = self.reference.params.min_score
        near = None if self._box is None else detected_box(detections, least, near_box_px=self._box, taken=taken)
        detected = near if near is not None else detected_box(detections, least, taken=taken)
        return NoGroundMap(NOT_SEEN) if detected is None else detected


def _covered(box: FloatArray, by: FloatArray) -> float:
    """Return the share of a box (4,) that another covers."""
    return float(shared_px2(box[None], by[None])[0, 0] / max(areas_px2(box[None])[0], 1e-9))
