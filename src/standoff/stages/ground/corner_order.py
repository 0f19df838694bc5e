"""Which corner is which, for a shape that can be turned onto itself: the site frame must not turn in between."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.pose import SHIFT, View
from standoff.stages.ground.projection import project
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import STATE, SolidState
from standoff.stages.ground.solid_fit import Belief


def turned_like(
    belief: Belief, shape: ReferenceShape, *, last: SolidState | None, corner_px: FloatArray | None
) -> Belief:
    """Choose among the ways in which the shape looks the same.

    Args:
        belief: Of one of these ways.
        shape: The reference's.
        last: The state believed before; the way nearest to its heading is taken.
        corner_px: (2,) about where corner 0 is, where there is no earlier state; None: at the picture's bottom left.
    """
    ways = [_turned(belief, shape, turn) for turn in shape.turns_onto_itself()]
    if len(ways) == 1:
        return belief
    if last is not None:
        ahead = last.view.site_to_camera[2]
        return max(ways, key=lambda way: float(way.state.view.site_to_camera[2, :2] @ ahead[:2]))
    corners = [_corner_px(way.state, shape) for way in ways]
    if corner_px is not None:
        return ways[int(np.argmin([np.linalg.norm(corner - corner_px) for corner in corners]))]
    return ways[int(np.argmin([corner[0] - corner[1] for corner in corners]))]


def doubt_between(belief: Belief, alternatives: Sequence[Belief], shape: ReferenceShape) -> FloatArray:
    """Return (9, 9) the covariance that is owed to alternatives that explain a picture as well, the furthest of them.

    Args:
        belief: What is taken.
        alternatives: With the corners named in any way.
        shape: The reference's.
    """
    doubt = np.zeros((STATE, STATE))
    for other in alternatives:
        like = turned_like(other, shape, last=belief.state, corner_px=None)
        change = like.state.change_from(belief.state)
        # One of two is right, and each as likely.
        owed = np.outer(change, change) / 2.0
        if np.trace(owed[SHIFT, SHIFT]) > np.trace(doubt[SHIFT, SHIFT]):
            doubt = owed
    return doubt


def _corner_px(state: SolidState, shape: ReferenceShape) -> FloatArray:
    return np.asarray(project(state.view, np.array([[*shape.corners_m[0], state.height_m]]))[0])


def _turned(belief: Belief, shape: ReferenceShape, turn: int) -> Belief:
    """Return the same picture with corner k called corner k - turn: the site turns under the camera."""
    if turn == 0:
        return belief
    middle = shape.corners_m.mean(axis=0)
    old = (shape.corners_m - middle) @ np.array([1.0, 1.0j])
    # What was called corner k + turn is now corner k, and has its place.
    angle = float(np.angle(np.vdot(np.roll(old, -turn), old)))
    spin = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    centre = np.array([*middle, 0.0])
    view = belief.state.view
    moved = View(view.camera, spin @ (view.position_m - centre) + centre, view.site_to_camera @ spin.T)
    back = np.eye(STATE)
    back[SHIFT, SHIFT] = spin.T
    return Belief(SolidState(moved, belief.state.height_m), back.T @ belief.information @ back)
