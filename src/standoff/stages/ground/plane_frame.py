"""From the site to the frame of a sloping plane, in which the ground is z = 0 and cameras are followed, and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap
from standoff.stages.ground.height_plane import HeightPlane
from standoff.stages.ground.marker_place import MarkerPlace
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid_observer import Reference

LEVEL_DEG = 2.0
"""Up to this slope what knows level ground only, the drone's telemetry and the sizes of people, is good for a plane."""


def map_in_site(ground: GroundMap, plane: HeightPlane) -> GroundMap:
    """Return a map to the plane's frame as one to the site's: horizontal metres, with what is known of the relief."""
    to_site = np.eye(3)
    to_site[:2, :2] = plane.plane_to_site[:2, :2]
    by_entries = np.eye(len(ground.covariance))
    by_entries[:9, :9] = np.kron(to_site, np.eye(3))
    return replace(
        ground,
        image_to_ground=to_site @ ground.image_to_ground,
        covariance=by_entries @ ground.covariance @ by_entries.T,
        scale_m_per_px=ground.scale_m_per_px * float(np.sqrt(np.linalg.det(to_site))),
        relief=plane.relief,
    )


def laid_reference(reference: Reference, plane: HeightPlane) -> Reference:
    """Return a reference of the plane's frame; one that stands wherever it is seen is the same in both."""
    if not reference.place_known:
        return reference
    return replace(reference, shape=ReferenceShape.from_corners(_laid(reference.shape.corners_m, plane)))


def laid_marker(place: MarkerPlace, plane: HeightPlane) -> MarkerPlace:
    """Return a marker that lies on the plane, or as high above it as it does above the ground."""
    xy_m = _laid(place.corners_m[:, :2], plane)
    return MarkerPlace(place.marker_id, np.column_stack([xy_m, place.corners_m[:, 2]]))


def _laid(corners_m: FloatArray, plane: HeightPlane) -> FloatArray:
    """Return (N, 2) a shape laid on the plane where its middle is on the site; it keeps its size and its heading."""
    middle_m = corners_m.mean(axis=0)
    left, _, right = np.linalg.svd(np.linalg.inv(plane.plane_to_site[:2, :2]))
    laid: FloatArray = plane.in_plane(middle_m[None], np.zeros(1))[:, :2] + (corners_m - middle_m) @ (left @ right).T
    return laid
