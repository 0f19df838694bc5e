from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stages.sinks.fake_site import FakeSite, quiet

from standoff.core.types import FrameResult, ImageArray, NoGroundMap, Proximities
from standoff.drawing.palette import bgr
from standoff.drawing.text import TextSprites
from standoff.stages.sinks import DrawParams
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.overlay import Overlay
from standoff.stages.sinks.sketch import Sketch

SIZE = (640, 360)
TEXT = TextSprites()


def _sketch(result: FrameResult, hazards: bool = True) -> Sketch:
    return Sketch.of(FrameMeasurements.of(result if hazards else quiet(result)), DrawParams())


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
    site = FakeSite(SIZE)
    results = [site.result(index) for index in range(71)]
    sketch = Sketch.of(FrameMeasurements.of(results[-1]), DrawParams())
    danger = [line for line in sketch.lines if line.tone == "danger"]
    assert danger
    assert all(line.text == "unknown" and line.dashed for line in danger)


def test_each_person_gets_one_line_to_the_nearest_machine() -> None:
    sketch = _sketch(FakeSite(SIZE, tracks=30).result(0), hazards=False)
    pairs = sketch.measurements.proximities
    workers = int((sketch.measurements.tracks.class_id == 0).sum())
    assert 0.5 * workers < len(sketch.lines) <= workers < len(pairs) / 10
    for line in sketch.lines:
        ids = {int(sketch.measurements.tracks.track_id[row]) for row in (line.row_a, line.row_b)}
        person = next(i for i in ids if sketch.measurements.tracks.class_id[i - 1] == 0)
        of_person = (pairs.track_a == person) | (pairs.track_b == person)
        assert line.text == f"{pairs.distance_m[of_person].min():.1f} ±0.3 m"


def test_a_far_pair_has_a_line_only_with_a_hazard() -> None:
    site = FakeSite(SIZE)
    result = site.result(0)
    nearest_only = Sketch.of(FrameMeasurements.of(quiet(result)), DrawParams(line_within_m=0.1))
    assert nearest_only.lines == []
    with_hazards = Sketch.of(FrameMeasurements.of(result), DrawParams(line_within_m=0.1))
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
    calm = quiet(site.result(0))
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
