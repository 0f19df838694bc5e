"""How large an upright body on the ground appears: the box of a vertical capsule, from any side and height.

A capsule is a ball at the feet, one at the head and all between them. Its box is that of the two balls, whose outlines
are conics with tangents in closed form (Hartley and Zisserman 2004, section 8.3). Seen from a steep angle it has the
body's depth in its box, as a person has.
"""

from __future__ import annotations

import numpy as np

from standoff.core.compiled import compiled
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray

_LOWEST_SLOPE = 0.02
"""A ray that falls less than this, or rises, is taken to fall so much: the body is then too far away to fit."""


@compiled
def log_sizes(
    rotation: FloatArray,
    position_m: FloatArray,
    view_of: IntArray,
    centre: FloatArray,
    height_m: float,
    diameter_m: float,
) -> tuple[FloatArray, FloatArray]:
    """Predict the boxes of bodies that stand where the middles of observed boxes say.

    Args:
        rotation: (P, V, 3, 3) site_to_camera of V pictures under each of P hypotheses.
        position_m: (P, V, 3) of the camera, site frame.
        view_of: (N,) picture of each box.
        centre: (P, N, 2) middles of the boxes in normalised pinhole coordinates.
        height_m: Of the body.
        diameter_m: Of the body.

    Returns:
        (P, N, 2) logarithms of width and height of each box in normalised coordinates, and (P, N) the share of the
        body's height in the box's: d log(box height) / d log(body height).
    """
    hypotheses, count = centre.shape[0], centre.shape[1]
    size = np.empty((hypotheses, count, 2))
    share = np.empty((hypotheses, count))
    radius = diameter_m / 2.0
    for p in range(hypotheses):
        for k in range(count):
            turn, at = rotation[p, view_of[k]], position_m[p, view_of[k]]
            up0, up1, up2 = turn[0, 2], turn[1, 2], turn[2, 2]
            ray0, ray1 = centre[p, k, 0], centre[p, k, 1]
            # The box's middle is not quite the body's: look where the first guess appears and step back by that.
            for attempt in range(2):
                slope = max(-(up0 * ray0 + up1 * ray1 + up2), _LOWEST_SLOPE)
                depth = max(at[2] - height_m / 2.0, 0.1) / slope
                low0, high0, low1, high1 = np.inf, -np.inf, np.inf, -np.inf
                for side in (-1.0, 1.0):
                    lift = side * (height_m / 2.0 - radius)
                    c0, c1 = ray0 * depth + lift * up0, ray1 * depth + lift * up1
                    c2 = max(depth + lift * up2, 1.1 * radius)
                    inverse = 1.0 / (c2 * c2 - radius * radius)
                    reach0 = radius * np.sqrt(c0 * c0 + c2 * c2 - radius * radius) * inverse
                    reach1 = radius * np.sqrt(c1 * c1 + c2 * c2 - radius * radius) * inverse
                    low0, high0 = min(low0, c0 * c2 * inverse - reach0), max(high0, c0 * c2 * inverse + reach0)
                    low1, high1 = min(low1, c1 * c2 * inverse - reach1), max(high1, c1 * c2 * inverse + reach1)
                if attempt == 0:
                    ray0 += centre[p, k, 0] - (low0 + high0) / 2.0
                    ray1 += centre[p, k, 1] - (low1 + high1) / 2.0
            size[p, k, 0], size[p, k, 1] = np.log(high0 - low0), np.log(high1 - low1)
            upright = abs(up1 - ray1 * up2) / np.sqrt(1.0 + ray1 * ray1)
            straight = height_m * upright
            share[p, k] = straight / (straight + diameter_m * (1.0 - upright))
    return size, share
