"""Skins over elliptic sections: limbs, trunks, hats and boots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import trimesh

from standoff.core.homography import FloatArray

Ring = tuple[float, float, float, float]
"""Height z of a section, x of its middle, its half axes along x and y; metres."""


def even_columns(count: int) -> FloatArray:
    """Return `count` angles once around, one of them straight ahead.

    >>> even_columns(4).tolist()
    [0.0, 90.0, 180.0, 270.0]
    """
    return np.linspace(0.0, 360.0, count, endpoint=False)


def loft(
    rings: Sequence[Ring], columns_deg: FloatArray, *, squareness: float = 2.0, folds: float = 0.0
) -> trimesh.Trimesh:
    """Return the closed skin over sections from the lowest to the highest.

    The first 2 * (rings - 1) * columns faces are the sides: ring by ring, column by column, two each; the ends follow.

    Args:
        rings: From the bottom up.
        columns_deg: (C,) rising angles of the vertices of a section, counter-clockwise from x.
        squareness: Exponent of the superellipse: 2 is an ellipse, 4 nearly a box.
        folds: How far the skin bulges in and out, as a share of the radius; cloth is never smooth.
    """
    sections = np.asarray(rings, dtype=np.float64)
    angle = np.deg2rad(columns_deg)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    around /= (np.abs(around) ** squareness).sum(axis=1, keepdims=True) ** (1.0 / squareness)
    height_m = sections[:, :1]
    bulge = 1.0 + folds * (np.sin(3.0 * angle + 41.0 * height_m) + 0.7 * np.sin(5.0 * angle - 67.0 * height_m + 1.0))
    outline = np.empty((len(sections), len(angle), 3))
    outline[..., 0] = sections[:, 1:2] + sections[:, 2:3] * around[:, 0] * bulge
    outline[..., 1] = sections[:, 3:4] * around[:, 1] * bulge
    outline[..., 2] = sections[:, None, 0]
    ends = np.array([[sections[i, 1], 0.0, sections[i, 0]] for i in (0, -1)])
    vertices = np.concatenate([outline.reshape(-1, 3), ends])
    return trimesh.Trimesh(vertices, _faces(len(sections), len(angle)), process=False)


def _faces(rings: int, columns: int) -> npt.NDArray[np.int64]:
    low, column = (grid.ravel() for grid in np.mgrid[: rings - 1, :columns])
    here, beside = low * columns + column, low * columns + (column + 1) % columns
    quads = np.stack([here, beside, beside + columns, here, beside + columns, here + columns], axis=1)
    first = np.arange(columns)
    following = (first + 1) % columns
    bottom, top, upper = rings * columns, rings * columns + 1, (rings - 1) * columns
    floor = np.column_stack([np.full(columns, bottom), following, first])
    roof = np.column_stack([np.full(columns, top), upper + first, upper + following])
    return np.concatenate([quads.reshape(-1, 3), floor, roof])


def keep(solid: trimesh.Trimesh, faces: npt.NDArray[np.bool_]) -> trimesh.Trimesh:
    """Return only some faces of a solid, given as (F,) flags."""
    return trimesh.Trimesh(solid.vertices, solid.faces[faces], process=True)
