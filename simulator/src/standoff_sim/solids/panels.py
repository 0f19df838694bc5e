"""Meshes from loose flat quadrilaterals: facades, roofs, streets, leaves, the sides of bars."""

from __future__ import annotations

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.solids.mesh import Colour, Mesh, Surface


def panels(
    corners_m: FloatArray, colour: Colour | FloatArray | None, surface: Surface = Surface.CONCRETE,
    tintable: float = 0.0,
) -> Mesh:  # fmt: skip
    """Return flat quadrilaterals, each seen from one side.

    Args:
        corners_m: (N, 4, 3), counter-clockwise from outside; two corners may fall together.
        colour: Linear albedo of all, or (N, 3); None: the tint alone.
        surface: Of all.
        tintable: Of all that have a colour.
    """
    corners = np.asarray(corners_m, dtype=np.float64).reshape(-1, 4, 3)
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first = 4 * np.arange(len(corners), dtype=np.uint32)[:, None, None]
    triangles = (first + np.array([[[0, 1, 2], [0, 2, 3]]], dtype=np.uint32)).reshape(-1, 3)
    own = (1.0, 1.0, 1.0) if colour is None else colour
    colours = np.broadcast_to(np.asarray(own, dtype=np.float32), (len(corners), 3))
    return Mesh(
        corners.reshape(-1, 3).astype(np.float32),
        np.repeat(normals, 4, axis=0).astype(np.float32),
        np.repeat(colours, 4, axis=0).astype(np.float32),
        np.full(4 * len(corners), 1.0 if colour is None else tintable, dtype=np.float32),
        np.full(4 * len(corners), surface, dtype=np.uint8),
        triangles,
    )


def upright(start_m: FloatArray, width_m: FloatArray, low_m: FloatArray, high_m: FloatArray) -> FloatArray:
    """Return (N, 4, 3) upright rectangles from places on the ground, facing right of their direction.

    Args:
        start_m: (N, 2) lower left corner as seen from outside.
        width_m: (N, 2) from there to the lower right one.
        low_m: (N,) height of the lower edge.
        high_m: (N,) height of the upper edge.
    """
    low, high = np.asarray(low_m)[:, None], np.asarray(high_m)[:, None]
    end = start_m + width_m
    return np.stack(
        [np.hstack([start_m, low]), np.hstack([end, low]), np.hstack([end, high]), np.hstack([start_m, high])], axis=1
    )


def level(west_m: float, south_m: float, east_m: float, north_m: float, height_m: float) -> FloatArray:
    """Return (1, 4, 3), a horizontal rectangle seen from above.

    >>> level(0.0, 0.0, 2.0, 1.0, 0.5)[0, 2].tolist()
    [2.0, 1.0, 0.5]
    """
    return np.array(
        [[[west_m, south_m, height_m], [east_m, south_m, height_m], [east_m, north_m, height_m],
          [west_m, north_m, height_m]]]
    )  # fmt: skip
