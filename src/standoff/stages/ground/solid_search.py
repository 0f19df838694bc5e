"""Find the reference in a box of one picture when nothing is known of where the camera is.

The solid is laid over the edges in the box from everywhere and pulled to those nearby (`solid_match`). Of one with four
corners every quadrilateral that the edges make is taken for the top and for the base as well, each way round and from
both places from which a camera could see it so. The whole solid is then laid over the picture at each of these places,
and the one wins at which the picture has most of its edges.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import LENS, SHIFT, TURN, View
from standoff.core.types import ImageArray, NoGroundMap
from standoff.stages.ground.edge_field import EdgeField
from standoff.stages.ground.edges import Edges, between_pixels, canny, sobel_gradients
from standoff.stages.ground.oriented_outline import likely_quadrilaterals, noise_thresholds
from standoff.stages.ground.outline import BOX_OUTSIDE, TOO_FEW_EDGES, undistorted_box
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import HEIGHT, STATE, SolidState
from standoff.stages.ground.solid_choice import NOT_THERE, Candidate, Found, best_of, upper_px
from standoff.stages.ground.solid_edges import Blurred
from standoff.stages.ground.solid_fit import Belief, SolidFit, fit_solid, outline_support, side_support
from standoff.stages.ground.solid_match import matching_states
from standoff.stages.ground.solid_outline import mixed_states, states_of

_MIN_EDGES = 16
_QUADRILATERALS, _MIXED = 24, 6
_MARGIN = 0.12
"""The search goes this share of the box's longer side beyond the box: detectors cut corners."""

_ROLL_SIGMA_RAD = np.deg2rad(5.0)
"""Gimbals keep the horizon level; hands nearly so."""

_BARE_COST, _ROLL_COST, _PATCHY = 0.45, 0.1, 0.33
_HEIGHT_COST, _LEAST_HEIGHT_SIGMA_M = 0.05, 0.1
"""A shadow's edge explains a solid twice as high as the real one, and explains more of the picture."""

_FACE_RINGS = 5
_REFINED = 10
_FIT_PX = 5.0
_MAX_SURPRISE = 16.0
"""Four standard errors of what was known before."""

_MIN_SIDE_SUPPORT, _MIN_MEAN_SUPPORT, _MIN_OTHER_SUPPORT = 0.5, 0.8, 0.85
"""So much of the sides must be seen when nothing else says that the reference is there."""

_SMOOTHINGS_PX = (0.0, 2.0)


@dataclass(frozen=True, slots=True)
class HeightPrior:
    """What is known of the reference's height.

    Attributes:
        height_m: The most likely one.
        sigma_m: Its standard error.
        tried_m: Heights to begin with.
    """

    height_m: float
    sigma_m: float
    tried_m: tuple[float, ...]

    @classmethod
    def known(cls, height_m: float) -> HeightPrior:
        """Return a height by tape measure, good to a centimetre or two."""
        return cls(height_m, 0.01 + 0.02 * height_m, (height_m,))

    @classmethod
    def unknown(cls) -> HeightPrior:
        """Return what can be said of any footing or plate."""
        return cls(0.35, 0.25, (0.0, 0.15, 0.3, 0.45, 0.6, 0.9))


def search_solid(
    gray: ImageArray,
    box_xyxy_px: FloatArray,
    shape: ReferenceShape,
    camera: CameraPrior,
    height: HeightPrior,
    agrees: Callable[[Belief], bool] | None = None,
) -> Found | NoGroundMap:
    """Find the reference in a box.

    Args:
        gray: (H, W).
        box_xyxy_px: (4,) about where; it may cut corners or take in shadows.
        shape: True shape.
        camera: What is known of it, for pictures of this size.
        height: What is known of the reference's height.
        agrees: Whether something else, such as the drone's telemetry, agrees with a belief; it decides where the
            picture alone leaves two ways. None: there is nothing else.

    Returns:
        The reference, or why it cannot be told where it is. For a shape that can be turned onto itself corner 0 is
        as arbitrary as the order in which the ways were tried.
    """
    margin = _MARGIN * float((box_xyxy_px[2:] - box_xyxy_px[:2]).max())
    box = box_xyxy_px + np.array([-margin, -margin, margin, margin])
    picture = Blurred.around(gray, box.reshape(2, 2), margin)
    if picture is None:
        return NoGroundMap(BOX_OUTSIDE)
    task = _Task(gray, picture, box_xyxy_px, box, shape, camera, height)
    found: Found | NoGroundMap = NoGroundMap(NOT_THERE)
    for smoothing_px in _SMOOTHINGS_PX:
        found = _search(task, smoothing_px, agrees)
        if isinstance(found, Found):
            break
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """What is looked for, and where.

    Attributes:
        gray: (H, W) the whole picture.
        picture: Around the reference.
        detected: (4,) box of the reference.
        box: (4,) the same with a margin, in which edges count.
        shape: Of the reference.
        camera: What is known of it.
        height: What is known of the reference's.
    """

    gray: ImageArray
    picture: Blurred
    detected: FloatArray
    box: FloatArray
    shape: ReferenceShape
    camera: CameraPrior
    height: HeightPrior


