"""Ground that is not watched: in the film, from above, in words, in the report and in the record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from pages import PageReader
from stages.sinks.fake_site import FakeSite, ended, quiet

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import BoolArray
from standoff.core.types import FrameResult, ImageArray, OpenHazards, Outcome, Proximities, WatchedGround
from standoff.core.watched_ground import (
    BEHIND_MACHINE,
    BLURRED,
    COLUMNS,
    NO_GROUND,
    REASONS,
    ROWS,
    TOO_SMALL,
    WATCHED,
    CellArray,
    cell_middles_px,
    cell_of,
)
from standoff.drawing.text import TextSprites
from standoff.stages.hazard import HazardMonitor
from standoff.stages.sinks import DrawParams, ReportParams, ReportSink
from standoff.stages.sinks.birdseye import BirdsEye
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.overlay import Overlay
from standoff.stages.sinks.shade import PictureShade, diagonals
from standoff.stages.sinks.sketch import Sketch

SIZE, PANEL = (640, 360), (300, 400)
WHOLE = np.array([0.0, 0.0, 1.0, 1.0])
LENS = Camera(*SIZE, np.array([[450.0, 0, 320], [0, 450, 180], [0, 0, 1]]), np.array([-0.2, 0.05, 0, 0, 0]))
TEXT = TextSprites()
BARE = DrawParams(circles=False, fans=False, labels=False, legend=False)


def of_cells(cells: CellArray, around: float = 1.0, tracks: int = 5) -> WatchedGround:
    return WatchedGround(cells, np.where(cells == WATCHED, 0.93, np.nan), np.full(tracks, around))


def all_cells(value: int) -> CellArray:
    return np.full((ROWS, COLUMNS), value, dtype=np.int8)


def sketch(result: FrameResult, watched: WatchedGround, params: DrawParams = BARE) -> Sketch:
    return Sketch.of(FrameMeasurements.of(replace(result, watched=watched)), params)


def noise(size_px: tuple[int, int], seed: int = 3) -> ImageArray:
    return np.random.default_rng(seed).integers(0, 256, (size_px[1], size_px[0], 3), dtype=np.uint8)


def near_middles(size_px: tuple[int, int]) -> BoolArray:
    """Return (H, W) whether a pixel is in the middle of its cell, where no neighbour's shade may reach."""
    sizes = zip(size_px, (COLUMNS, ROWS), strict=True)
    across, down = (np.abs((np.arange(size) + 0.5) / size * count % 1.0 - 0.5) < 0.1 for size, count in sizes)
    return down[:, None] & across


