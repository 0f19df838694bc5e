"""Edges inside the reference object's box: the paper's Canny operator.

Gaussian 7 x 7 with sigma 1, Sobel, non-maximum suppression, hysteresis with thresholds that are fractions of
the largest gradient in the box (paper, section 5.1). The picture around the box is used for the filters'
margins only, so that the box's own border makes no edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.camera import Camera
from standoff.core.compiled import compiled
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray

_FILTER_MARGIN_PX = 5
"""Three pixels of Gaussian, one of Sobel, one of non-maximum suppression."""

_FIXED_POINT = 16.0
"""OpenCV's Canny takes 16-bit gradients; 16 x 1020, the steepest Sobel response, still fits."""

_MAX_SHIFT_PX = 0.7
"""Half a pixel's diagonal: further away another pixel would have been the maximum."""


@dataclass(frozen=True, slots=True, eq=False)
class Gradients:
    """Smoothed gradient of the picture in a box and one pixel around it.

    Attributes:
        dx: (H, W) Sobel response, grey levels times 8 per pixel, positive where it gets brighter to the right.
        dy: (H, W), positive where it gets brighter downwards.
        left_px: Picture column of `dx[:, 0]`.
        top_px: Picture row of `dx[0]`.
    """

    dx: FloatArray
    dy: FloatArray
    left_px: int
    top_px: int


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Edge points of one box.

    Attributes:
        points_px: (N, 2) in picture coordinates, row by row from the top.
        gradient: (N, 2) Sobel response there, pointing to the brighter side.
    """

    points_px: FloatArray
    gradient: FloatArray

    def __len__(self) -> int:
        return len(self.points_px)

    def __getitem__(self, mask: BoolArray) -> Edges:
        return Edges(self.points_px[mask], self.gradient[mask])

    @property
    def direction(self) -> FloatArray:
        """(N, 2) unit vectors across the edge, towards its brighter side."""
        unit: FloatArray = self.gradient / np.linalg.norm(self.gradient, axis=1)[:, None]
        return unit

    def undistorted(self, camera: Camera | None) -> Edges:
        """Return the points as an ideal pinhole camera would see them, where straight edges are straight.

        Only a fisheye turns the gradients: other lenses do so by far less than their noise.
        """
        if camera is None:
            return self
        points = camera.undistort(self.points_px)
        known = np.isfinite(points).all(axis=1)
        points, gradient = points[known], self.gradient[known]
        if camera.lens == "fisheye":
            gradient = _straightened(gradient, points, camera)
        return Edges(points, gradient)


def _straightened(gradient: FloatArray, points_px: FloatArray, camera: Camera) -> FloatArray:
    """Return gradients (N, 2) as an ideal pinhole camera would see them, as strong as they are.

    Args:
        gradient: As seen through the lens.
        points_px: (N, 2) where, undistorted.
        camera: The lens.
    """
    focal = np.diag(camera.matrix)[:2]
    _, bent_by_straight = camera.distorted_with_jacobian((points_px - camera.matrix[:2, 2]) / focal)
    turned = ((gradient * focal)[:, None] @ bent_by_straight)[:, 0] / focal
    strength = np.linalg.norm(gradient, axis=1, keepdims=True) / np.linalg.norm(turned, axis=1, keepdims=True)
    straightened: FloatArray = turned * strength
    return straightened


def sobel_gradients(gray: ImageArray, box_xyxy_px: FloatArray) -> Gradients | None:
    """Smooth and differentiate the pixels of a box.

    Args:
        gray: (H, W) the whole picture.
        box_xyxy_px: (4,) left, top, right, bottom in picture coordinates; clipped to the picture.

    Returns:
        The gradients, or None if fewer than three rows or columns of the box lie in the picture.

    Source:
        Paper, section 5.1, edge detection.
    """
    height, width = gray.shape
    left, top = np.maximum(np.ceil(box_xyxy_px[:2]), 1).astype(int)
    right, bottom = np.minimum(np.floor(box_xyxy_px[2:]), (width - 2, height - 2)).astype(int)
    if right - left < 2 or bottom - top < 2:
        return None
    x0, y0 = max(left - _FILTER_MARGIN_PX, 0), max(top - _FILTER_MARGIN_PX, 0)
    crop = gray[y0 : bottom + _FILTER_MARGIN_PX + 1, x0 : right + _FILTER_MARGIN_PX + 1].astype(np.float32)
    smooth = cv2.GaussianBlur(crop, (7, 7), 1.0, borderType=cv2.BORDER_REPLICATE)
    inner = (slice(top - 1 - y0, bottom + 2 - y0), slice(left - 1 - x0, right + 2 - x0))
    dx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, borderType=cv2.BORDER_REPLICATE)[inner]
    dy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, borderType=cv2.BORDER_REPLICATE)[inner]
    return Gradients(np.ascontiguousarray(dx), np.ascontiguousarray(dy), int(left) - 1, int(top) - 1)


def canny(gradients: Gradients, high: float, low: float) -> Edges:
    """Thin the gradients to lines one pixel wide and keep those that hang together with a strong one.

    Args:
        gradients: Of the box.
        high: Points at least this fraction of the largest gradient in the box start an edge.
        low: Points at least this fraction continue it.

    Returns:
        Edge points at pixel centres, inside the box.

    Source:
        Paper, section 5.1; the thresholds 0.6 and 0.24 are read as fractions of the largest gradient.
    """
    dx, dy = gradients.dx, gradients.dy
    largest = float(cv2.magnitude(dx, dy)[1:-1, 1:-1].max()) * _FIXED_POINT
    if largest == 0.0:
        return Edges(np.zeros((0, 2)), np.zeros((0, 2)))
    fixed_x, fixed_y = (np.rint(component * _FIXED_POINT).astype(np.int16) for component in (dx, dy))
    thin = cv2.Canny(fixed_x, fixed_y, low * largest, high * largest, L2gradient=True)[1:-1, 1:-1]
    rows, columns = np.nonzero(thin > 0)
    rows, columns = rows + 1, columns + 1
    points = np.column_stack([columns + gradients.left_px, rows + gradients.top_px]).astype(np.float64)
    return Edges(points, np.column_stack([dx[rows, columns], dy[rows, columns]]).astype(np.float64))


def between_pixels(edges: Edges, gradients: Gradients) -> Edges:
    """Move each edge point along its gradient to the top of a parabola through the gradient's magnitude.

    Args:
        edges: From `canny`, at pixel centres.
        gradients: The same that `canny` was given.

    Source:
        Devernay, "A non-maxima suppression method for edge detection with sub-pixel accuracy", 1995.
    """
    if not len(edges):
        return edges
    magnitude = cv2.magnitude(gradients.dx, gradients.dy)
    direction = edges.direction
    shift = _shifts_to_top(magnitude, edges.points_px - (gradients.left_px, gradients.top_px), direction)
    return Edges(edges.points_px + shift[:, None] * direction, edges.gradient)


@compiled
def _shifts_to_top(magnitude: npt.NDArray[np.float32], points: FloatArray, direction: FloatArray) -> FloatArray:
    """Return (N,) how far along their (N, 2) directions the parabola through each point and one px around it peaks."""
    shifts = np.zeros(len(points))
    for k in range(len(points)):
        x, y, step_x, step_y = points[k, 0], points[k, 1], direction[k, 0], direction[k, 1]
        before, after = interpolated(magnitude, x - step_x, y - step_y), interpolated(magnitude, x + step_x, y + step_y)
        bend = before + after - 2.0 * interpolated(magnitude, x, y)
        if bend < 0:
            shifts[k] = min(max((before - after) / (2.0 * bend), -_MAX_SHIFT_PX), _MAX_SHIFT_PX)
    return shifts


@compiled
def interpolated(values: npt.NDArray[np.float32], x: float, y: float) -> float:
    """Return a picture's value between its pixels; the point lies on the picture."""
    column, row = min(int(x), values.shape[1] - 2), min(int(y), values.shape[0] - 2)
    right, down = x - column, y - row
    above = values[row, column] * (1.0 - right) + values[row, column + 1] * right
    below = values[row + 1, column] * (1.0 - right) + values[row + 1, column + 1] * right
    value: float = above * (1.0 - down) + below * down
    return value
