"""Which of several references is in which of the boxes in which references were detected."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.classes import Role, class_ids
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import Detections, ImageArray, NoGroundMap
from standoff.stages.ground.solid_choice import Found
from standoff.stages.ground.solid_observer import SolidObserver
from standoff.stages.ground.solid_search import search_solid

WHICH = "one of several references is in sight, and nothing says which: give box_px, or show two of them"
NONE_FITS = "the references in sight cannot be told apart"

_MOST_BOXES = 3
_SAME_HEIGHT, _SAME_PITCH_RAD = np.log(1.15), np.deg2rad(4.0)
"""Two references on the same ground, seen by the same camera, agree about how high it is and how it looks."""

_SAME_SIZE = 0.03


def sort_out(solids: Sequence[SolidObserver], gray: ImageArray, detections: Detections, camera: CameraPrior) -> str:
    """Tell references that have not been seen yet which box they are in.

    One camera is as high above all of them: only the right choice makes it so.

    Args:
        solids: The references, two or more.
        gray: (H, W).
        detections: Of this frame.
        camera: What is known of the lens.

    Returns:
        Why nothing was told, or "".
    """
    boxes = _boxes(detections, min(solid.reference.params.min_score for solid in solids))
    if not len(boxes):
        return ""
    if len(boxes) == 1:
        if not _same_size(solids):
            return WHICH
        solids[0].is_in(boxes[0])
        return ""
    views = {
        (k, box): found.fit.state.view
        for k, solid in enumerate(solids)
        for box in range(len(boxes))
        if isinstance(found := _search(solid, gray, boxes[box], camera), Found)
    }
    for chosen in _choices(len(solids), len(boxes)):
        if all(pair in views for pair in chosen) and _alike([views[pair] for pair in chosen]):
            for k, box in chosen:
                solids[k].is_in(boxes[box])
            return ""
    return NONE_FITS


def _boxes(detections: Detections, min_score: float) -> FloatArray:
    """Return (B, 4) the surest boxes of references."""
    seen = np.isin(detections.class_id, class_ids(Role.REFERENCE)) & (detections.score >= min_score)
    order = np.argsort(-detections.score[seen], kind="stable")[:_MOST_BOXES]
    return np.asarray(detections.xyxy_px[seen][order])


def _search(solid: SolidObserver, gray: ImageArray, box: FloatArray, camera: CameraPrior) -> Found | NoGroundMap:
    return search_solid(gray, box, solid.reference.shape, camera, solid.height)


def _choices(solids: int, boxes: int) -> list[tuple[tuple[int, int], ...]]:
    """Return every way to put two references or more into a box each, those that place the most first."""
    return [
        tuple(zip(some, order, strict=True))
        for count in range(min(solids, boxes), 1, -1)
        for some in combinations(range(solids), count)
        for order in permutations(range(boxes), count)
    ]


def _alike(views: Sequence[View]) -> bool:
    heights = np.log([view.position_m[2] for view in views])
    pitches = np.array([view.pitch_rad for view in views])
    return bool(np.ptp(heights) < _SAME_HEIGHT and np.ptp(pitches) < _SAME_PITCH_RAD)


def _same_size(solids: Sequence[SolidObserver]) -> bool:
    """Return whether the references are of one size, so that any of them may be taken for any other."""
    sides = [np.sort(solid.reference.shape.sides_m) for solid in solids]
    return all(len(one) == len(sides[0]) and np.allclose(one, sides[0], rtol=_SAME_SIZE) for one in sides)
