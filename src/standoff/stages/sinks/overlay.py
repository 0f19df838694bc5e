"""Draw what was measured over the camera's picture."""

from __future__ import annotations

import math

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.outputs import ASSISTANCE
from standoff.core.types import GroundMap, ImageArray
from standoff.core.zones import NOT_PLACED
from standoff.drawing.ground_shapes import circle_outlines_px, outlines_in_sight_px
from standoff.drawing.painter import Painter
from standoff.drawing.palette import Tone, bgr
from standoff.drawing.text import TextSprites
from standoff.stages.sinks.fans import FAN_OPACITY
from standoff.stages.sinks.params import DrawParams
from standoff.stages.sinks.shade import PictureShade
from standoff.stages.sinks.sketch import Sketch
from standoff.stages.sinks.zone_drawing import ZoneDrawing

_LEGEND: tuple[tuple[Tone, str], ...] = (
    ("danger", "danger"),
    ("warning", "warning"),
    ("worker", "worker"),
    ("machine", "machine"),
    ("unknown", "unknown"),
    ("light", "dashed: not seen now"),
)
_ZONE_LEGEND: tuple[Tone, str] = ("zone", "zone")
_GRAVENESS: dict[Tone, int] = {"danger": 0, "warning": 1, "unknown": 2}


class Overlay:
    """Draw boxes, hazard circles, distance lines and labels.

    Args:
        params: What is drawn.
        text: Where text comes from; share one between everything that draws.
    """

    def __init__(self, params: DrawParams | None = None, text: TextSprites | None = None) -> None:
        self._params = params or DrawParams()
        self._text = text or TextSprites()
        self._shade = PictureShade()

    def draw(self, canvas: ImageArray, sketch: Sketch, region_px: FloatArray | None = None) -> None:
        """Draw over a picture, in place.

        Args:
            canvas: (H, W, 3) uint8 BGR, the frame, or a region of it, at any size.
            sketch: What to draw, in full-size pixels.
            region_px: (4,) left, top, right, bottom edges of the region that the canvas shows, in full-size
                pixels; the whole frame by default.
        """
        measurements = sketch.measurements
        painter = Painter(canvas, self._text, self._params.size)
        if region_px is None:
            region_px = np.array([0.0, 0.0, *measurements.size_px])
        to_canvas = _ToCanvas(canvas, region_px)
        zones = None
        self._shade.draw(canvas, sketch.cells, region_px / np.tile(measurements.size_px, 2))
        if words := measurements.unknown_words():
            _draw_banner(painter, canvas, words)
        if isinstance(measurements.ground, GroundMap):
            ground, (height, width) = measurements.ground, canvas.shape[:2]
            zones = ZoneDrawing(
                measurements,
                lambda rings_m: [to_canvas(one) for one in outlines_in_sight_px(ground, rings_m)],
                (width, height),
            )
            zones.draw(painter)
            _draw_anchors(painter, to_canvas, measurements.ground)
            if self._params.circles:
                _draw_circles(painter, to_canvas, sketch, measurements.ground)
            _draw_fans(painter, to_canvas, sketch, measurements.ground)
        _draw_boxes(painter, to_canvas, sketch)
        _draw_lines(painter, to_canvas, sketch)
        _draw_status(painter, canvas, sketch)
        if self._params.legend:
            _draw_legend(painter, canvas, (*_LEGEND, _ZONE_LEGEND) if measurements.zones else _LEGEND)
        if self._params.labels:
            _label_lines(painter, to_canvas, sketch)
            _label_boxes(painter, to_canvas, sketch)
            if zones is not None:
                zones.label(painter)


class _ToCanvas:
    """Full-size picture pixels to canvas pixels; pixel centres are whole numbers in both, edges lie half way."""

    def __init__(self, canvas: ImageArray, region_px: FloatArray) -> None:
        self._origin = region_px[:2]
        self._factor = np.array(canvas.shape[1::-1]) / (region_px[2:] - region_px[:2])

    def __call__(self, points_px: FloatArray) -> FloatArray:
        scaled: FloatArray = (np.asarray(points_px).reshape(-1, 2) - self._origin + 0.5) * self._factor - 0.5
        return scaled


def _draw_banner(painter: Painter, canvas: ImageArray, text: str) -> None:
    height, width = canvas.shape[:2]
    bar = canvas[: round(2.4 * painter.font_px)]
    bar[:] = (bar * 0.12 + np.array(bgr("danger")) * 0.7).astype(np.uint8)
    painter.reserve((0, 0, width, len(bar)))
    painter.title(text, (painter.font_px, round(0.6 * painter.font_px)))
    painter.box((1, 1, width - 2, height - 2), bgr("danger"))


def _draw_anchors(painter: Painter, to_canvas: _ToCanvas, ground: GroundMap) -> None:
    if not len(ground.anchors_px):
        return
    anchors = to_canvas(ground.anchors_px)
    if len(anchors) == 4:
        painter.cased_line(np.vstack([anchors, anchors[:1]]), bgr("reference"), dashed=ground.age_s > 0)
    for anchor in anchors.tolist():
        painter.dot(anchor, bgr("reference"), hollow=ground.age_s > 0)


def _draw_circles(painter: Painter, to_canvas: _ToCanvas, sketch: Sketch, ground: GroundMap) -> None:
    positions = sketch.measurements.positions
    outlines = circle_outlines_px(ground, positions.xy_m, positions.radius_m)
    for runs, tone, observed in zip(outlines, sketch.tones, sketch.measurements.tracks.observed, strict=True):
        for run in runs:
            outline = to_canvas(run)
            if tone in ("danger", "warning"):
                painter.fill(outline, bgr(tone), 0.16)
            painter.line(outline, bgr(tone), dashed=not observed)


