"""Where clutter lies: rows of stores, heaps around the work, things along the fence, and strays.

Free ground is a raster. A thing takes the rectangle that its meshes cover, so that long things lie close together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import shapely

from standoff.core.homography import FloatArray
from standoff.simulation.mesh import Mesh
from standoff.simulation.props.prop import Prop
from standoff.simulation.scene import Batch, Ground

_CELL_M = 0.2
_MARGIN_M = 0.25
"""Half a cell's diagonal for the raster and as much for the samples: true rectangles never overlap."""
_TALL_M = 1.2
"""Lower things lean with the ground they lie on; taller ones stand upright and sink in."""
_STEEPEST = 0.22
_ZONE_SHARES = (0.4, 0.4, 0.12, 0.08)
_TRIES = 6


@dataclass(frozen=True, slots=True)
class _Spot:
    """A proposal: which prop, where, in which direction."""

    prop: int
    xy_m: tuple[float, float]
    turn_rad: float


def lay_out(
    rng: np.random.Generator, props: Sequence[Prop], density: float, keep_clear: Sequence[shapely.Polygon],
    extent_m: tuple[float, float, float, float], ground: Ground,
) -> tuple[Batch, ...]:  # fmt: skip
    """Strew props over a site.

    Args:
        rng: Decides everything.
        props: To choose from, by weight.
        density: Share 0..1 of the free ground that things shall cover; 0.3 is a crowded site.
        keep_clear: Nothing comes into these: paths of actors, the reference object (site frame).
        extent_m: West, south, east, north of the area.
        ground: Things stand on it.

    Returns:
        One batch for each mesh, poses in the site frame.
    """
    yard = _Yard(extent_m, keep_clear)
    wanted_m2 = density * yard.free_m2()
    pieces: list[tuple[Batch, FloatArray]] = []
    for spot in _proposals(rng, props, extent_m, wanted_m2):
        if yard.taken_m2 >= wanted_m2:
            break
        batches = props[spot.prop].make(rng)
        low, high, top_m = _bounds(batches)
        corners = _turned(np.array([low, (high[0], low[1]), high, (low[0], high[1])]), spot)
        if not yard.free(corners):
            continue
        pose = _stand(spot, corners, top_m, ground)
        if pose is None:
            continue
        yard.take(corners)
        pieces += [(batch, pose) for batch in batches]
    return _merged(pieces)
