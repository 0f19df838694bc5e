"""Zones in pictures: outlines in a colour of their own, and always their names."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.zones import ring_area, ring_middle
from standoff.drawing.ground_shapes import clip_to_box
from standoff.drawing.painter import Painter
from standoff.drawing.palette import Tone, bgr
from standoff.stages.sinks.frame_measurements import FrameMeasurements

_TINT = 0.14


def largest_part(parts: Sequence[FloatArray]) -> FloatArray | None:
    """Return the ring with the largest area; None where there is none."""
    areas = [(abs(ring_area(part)), k) for k, part in enumerate(parts) if len(part) > 2]
    return parts[max(areas)[1]] if areas else None


class ZoneDrawing:
    """The zones of one frame as they appear in one picture.

    Args:
        measurements: What there is.
        project: From rings on the ground to rings in the picture, empty where out of sight.
        size_px: (width, height) of the picture.
    """

    def __init__(
        self,
        measurements: FrameMeasurements,
        project: Callable[[Sequence[FloatArray]], Sequence[FloatArray]],
        size_px: tuple[int, int],
    ) -> None:
        self._high = np.array(size_px, dtype=np.float64) - 1.0
        zones = measurements.placed_zones
        projected = iter(project([ring for zone in zones for ring in zone.rings_m]) if zones else ())
        self._zones: list[tuple[str, Tone, list[list[FloatArray]]]] = [
            (
                zone.title,
                measurements.zone_tone(zone),
                [[next(projected) for _ in polygon] for polygon in zone.polygons_m],
            )
            for zone in zones
        ]

    def draw(self, painter: Painter) -> None:
        """Draw the outlines, and a tint where a hazard is open."""
        for _, tone, polygons in self._zones:
            for outer, *holes in polygons:
                if tone != "zone":
                    painter.fill(outer, bgr(tone), _TINT, [hole for hole in holes if len(hole) > 2])
                for ring in (outer, *holes):
                    if len(ring) > 1:
                        painter.cased_line(np.concatenate([ring, ring[:1]]), bgr(tone))

    def label(self, painter: Painter) -> None:
        """Write the name of each zone once into its largest visible part."""
        for title, tone, polygons in self._zones:
            parts = [clip_to_box(outer, np.zeros(2), self._high) for outer, *_ in polygons]
            part = largest_part(parts)
            if part is None:
                continue
            middle = ring_middle(part)
            spots = [middle, *(middle + (corner - middle) / 2.0 for corner in part)]
            half = np.array(painter.label_size_px(title)) / 2.0
            painter.label(title, [(float(x), float(y)) for x, y in spots - half], accent=bgr(tone))
