"""Places all over a zone, at which it is asked whether the zone is watched."""

from __future__ import annotations

from typing import Final

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.zones import Zone

_MOST: Final = 200
_TRIES: Final = 8


def zone_grid_m(zone: Zone) -> FloatArray:
    """Return (N, 2) places in a zone, site frame, a few hundred at most and evenly spread; its corners if it is thin.

    >>> square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    >>> len(zone_grid_m(Zone("yard", "no_go", [[square]]))) > 50
    True
    """
    corners = np.concatenate(zone.rings_m)
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = 10
    found: FloatArray = corners
    for _ in range(_TRIES):
        x, y = np.meshgrid(*(np.linspace(a, b, side + 2)[1:-1] for a, b in zip(low, high, strict=True)))
        grid = np.column_stack([x.ravel(), y.ravel()])
        inside = grid[zone.contains(grid)]
        found = inside if len(inside) else found
        if len(inside) >= _MOST // 4:
            break
        side *= 2
    return found[:: max(1, len(found) // _MOST)]
