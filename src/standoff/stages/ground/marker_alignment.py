"""Lay the drawing of a marker over its picture until they agree: all of its edges fix its corners, not the outer four.

Gauss-Newton on grey levels, the eight corner coordinates together with what light and lens do to the drawing:
contrast, brightness and its slope, and first-order changes of blur (which sharpening is, too) and of how far white
runs over into black where the picture is too bright. Measured on drawn pictures, corners were biased by 0.1 to 0.4 px
outwards on grey levels as they are coded, and by 0.02 px in linear light with these columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray

_Float32Array = npt.NDArray[np.float32]

_PATCH_SIDE_PX = 48.0
"""Larger markers are scaled down to this side: their corners are good enough, and time grows with the area."""

_CODED = np.arange(256) / 255.0
_TO_LINEAR = np.where(_CODED <= 0.04045, _CODED / 12.92, ((_CODED + 0.055) / 1.055) ** 2.4).astype(np.float32)
"""sRGB's grey levels as light: lenses and pixels mix light, not its coded levels."""

_CELL = 8
_SUPERSAMPLING = 3
_BLUR_PX = 0.7
_ROUNDS = 6
_SETTLED_PX = 0.05
_LONGEST_STEP_PX = 2.0
_QUIET_MODULES = 0.8
"""How much of the white around the marker takes part; more would meet what lies beside a narrow sheet."""

_LIGHT = 6
"""Columns that describe light and lens, before the eight of the corners."""

_UNIT = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], np.float32)
"""Lower left, lower right, upper right, upper left in the drawing, whose v goes down as rows do."""


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """A marker's corners after its drawing was laid over the picture.

    Attributes:
        corners_px: (4, 2) lower left, lower right, upper right, upper left of the upright marker.
        sigma_px: (4,) standard error of their coordinates if what the drawing left unexplained were noise,
            independent from pixel to pixel; infinite where the fit failed.
        correlation: Of the drawing with the picture inside the black border, where no dark square on a bright
            ground gets it for nothing: 1 for a perfect likeness; 0 where the fit failed.
    """

    corners_px: FloatArray
    sigma_px: FloatArray
    correlation: float


def align(gray: ImageArray, corners_px: FloatArray, pattern: BoolArray) -> Alignment:
    """Refine the corners of a marker.

    Args:
        gray: (H, W) uint8.
        corners_px: (4, 2) to about half a module, in the order of `Alignment`.
        pattern: (n, n) of `marker_pattern`.
    """
    patch, scale, offset = _cut(gray, corners_px, len(pattern))
    start = (corners_px + 0.5) * scale - 0.5 - offset
    corners, fit = start, None
    for _ in range(_ROUNDS):
        fit = _step(patch, corners, pattern)
        reach = np.abs(corners - start).max()
        if fit is None or reach > patch.shape[0] + patch.shape[1]:
            return Alignment(corners_px, np.full(4, np.inf), 0.0)
        corners = corners + np.clip(fit.corners_px, -_LONGEST_STEP_PX, _LONGEST_STEP_PX)
        if np.abs(fit.corners_px).max() < _SETTLED_PX:
            break
    assert fit is not None, "there is at least one round"
    return Alignment((corners + offset + 0.5) / scale - 0.5, fit.sigma_px / scale, fit.correlation)


