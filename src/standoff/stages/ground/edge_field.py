"""The nearest edge point that runs a given way, looked up for many places at once."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff.stages.ground.edges import Edges

_DIRECTIONS = 16
_AGREE_RAD = np.deg2rad(17.0)
"""An edge point counts for all directions within this angle of its own: one and a half steps between directions."""

_CELLS = 160
"""Along the box's longer side at most: so a box of any size costs the same."""

_BEYOND = 0.25
"""The table goes this share of the box's longer side beyond the box, for outlines that begin too large."""


class EdgeField:
    """A table of the nearest edge points of a box, by place and direction.

    Args:
        edges: Of the box.
        box_xyxy_px: (4,) in the same pixels as the edges.

    Attributes:
        cell_px: Size of the table's cells; never less than a pixel.

    Source:
        Liu, Tuzel, Veeraraghavan and Chellappa, Fast directional chamfer matching, 2010.
    """

    def __init__(self, edges: Edges, box_xyxy_px: FloatArray) -> None:
        size = box_xyxy_px[2:] - box_xyxy_px[:2]
        self.cell_px = max(1.0, float(size.max()) / _CELLS)
        self._origin = box_xyxy_px[:2] - _BEYOND * size.max()
        columns, rows = np.ceil((size + 2.0 * _BEYOND * size.max()) / self.cell_px).astype(int) + 1
        cells = np.rint((edges.points_px - self._origin) / self.cell_px).astype(np.int64)
        within = (cells >= 0).all(axis=1) & (cells < (columns, rows)).all(axis=1)
        cells, points = cells[within], edges.points_px[within]
        # An edge runs across its gradient; which side of it is the brighter one plays no part.
        angle = np.arctan2(edges.gradient[within, 1], edges.gradient[within, 0]) + np.pi / 2.0
        self._nearest = np.full((_DIRECTIONS, rows, columns, 2), np.inf, dtype=np.float32)
        for k in range(_DIRECTIONS):
            off = np.abs(np.mod(angle - k * np.pi / _DIRECTIONS + np.pi / 2.0, np.pi) - np.pi / 2.0)
            mine = np.flatnonzero(off < _AGREE_RAD)
            if len(mine):
                free = np.ones((rows, columns), dtype=np.uint8)
                free[cells[mine, 1], cells[mine, 0]] = 0
                _, label = cv2.distanceTransformWithLabels(free, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
                of_label = np.zeros((int(label.max()) + 1, 2), dtype=np.float32)
                of_label[label[cells[mine, 1], cells[mine, 0]]] = points[mine]
                self._nearest[k] = of_label[label]

    def offsets(self, points_px: FloatArray, angle_rad: FloatArray) -> FloatArray:
        """Return how far away the nearest edge points are that run a given way.

        Args:
            points_px: (..., 2) places; NaN where there is none.
            angle_rad: (...) direction in which the edge runs, from the x axis to the y axis; either way along it.

        Returns:
            (..., 2) px; inf outside the table and where no edge runs that way.
        """
        _, rows, columns, _ = self._nearest.shape
        places = np.nan_to_num((points_px - self._origin) / self.cell_px, nan=-1.0, posinf=-1.0, neginf=-1.0)
        column, row = np.moveaxis(np.rint(places.clip(-1, max(rows, columns))).astype(np.int64), -1, 0)
        outside = (column < 0) | (row < 0) | (column >= columns) | (row >= rows)
        direction = np.rint(np.nan_to_num(angle_rad) * (_DIRECTIONS / np.pi)).astype(np.int64) % _DIRECTIONS
        nearest = self._nearest[direction, np.where(outside, 0, row), np.where(outside, 0, column)]
        offsets: FloatArray = np.where(outside[..., None], np.inf, nearest - np.nan_to_num(points_px))
        return offsets
