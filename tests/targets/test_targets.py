from __future__ import annotations

import re
from io import BytesIO
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np
import pytest
from tolerances import MARKER_CORNER_PX, PDF_POINTS

from standoff.core.errors import ConfigError, GroundError, OutputError
from standoff.core.types import ImageArray
from standoff.stages.ground import MARKER_FAMILIES, MarkerFamily, find_markers, marker_pattern
from standoff.targets import Paper, Target, tiles, write_target
from standoff.targets.drawing import draw_target, page
from standoff.targets.outline import black_outline
from standoff.targets.sheet import MARGIN_MM, OVERLAP_MM

POINTS_PER_MM = 72.0 / 25.4


def page_sizes(path: Path) -> list[tuple[float, float]]:
    boxes = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", path.read_bytes())
    return [(float(width), float(height)) for width, height in boxes]


def printed(target: Target, pixels_per_mm: float) -> ImageArray:
    figure, axes = page(target.whole_mm, target.whole_mm)
    draw_target(axes, target, (0.0, 0.0))
    file = BytesIO()
    with mpl.rc_context({"path.snap": False}):
        figure.savefig(file, dpi=pixels_per_mm * 25.4, format="png")
    return np.asarray(cv2.imdecode(np.frombuffer(file.getvalue(), np.uint8), cv2.IMREAD_GRAYSCALE))


@pytest.mark.parametrize(("paper", "size_mm"), [("A4", (210.0, 297.0)), ("letter", (215.9, 279.4))])
def test_sheets_have_exactly_the_papers_size(tmp_path: Path, paper: Paper, size_mm: tuple[float, float]) -> None:
    out = tmp_path / "target.pdf"
    count = write_target(Target(0.2, 3), out, paper=paper)
    sizes = page_sizes(out)
    assert len(sizes) == count == 1 + len(tiles(Target(0.2, 3), paper))
    for size in sizes:
        assert sorted(size) == pytest.approx([side * POINTS_PER_MM for side in size_mm], abs=PDF_POINTS)


def test_a_single_page_is_exactly_as_large_as_the_target(tmp_path: Path) -> None:
    out = tmp_path / "target.pdf"
    assert write_target(Target(1.2), out, paper="single") == 1
    # 1.2 m in eight modules: one module of white and a quarter for the notes, on both sides
    assert page_sizes(out) == [pytest.approx((1575.0 * POINTS_PER_MM, 1575.0 * POINTS_PER_MM), abs=PDF_POINTS)]


def test_the_same_target_gives_the_same_file(tmp_path: Path) -> None:
    for name in ("one.pdf", "two.pdf"):
        write_target(Target(0.2), tmp_path / name, paper="single")
    assert (tmp_path / "one.pdf").read_bytes() == (tmp_path / "two.pdf").read_bytes()


@pytest.mark.parametrize("paper", ["A4", "A3", "A0", "tabloid"])
@pytest.mark.parametrize("size_m", [0.1, 0.33, 1.2])
def test_sheets_cover_the_target_and_overlap_by_what_the_dashed_lines_say(paper: Paper, size_m: float) -> None:
    target = Target(size_m)
    pieces = {(tile.row, tile.column): tile for tile in tiles(target, paper)}
    for (row, column), tile in pieces.items():
        width, height = tile.shown_mm
        assert width <= tile.paper_mm[0] - 2 * MARGIN_MM + 1e-9
        assert height <= tile.paper_mm[1] - 2 * MARGIN_MM + 1e-9
        right = tile.left_mm + width
        if tile.has_right:
            assert pieces[row, column + 1].left_mm == pytest.approx(right - OVERLAP_MM)
        else:
            assert right == pytest.approx(target.whole_mm)
        if tile.has_below:
            below = pieces[row + 1, column]
            assert below.bottom_mm + below.shown_mm[1] == pytest.approx(tile.bottom_mm + OVERLAP_MM)
        else:
            assert tile.bottom_mm == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("family", MARKER_FAMILIES)
def test_the_printed_marker_is_found_upright_with_its_corners_where_the_page_says(family: MarkerFamily) -> None:
    target, pixels_per_mm = Target(1.12, 5, family), 0.2
    sheet = printed(target, pixels_per_mm)
    found = find_markers(cv2.GaussianBlur(sheet, (0, 0), 0.7), family)
    assert found.ids.tolist() == [5]
    low, high = target.edge_mm * pixels_per_mm, (target.edge_mm + target.size_mm) * pixels_per_mm
    height_px = len(sheet)
    wanted = np.array([[low, low], [high, low], [high, high], [low, high]])
    wanted[:, 1] = height_px - wanted[:, 1]
    assert np.abs(found.corners_px[0] - (wanted - 0.5)).max() < MARKER_CORNER_PX


def test_notes_leave_a_whole_module_of_white_around_the_black_square() -> None:
    target, pixels_per_mm = Target(0.4), 1.0
    sheet = printed(target, pixels_per_mm)
    edge, module = round(target.edge_mm), target.module_mm
    outer, inner = sheet.copy(), round(target.strip_mm)
    outer[edge - 1 : -edge + 1, edge - 1 : -edge + 1] = 255
    assert module > 10.0
    assert (outer[inner + 1 : -inner - 1, inner + 1 : -inner - 1] == 255).all()


def test_the_black_outline_holds_the_black_modules_and_no_others() -> None:
    pattern = marker_pattern("apriltag36h11", 40)
    middles = np.argwhere(np.ones_like(pattern)) + 0.5
    outline = black_outline(pattern).to_polygons()
    inside = np.zeros(pattern.size)
    for loop in outline:
        edge = np.asarray(loop, dtype=np.float32)
        inside += [cv2.pointPolygonTest(edge, (column, row), False) > 0 for row, column in middles.tolist()]
    assert np.array_equal(inside.reshape(pattern.shape) % 2 == 1, ~pattern[::-1])


@pytest.mark.parametrize("size_m", [0.05, 4.0, float("nan")])
def test_sizes_that_cannot_be_printed_are_refused(size_m: float) -> None:
    with pytest.raises(ConfigError, match=r"0.1 to 3.5 m"):
        Target(size_m)


def test_ids_and_papers_that_do_not_exist_are_refused() -> None:
    with pytest.raises(GroundError, match="0 to 586"):
        Target(1.0, 587)
    with pytest.raises(ConfigError, match="A4"):
        tiles(Target(1.0), "A9")  # type: ignore[arg-type]


def test_an_existing_file_is_kept_unless_told_otherwise(tmp_path: Path) -> None:
    out = tmp_path / "target.pdf"
    out.write_text("mine")
    with pytest.raises(OutputError, match="--overwrite"):
        write_target(Target(0.2), out, paper="single")
    assert out.read_text() == "mine"
    write_target(Target(0.2), out, paper="single", overwrite=True)
    assert out.read_bytes().startswith(b"%PDF")
