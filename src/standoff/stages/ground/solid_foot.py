"""How high a solid stands above the ground, by the line at which its sides change into ground of another hue.

Sides fade towards their foot, and a shadow's outer edge is sharper than the foot itself: brightness alone misleads. The
hue of what is in shade is the hue of what is in the sun, nearly, so the first line below the upper edges at which the
hue changes is the foot; a second change, further out, is that of the light in a shadow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import View
from standoff.core.types import ImageArray
from standoff.stages.ground.projection import project
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import HEIGHT, SolidState, facing_sides
from standoff.stages.ground.solid_choice import Found
from standoff.stages.ground.solid_fit import Belief, fit_solid
from standoff.stages.ground.solid_search import HeightPrior

_HIGHEST_M: Final = 1.5
_MOST_STEP_M, _MOST_STEP_PX = 0.03, 1.0
"""Heights are tried in steps of no more than both, the second as it is seen."""

_ALONG: Final = np.linspace(0.06, 0.94, 60)
_ACROSS_PX: Final = 1.5
"""Hue is compared so far inside and outside of a line: a compressed picture has half as many pixels of colour."""

_USUAL_M: Final = HeightPrior.unknown().height_m
_LEAST_SIDE_PX: Final = 3.0
"""A side that would look narrower than this at the usual height tells nothing."""

_LEAST_GAP_PX: Final = 2.5
"""Nearer to the upper edge it is the hue of the upper face that is compared."""

_CORRELATED_PX: Final = 6.0
_LEAST_CHANGE: Final = 40.0
"""Chi-square of two hues on the sides in sight from which a change is one."""

_LEAST_SHARE: Final = 0.3
"""A first change that is less than this of the greatest one may as well be a stain."""

_MOST_BRIGHTER: Final = 10.0
"""Standard errors by which ground may be brighter than the side that stands on it."""

_TOP_SHARE: Final = 0.5
_SIGMA_WIDTHS: Final = 0.4
"""Standard error of a peak's place, in its widths at half its height.