def cells_of_pixels(size_px: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    width, height = size_px
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    places, _ = cell_of(np.column_stack([x.ravel(), y.ravel()]).astype(np.float64), size_px)
    return places[:, 0].reshape(height, width), places[:, 1].reshape(height, width)


@examples(15)
@given(st.integers(0, 10_000), st.sampled_from([(640, 360), (401, 300), (1122, 672)]))
def test_only_ground_that_is_not_watched_is_hatched_in_the_picture(seed: int, size_px: tuple[int, int]) -> None:
    cells = np.random.default_rng(seed).integers(NO_GROUND, len(REASONS), (ROWS, COLUMNS)).astype(np.int8)
    picture = noise(size_px)
    drawn = picture.copy()
    PictureShade().draw(drawn, cells, WHOLE)
    changed = (drawn != picture).any(axis=2)
    hatched = (cells > WATCHED) & (cells != BEHIND_MACHINE)
    middle = near_middles(size_px)
    np.testing.assert_array_equal(changed[middle], hatched[cells_of_pixels(size_px)][middle])


def test_what_was_drawn_of_other_cells_sizes_and_parts_is_not_drawn_again() -> None:
    rng, kept = np.random.default_rng(5), PictureShade()
    for size_px in ((320, 180), (320, 180), (400, 300), (320, 180)):
        for part in (WHOLE, WHOLE, np.array([0.25, 0.5, 0.75, 1.0])):
            cells = rng.integers(NO_GROUND, len(REASONS), (ROWS, COLUMNS)).astype(np.int8)
            once, again = noise(size_px), noise(size_px)
            PictureShade().draw(once, cells, part)
            kept.draw(again, cells, part)
            np.testing.assert_array_equal(once, again)


def test_a_part_of_the_picture_is_hatched_as_it_is_in_the_whole() -> None:
    cells = all_cells(WATCHED)
    cells[9:, 8:20] = TOO_SMALL
    result = FakeSite(SIZE, tracks=0).result(0)
    region_px = np.array([SIZE[0] / 4, SIZE[1] / 2, 3 * SIZE[0] / 4, SIZE[1]])
    plain = np.full((180, 320, 3), 120, dtype=np.uint8)
    drawn = plain.copy()
    Overlay(BARE, TEXT).draw(drawn, sketch(result, of_cells(cells, tracks=0)), region_px)
    without = plain.copy()
    Overlay(BARE, TEXT).draw(without, sketch(result, of_cells(all_cells(WATCHED), tracks=0)), region_px)
    changed = (drawn != without).any(axis=2)[45:110]  # between the reference and the words
    assert changed[:, 10:230].all() and not changed[:, 250:].any()


def test_a_part_that_shows_watched_ground_only_stays_as_it_is_whatever_the_rest_shows() -> None:
    cells = np.full((ROWS, COLUMNS), WATCHED, dtype=np.int8)
    cells[:, : COLUMNS // 4] = TOO_SMALL
    shade, canvas = PictureShade(), np.full((90, 160, 3), 100, dtype=np.uint8)
    for part in ((0.5, 0.5, 1.0, 1.0), (0.0, 0.0, 0.5, 0.5), (0.5, 0.5, 1.0, 1.0)):
        drawn = canvas.copy()
        shade.draw(drawn, cells, np.array(part))
        assert (drawn == canvas).all() == (part[0] == 0.5)


def test_where_nobody_judged_or_wants_to_see_it_nothing_is_hatched() -> None:
    result, picture = FakeSite(SIZE).result(0), noise(SIZE)
    wanted, unwanted = DrawParams(), DrawParams(unwatched=False)
    unwatched = of_cells(all_cells(TOO_SMALL))
    assert sketch(result, unwatched, wanted).cells.size
    assert not sketch(result, unwatched, unwanted).cells.size
    assert not sketch(result, WatchedGround(), wanted).cells.size
    assert not sketch(FakeSite(SIZE).result(70), unwatched, wanted).cells.size  # no map: a bar across the picture
    drawn = picture.copy()
    PictureShade().draw(drawn, WatchedGround().cells, WHOLE)
    np.testing.assert_array_equal(drawn, picture)


def panel(result: FrameResult, watched: WatchedGround, grey: int = 140) -> tuple[ImageArray, BirdsEye]:
    canvas = np.zeros((PANEL[1], PANEL[0], 3), dtype=np.uint8)
    birdseye = BirdsEye(PANEL, BARE, TEXT)
    birdseye.draw(canvas, np.full((SIZE[1], SIZE[0], 3), grey, dtype=np.uint8), sketch(result, watched))
    return canvas, birdseye


@pytest.mark.parametrize("camera", [None, LENS])
def test_from_above_the_same_ground_is_hatched_and_what_is_behind_machines_too(camera: Camera | None) -> None:
    result = FakeSite(SIZE, camera=camera, tracks=0).result(0)
    cells = all_cells(WATCHED)
    cells[:6], cells[9:14, 12:20] = TOO_SMALL, BEHIND_MACHINE
    drawn, birdseye = panel(result, of_cells(cells, tracks=0))
    plain, _ = panel(result, of_cells(all_cells(WATCHED), tracks=0))
    window = birdseye._window
    assert window is not None
    x, y = np.meshgrid(np.arange(PANEL[0]), np.arange(PANEL[1]))
    pixels = np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)
    at_px, in_front = result.ground.to_image(homography.apply(homography.invert(window.ground_to_window), pixels)[0])  # type: ignore[union-attr]
    # The shade ends half way between cells, give or take what a panel's pixels are worth: far from there it is sure.
    hatched = []
    for shift_px in np.array([[-16.0, -16.0], [-16.0, 16.0], [16.0, -16.0], [16.0, 16.0]]):
        places, inside = cell_of(np.where(in_front[:, None], at_px + shift_px, -1.0), SIZE)
        hatched.append(np.where(inside, cells[places[:, 0], places[:, 1]] > WATCHED, np.nan))
    bare = (plain == np.median(plain)).all(axis=2)  # without the axes and the scale bar
    sure = bare & (np.ptp(hatched, axis=0) == 0.0).reshape(PANEL[::-1])
    wanted = (hatched[0] == 1.0).reshape(PANEL[::-1])
    changed = (drawn != plain).any(axis=2)
    assert (sure & wanted).sum() > 2000 and (sure & ~wanted).sum() > 2000
    np.testing.assert_array_equal(changed[sure], wanted[sure])


def test_from_above_ground_outside_of_the_picture_looks_as_unwatched_as_ground_in_it() -> None:
    result = FakeSite(SIZE, tracks=0).result(0)
    drawn, _ = panel(result, of_cells(all_cells(TOO_SMALL), tracks=0))
    watched, _ = panel(result, of_cells(all_cells(WATCHED), tracks=0))
    lines = diagonals(PANEL) > 0
    left = np.zeros(PANEL[::-1], dtype=bool)
    left[150:300, 1:-1] = True  # no axes, no scale bar
    outside = left & (watched.max(axis=2) < 60)
    inside = left & (watched == np.median(watched)).all(axis=2)
    assert outside.sum() > 300 and inside.sum() > 5000
    for place in (outside, inside):
        on, off = drawn[place & lines].astype(int), drawn[place & ~lines].astype(int)
        assert on.min() > off.max()
    assert watched[inside & lines].max() == watched[inside & ~lines].min()


def test_the_picture_says_how_much_of_the_ground_is_watched_and_why_not_the_rest() -> None:
    result, cells = FakeSite(SIZE).result(0), all_cells(WATCHED)
    words = sketch(result, of_cells(cells)).measurements.watched_words()
    assert words == "100 % of the ground watched"
    cells[:9, :16], cells[9, :1] = TOO_SMALL, BLURRED
    words = sketch(result, of_cells(cells)).measurements.watched_words()
    assert words == "74 % of the ground watched; rest: workers would be too small"
    assert sketch(result, of_cells(cells)).measurements.watched_words(hatched=True) == words.replace(
        "rest:", "rest (hatched):"
    )
    cells[9:, :16] = BEHIND_MACHINE
    cells[:, 20:] = NO_GROUND
    words = sketch(result, of_cells(cells)).measurements.watched_words()
    assert words == "20 % of the ground watched; rest: workers would be too small, behind a machine"
    assert sketch(result, WatchedGround()).measurements.watched_words() == ""
    assert sketch(FakeSite(SIZE).result(70), of_cells(cells)).measurements.watched_words() == ""
    canvas, without = np.zeros((2, SIZE[1], SIZE[0], 3), dtype=np.uint8)
    Overlay(DrawParams(unwatched=False), TEXT).draw(
        canvas, sketch(result, of_cells(cells), DrawParams(unwatched=False))
    )
    Overlay(DrawParams(), TEXT).draw(without, sketch(result, WatchedGround(), DrawParams()))
    assert (canvas > 200).sum() > (without > 200).sum()  # the words, where nothing is hatched too


def test_a_machine_with_ground_about_it_that_is_not_watched_says_so() -> None:
    result = FakeSite(SIZE).result(0)
    around = np.array([np.nan, 0.62, 0.95, np.nan, 0.0])
    watched = replace(of_cells(all_cells(WATCHED)), around=around)
    assert sketch(result, watched).measurements.around_words() == {
        2: "62 % around it watched",
        5: "0 % around it watched",
    }
    assert sketch(result, WatchedGround()).measurements.around_words() == {}


def test_a_machine_near_which_somebody_may_stand_says_so_in_the_colour_of_what_is_unknown() -> None:
    site, monitor = FakeSite(SIZE), HazardMonitor()
    suspects = np.array([True, False, True, False, False])
    watched = replace(of_cells(all_cells(WATCHED)), suspects=suspects)
    open_hazards = OpenHazards()
    for k in range(12):
        result = replace(site.result(0), proximities=Proximities.empty())
        events = monitor.update(
            0.1 * k, result.positions, result.proximities, result.ground, result.unfollowed, watched
        )
        open_hazards = open_hazards.after(events)
    measurements = sketch(replace(result, open_hazards=open_hazards), watched).measurements
    assert measurements.machine_words() == {3: "somebody may stand near it"}
    assert measurements.track_tones()[2] == "unknown"
    assert sketch(result, watched).measurements.machine_words() == {}
    assert sketch(result, watched).measurements.track_tones()[2] != "unknown"


def test_a_stream_of_which_no_ground_is_watched_says_so_as_plainly_as_one_without_map() -> None:
    site, monitor, watched = FakeSite(SIZE), HazardMonitor(), of_cells(all_cells(BLURRED))
    result = site.result(0)
    events = monitor.update(0.0, result.positions, result.proximities, result.ground, result.unfollowed, watched)
    unseeing = sketch(replace(result, open_hazards=OpenHazards().after(events)), watched)
    assert unseeing.measurements.unknown_words() == "UNKNOWN: no ground is watched: blurred"
    assert sketch(result, watched).measurements.unknown_words() == ""
    lost = sketch(site.result(70), WatchedGround())
    assert lost.measurements.unknown_words() == "NO MEASUREMENT: reference hidden & <not> found"
    for one in (unseeing, lost):
        canvas = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
        Overlay(BARE, TEXT).draw(canvas, one)
        assert (canvas[1, 5:-5, 2] > 150).all()  # red over the whole width
        assert canvas[:20, : SIZE[0] // 2].min(axis=2).max() > 200  # white text in it


def page(folder: Path, watched: list[WatchedGround], about: Mapping[str, object] | None = None) -> str:
    sink, site = ReportSink(folder / "report.html", ReportParams(pairs=1, moments=0)), FakeSite((160, 90))
    results = [replace(quiet(site.result(index)), watched=one) for index, one in enumerate(watched)]
    for result in results:
        sink.write(result)
    sink.close(ended(results, Outcome("complete", about=about or {})))
    return PageReader.of((folder / "report.html").read_text(encoding="utf-8")).text


def test_the_report_says_of_which_ground_it_speaks(tmp_path: Path) -> None:
    half, three_quarters = all_cells(WATCHED), all_cells(WATCHED)
    half[:9] = TOO_SMALL
    three_quarters[:, :8] = BEHIND_MACHINE
    text = page(tmp_path, [of_cells(half), of_cells(three_quarters)] * 5)
    assert "62.5 % of the ground watched: a worker there would be found" in text
    assert "Of the workers who stand there, 7.0 % are missed in one picture. What hides a worker there" in text
    assert "workers would be too small 25.0 % behind a machine 12.5 %" in text
    assert "None on the ground that was watched, 62.5 % of what the pictures show; unknown on the rest." in text
    assert "Nobody measured" not in text and "a part of the ground" not in text


def test_a_report_of_hardly_watched_ground_never_reads_as_safe(tmp_path: Path) -> None:
    little, nothing = all_cells(TOO_SMALL), all_cells(TOO_SMALL)
    little[:3] = WATCHED
    for name, cells, said in (("little", little, "Only a part"), ("nothing", nothing, "Hardly any")):
        (tmp_path / name).mkdir()
        text = page(tmp_path / name, [of_cells(cells)] * 3, {"watched": {"measured": False}})
        assert f"{said} of the ground was watched:" in text
        assert "None." not in text
        assert "Nobody measured how small a worker this detector finds" in text
        assert ("are missed in one picture" in text) == (name == "little")


def test_a_report_of_what_nobody_judged_is_silent_about_it(tmp_path: Path) -> None:
    assert "Ground that was watched" not in page(tmp_path, [WatchedGround()] * 3)


def test_cell_middles_are_where_the_regions_say_what_the_cells_say() -> None:
    """What the two laws above rest on: the cells of the picture are those of `cell_of`."""
    middles = cell_middles_px(SIZE)
    places, inside = cell_of(middles, SIZE)
    assert inside.all()
    np.testing.assert_array_equal(places[:, 0] * COLUMNS + places[:, 1], np.arange(ROWS * COLUMNS))
