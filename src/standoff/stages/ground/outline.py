"""The reference's outline in one picture: the paper's steps, or one of their named refinements."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray, NoGroundMap
from standoff.stages.ground.edges import Edges, between_pixels, canny, sobel_gradients
from standoff.stages.ground.lines import ransac_contours, refit, sample_pairs
from standoff.stages.ground.oriented_outline import noise_thresholds, oriented_lines
from standoff.stages.ground.params import ReferenceParams
from standoff.stages.ground.quadrilateral import (
    NO_QUADRILATERAL,
    Quadrilateral,
    quadrilateral_from_lines,
    why_implausible,
)

BOX_OUTSIDE = "the reference's box lies outside the picture"
TOO_FEW_EDGES = "too few edges in the reference's box"

_MIN_EDGES = 16
_ORIENTED_MARGIN = 0.06


class OutlineFinder:
    """Finds the reference's outline in a box; holds nothing but its settings and RANSAC's hypotheses.

    Args:
        params: Settings.
        camera: The lens to remove from edge points before lines are fitted, for pictures of this size.
        believable: Whether (4, 2) corners in undistorted pixels, a pixel or two off, could be the reference;
            only `oriented` asks, to choose between quadrilaterals.
    """

    def __init__(
        self,
        params: ReferenceParams | None = None,
        camera: Camera | None = None,
        believable: Callable[[FloatArray], bool] = lambda _: True,
    ) -> None:
        self.params = params if params is not None else ReferenceParams(method="oriented")
        self.camera = camera
        self._believable = believable
        self._pairs = sample_pairs(self.params.iterations, self.params.seed)

    def find(self, gray: ImageArray, box_xyxy_px: FloatArray) -> Quadrilateral | NoGroundMap:
        """Find the four corners.

        Args:
            gray: (H, W) the whole picture.
            box_xyxy_px: (4,) the reference's box in the picture.

        Returns:
            The outline in undistorted pixels, or why there is none that can be believed.
        """
        is_oriented = self.params.method == "oriented"
        share = self.params.box_margin
        if share is None:
            share = _ORIENTED_MARGIN if is_oriented else 0.0
        margin = share * float((box_xyxy_px[2:] - box_xyxy_px[:2]).max())
        box_xyxy_px = box_xyxy_px + np.array([-margin, -margin, margin, margin])
        found = self._find_oriented(gray, box_xyxy_px) if is_oriented else self._find_by_paper(gray, box_xyxy_px)
        if isinstance(found, NoGroundMap):
            return found
        corners_px = found.corners_px if self.camera is None else self.camera.distort(found.corners_px)
        why_not = why_implausible(found, corners_px, box_xyxy_px, self.params.min_side_support)
        return found if why_not is None else why_not

    def _find_by_paper(self, gray: ImageArray, box_xyxy_px: FloatArray) -> Quadrilateral | NoGroundMap:
        gradients = sobel_gradients(gray, box_xyxy_px)
        if gradients is None:
            return NoGroundMap(BOX_OUTSIDE)
        edges = canny(gradients, self.params.high_threshold, self.params.low_threshold).undistorted(self.camera)
        contours = ransac_contours(edges.points_px, self._pairs, self.params.inlier_px)
        if contours is None or len(edges) < _MIN_EDGES:
            return NoGroundMap(TOO_FEW_EDGES)
        if self.params.method == "paper":
            return self._joined(contours.lines, edges, self.params.corner_sigma_px)
        return self._joined(refit(edges.points_px, contours).lines, edges, None)

    def _find_oriented(self, gray: ImageArray, box_xyxy_px: FloatArray) -> Quadrilateral | NoGroundMap:
        gradients = sobel_gradients(gray, box_xyxy_px)
        if gradients is None:
            return NoGroundMap(BOX_OUTSIDE)
        edges = between_pixels(canny(gradients, *noise_thresholds(gradients)), gradients).undistorted(self.camera)
        if len(edges) < _MIN_EDGES:
            return NoGroundMap(TOO_FEW_EDGES)
        lines = oriented_lines(edges, undistorted_box(box_xyxy_px, self.camera), self._believable)
        return lines if isinstance(lines, NoGroundMap) else self._joined(lines, edges, None)

    def _joined(self, lines: FloatArray, edges: Edges, sigma_px: float | None) -> Quadrilateral | NoGroundMap:
        made = quadrilateral_from_lines(lines, edges.points_px, self.params.inlier_px, sigma_px)
        return NoGroundMap(NO_QUADRILATERAL) if made is None else made


def undistorted_box(box_xyxy_px: FloatArray, camera: Camera | None) -> FloatArray:
    """Return the box around the undistorted outline of a picture box."""
    if camera is None:
        return box_xyxy_px
    left, top, right, bottom = box_xyxy_px
    x, y = np.meshgrid([left, (left + right) / 2.0, right], [top, (top + bottom) / 2.0, bottom])
    outline = camera.undistort(np.column_stack([x.ravel(), y.ravel()]))
    known = outline[np.isfinite(outline).all(axis=1)]
    if not len(known):
        return box_xyxy_px
    return np.concatenate([known.min(axis=0), known.max(axis=0)])
