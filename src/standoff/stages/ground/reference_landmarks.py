"""Reference objects as landmarks: they begin the belief about the camera, correct it, or show that they were moved."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import NoGroundMap
from standoff.stages.ground.camera_belief import STATED, CameraBelief, FrameEvidence
from standoff.stages.ground.corner_order import doubt_between
from standoff.stages.ground.lens_check import found_with_another_lens, refitted_lens
from standoff.stages.ground.placement import Placement
from standoff.stages.ground.pose_filter import Estimate
from standoff.stages.ground.reference_matching import sort_out
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.solid_choice import NOT_THERE
from standoff.stages.ground.solid_fit import Belief
from standoff.stages.ground.solid_observer import Reference, SolidObserver
from standoff.stages.ground.telemetry_agreement import agrees_with_telemetry, with_telemetry

CONTRADICTED = "the reference looks otherwise than the drone's telemetry says"
OTHERWISE = "a reference does not look as it must from where the camera is"

_DOUBTED_S = 2.0
"""For so long a reference that telemetry contradicts is not believed: what hides a part of it soon hides another."""

_MOST_LENS_DOUBTS = 2
"""So often at most the lens is doubted, because each doubt costs a search."""

_MOVED_M, _MOVED_SIGMAS = 0.15, 4.0
"""A reference that is seen so far from where it stood has been moved."""

_MOST_CHI2 = 35.0
"""Height, angles and lens by two things exceed it once in ten thousand times, edges being pulled here and there."""


class ReferenceLandmarks:
    """The reference objects of one stream.

    Args:
        references: The most important one first.
        telemetry: Whether the drone's telemetry counts beside them.
        remember: Whether frames know of those before them.
    """

    def __init__(self, references: Sequence[Reference], *, telemetry: bool, remember: bool) -> None:
        self._solids = [
            SolidObserver(one, _name(k, len(references)), remember=remember) for k, one in enumerate(references)
        ]
        self._telemetry, self._remember = telemetry, remember
        self._lens_doubts = 0
        self._contradicted_s: float | None = None
        self._why_unseen: dict[str, str] = {}

    def reset(self) -> None:
        """Forget everything that the pictures have told."""
        self._lens_doubts = 0
        self._contradicted_s = None
        self._why_unseen.clear()
        for solid in self._solids:
            solid.reset()

    @property
    def never_seen(self) -> list[str]:
        """What was looked for in vain in every frame so far, each with the last reason."""
        unseen = [solid for solid in self._solids if not solid.was_seen and solid.name in self._why_unseen]
        return [f"{solid.name} was found in no frame: {self._why_unseen[solid.name]}" for solid in unseen]

    @property
    def corners_told(self) -> bool:
        """Whether of every reference with a stated place it is certain which corner is which."""
        return all(solid.corners_told for solid in self._solids if solid.reference.place_known)

    def forget_places(self) -> None:
        """Forget where references without a stated place stand: the site frame is another one now."""
        for solid in self._solids:
            solid.forget_place()

    def keeper(self, belief: CameraBelief) -> SolidObserver | None:
        """Return the reference whose height is the belief's, if there is one."""
        return next((solid for solid in self._solids if solid.name == belief.keeper), None)

    def look(self, evidence: FrameEvidence, belief: CameraBelief) -> list[str]:
        """Take in the references in the picture.

        Args:
            evidence: The frame.
            belief: About the camera; begun or corrected here.

        Returns:
            Why those that were not taken in were not.
        """
        now = belief.now if evidence.held else None
        if now is not None:
            for solid in self._solids:
                solid.carry(now, evidence.frame.time_s, keeps_height=_keeps_height(solid, belief))
        lost = [solid for solid in self._solids if not solid.located]
        if len(lost) > 1 and not (belief.by_landmark and evidence.held):
            reason = sort_out(lost, evidence.gray, evidence.detections, belief.lens)
            if reason:
                return [reason]
        reasons = []
        for solid in self._solids:
            reason = self._look_at(solid, evidence, belief)
            if reason:
                reasons.append(reason)
                self._why_unseen[solid.name] = reason
        return reasons

    def _look_at(self, solid: SolidObserver, evidence: FrameEvidence, belief: CameraBelief) -> str:
        now, time_s = belief.now, evidence.frame.time_s
        if now is not None and belief.by_landmark:
            seen = solid.look(evidence.luma, now, held=evidence.held, keeps_height=_keeps_height(solid, belief))
            if seen is not None:
                _take(solid, seen, evidence, belief)
                return ""
        taken = [other.box for other in self._solids if other is not solid and other.box is not None]
        held = belief.by_landmark and evidence.held
        telemetry = evidence.frame.telemetry if self._telemetry else None
        agrees = None if telemetry is None else partial(agrees_with_telemetry, telemetry=telemetry)
        found = solid.search(
            evidence.gray,
            evidence.frame.picture,
            time_s,
            evidence.detections,
            belief.lens,
            held=held,
            taken=taken,
            agrees=agrees,
        )
        if isinstance(found, NoGroundMap):
            if found.reason == NOT_THERE:
                self._doubt_lens(evidence, belief, solid)
            return found.reason
        own = solid.belief(found, time_s)
        doubt = doubt_between(own, found.alternatives, solid.reference.shape)
        outranks = solid.reference.place_known and belief.frame_of not in ("", STATED)
        if not held or outranks:
            return self._begin(solid, own, doubt, evidence, belief)
        reason = _join(solid, own, evidence, belief)
        alone = len(self._solids) == 1 and belief.source == "reference"
        if reason and alone and solid.is_elsewhere(time_s, evidence.detections):
            # What was believed began with a mistake.
            return self._begin(solid, own, doubt, evidence, belief)
        return reason

    def _doubt_lens(self, evidence: FrameEvidence, belief: CameraBelief, solid: SolidObserver) -> None:
        """See whether another lens would explain a reference that is not found, a few times at most."""
        box = solid.box_now(evidence.frame.time_s, evidence.detections, ())
        if isinstance(box, NoGroundMap) or belief.by_landmark or self._lens_doubts >= _MOST_LENS_DOUBTS:
            return
        self._lens_doubts += 1
        text = found_with_another_lens(evidence.gray, box, solid.reference.shape, belief.lens, solid.height)
        if text:
            belief.warnings.setdefault("lens", f"{text} ({evidence.text})")

    def _begin(
        self, solid: SolidObserver, own: Belief, doubt: FloatArray, evidence: FrameEvidence, belief: CameraBelief
    ) -> str:
        """Begin the belief with what one reference shows; return why not, or ""."""
        own, text = refitted_lens(evidence.luma, solid.reference.shape, own, belief.lens)
        if text:
            belief.warnings.setdefault("lens", f"{text} ({evidence.text})")
            belief.doubt_lens(own.state.view.camera)
        telemetry = evidence.frame.telemetry
        if self._telemetry and telemetry is not None:
            own, contradiction = with_telemetry(own, telemetry)
            if contradiction and self._still_doubts(evidence.frame.time_s):
                return CONTRADICTED
            if contradiction:
                text = f"{contradiction} ({evidence.text}): {solid.name} is trusted, because its size was measured"
                belief.warnings.setdefault("telemetry", text)
        frame_of = STATED if solid.reference.place_known else solid.name
        known = solid.reference.height_m is not None
        if frame_of != belief.frame_of or belief.now is None:
            self.forget_places()
        belief.begin("reference", own, evidence, frame_of=frame_of, keeper=solid.name, height_known=known, doubt=doubt)
        solid.defines_frame()
        evidence.anchors_px.append(solid.note(own.state, evidence.frame.time_s))
        return ""

    def _still_doubts(self, time_s: float) -> bool:
        """Return whether a contradiction is new; where frames know of none before them it never is."""
        if not self._remember:
            return False
        if self._contradicted_s is None:
            self._contradicted_s = time_s
        return time_s - self._contradicted_s < _DOUBTED_S


