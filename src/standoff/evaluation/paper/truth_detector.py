"""The true boxes in place of a detector and a tracker, so that only geometry is measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from standoff.clips import Clip
from standoff.core import protocols
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.protocols import AnyGround, AnyMotion
from standoff.core.types import Detections, Frame, Tracks

REFERENCE_MARGIN_PX = 3.0
"""The reference's box is drawn this much wide of it, as people draw boxes; the paper looks for edges inside only."""


@dataclass(frozen=True, slots=True)
class BoxError:
    """Standard error of each edge of a box, all edges on their own: pixels plus a share of the side across.

    Attributes:
        px: Fixed part.
        share: Of the width for the left and right edge, of the height for the others.
    """

    px: float = 0.0
    share: float = 0.0

    def sigma_px(self, box_px: FloatArray) -> FloatArray:
        """Return (N, 4) standard errors of the edges of (N, 4) boxes.

        >>> BoxError(px=1.0, share=0.1).sigma_px(np.array([[0.0, 0.0, 10.0, 20.0]]))
        array([[2., 3., 2., 3.]])
        """
        sides_px = box_px[:, 2:] - box_px[:, :2]
        sigma_px: FloatArray = self.px + self.share * np.concatenate([sides_px, sides_px], axis=1)
        return sigma_px


class TrueBoxes(protocols.Detector, protocols.Tracker):
    """Detector and tracker of one clip: yields what can be seen, under the truth's own identities.

    Args:
        clip: The truth.
        error: Of every box, the reference's included.
        seed: Of the errors; those of a frame depend on nothing else.
    """

    def __init__(self, clip: Clip, error: BoxError | None = None, seed: int = 0) -> None:
        self._clip, self._error, self._seed = clip, error, seed
        self._shown = np.zeros(len(clip.entity_id), dtype=np.bool_)
        self._first_s: dict[int, float] = {}

    def describe(self) -> dict[str, Any]:
        """Return what this is, for the record."""
        return {"kind": "true boxes", "reference_margin_px": REFERENCE_MARGIN_PX}

    def detect(self, frame: Frame) -> Detections:
        """Return the boxes of what can be seen, in the order of the truth's ids, the reference last."""
        boxes_px = self._clip.box_px[frame.index]
        self._shown = np.isfinite(boxes_px).all(axis=1)
        reference_px = self._clip.reference_box_px[frame.index : frame.index + 1]
        reference_px = reference_px[np.isfinite(reference_px).all(axis=1)]
        reference_px = reference_px + REFERENCE_MARGIN_PX * np.array([-1.0, -1.0, 1.0, 1.0])
        xyxy_px = np.concatenate([boxes_px[self._shown], reference_px])
        if self._error is not None:
            rng = np.random.default_rng([self._seed, frame.index])
            xyxy_px = xyxy_px + self._error.sigma_px(xyxy_px) * rng.standard_normal(xyxy_px.shape)
            # A tiny box may turn inside out.
            xyxy_px = np.sort(xyxy_px.reshape(-1, 2, 2), axis=1).reshape(-1, 4)
        reference_id = np.full(len(reference_px), CLASS_BY_NAME["reference"].id)
        class_id = np.concatenate([self._clip.class_id[self._shown], reference_id])
        return Detections(xyxy_px, np.ones(len(xyxy_px)), class_id)

    def update(self, time_s: float, detections: Detections, motion: AnyMotion, ground: AnyGround) -> Tracks:
        """Return the last detections as tracks; the reference is none, and motion and ground play no part."""
        own = without_reference(detections)
        track_id = self._clip.entity_id[self._shown]
        for entity_id in track_id.tolist():
            self._first_s.setdefault(entity_id, time_s)
        return Tracks(
            track_id=track_id,
            xyxy_px=own.xyxy_px,
            score=own.score,
            class_id=own.class_id,
            observed=np.ones(len(own), dtype=np.bool_),
            age_s=np.array([time_s - self._first_s[entity_id] for entity_id in track_id.tolist()]),
        )

    def coast(self, time_s: float, motion: AnyMotion) -> Tracks:
        """Return nothing: the truth is asked in every frame."""
        return Tracks.empty()


def without_reference(detections: Detections) -> Detections:
    """Return all detections but the reference object's."""
    return detections[detections.class_id != CLASS_BY_NAME["reference"].id]
