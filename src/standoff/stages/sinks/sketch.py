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
from standoff.stages.sinks.pair_lines import PairLine, pair_lines
from standoff.stages.sinks.params import DrawParams
from standoff.stages.sinks.scene import Scene


@dataclass(frozen=True, slots=True)
class Sketch:
    """A scene with the colours and lines that it is drawn with.

    Attributes:
        scene: What was measured.
        tones: Colour of each track.
        feet_px: (M, 2) where each track stands, in full-size picture pixels.
        lines: Pairs to draw, gravest first.
        fans: What is ahead of those who move.
        unit: What lengths are said in.
        cells: Ground to hatch, as in `WatchedGround`; (0, 0): none, or the whole picture is unknown.
    """

    scene: Scene
    tones: list[Tone]
    feet_px: FloatArray
    lines: list[PairLine]
    fans: list[Fan]
    unit: LengthUnit
    cells: CellArray

    @classmethod
    def of(cls, scene: Scene, params: DrawParams, unit: LengthUnit = METRES) -> Sketch:
        """Decide what to draw."""
        feet_px = scene.feet_px()
        fans = fans_of(scene.positions) if params.fans else []
        lines = pair_lines(scene, feet_px, params.line_within_m, unit)
        hatched = params.unwatched and isinstance(scene.ground, GroundMap)
        cells = scene.watched.cells if hatched else np.zeros((0, 0), dtype=np.int8)
        return cls(scene, scene.track_tones(), feet_px, lines, fans, unit, cells)
