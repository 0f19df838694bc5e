"""What is wrong with the rings of some polygons, before anybody asks what lies inside them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.polygon import nearest_on, sides, within
from standoff.core.zones import Ring, ring_area

_LEAST_AREA_M2 = 0.01
_MOST_RINGS = 60
_TOUCHING = 1e-9
"""Of a figure's size: nearer than rounding can tell."""


def faults_of(polygons_m: Sequence[Sequence[Ring]]) -> str:
    """Return what keeps rings from being the outlines and holes of polygons, "" where nothing does.

    Args:
        polygons_m: Rings of each polygon, its outer one first, then its holes; (V, 2) each, no corner twice in a row.
    """
    rings = [ring for polygon in polygons_m for ring in polygon]
    if len(rings) > _MOST_RINGS:
        return f"{len(rings)} rings, more than {_MOST_RINGS}"
    for ring in rings:
        if len(ring) > 2 and _meets_itself(ring):
            return "a ring that crosses or touches itself"
        if len(ring) < 3 or abs(ring_area(ring)) < _LEAST_AREA_M2:
            return "a ring without an area"
    if any(_cross(sides(one), sides(other)) for k, one in enumerate(rings) for other in rings[:k]):
        return "rings that cross each other"
    for outer, *holes in polygons_m:
        if not all(_lies_in(hole, [outer]) for hole in holes):
            return "a hole outside its polygon"
        if any(_lies_in(one, [other]) for one in holes for other in holes if one is not other):
            return "a hole in a hole"
    nested = (_lies_in(one[0], other) for one in polygons_m for other in polygons_m if one is not other)
    return "a polygon in another" if any(nested) else ""


def _meets_itself(ring: Ring) -> bool:
    """Tell whether two sides have more in common than the corner between neighbours."""
    one, count = sides(ring), len(ring)
    from_middle = one - ring.mean(axis=0)
    meets = _meet(from_middle)
    near = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    meets[(near <= 1) | (near == count - 1)] = False
    along = one[:, 1] - one[:, 0]
    turned = np.roll(along, -1, axis=0)
    back = (_crossed(along, turned) == 0) & ((along * turned).sum(axis=1) < 0)
    return bool(meets.any() or back.any())


def _meet(outline: FloatArray) -> BoolArray:
    """Tell (E, E) which sides have a point in common, touching included."""
    start, end = outline[:, None, 0], outline[:, None, 1]
    across = _crossed(end - start, outline[None, :, 0] - start), _crossed(end - start, outline[None, :, 1] - start)
    apart = across[0] * across[1] > 0
    low, high = outline.min(axis=1), outline.max(axis=1)
    overlap = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    return np.asarray(~apart & ~apart.T & overlap)


def _cross(one: FloatArray, other: FloatArray) -> bool:
    """Tell whether any sides of two outlines (E, 2, 2) go through each other."""
    return bool((_parts(one, other) & _parts(other, one).T).any())


def _parts(one: FloatArray, other: FloatArray) -> BoolArray:
    """Tell (E, F) whether the line along each side of one keeps the ends of each side of the other apart."""
    start, along = one[:, None, 0], one[:, None, 1] - one[:, None, 0]
    scale = np.linalg.norm(along, axis=2) * _TOUCHING * np.abs(one - one[0, 0]).max()
    first, second = _crossed(along, other[None, :, 0] - start), _crossed(along, other[None, :, 1] - start)
    return np.asarray((first > scale) & (second < -scale) | (first < -scale) & (second > scale))


def _lies_in(ring: Ring, polygon: Sequence[Ring]) -> bool:
    """Tell whether a ring that crosses none of a polygon's lies in it."""
    outline = np.concatenate([sides(one) for one in polygon])
    corners = np.concatenate([ring, sides(ring).mean(axis=1)])
    # A corner may lie on the other's outline, where neither is the answer.
    furthest = corners[nearest_on(outline, corners)[0].argmax()]
    return bool(within(outline, furthest[None])[0])


def _crossed(one: FloatArray, other: FloatArray) -> FloatArray:
    crossed: FloatArray = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return crossed
