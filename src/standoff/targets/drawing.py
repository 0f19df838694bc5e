"""Draw a target, whole or through the window of one sheet, in millimetres on a page."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, PathPatch, Polygon, Rectangle
from matplotlib.transforms import Affine2D

from standoff.targets.outline import black_outline
from standoff.targets.sheet import Target

INK, NOTE, FAINT = "#000000", "#303030", "#808080"
BAR_MM = 100.0
_INCH_MM = 25.4
_NOTE_LARGEST_MM = 24.0


def page(width_mm: float, height_mm: float) -> tuple[Figure, Axes]:
    """Return a page of an exact size, and axes over all of it whose units are millimetres."""
    figure = Figure(figsize=(width_mm / _INCH_MM, height_mm / _INCH_MM))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, width_mm)
    axes.set_ylim(0.0, height_mm)
    return figure, axes


def points(height_mm: float) -> float:
    """Return the font size of lines of that height."""
    return height_mm * 72.0 / _INCH_MM


@dataclass
class _Pen:
    """Draws in a target's own millimetres somewhere on a page, at some scale, inside a window."""

    axes: Axes
    offset_mm: tuple[float, float]
    scale: float
    clip: Rectangle | None
    drawn: list[Artist] = field(default_factory=list)

    def add(self, artist: Artist) -> None:
        if self.clip is not None:
            artist.set_clip_path(self.clip)

    def at(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        return self.offset_mm[0] + x_mm * self.scale, self.offset_mm[1] + y_mm * self.scale

    def text(self, x_mm: float, y_mm: float, words: str, height_mm: float, turn_deg: float = 0.0) -> None:
        size = points(height_mm * self.scale)
        self.add(
            self.axes.text(
                *self.at(x_mm, y_mm), words, fontsize=size, color=NOTE, ha="center", va="center", rotation=turn_deg,
                rotation_mode="anchor", clip_on=True,
            )
        )  # fmt: skip

    def polygon(self, corners_mm: list[tuple[float, float]], colour: str = NOTE) -> None:
        self.add(
            self.axes.add_patch(Polygon([self.at(*one) for one in corners_mm], closed=True, fc=colour, ec="none", lw=0))
        )


def draw_target(
    axes: Axes, target: Target, offset_mm: tuple[float, float], scale: float = 1.0, clip: Rectangle | None = None
) -> None:
    """Draw a target with its notes.

    Args:
        axes: In millimetres.
        target: What to draw.
        offset_mm: Where its lower left corner comes to lie.
        scale: Of everything.
        clip: Nothing is drawn outside it.
    """
    pen = _Pen(axes, offset_mm, scale, clip)
    place = Affine2D().scale(target.module_mm).translate(target.edge_mm, target.edge_mm).scale(scale)
    shape = place.translate(*offset_mm).transform_path(black_outline(target.pattern))
    pen.add(axes.add_patch(PathPatch(shape, facecolor=INK, edgecolor="none", linewidth=0)))
    _draw_corner_numbers(pen, target)
    _draw_arrows(pen, target)
    _draw_words(pen, target)


def _draw_corner_numbers(pen: _Pen, target: Target) -> None:
    """Number the corners in the strip; the first is a filled disc, so that it can be told from afar."""
    middle, far = target.strip_mm / 2.0, target.whole_mm - target.strip_mm / 2.0
    radius = min(0.4 * target.strip_mm, 0.8 * _NOTE_LARGEST_MM)
    for number, (x, y) in enumerate(((middle, middle), (far, middle), (far, far), (middle, far))):
        first = number == 0
        ring = Circle(
            pen.at(x, y), radius * pen.scale, facecolor=NOTE if first else "white", edgecolor=NOTE, linewidth=0.8
        )
        pen.add(pen.axes.add_patch(ring))
        size = points(1.3 * radius * pen.scale)
        colour = "white" if first else NOTE
        label = pen.axes.text(
            *pen.at(x, y), str(number), fontsize=size, color=colour, ha="center", va="center_baseline", clip_on=True
        )
        pen.add(label)


def _draw_arrows(pen: _Pen, target: Target) -> None:
    """Draw the site's x axis from corner 0 along the lower strip, and y along the left one."""
    middle, strip = target.strip_mm / 2.0, target.strip_mm
    start, end = 1.4 * strip, 0.36 * target.whole_mm
    half, head = min(0.05 * strip, 2.5), min(0.22 * strip, 9.0)
    shaft = [(start, -half), (end - 2 * head, -half), (end - 2 * head, -head), (end, 0.0)]
    shaft += [(x, -y) for x, y in reversed(shaft[:-1])]
    note = min(0.5 * strip, _NOTE_LARGEST_MM)
    pen.polygon([(x, middle + y) for x, y in shaft])
    pen.polygon([(middle + y, x) for x, y in shaft])
    pen.text(end + note, middle, "x", note)
    pen.text(middle, end + note, "y", note)


def _draw_words(pen: _Pen, target: Target) -> None:
    """Say in the upper strip what this is, and in the right one how its side is measured."""
    strip, whole = target.strip_mm, target.whole_mm
    note = min(0.34 * strip, _NOTE_LARGEST_MM, 0.026 * whole)
    what = f"standoff target   {target.family}   id {target.marker_id}   black square {target.size_m:.3f} m"
    pen.text(whole / 2.0, whole - strip / 2.0, what, note)
    pen.text(
        whole - strip / 2.0, whole / 2.0,
        f"{target.size_m:.3f} m = outer edge to outer edge of the black square", min(note, 0.026 * whole), 90.0,
    )  # fmt: skip


def draw_bar(axes: Axes, x_mm: float, y_mm: float, words: str, height_mm: float = 2.6) -> None:
    """Draw the bar that tells whether the printer kept the size: 10 cm in ten parts, words to its right."""
    for index in range(10):
        left = x_mm + index * BAR_MM / 10.0
        fill = INK if index % 2 == 0 else "white"
        axes.add_patch(Rectangle((left, y_mm), BAR_MM / 10.0, 2.0, facecolor=fill, edgecolor="none", linewidth=0))
    corners = [(x_mm, y_mm), (x_mm + BAR_MM, y_mm), (x_mm + BAR_MM, y_mm + 2.0), (x_mm, y_mm + 2.0), (x_mm, y_mm)]
    for (x1, y1), (x2, y2) in pairwise(corners):
        axes.plot([x1, x2], [y1, y2], color=INK, linewidth=0.3, solid_capstyle="butt")
    axes.text(x_mm + BAR_MM + 2.0, y_mm + 1.0, words, fontsize=points(height_mm), color=NOTE, va="center", ha="left")