def _search(task: _Task, smoothing_px: float, agrees: Callable[[Belief], bool] | None) -> Found | NoGroundMap:
    edges = _edges(task, smoothing_px)
    if isinstance(edges, NoGroundMap):
        return edges
    states = _scored(task, _by_matching(task, edges))
    if len(task.shape.corners_m) == 4:
        states += _by_quadrilaterals(task, edges)
    candidates: list[Candidate] = []
    for state in _best(states, _REFINED * len(task.height.tried_m)):
        if sum(one.believable for one in candidates) == _REFINED:
            break
        prior = _prior(state, task.camera, task.height)
        fit = fit_solid(task.gray, task.shape, prior, _FIT_PX, start=state)
        if fit is not None and (score := _score_of_fit(task, fit)) > 0:
            believable = _believable(fit, task.shape) and _expected(fit, prior, task.shape)
            candidates.append(Candidate(score, Found(fit, prior), believable))
    return best_of(candidates, task.shape, agrees)


def _score_of_fit(task: _Task, fit: SolidFit) -> float:
    """Return px of outline that the picture has where a fit puts it, less what its height costs."""
    off = (fit.state.height_m - task.height.height_m) / max(task.height.sigma_m, _LEAST_HEIGHT_SIGMA_M)
    around_px = fit.length_px[: len(task.shape.corners_m)].sum()
    return _score_of(task, fit.state, fit.support, fit.length_px) - _HEIGHT_COST * off**2 * float(around_px)


_Scored = tuple[float, SolidState]


def _scored(task: _Task, states: Iterable[SolidState]) -> list[_Scored]:
    """Say of states how much of them the picture has."""
    return [(_score(task, state), state) for state in states]


def _best(scored: Sequence[_Scored], count: int) -> list[SolidState]:
    """Return so many of the states, those first of which the picture has the most."""
    return [state for _, state in sorted(scored, key=lambda one: -one[0])[:count]]


def _by_quadrilaterals(task: _Task, edges: Edges) -> list[_Scored]:
    """Return the states that quadrilaterals of edges speak for."""
    outlines = likely_quadrilaterals(edges, undistorted_box(task.box, task.camera.camera), _QUADRILATERALS)
    camera, heights_m = task.camera.camera, task.height.tried_m
    states = _scored(
        task, (state for outline in outlines for state in states_of(outline, task.shape, camera, heights_m))
    )
    mixed = (other for state in _best(states, _MIXED) for other in mixed_states(state, task.shape))
    return states + _scored(task, mixed)


def _by_matching(task: _Task, edges: Edges) -> list[SolidState]:
    """Return the states whose outlines come to rest on edges."""
    camera = task.camera.camera
    field = EdgeField(edges, undistorted_box(task.box, camera))
    detected = undistorted_box(task.detected, camera)
    # Heights adapt, so that every other one will do to begin with.
    return matching_states(field, detected, task.shape, camera, task.height.tried_m[::2], task.height.sigma_m)


def _edges(task: _Task, smoothing_px: float) -> Edges | NoGroundMap:
    """Return the undistorted edges in the box; smoothing finds faint ones in noise, and loses fine ones."""
    gray = task.gray if smoothing_px == 0 else _smoothed_in(task.gray, task.box, smoothing_px)
    gradients = sobel_gradients(gray, task.box)
    if gradients is None:
        return NoGroundMap(BOX_OUTSIDE)
    edges = between_pixels(canny(gradients, *noise_thresholds(gradients)), gradients).undistorted(task.camera.camera)
    return edges if len(edges) >= _MIN_EDGES else NoGroundMap(TOO_FEW_EDGES)


def _smoothed_in(gray: ImageArray, box: FloatArray, smoothing_px: float) -> ImageArray:
    """Return the picture, smoothed in and around a box."""
    margin = int(4 * smoothing_px) + 8
    height, width = gray.shape
    left, top = np.maximum(np.floor(box[:2]).astype(int) - margin, 0)
    right, bottom = np.minimum(np.ceil(box[2:]).astype(int) + margin, (width, height))
    smooth = gray.copy()
    smooth[top:bottom, left:right] = cv2.GaussianBlur(gray[top:bottom, left:right], (0, 0), smoothing_px)
    return smooth


