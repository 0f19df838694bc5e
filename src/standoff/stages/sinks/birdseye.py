"""The panel beside the camera's picture: the ground from above, with a scale bar."""

from __future__ import annotations

import cv2
import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.lengths import LengthUnit
from standoff.core.types import GroundMap, ImageArray, NoGroundMap
from standoff.drawing.ground_window import GroundWindow, camera_up, rectify, seen_ground_m, window_around
from standoff.drawing.painter import Painter
from standoff.drawing.palette import bgr
from standoff.drawing.text import TextSprites
from standoff.stages.sinks.fans import FAN_OPACITY
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.params import DrawParams
from standoff.stages.sinks.shade import GroundShade, diagonals
from standoff.stages.sinks.sketch import Sketch
from standoff.stages.sinks.zone_drawing import ZoneDrawing

_OUTSIDE_FOR_S = 2.0
_DIMMED = 0.72
_ANGLES = np.linspace(0.0, 2.0 * np.pi, 49)
_CIRCLE = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])


class BirdsEye:
    """Draw the rectified picture; its window stays where it is until a track has been outside for two seconds.

    Args:
        size_px: (width, height) of the panel.
        params: What is drawn.
        text: Where text comes from; share one between everything that draws.
    """

    def __init__(
        self, size_px: tuple[int, int], params: DrawParams | None = None, text: TextSprites | None = None
    ) -> None:
        self._params = params or DrawParams()
        self._text = text or TextSprites()
        self._backdrop = _hatched(size_px)
        self._shade = GroundShade(size_px)
        self._window: GroundWindow | None = None
        self._all_inside_at_s = -np.inf

    def draw(self, panel: ImageArray, picture: ImageArray, sketch: Sketch) -> None:
        """Draw one frame's panel.

        Args:
            panel: (height, width, 3) uint8 BGR, written to.
            picture: The frame at any size, without drawings.
            sketch: What to draw.
        """
        measurements = sketch.measurements
        panel[:] = self._backdrop
        painter = Painter(panel, self._text, self._params.size)
        if isinstance(measurements.ground, NoGroundMap):
            _write_centred(painter, panel, ("NO GROUND MAP", measurements.ground.reason))
            return
        self._choose_window(measurements, measurements.ground)
        if self._window is None:
            _write_centred(painter, panel, ("NO GROUND IN SIGHT",))
            return
        rectify(picture, measurements.ground, self._window, panel)
        cv2.convertScaleAbs(panel, dst=panel, alpha=_DIMMED)
        self._shade.draw(panel, sketch.cells, measurements.ground, self._window)
        _draw_axes(painter, self._window)
        _draw_scale_bar(painter, panel, self._window, sketch.unit)
        window = self._window
        zones = ZoneDrawing(measurements, lambda rings_m: [window.to_window(ring) for ring in rings_m], window.size_px)
        zones.draw(painter)
        self._draw_entities(painter, sketch, window)
        if self._params.labels:
            zones.label(painter)

    def _choose_window(self, measurements: FrameMeasurements, ground: GroundMap) -> None:
        placed = measurements.positions.xy_m[measurements.positions.valid]
        if self._window is not None:
            if self._window.covers(placed).all():
                self._all_inside_at_s = measurements.time_s
            if measurements.time_s - self._all_inside_at_s <= _OUTSIDE_FOR_S:
                return
        points = np.vstack([placed, seen_ground_m(ground)])
        if len(points):
            height, width = self._backdrop.shape[:2]
            self._window = window_around(points, (width, height), camera_up(ground), margin_m=6.0)
            self._all_inside_at_s = measurements.time_s

    def _draw_entities(self, painter: Painter, sketch: Sketch, window: GroundWindow) -> None:
        at = window.to_window(sketch.measurements.positions.xy_m)
        placed = sketch.measurements.positions.valid
        radii_px = sketch.measurements.positions.radius_m / window.m_per_px
        observed = sketch.measurements.tracks.observed
        if self._params.circles:
            for i in np.flatnonzero(placed).tolist():
                outline = at[i] + radii_px[i] * _CIRCLE
                if sketch.tones[i] in ("danger", "warning"):
                    painter.fill(outline, bgr(sketch.tones[i]), 0.2)
                painter.line(outline, bgr(sketch.tones[i]), dashed=not observed[i])
        for fan in sketch.fans:
            painter.fill(window.to_window(fan.outline_m), bgr(sketch.tones[fan.row]), FAN_OPACITY)
            painter.line(window.to_window(fan.path_m), bgr(sketch.tones[fan.row]))
        for line in reversed(sketch.lines):
            ends = [line.row_a, line.row_b]
            if placed[ends].all():
                painter.cased_line(at[ends], bgr(line.tone), dashed=line.dashed)
        for i in np.flatnonzero(placed).tolist():
            painter.dot(at[i].tolist(), bgr(sketch.tones[i]), hollow=not observed[i])
        if self._params.labels:
            _label_dots(painter, sketch, at, placed)


def _label_dots(painter: Painter, sketch: Sketch, at_px: FloatArray, placed: BoolArray) -> None:
    for i in np.flatnonzero(placed).tolist():
        text = str(sketch.measurements.tracks.track_id[i])
        width, height = painter.label_size_px(text)
        x, y = at_px[i].tolist()
        gap = 6 + 2 * painter.stroke_px
        corners = [(x + gap, y - height / 2), (x - gap - width, y - height / 2), (x - width / 2, y + gap)]
        if painter.shows((x, y, x, y)):
            painter.label(text, corners, accent=bgr(sketch.tones[i]), optional=True)


def _hatched(size_px: tuple[int, int]) -> ImageArray:
    """Return the ground that no camera sees: dark grey with thin diagonals."""
    stripes = diagonals(size_px)[:, :, None] > 0
    return np.where(stripes, (50, 45, 41), (35, 31, 28)).astype(np.uint8)


def _write_centred(painter: Painter, panel: ImageArray, lines: tuple[str, ...]) -> None:
    height, width = panel.shape[:2]
    for row, text in enumerate(lines):
        text_width, text_height = painter.label_size_px(text, bold=row == 0)
        corner = ((width - text_width) / 2, height / 2 + (row - len(lines) / 2) * 1.3 * text_height)
        painter.label(text, [corner], accent=bgr("danger") if row == 0 else None, bold=row == 0)


def _draw_scale_bar(painter: Painter, panel: ImageArray, window: GroundWindow, unit: LengthUnit) -> None:
    height, width = panel.shape[:2]
    length_m, text = unit.bar(0.4 * width * window.m_per_px)
    margin = painter.font_px
    left, right, bottom = margin, margin + length_m / window.m_per_px, height - margin
    tick = painter.font_px / 3
    bar = np.array([[left, bottom - tick], [left, bottom], [right, bottom], [right, bottom - tick]])
    painter.cased_line(bar, bgr("light"))
    painter.label(text, [(left, bottom - tick - painter.label_size_px("0")[1] - 3)])


def _draw_axes(painter: Painter, window: GroundWindow) -> None:
    """Show where the site frame's x and y point, because the window is turned to the camera's view."""
    arm = 2.2 * painter.font_px
    corner = np.array([1.6 * arm, 1.6 * arm])
    for axis, name in enumerate("xy"):
        direction = window.ground_to_window[:2, axis] * window.m_per_px
        tip = corner + arm * direction
        painter.cased_line(np.vstack([corner, tip]), bgr("light"))
        width, height = painter.label_size_px(name)
        painter.label(name, [tuple(tip + 0.55 * painter.font_px * direction - (width / 2, height / 2))])
