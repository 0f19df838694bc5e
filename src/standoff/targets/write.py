"""Write a target as a PDF of exact size: sheets to be glued together, or one page for a print shop."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from standoff.core.errors import OutputError
from standoff.files.whole import whole_file
from standoff.targets.assembly import assembly_page, tile_name
from standoff.targets.drawing import FAINT, INK, NOTE, draw_bar, draw_target, page, points
from standoff.targets.sheet import MARGIN_MM, OVERLAP_MM, Paper, Target, Tile, tiles

_MARK_MM = 4.5


def write_target(target: Target, out: Path, *, paper: Paper = "A4", overwrite: bool = False) -> int:
    """Write a target's PDF, whole or not at all.

    Args:
        target: What to print.
        out: The file.
        paper: Of the sheets, with a page in front that says how to put them together; `single`: one page as large as
            the target.
        overwrite: Replace an existing file.

    Returns:
        How many pages it has.

    Raises:
        ConfigError: There is no such paper.
        OutputError: The file is there already, or cannot be written.
    """
    if out.is_dir() or (out.exists() and not overwrite):
        found = f"the folder {out}" if out.is_dir() else f"{out}, which is there already"
        fix = "choose a file" if out.is_dir() else "choose another file or pass --overwrite"
        raise OutputError(expected="a new file to write", found=found, fix=fix)
    pieces = tiles(target, paper)
    # No date: the same target gives the same file.
    about = {"Title": f"standoff target {target.family} {target.marker_id}, {target.size_m:g} m", "CreationDate": None}
    count = 0
    with whole_file(out) as path, PdfPages(path, metadata=about) as document:
        for figure in _pages(target, pieces, paper):
            document.savefig(figure)
            count += 1
    return count


def _pages(target: Target, pieces: tuple[Tile, ...], paper: Paper) -> Iterator[Figure]:
    if paper == "single":
        figure, axes = page(target.whole_mm, target.whole_mm)
        draw_target(axes, target, (0.0, 0.0))
        yield figure
        return
    yield assembly_page(target, pieces, paper)
    for number, tile in enumerate(pieces, start=1):
        yield _tile_page(target, tile, f"sheet {number} of {len(pieces)}")


def _tile_page(target: Target, tile: Tile, numbered: str) -> Figure:
    figure, axes = page(*tile.paper_mm)
    width, height = tile.shown_mm
    window = Rectangle((MARGIN_MM, MARGIN_MM), width, height, transform=axes.transData)
    offset = (MARGIN_MM - tile.left_mm, MARGIN_MM - tile.bottom_mm)
    draw_target(axes, target, offset, clip=window)
    _draw_marks(axes, tile)
    top = MARGIN_MM + height
    which = f"row {tile.row + 1}, column {tile.column + 1}   ({numbered})"
    note = f"{which}   {target.family} id {target.marker_id}, {target.size_m:g} m"
    axes.text(MARGIN_MM + 10.0, top + 4.2, f"{tile_name(tile)}   {note}", fontsize=points(3.0), color=NOTE, va="center")
    draw_bar(axes, MARGIN_MM + 2.0, 4.8, "measure after printing: this bar is exactly 10 cm")
    return figure


def _draw_marks(axes: Axes, tile: Tile) -> None:
    """Draw where to cut, and where the next sheet's edge comes to lie."""
    left, bottom = MARGIN_MM, MARGIN_MM
    right, top = left + tile.shown_mm[0], bottom + tile.shown_mm[1]
    for x in (left, right):
        for y, away in ((bottom, -1.0), (top, 1.0)):
            axes.plot([x, x], [y + away * 1.0, y + away * _MARK_MM], color=INK, linewidth=0.4)
    for y in (bottom, top):
        for x, away in ((left, -1.0), (right, 1.0)):
            axes.plot([x + away * 1.0, x + away * _MARK_MM], [y, y], color=INK, linewidth=0.4)
    if tile.has_right:
        _draw_dashes(axes, [right - OVERLAP_MM] * 2, [bottom, top])
    if tile.has_below:
        _draw_dashes(axes, [left, right], [bottom + OVERLAP_MM] * 2)


def _draw_dashes(axes: Axes, xs_mm: list[float], ys_mm: list[float]) -> None:
    axes.plot(xs_mm, ys_mm, color=FAINT, linewidth=0.6, linestyle=(0, (4, 3)))