def _name(index: int, count: int) -> str:
    return "the reference" if count == 1 else f"reference {index + 1}"


def _keeps_height(solid: SolidObserver, belief: CameraBelief) -> bool:
    """Return whether the belief's height is this reference's, and the reference still where it was."""
    return solid.name == belief.keeper and solid.stands_still


def _take(
    solid: SolidObserver, seen: tuple[SolidState, FloatArray], evidence: FrameEvidence, belief: CameraBelief
) -> None:
    belief.correct(*seen, solid.name, evidence)
    now = belief.now
    assert now is not None
    evidence.anchors_px.append(solid.note_seen(now, evidence.frame.time_s, keeps_height=_keeps_height(solid, belief)))


def _join(solid: SolidObserver, own: Belief, evidence: FrameEvidence, belief: CameraBelief) -> str:
    """Take in a reference that was found by a search while the camera's place is known; or say why not."""
    now = belief.now
    assert now is not None
    placement = Placement.between(own.state.view, now.state.view, solid.reference.middle_m, own.state.height_m)
    if not _agree(solid, placement, own, now):
        return OTHERWISE
    stood = solid.placement
    moved_m = 0.0 if stood is None else placement.moved_by(stood, solid.reference.middle_m)
    if stood is None or moved_m > max(_MOVED_M, _MOVED_SIGMAS * solid.place_sigma_m(now)):
        if stood is not None:
            belief.warnings.setdefault(f"{solid.name} moved", _moved(solid, moved_m, evidence))
        if solid.name == belief.keeper:
            solid.remember_height(now)
        solid.stands(placement)
    keeps_height = _keeps_height(solid, belief)
    seen = solid.look(evidence.luma, now, held=True, keeps_height=keeps_height, found=own.state)
    if seen is not None:
        _take(solid, seen, evidence, belief)
    return ""


def _agree(solid: SolidObserver, placement: Placement, own: Belief, now: Estimate) -> bool:
    """Return whether a reference, wherever it stands, is seen as a camera of this height and these angles sees it."""
    through = solid.through(now, placement, place_known=False)
    spread = through.covariance + now.lasting + np.linalg.inv(own.information)
    off = own.state.change_from(through.belief.state)
    return bool(off @ np.linalg.solve(spread, off) <= _MOST_CHI2)


def _moved(solid: SolidObserver, moved_m: float, evidence: FrameEvidence) -> str:
    if solid.was_seen:
        return (
            f"{solid.name} was moved by {moved_m:.1f} m before {evidence.text}: the ground's picture tells places now"
        )
    return (
        f"{solid.name} stands {moved_m:.1f} m from its stated place ({evidence.text}): what was seen first is trusted"
    )
