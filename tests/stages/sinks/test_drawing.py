from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stages.sinks.fake_site import FakeSite

from standoff.core.types import FrameResult, ImageArray, NoGroundMap, Proximities
from standoff.stages.sinks import DrawParams
from standoff.stages.sinks.drawing import Overlay
from standoff.stages.sinks.painter import Painter
from standoff.stages.sinks.palette import bgr
from standoff.stages.sinks.scene import OpenHazards, Scene
from standoff.stages.sinks.sketch import Sketch
from standoff.stages.sinks.text import TextSprites

SIZE = (640, 360)
TEXT = TextSprites()


def _sketch(result: FrameResult, hazards: bool = True) -> Sketch:
    open_hazards = OpenHazards()
    open_hazards.update(result.hazards if hazards else ())
    return Sketch.of(Scene.of(result, open_hazards), DrawParams())


def _drawn(result: FrameResult, params: DrawParams | None = None) -> ImageArray:
    canvas = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
    Overlay(params, TEXT).draw(canvas, _sketch(result))
    return canvas


def _share_of(canvas: ImageArray, colour: tuple[int, int, int]) -> float:
    return float((np.abs(canvas.astype(int) - colour).max(axis=2) < 12).mean())


def test_a_frame_without_map_says_so_across_the_picture() -> None:
    with_map, without = _drawn(FakeSite(SIZE).result(0)), _drawn(FakeSite(SIZE).result(70))
    np.testing.assert_array_equal(with_map[1, 100:-100], 0)
    assert (without[1, 5:-5, 2] > 150).all()  # red over the whole width
    assert without[:20, : SIZE[0] // 2].min(axis=2).max() > 200  # white text in it


def test_without_a_position_nobody_looks_at_ease() -> None:
    site = FakeSite(SIZE)
    assert "unknown" not in _sketch(site.result(0), hazards=False).tones
    assert set(_sketch(site.result(70), hazards=False).tones) == {"unknown"}


def test_an_open_hazard_keeps_its_colour_while_it_cannot_be_measured() -> None:
    site, open_hazards = FakeSite(SIZE), OpenHazards()
    for index in range(71):
        result = site.result(index)
        open_hazards.update(result.hazards)
    sketch = Sketch.of(Scene.of(result, open_hazards), DrawParams())
    danger = [line for line in sketch.lines if line.tone == "danger"]
    assert danger
    assert all(line.text == "unknown" and line.dashed for line in danger)


def test_each_person_gets_one_line_to_the_nearest_machine() -> None:
    sketch = _sketch(FakeSite(SIZE, tracks=30).result(0), hazards=False)
    pairs = sketch.scene.proximities
    workers = int((sketch.scene.tracks.class_id == 0).sum())
    assert 0.5 * workers < len(sketch.lines) <= workers < len(pairs) / 10
    for line in sketch.lines:
        ids = {int(sketch.scene.tracks.track_id[row]) for row in (line.row_a, line.row_b)}
        person = next(i for i in ids if sketch.scene.tracks.class_id[i - 1] == 0)
        of_person = (pairs.track_a == person) | (pairs.track_b == person)
        assert line.text == f"{pairs.distance_m[of_person].min():.1f} ±0.3 m"


def test_a_far_pair_has_a_line_only_with_a_hazard() -> None:
    site = FakeSite(SIZE)
    result = site.result(0)
    nearest_only = Sketch.of(Scene.of(result, OpenHazards()), DrawParams(line_within_m=0.1))
    assert nearest_only.lines == []
    open_hazards = OpenHazards()
    open_hazards.update(result.hazards)
    with_hazards = Sketch.of(Scene.of(result, open_hazards), DrawParams(line_within_m=0.1))
    assert len(with_hazards.lines) == len(result.hazards) > 0


def test_a_pair_that_cannot_be_measured_is_drawn_as_unknown() -> None:
    result = FakeSite(SIZE).result(30)  # track 2 has no position
    unknown = [line for line in _sketch(result, hazards=False).lines if line.text == "unknown"]
    assert unknown
    assert all(1 in (line.row_a, line.row_b) and line.tone == "unknown" and line.dashed for line in unknown)


def test_a_filtered_distance_is_marked() -> None:
    result = FakeSite(SIZE).result(0)
    pairs = result.proximities
    result = replace(result, proximities=replace(pairs, filtered=np.ones(len(pairs), dtype=bool)))
    assert all(line.text.startswith("≈") for line in _sketch(result).lines)


def test_a_hazard_turns_the_picture_red() -> None:
    site = FakeSite(SIZE)
    calm = replace(site.result(0), hazards=())
    assert _share_of(_drawn(calm), bgr("danger")) < 0.0005  # the legend's bar
    assert _share_of(_drawn(FakeSite(SIZE).result(0)), bgr("danger")) > 0.002


def test_drawing_at_half_size_draws_the_same_things() -> None:
    result = FakeSite(SIZE).result(0)
    params = DrawParams(labels=False, legend=False)
    half = np.zeros((SIZE[1] // 2, SIZE[0] // 2, 3), dtype=np.uint8)
    Overlay(params, TEXT).draw(half, _sketch(result))
    full = _drawn(result, params)
    rows, columns = np.nonzero(full[: SIZE[1] - 120].any(axis=2))
    half_rows, half_columns = np.nonzero(half[: SIZE[1] // 2 - 60].any(axis=2))
    assert half_columns.min() == pytest.approx(columns.min() / 2, abs=3)
    assert half_columns.max() == pytest.approx(columns.max() / 2, abs=3)
    assert half_rows.min() == pytest.approx(rows.min() / 2, abs=3)


def test_nothing_at_all_can_be_drawn() -> None:
    result = FakeSite(SIZE, tracks=0).result(0)
    assert len(result.tracks) == 0
    result = replace(result, ground=NoGroundMap("nobody there"), proximities=Proximities.empty())
    assert _drawn(result).any()


@given(
    st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9)), min_size=2, max_size=6),
    st.booleans(),
)
def test_no_point_is_too_far_to_be_drawn(points: list[tuple[float, float]], dashed: bool) -> None:
    canvas = np.zeros((90, 160, 3), dtype=np.uint8)
    painter = Painter(canvas, TEXT)
    outline = np.array(points)
    painter.cased_line(outline, bgr("danger"), dashed=dashed)
    painter.fill(outline, bgr("danger"), 0.5)
    painter.dot(outline[0].tolist(), bgr("danger"))
    painter.box([*outline.min(axis=0), *outline.max(axis=0)], bgr("danger"), dashed=dashed)
    painter.label("far", [(x, y) for x, y in points])
    assert canvas.any()


def test_labels_do_not_cover_each_other() -> None:
    painter = Painter(np.zeros((200, 400, 3), dtype=np.uint8), TEXT)
    corners = [(10.0, 10.0), (10.0, 60.0), (200.0, 10.0)]
    for name in ("one", "two", "three", "four"):
        painter.label(name, corners, optional=True)
    taken = painter._taken
    assert len(taken) == 3
    assert all(a[2] <= b[0] or a[3] <= b[1] or b[2] <= a[0] or b[3] <= a[1] for a in taken for b in taken if a is not b)
    painter.label("danger", corners)
    assert len(taken) == 4
