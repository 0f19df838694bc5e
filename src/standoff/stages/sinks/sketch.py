"""What is drawn of a frame, decided once for all pictures that show it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.lengths import METRES, LengthUnit
from standoff.core.types import GroundMap
from standoff.core.watched_ground import CellArray
from standoff.drawing.palette import Tone
from standoff.stages.sinks.fans import Fan, fans_of
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.pair_lines import PairLine, pair_lines
from standoff.stages.sinks.params import DrawParams


@dataclass(frozen=True, slots=True)
class Sketch:
    """A frame's measurements with the colours and lines that they are drawn with.

    Attributes:
        measurements: What was measured.
        tones: Colour of each track.
        feet_px: (M, 2) where each track stands, in full-size picture pixels.
        lines: Pairs to draw, gravest first.
        fans: What is ahead of those who move.
        unit: What lengths are said in.
        cells: Ground to hatch, as in `WatchedGround`; (0, 0): none, or the whole picture is unknown.
    """

    measurements: FrameMeasurements
    tones: list[Tone]
    feet_px: FloatArray
    lines: list[PairLine]
    fans: list[Fan]
    unit: LengthUnit
    cells: CellArray

    @classmethod
    def of(cls, measurements: FrameMeasurements, params: DrawParams, unit: LengthUnit = METRES) -> Sketch:
        """Decide what to draw."""
        feet_px = measurements.feet_px()
        fans = fans_of(measurements.positions) if params.fans else []
        lines = pair_lines(measurements, feet_px, params.line_within_m, unit)
        hatched = params.unwatched and isinstance(measurements.ground, GroundMap)
        cells = measurements.watched.cells if hatched else np.zeros((0, 0), dtype=np.int8)
        return cls(measurements, measurements.track_tones(), feet_px, lines, fans, unit, cells)