Chosen on the simulated clips of seeds 601 to 605 and 611 to 613.
"""

_LEAST_SIGMA_M: Final = 0.05
_MOST_SIGMA_M: Final = 0.2
_FIT_PX: Final = 5.0
_SIGMAS: Final = 3.0
_DARK: Final = 12.0
"""Grey levels that keep the hues of dark pixels, which are noise, near zero."""

_PER_CENT: Final = 100.0
_NO_HUE: Final = 128.0
_SMOOTH_PX: Final = 1.0
_MARGIN_PX: Final = 4
_NOISE: Final = 0.3


def with_foot(found: Found, gray: ImageArray, bgr: ImageArray, shape: ReferenceShape) -> Found:
    """Look for the foot of a solid of unknown height, and fit the solid again with what that says of its height.

    Args:
        found: By its edges.
        gray: (H, W).
        bgr: (H, W, 3) the same picture.
        shape: Of the solid.

    Returns:
        What was found, as it was where no foot is seen.
    """
    foot = height_by_hue(bgr, shape, found.fit.state)
    if foot is None:
        return found
    height_m, sigma_m = foot
    prior = _with_height(found.prior, height_m, sigma_m)
    fit = fit_solid(gray, shape, prior, _FIT_PX, start=_raised(found.fit.state, height_m))
    if fit is None:
        return found
    alternatives = tuple(
        _with_height(other, height_m, sigma_m)
        for other in found.alternatives
        if abs(other.state.height_m - height_m) <= _SIGMAS * np.hypot(sigma_m, _height_sigma_m(other))
    )
    return Found(fit, prior, alternatives)


def _with_height(belief: Belief, height_m: float, sigma_m: float) -> Belief:
    """Return a belief after the height was measured."""
    information = belief.information.copy()
    information[HEIGHT, HEIGHT] += sigma_m**-2
    pull = np.zeros(len(information))
    pull[HEIGHT] = (height_m - belief.state.height_m) / sigma_m**2
    change = np.asarray(np.linalg.solve(information, pull), dtype=np.float64)
    return Belief(belief.state.changed(change), information)


def _height_sigma_m(belief: Belief) -> float:
    return float(np.sqrt(np.linalg.inv(belief.information)[HEIGHT, HEIGHT]))


def _raised(state: SolidState, height_m: float) -> SolidState:
    """Return the solid with another height and its upper edges where they were."""
    view = state.view
    up_m = np.array([0.0, 0.0, height_m - state.height_m])
    return SolidState(View(view.camera, view.position_m + up_m, view.site_to_camera), height_m)


def height_by_hue(bgr: ImageArray, shape: ReferenceShape, state: SolidState) -> tuple[float, float] | None:
    """Look for the foot of the solid below its upper edges, which stay where they are.

    Args:
        bgr: (H, W, 3) the picture.
        shape: Of the solid.
        state: Where its upper edges were seen.

    Returns:
        Its height and the standard error of that, m; None where no change of hue, or no clear one, is seen.
    """
    usual_px = {
        side: float(_Side.of(shape, state, np.array([_USUAL_M]), side).gap_px[0])
        for side in np.flatnonzero(facing_sides(shape, state.view)).tolist()
    }
    sides = [side for side, gap_px in usual_px.items() if gap_px >= _LEAST_SIDE_PX]
    if not sides:
        return None
    step_m = min(_MOST_STEP_M, _MOST_STEP_PX * _USUAL_M / max(usual_px.values()))
    heights_m = np.arange(step_m, _HIGHEST_M, step_m)
    looks = [_Side.of(shape, state, heights_m, side) for side in sides]
    first = max(int(np.searchsorted(look.gap_px, _LEAST_GAP_PX)) for look in looks)
    inside = np.all([look.is_inside(bgr.shape) for look in looks], axis=0)
    # Feet that would lie outside the picture are not looked for.
    last = len(inside) if inside.all() else int(inside.argmin())
    if first >= last:
        return None
    looks = [look.between(first, last) for look in looks]
    hues = _hues(bgr, np.concatenate([look.line_px.reshape(-1, 2) for look in looks]))
    change = np.sum([hues.change_across(look) for look in looks], axis=0)
    brighter = np.max([hues.brighter_outside(look) for look in looks], axis=0)
    return _first_change(heights_m[first:last], change, brighter)


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One side of a solid, for each of some heights.

    Attributes:
        line_px: (G, S, 2) points along its foot.
        outward: (G, 2) unit vectors across the foot, away from the side.
        gap_px: (G,) how far the foot lies from the upper edge, across it.
    """

    line_px: FloatArray
    outward: FloatArray
    gap_px: FloatArray

    @classmethod
    def of(cls, shape: ReferenceShape, state: SolidState, heights_m: FloatArray, side: int) -> _Side:
        """Look at a side with the upper edges where they are: a higher solid has a lower foot."""
        start, end = shape.corners_m[side], shape.corners_m[(side + 1) % len(shape.corners_m)]
        along = start + _ALONG[:, None] * (end - start)
        places = np.empty((len(heights_m), len(along), 3))
        places[:, :, :2] = along
        places[:, :, 2] = (state.height_m - heights_m)[:, None]
        line_px = project(state.view, places.reshape(-1, 3)).reshape(len(heights_m), len(along), 2)
        upper_px = project(state.view, np.column_stack([along, np.full(len(along), state.height_m)]))
        direction = line_px[:, -1] - line_px[:, 0]
        across = np.column_stack([-direction[:, 1], direction[:, 0]]) / np.linalg.norm(direction, axis=1)[:, None]
        gap_px = ((line_px - upper_px) * across[:, None]).sum(axis=2).mean(axis=1)
        return cls(line_px, across * np.sign(gap_px)[:, None], np.abs(gap_px))

    def is_inside(self, shape: tuple[int, ...]) -> BoolArray:
        """Return (G,) whether the whole line and what is compared beside it lie in a picture (H, W, ...)."""
        with np.errstate(invalid="ignore"):
            inside = (self.line_px >= _MARGIN_PX) & (self.line_px <= np.array(shape[1::-1]) - 1.0 - _MARGIN_PX)
        return np.asarray(inside.all(axis=(1, 2)))

    def between(self, first: int, last: int) -> _Side:
        """Return it for some of the heights."""
        some = slice(first, last)
        return _Side(self.line_px[some], self.outward[some], self.gap_px[some])