def _cut(gray: ImageArray, corners_px: FloatArray, modules: int) -> tuple[_Float32Array, float, FloatArray]:
    """Return the marker and its white in linear light, (h, w) 0..1, its scale, and its first pixel, scaled."""
    side_px = float(np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1).mean())
    shrink = max(1, int(np.ceil(side_px / _PATCH_SIDE_PX)))
    margin_px = 1.5 * side_px / modules + 2.0 * shrink
    low = np.floor(np.maximum(corners_px.min(axis=0) - margin_px, 0.0) / shrink).astype(int)
    high = np.ceil((corners_px.max(axis=0) + margin_px) / shrink).astype(int)
    high = np.minimum(high, np.array(gray.shape[::-1]) // shrink)
    (left, top), (right, bottom) = low * shrink, high * shrink
    cut = _TO_LINEAR[gray[top:bottom, left:right]]
    if shrink > 1:
        cut = cv2.resize(cut, (int(high[0] - low[0]), int(high[1] - low[1])), interpolation=cv2.INTER_AREA)
    return cut, 1.0 / shrink, low.astype(np.float64)


def _drawn(pattern: BoolArray, unit_to_patch: FloatArray, shape: tuple[int, ...]) -> _Float32Array:
    """Return the marker as a slightly soft camera would show it in the patch, (h, w) 0..1."""
    sheet = np.pad(pattern, 1, constant_values=True).astype(np.float32)
    sheet = np.kron(sheet, np.ones((_CELL, _CELL), np.float32))
    per_unit = _CELL * len(pattern)
    # pixel i of the sheet has its centre at i + 0.5 cells' pixels from the sheet's edge, one module before the marker
    sheet_to_unit = np.array([[1.0, 0.0, 0.5 - _CELL], [0.0, 1.0, 0.5 - _CELL], [0.0, 0.0, per_unit]])
    half = (_SUPERSAMPLING - 1) / 2.0
    to_fine = np.array([[_SUPERSAMPLING, 0.0, half], [0.0, _SUPERSAMPLING, half], [0.0, 0.0, 1.0]])
    size = (shape[1] * _SUPERSAMPLING, shape[0] * _SUPERSAMPLING)
    fine = cv2.warpPerspective(sheet, to_fine @ unit_to_patch @ sheet_to_unit, size, borderValue=1.0)
    coarse = cv2.resize(fine, (shape[1], shape[0]), interpolation=cv2.INTER_AREA)
    drawn: _Float32Array = cv2.GaussianBlur(coarse, (0, 0), _BLUR_PX)
    return drawn


def _step(patch: _Float32Array, corners: FloatArray, pattern: BoolArray) -> Alignment | None:
    """Return by how much the corners have to move, as an Alignment; None where nothing follows from the patch."""
    unit_to_patch = cv2.getPerspectiveTransform(_UNIT, corners.astype(np.float32))
    if min(patch.shape) < 4 or not np.isfinite(unit_to_patch).all() or abs(np.linalg.det(unit_to_patch)) < 1e-9:
        return None
    unit = _unit_points(patch.shape, unit_to_patch)
    inside = np.flatnonzero((np.abs(unit - 0.5) < 0.5 + _QUIET_MODULES / len(pattern)).all(axis=1))
    if len(inside) < 4 * (_LIGHT + 8):
        return None
    unit, seen = unit[inside], patch.ravel()[inside].astype(np.float64)
    drawn = _drawn(pattern, unit_to_patch, patch.shape)
    bend = cv2.Laplacian(drawn, cv2.CV_32F)
    columns = np.empty((len(inside), _LIGHT + 8))
    columns[:, 0], columns[:, 1], columns[:, 2] = drawn.ravel()[inside], 1.0, bend.ravel()[inside]
    spread = cv2.magnitude(*_slopes(drawn))
    columns[:, 3] = spread.ravel()[inside]
    columns[:, 4:_LIGHT] = unit - 0.5
    lit = np.linalg.lstsq(columns[:, :_LIGHT].T @ columns[:, :_LIGHT], columns[:, :_LIGHT].T @ seen)[0]
    # The slopes must be those of the picture, as soft or as sharpened as it is: with others the steps are too short.
    likeness = np.float32(lit[0]) * drawn + np.float32(lit[2]) * bend + np.float32(lit[3]) * spread
    slope_x, slope_y = (slope.ravel()[inside] for slope in _slopes(likeness))
    columns[:, _LIGHT:] = -_moves(unit_to_patch, unit, slope_x, slope_y)
    coded: BoolArray = np.abs(unit - 0.5).max(axis=1) < 0.5 - 1.0 / len(pattern)
    return _solved(columns, seen, coded)


def _slopes(picture: _Float32Array) -> tuple[_Float32Array, _Float32Array]:
    along_x: _Float32Array = cv2.Sobel(picture, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)
    along_y: _Float32Array = cv2.Sobel(picture, cv2.CV_32F, 0, 1, ksize=1, scale=0.5)
    return along_x, along_y


def _unit_points(shape: tuple[int, ...], unit_to_patch: FloatArray) -> FloatArray:
    """Return where each pixel of the patch lies on the marker, (h w, 2) with the marker from 0 to 1; NaN if nowhere."""
    inverse = np.linalg.inv(unit_to_patch)
    rows = np.arange(shape[0])[:, None, None] * inverse[:, 1]
    columns = np.arange(shape[1])[:, None] * inverse[:, 0] + inverse[:, 2]
    homogeneous = (rows + columns).reshape(-1, 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit: FloatArray = homogeneous[:, :2] / homogeneous[:, 2:]
    return unit


def _moves(unit_to_patch: FloatArray, unit: FloatArray, slope_x: _Float32Array, slope_y: _Float32Array) -> FloatArray:
    """Return (N, 8): how grey levels change with a corner's x or y, in the order x y x y ... of the four corners."""
    at_corners = homography.parameter_jacobian(unit_to_patch, _UNIT.astype(np.float64))[..., :8].reshape(8, 8)
    ends = np.column_stack([unit, np.ones(len(unit))])
    mapped = ends @ unit_to_patch.T
    ends /= mapped[:, 2:]
    towards = (slope_x * mapped[:, 0] + slope_y * mapped[:, 1]) / mapped[:, 2]
    by_entry = np.hstack([slope_x[:, None] * ends, slope_y[:, None] * ends, -towards[:, None] * ends[:, :2]])
    moves: FloatArray = by_entry @ np.linalg.inv(at_corners)
    return moves


def _solved(columns: FloatArray, seen: FloatArray, coded: BoolArray) -> Alignment | None:
    """Return what least squares makes of the columns of light and of the corners; the code tells how like they are."""
    try:
        inverse = np.linalg.inv(columns.T @ columns)
    except np.linalg.LinAlgError:
        return None
    solution = inverse @ (columns.T @ seen)
    if not solution[0] > 0:
        return None
    left_over = seen - columns @ solution
    variance = left_over @ left_over / (len(seen) - len(solution))
    sigma = np.sqrt(np.maximum(np.diag(inverse), 0.0)[_LIGHT:].reshape(4, 2).mean(axis=1) * variance)
    unexplained = float((left_over[coded] ** 2).mean()) / max(float(seen[coded].var()), 1e-12)
    return Alignment(solution[_LIGHT:].reshape(4, 2), sigma, float(np.sqrt(max(1.0 - unexplained, 0.0))))
