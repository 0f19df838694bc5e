"""The page in front of the sheets: which goes where, how to glue and check them, how to lay the target."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from standoff.targets.drawing import FAINT, INK, NOTE, draw_bar, draw_target, page, points
from standoff.targets.sheet import OVERLAP_MM, Paper, Target, Tile, paper_mm

_BORDER_MM = 14.0
_SKETCH_SHARE = 0.62
_SHEET_COLOUR = "#c2410c"


def tile_name(tile: Tile) -> str:
    """Return a sheet's name: rows are letters from the top, columns numbers from the left.

    >>> tile_name(Tile(1, 2, (210.0, 297.0), 0.0, 0.0, (1.0, 1.0), has_right=False, has_below=False))
    'B3'
    """
    return f"{chr(ord('A') + tile.row)}{tile.column + 1}"


def assembly_page(target: Target, pieces: tuple[Tile, ...], paper: Paper) -> Figure:
    """Return the page; it is as large as the sheets, upright."""
    width, height = paper_mm(paper, target)
    figure, axes = page(width, height)
    unit = width / 210.0
    top = height - _BORDER_MM
    title = f"standoff target: {target.family}, id {target.marker_id}"
    axes.text(_BORDER_MM, top, title, fontsize=points(6.0 * unit), color=INK, va="top", weight="bold")
    axes.text(
        _BORDER_MM, top - 9.0 * unit, _summary(target, pieces, paper), fontsize=points(3.6 * unit), color=NOTE, va="top"
    )
    sketch = min(_SKETCH_SHARE * width, 0.46 * height)
    corner = ((width - sketch) / 2.0, top - 26.0 * unit - sketch)
    _draw_sketch(axes, target, pieces, corner, sketch)
    below = corner[1] - 16.0 * unit
    for number, step in enumerate(_steps(target), start=1):
        axes.text(_BORDER_MM, below, f"{number}.", fontsize=points(3.4 * unit), color=INK, va="top", weight="bold")
        axes.text(
            _BORDER_MM + 7.0 * unit, below, step, fontsize=points(3.4 * unit), color=NOTE, va="top", linespacing=1.3
        )
        below -= (4.6 * unit) * (step.count("\n") + 1) + 1.6 * unit
    draw_bar(axes, _BORDER_MM, 9.0, "this bar is exactly 10 cm", 3.2)
    return figure


def _summary(target: Target, pieces: tuple[Tile, ...], paper: Paper) -> str:
    rows, columns = pieces[-1].row + 1, pieces[-1].column + 1
    return (
        f"black square {target.size_m:.3f} m, with its white edge {target.whole_mm / 1000.0:.3f} m\n"
        f"{len(pieces)} sheets {paper}: {rows} rows (A at the top) of {columns}"
    )


def _steps(target: Target) -> tuple[str, ...]:
    return (
        'Print all sheets at 100 % ("actual size", not "fit to page"), on matt paper: gloss mirrors the sun.\n'
        "Measure the bar below with a ruler. If it is not 10 cm, the target has another size than it says.",
        "On each sheet cut along the marks at the top and at the left. At the right and below, sheets with dashed\n"
        f"lines keep their {OVERLAP_MM:g} mm beyond these: the next sheet is glued there, its cut edge on the line.",
        "Glue row by row, then the rows, onto a flat stiff board. Do not cut the white edge off: it is needed.",
        f"Measure the black square, outer edge to outer edge, on all four sides. Give standoff what you measured\n"
        f"(here {target.size_m:.3f} m): every distance grows and shrinks with it.",
        "Lay it flat and level, where the drone sees it and nobody drives. The site's x runs from corner 0\n"
        "(filled disc) along the arrow to corner 1, y from corner 0 to corner 3.",
        f"Then:  standoff run VIDEO --out RUN --ground marker:{target.size_m:g}"
        + (f",id={target.marker_id}" if target.marker_id else ""),
    )


def _draw_sketch(
    axes: Axes, target: Target, pieces: tuple[Tile, ...], corner_mm: tuple[float, float], side_mm: float
) -> None:
    """Draw the target small, its sheets over it, and the measure of its black square."""
    scale = side_mm / target.whole_mm
    left, bottom = corner_mm
    axes.add_patch(Rectangle(corner_mm, side_mm, side_mm, facecolor="white", edgecolor=FAINT, linewidth=0.6))
    draw_target(axes, target, corner_mm, scale)
    columns = pieces[-1].column + 1
    name_mm = min(4.0, 0.35 * side_mm / columns)
    for tile in pieces:
        x, y = left + tile.left_mm * scale, bottom + tile.bottom_mm * scale
        wide, high = (shown * scale for shown in tile.shown_mm)
        # The cut edges: left and top lie over the sheets beside.
        axes.plot([x, x, x + wide], [y, y + high, y + high], color=_SHEET_COLOUR, linewidth=0.7)
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
        axes.text(
            x + wide / 2.0, y + high / 2.0, tile_name(tile), fontsize=points(name_mm), color=_SHEET_COLOUR, ha="center",
            va="center", bbox=box,
        )  # fmt: skip
    first, last = left + target.edge_mm * scale, left + (target.edge_mm + target.size_mm) * scale
    line = bottom - 5.0
    axes.annotate(
        "",
        (first, line),
        (last, line),
        arrowprops={"arrowstyle": "<->", "color": INK, "lw": 0.8, "shrinkA": 0, "shrinkB": 0},
    )
    for x in (first, last):
        axes.plot([x, x], [bottom + target.edge_mm * scale - 1.0, line - 2.0], color=INK, linewidth=0.4)
    axes.text(
        (first + last) / 2.0, line - 1.5, f"{target.size_m:.3f} m: outer edge to outer edge of the black square",
        fontsize=points(3.4), color=INK, ha="center", va="top",
    )  # fmt: skip