def _believable(fit: SolidFit, shape: ReferenceShape) -> bool:
    """Return whether the picture has enough of the sides: of every one, or of all but one and of the solid below."""
    count = len(shape.corners_m)
    sides = side_support(fit.support, fit.lower_side, count)
    if count == 3:
        # Three sides can be explained from almost anywhere: of them none is to spare.
        return bool(sides.min() >= _MIN_OTHER_SUPPORT)
    if count > 4:
        # A corner cut off, or a side seen end on, may be too short to have an edge; the others are enough.
        sides = sides[fit.length_px[:count] > 0]
    sides = np.sort(sides)
    if len(sides) < 4:
        return False
    if sides[0] >= _MIN_SIDE_SUPPORT and sides.mean() >= _MIN_MEAN_SUPPORT:
        return True
    lower = fit.support[(fit.lower_side >= 0) & np.isfinite(fit.support)]
    return bool(sides[1] >= _MIN_OTHER_SUPPORT and len(lower) and lower.max() >= _MIN_OTHER_SUPPORT)


def _expected(fit: SolidFit, prior: Belief, shape: ReferenceShape) -> bool:
    """Return whether height, lens and horizon are about as they are known; four corners are hard to explain falsely."""
    change = fit.state.change_from(prior.state)
    return len(shape.corners_m) == 4 or float(change @ prior.information @ change) < _MAX_SURPRISE


def _score(task: _Task, state: SolidState) -> float:
    """Return px of outline that the picture has where a state puts it, as `_score_of`."""
    samples, support = outline_support(task.picture, task.shape, state)
    return _score_of(task, state, support, samples.length_px)


def _score_of(task: _Task, state: SolidState, support: FloatArray, length: FloatArray) -> float:
    """Return px of outline that the picture has, less what is bare of the top, less what is unlikely.

    Args:
        task: What is looked for.
        state: Where it is.
        support: (E,) share of each visible edge that the picture has.
        length: (E,) of each, px.
    """
    support = np.nan_to_num(support, nan=0.0)
    corners = len(task.shape.corners_m)
    top = float((length[:corners] * (support[:corners] - _BARE_COST)).sum())
    lower = float((length[corners:] * np.maximum(support[corners:] - _BARE_COST, 0.0)).sum())
    roll = state.view.roll_rad
    top_px = upper_px(state, task.shape)
    unlikely = (
        _ROLL_COST * (roll / _ROLL_SIGMA_RAD) ** 2
        + _outside_share(top_px, task.box)
        + _patchy_share(task.picture, top_px)
    )
    return float(top + lower - unlikely * length[:corners].sum())


def _patchy_share(picture: Blurred, top_px: FloatArray) -> float:
    """Return the share of the upper face that is much darker or brighter than the rest: half of it lies in shade."""
    if not np.isfinite(top_px).all():
        return 1.0
    grid = _all_over_face(len(top_px)) @ top_px
    columns, rows = np.rint(grid - (picture.left_px, picture.top_px)).astype(np.int64).T
    height, width = picture.values.shape
    inside = (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
    values = picture.values[rows[inside], columns[inside]]
    if not len(values):
        return 1.0
    middle = float(np.median(values))
    return float((np.abs(values - middle) > _PATCHY * max(middle, 1.0)).mean())


@cache
def _all_over_face(corners: int) -> FloatArray:
    """Return (G, N) weights of a face's corners that make points all over it, away from its sides."""
    if corners == 4:
        u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0.15, 0.85, 8), np.linspace(0.15, 0.85, 8)))
        everywhere = np.column_stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
    else:
        # Rings around the middle: the number of points on each grows with its size, as its share of the area does.
        parts = []
        for ring in range(1, _FACE_RINGS + 1):
            share, along = 0.7 * ring / _FACE_RINGS, (np.arange(ring) + 0.5) / ring
            for k in range(corners):
                weights = np.full((ring, corners), (1.0 - share) / corners)
                weights[:, k] += share * (1.0 - along)
                weights[:, (k + 1) % corners] += share * along
                parts.append(weights)
        everywhere = np.concatenate(parts)
    everywhere.setflags(write=False)
    return everywhere


def _outside_share(points_px: FloatArray, box: FloatArray) -> float:
    """Return how far points (N, 2) lie outside a box, as a share of its size; far if they cannot be seen."""
    if not np.isfinite(points_px).all():
        return 10.0
    beyond = np.maximum(box[:2] - points_px, points_px - box[2:]).max()
    return max(float(beyond) / float((box[2:] - box[:2]).min()), 0.0)


def _prior(state: SolidState, camera: CameraPrior, height: HeightPrior) -> Belief:
    """Return what is known before the picture is looked at: lens, height, and that cameras are held level."""
    sigma = np.full(STATE, np.inf)
    sigma[TURN], sigma[SHIFT] = 1.0, 100.0
    sigma[LENS] = camera.focal_sigma, camera.k1_sigma
    sigma[HEIGHT] = height.sigma_m
    roll = state.view.roll_rad
    level = np.zeros(STATE)
    level[2] = -roll
    start = state.changed(level)
    information = np.diag(1.0 / sigma**2)
    information[2, 2] = 1.0 / _ROLL_SIGMA_RAD**2
    view = View(camera.camera, start.view.position_m, start.view.site_to_camera)
    return Belief(SolidState(view, height.height_m), information[:STATE, :STATE])