@dataclass(frozen=True, slots=True, eq=False)
class _Hues:
    """The hues of a part of a picture.

    Attributes:
        values: (H, W) each of two, per cent of the brightness.
        brightness: (H, W) grey levels.
        corner_px: (2,) place of the first pixel in the picture.
    """

    values: tuple[ImageArray, ...]
    brightness: ImageArray
    corner_px: FloatArray

    def change_across(self, side: _Side) -> FloatArray:
        """Return (G,) the chi-square of the difference between the hues inside and outside of each line."""
        changes = np.array([self._change(values, side) for values in self.values])
        return np.asarray((changes**2).sum(axis=0))

    def brighter_outside(self, side: _Side) -> FloatArray:
        """Return (G,) by how many standard errors it is brighter outside of each line than inside."""
        return self._change(self.brightness, side)

    def _change(self, values: ImageArray, side: _Side) -> FloatArray:
        step = side.outward[:, None] * _ACROSS_PX
        difference = self._at(values, side.line_px + step) - self._at(values, side.line_px - step)
        middle = np.median(difference, axis=1)
        scatter = 1.4826 * np.median(np.abs(difference - middle[:, None]), axis=1) + _NOISE
        length_px = np.linalg.norm(side.line_px[:, -1] - side.line_px[:, 0], axis=1)
        independent = np.maximum(length_px / _CORRELATED_PX, 3.0)
        return np.asarray(np.sqrt(independent) * difference.mean(axis=1) / scatter)

    def _at(self, values: ImageArray, points_px: FloatArray) -> FloatArray:
        x, y = np.moveaxis((points_px - self.corner_px).astype(np.float32), -1, 0)
        return np.asarray(cv2.remap(values, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), dtype=np.float64)


def _hues(bgr: ImageArray, points_px: FloatArray) -> _Hues:
    """Return the hues around points in the picture."""
    low = np.floor(points_px.min(axis=0)).astype(int) - _MARGIN_PX
    high = np.ceil(points_px.max(axis=0)).astype(int) + _MARGIN_PX + 1
    parts = cv2.cvtColor(bgr[low[1] : high[1], low[0] : high[0]], cv2.COLOR_BGR2YCrCb).astype(np.float32)
    brightness = cv2.GaussianBlur(parts[..., 0], (0, 0), _SMOOTH_PX) + _DARK
    values = tuple(
        np.asarray(_PER_CENT * cv2.GaussianBlur(parts[..., k] - _NO_HUE, (0, 0), _SMOOTH_PX) / brightness)
        for k in (1, 2)
    )
    return _Hues(values, brightness, low.astype(np.float64))


def _first_change(heights_m: FloatArray, change: FloatArray, brighter: FloatArray) -> tuple[float, float] | None:
    """Return the middle and the width of the first peak that stands alone, unless that is a shadow's outer edge.

    A side in the shade stands in its own shadow, and one in the sun on ground in the sun: the foot is no edge of light.
    """
    for at in range(1, len(change) - 1):
        if change[at] < _LEAST_CHANGE or change[at] < change[at - 1] or change[at] < change[at + 1]:
            continue
        low = change <= _TOP_SHARE * change[at]
        before, after = np.flatnonzero(low[:at]), np.flatnonzero(low[at:])
        if not len(before) or not len(after):
            continue
        top = slice(before[-1] + 1, at + after[0])
        if change[top].max() > change[at]:
            continue
        middle_m = float(np.average(heights_m[top], weights=change[top]))
        width_m = float(heights_m[top.stop] - heights_m[top.start])
        sigma_m = max(_SIGMA_WIDTHS * width_m, _LEAST_SIGMA_M)
        if change[at] < _LEAST_SHARE * change[at:].max() or brighter[top].max() > _MOST_BRIGHTER:
            return None
        return (middle_m, sigma_m) if sigma_m <= _MOST_SIGMA_M else None
    return None