def _draw_fans(painter: Painter, to_canvas: _ToCanvas, sketch: Sketch, ground: GroundMap) -> None:
    if not sketch.fans:
        return
    # All at once: a map with a lens costs by the call.
    curves_m = [curve_m for fan in sketch.fans for curve_m in (fan.outline_m, fan.path_m)]
    points_px, seen = ground.to_image(np.concatenate(curves_m))
    ends = np.cumsum([len(curve_m) for curve_m in curves_m])[:-1]
    curves_px, all_seen = np.split(to_canvas(points_px), ends), [part.all() for part in np.split(seen, ends)]
    for k, fan in enumerate(sketch.fans):
        if all_seen[2 * k] and all_seen[2 * k + 1]:
            painter.fill(curves_px[2 * k], bgr(sketch.tones[fan.row]), FAN_OPACITY)
            painter.line(curves_px[2 * k + 1], bgr(sketch.tones[fan.row]))


def _draw_boxes(painter: Painter, to_canvas: _ToCanvas, sketch: Sketch) -> None:
    tracks = sketch.measurements.tracks
    corners = to_canvas(tracks.xyxy_px).reshape(-1, 4)
    for xyxy, tone, observed in zip(corners.tolist(), sketch.tones, tracks.observed, strict=True):
        painter.box(xyxy, bgr(tone), dashed=not observed)


def _draw_lines(painter: Painter, to_canvas: _ToCanvas, sketch: Sketch) -> None:
    feet = to_canvas(sketch.feet_px)
    for line in reversed(sketch.lines):
        painter.cased_line(feet[[line.row_a, line.row_b]], bgr(line.tone), dashed=line.dashed)
    for foot, tone, observed in zip(feet.tolist(), sketch.tones, sketch.measurements.tracks.observed, strict=True):
        painter.dot(foot, bgr(tone), hollow=not observed)


def _label_lines(painter: Painter, to_canvas: _ToCanvas, sketch: Sketch) -> None:
    feet = to_canvas(sketch.feet_px).tolist()
    for line in sketch.lines:
        (x0, y0), (x1, y1) = feet[line.row_a], feet[line.row_b]
        if not painter.shows((min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))):
            continue
        width, height = painter.label_size_px(line.text, bold=True)
        along_x, along_y = x1 - x0, y1 - y0
        spots = [(x0 + share * along_x, y0 + share * along_y) for share in (0.5, 0.35, 0.65)]
        on_line = [(x - width / 2, y - height / 2) for x, y in spots]
        beside = [(x - width / 2, y + sign * 1.2 * height - height / 2) for x, y in spots for sign in (1, -1)]
        is_short = math.hypot(along_x, along_y) < 1.5 * width
        corners = beside + on_line if is_short else on_line + beside
        painter.label(line.text, corners, accent=bgr(line.tone), bold=True, optional=line.tone != "danger")


def _label_boxes(painter: Painter, to_canvas: _ToCanvas, sketch: Sketch) -> None:
    measurements, tones = sketch.measurements, sketch.tones
    corners = to_canvas(measurements.tracks.xyxy_px).reshape(-1, 4).tolist()
    remarks = measurements.zone_words(), measurements.machine_words(), measurements.around_words()
    names = [
        ", ".join([name, *(words[track] for words in remarks if track in words)])
        for track, name in measurements.names().items()
    ]
    has_map = isinstance(measurements.ground, GroundMap)
    for i in sorted(range(len(tones)), key=lambda row: _GRAVENESS.get(tones[row], len(_GRAVENESS))):
        if not painter.shows(corners[i]):
            continue
        unplaced = has_map and not measurements.positions.valid[i]
        text = f"{names[i]}: {measurements.positions.reason[i] or 'no position'}" if unplaced else names[i]
        x1, y1, x2, y2 = corners[i]
        width, height = painter.label_size_px(text)
        above, below = y1 - height - 2, y2 + 2
        places = [(x1, above), (x1, below), (x2 + 2, y1), (x1 - width - 2, y1), (x2 - width, above)]
        painter.label(text, places, accent=bgr(tones[i]), optional=tones[i] != "danger")


def _draw_status(painter: Painter, canvas: ImageArray, sketch: Sketch) -> None:
    measurements = sketch.measurements
    minutes, seconds = divmod(measurements.time_s, 60.0)
    text = f"{int(minutes):02d}:{seconds:06.3f}   frame {measurements.frame_index}"
    if isinstance(measurements.ground, GroundMap):
        age = f", {measurements.ground.age_s:.1f} s old" if measurements.ground.age_s > 0 else ""
        text += f"   map: {measurements.ground.method}{age}"
    margin = painter.font_px // 2
    top = canvas.shape[0] - painter.label_size_px(text)[1] - margin
    step = 1.3 * painter.label_size_px(text)[1]
    for line in filter(None, (text, measurements.watched_words(hatched=sketch.cells.size > 0), ASSISTANCE)):
        painter.label(line, [(margin, top)])
        top -= step
    if isinstance(measurements.ground, GroundMap) and measurements.zones and not measurements.placed_zones:
        unknown = f"ZONES UNKNOWN: {NOT_PLACED}"
        painter.label(unknown, [(margin, top)], accent=bgr("unknown"), bold=True)


def _draw_legend(painter: Painter, canvas: ImageArray, legend: tuple[tuple[Tone, str], ...]) -> None:
    margin = painter.font_px // 2
    right = canvas.shape[1] - margin
    for tone, text in reversed(legend):
        width, height = painter.label_size_px(text)
        right -= width
        painter.label(text, [(right, canvas.shape[0] - height - margin)], accent=bgr(tone))
        right -= margin // 2
