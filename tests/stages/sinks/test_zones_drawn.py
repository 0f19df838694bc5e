"""Zones in the film, from above, in the report, the tables and the record."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from pages import PageReader
from stages.sinks.fake_site import FakeSite, ended, quiet

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.protocols import Sink
from standoff.core.types import (
    FrameResult,
    GroundPositions,
    Hazard,
    ImageArray,
    OpenHazards,
    Outcome,
    Proximities,
    Tracks,
)
from standoff.core.zones import Zone
from standoff.drawing.ground_shapes import clip_to_box, outlines_in_sight_px
from standoff.drawing.palette import bgr
from standoff.drawing.text import TextSprites
from standoff.stages.hazard import HazardMonitor
from standoff.stages.sinks import (
    TRACKS,
    ZONED_TRACKS,
    DrawParams,
    HazardSink,
    ReportParams,
    ReportSink,
    TableSink,
)
from standoff.stages.sinks.birdseye import BirdsEye
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.overlay import Overlay
from standoff.stages.sinks.sketch import Sketch

SIZE = (640, 360)
LENS = Camera(*SIZE, np.array([[450.0, 0, 320], [0, 450, 180], [0, 0, 1]]), np.array([-0.2, 0.05, 0, 0, 0]))
TEXT = TextSprites()
NAN = float("nan")


def box(x: float, y: float, width: float, height: float) -> FloatArray:
    return np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]])


PIT = Zone("pit", "no_go", [[box(-6.0, 6.0, 9.0, 8.0), box(-3.0, 9.0, 2.0, 2.0)]])
ROAD = Zone("haul road", "machine_only", [[np.array([[10.0, -400.0], [16.0, -400.0], [22.0, 600.0], [14.0, 600.0]])]])
ZONES = (PIT, ROAD)


@pytest.fixture(scope="module")
def watched() -> list[FrameResult]:
    """Three seconds with the hazards of the zones: the excavator is in the pit, a worker comes to the road."""
    site, monitor = FakeSite((160, 90)), HazardMonitor(zones=ZONES)
    results, still_open = [], OpenHazards()
    for index in range(62):
        result = site.result(index)
        events = monitor.update(
            result.frame.time_s, result.positions, result.proximities, result.ground, result.unfollowed
        )
        still_open = still_open.after(events)
        results.append(replace(result, hazards=events, open_hazards=still_open))
    return results


def sketch(result: FrameResult, hazards: Sequence[Hazard] = ()) -> Sketch:
    return Sketch.of(
        FrameMeasurements.of(replace(result, open_hazards=OpenHazards().after(hazards)), ZONES), DrawParams()
    )


def drawn(result: FrameResult, hazards: Sequence[Hazard] = ()) -> ImageArray:
    """Return the overlay of the zones and the status line, without anybody."""
    empty = replace(result, tracks=Tracks.empty(), positions=GroundPositions.empty(), proximities=Proximities.empty())
    canvas = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
    Overlay(DrawParams(size=3.0, legend=False, labels=False), TEXT).draw(canvas, sketch(empty, hazards))
    return canvas


def shows(canvas: ImageArray, at_px: FloatArray, colour: tuple[int, int, int]) -> bool:
    x, y = np.round(at_px).astype(int)
    around = canvas[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3].astype(int)
    return bool((np.abs(around - colour).max(axis=2) < 30).any())


def in_zone(severity: str, track: int = 3, phase: str = "opened") -> Hazard:
    return Hazard("Z", "zone", severity, phase, (track,), 0.0, 0.0, -1.0, 0.2, zone="pit")  # type: ignore[arg-type]


@pytest.mark.parametrize("camera", [None, LENS])
def test_a_zone_is_outlined_where_its_sides_are_seen(camera: Camera | None) -> None:
    result = FakeSite(SIZE, camera=camera).result(0)
    canvas = drawn(result)
    ground = FakeSite(SIZE, camera=camera).ground()
    for ring in PIT.rings_m:
        middles_px, _ = ground.to_image((ring + np.roll(ring, -1, axis=0)) / 2.0)
        assert all(shows(canvas, at_px, bgr("zone")) for at_px in middles_px)


@pytest.mark.parametrize("camera", [None, LENS])
def test_a_zone_that_goes_on_behind_the_camera_is_cut_off_outside_the_picture(camera: Camera | None) -> None:
    ground = FakeSite(SIZE, camera=camera).ground()
    (outline_px,) = outlines_in_sight_px(ground, ROAD.rings_m)
    assert len(outline_px) > 3 and np.isfinite(outline_px).all()
    # Of all pixels those whose ground is on the road are within what is drawn.
    x, y = np.meshgrid(np.arange(4, SIZE[0], 16), np.arange(60, SIZE[1], 16))
    pixels = np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)
    on_road = ROAD.contains(ground.to_ground(pixels)[0])
    assert 20 < on_road.sum() < 400
    as_drawn = Zone("drawn", "no_go", [[outline_px]])
    clear = np.abs(as_drawn.gap_m(pixels)[0]) > 1.5
    np.testing.assert_array_equal(as_drawn.contains(pixels)[clear], on_road[clear])
    behind = box(-20.0, -120.0, 30.0, 30.0)
    assert [len(one) for one in outlines_in_sight_px(ground, [behind])] == [0]


def test_cutting_a_polygon_to_a_box_keeps_the_part_in_it() -> None:
    part = clip_to_box(np.array([[-1.0, 1.0], [1.0, -1.0], [3.0, 1.0], [1.0, 3.0]]), np.zeros(2), np.full(2, 2.0))
    assert Zone("a", "no_go", [[part]]).contains(np.array([[0.1, 0.1], [1.0, 1.0]])).all()
    np.testing.assert_allclose([part.min(axis=0), part.max(axis=0)], [[0.0, 0.0], [2.0, 2.0]])
    assert len(clip_to_box(box(5.0, 5.0, 1.0, 1.0), np.zeros(2), np.full(2, 2.0))) == 0


def test_a_zone_with_a_hazard_has_its_colour_and_the_entity_says_where_it_is() -> None:
    site = FakeSite(SIZE)
    calm, danger = drawn(site.result(0)), drawn(site.result(0), [in_zone("danger")])
    corner_px = site.ground().to_image(PIT.rings_m[0][:1])[0][0]
    assert shows(calm, corner_px, bgr("zone")) and shows(danger, corner_px, bgr("danger"))
    inside_px, _ = site.ground().to_image(np.array([[1.5, 7.0], [-2.0, 10.0]]))
    (in_pit, in_hole) = (danger[round(y), round(x)].max() for x, y in inside_px.tolist())
    assert in_pit > 20 and in_hole == 0
    measurements = sketch(site.result(0), [in_zone("danger")]).measurements
    assert measurements.zone_words() == {3: "in pit"}
    assert measurements.track_tones()[2] == "danger"
    assert sketch(site.result(0), [in_zone("warning")]).measurements.zone_words() == {3: "near pit"}
    assert sketch(site.result(0), [in_zone("danger", phase="unknown")]).measurements.zone_words() == {
        3: "perhaps in pit"
    }


def test_the_hazard_of_a_crossing_is_not_that_of_its_pair() -> None:
    crossing = replace(in_zone("danger"), track_ids=(1, 3))
    near = Hazard("P", "proximity", "warning", "opened", (1, 3), 0.0, 9.0, 0.5, 0.2)
    open_hazards = OpenHazards().after([near, crossing])
    assert open_hazards.by_pair() == {(1, 3): near}
    assert open_hazards.in_zones() == (crossing,)


def test_where_the_site_frame_is_nobodys_no_zone_is_drawn_and_the_picture_says_so() -> None:
    result = FakeSite(SIZE).result(0)
    elsewhere = replace(result, ground=replace(FakeSite(SIZE).ground(), frame_stated=False))
    difference = (drawn(result) != drawn(elsewhere)).any(axis=2)
    assert not any(shows(drawn(elsewhere), at_px, bgr("zone")) for at_px in np.argwhere(difference)[::50, ::-1])
    assert (drawn(elsewhere)[-90:] > 200).sum() > 1.2 * (drawn(result)[-90:] > 200).sum()  # three lines, not two


def test_from_above_a_zone_lies_where_it_is() -> None:
    panel = np.zeros((400, 300, 3), dtype=np.uint8)
    birdseye = BirdsEye((300, 400), DrawParams(size=3.0, circles=False, labels=False), TEXT)
    result = FakeSite(SIZE).result(0)
    birdseye.draw(panel, result.frame.image, sketch(result))
    window = birdseye._window
    assert window is not None
    corners_px = window.to_window(PIT.rings_m[0])
    assert all(shows(panel, at_px, bgr("zone")) for at_px in corners_px)


def test_the_report_lists_the_zones_and_draws_them_on_the_plan(tmp_path: Path, watched: list[FrameResult]) -> None:
    sink = ReportSink(tmp_path / "report.html", ReportParams(pairs=1, moments=0), zones=ZONES)
    for result in watched:
        sink.write(result)
    sink.close(ended(watched))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    text = PageReader.of(page).text
    assert "excavator 3: zone pit" in text
    assert "pit no go 1 0 0 0:02." in text and "haul road machines only 1 0 0 0:01." in text
    assert ">pit: no go<" in page and "Hatched: zones, by name." in text


def test_a_report_of_frames_without_a_stated_frame_says_that_no_zone_was_watched(
    tmp_path: Path, watched: list[FrameResult]
) -> None:
    sink = ReportSink(tmp_path / "report.html", ReportParams(pairs=1, moments=0), zones=ZONES)
    elsewhere = replace(FakeSite((160, 90)).ground(), frame_stated=False)
    results = [replace(quiet(result), ground=elsewhere) for result in watched[:20]]
    for result in results:
        sink.write(result)
    sink.close(ended(results))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    text = PageReader.of(page).text
    assert "Not watched in 20 of 20 measured frames: nobody stated where the site frame lies." in text
    assert ">pit: no go<" not in page and "Zones are not drawn" in text


def test_tables_events_and_the_record_say_the_zone_and_are_as_before_without_one(
    tmp_path: Path, watched: list[FrameResult]
) -> None:
    hazards = HazardSink(tmp_path / "hazards.jsonl")
    tables = {
        name: TableSink(tmp_path / f"{name}.parquet", table)
        for name, table in (("zones", ZONED_TRACKS), ("plain", TRACKS))
    }
    sinks: list[Sink] = [hazards, *tables.values()]
    for result in watched:
        for sink in sinks:
            sink.write(result)
    for sink in sinks:
        sink.close(Outcome("complete"))
    lines = [json.loads(line) for line in (tmp_path / "hazards.jsonl").read_text().splitlines()]
    assert {line["zone"] for line in lines if line["rule"] == "zone"} == {"pit", "haul road"}
    assert all("zone" not in line for line in lines if line["rule"] != "zone")
    assert ended(watched).counts.zones == {
        "haul road": {"danger": 1},
        "pit": {"danger": 1},
    }
    table = pq.read_table(tmp_path / "zones.parquet")
    assert table.drop_columns("zones").equals(pq.read_table(tmp_path / "plain.parquet"))
    last = [row for row in table.to_pylist() if row["frame"] == 61]
    assert {row["track_id"]: row["zones"] for row in last} == {1: [], 2: [], 3: ["pit"], 4: ["haul road"], 5: []}
