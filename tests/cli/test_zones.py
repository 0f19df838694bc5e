"""Zones from the command line to every output."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from cli.calling import Call
from cli.test_cli import FINDS, make_video
from files.test_zone_file import collection, feature
from pages import PageReader

from standoff.core import protocols
from standoff.core.types import Detections, Frame, GroundMap
from standoff.files.zone_file import read_zones

RING = [[5.0, 5.0], [8.0, 5.0], [8.0, 7.0], [5.0, 7.0], [5.0, 5.0]]


class Walk(protocols.Detector):
    """A detector that sees a worker walk through the picture at 3 m/s, along y = 5.5 m."""

    def describe(self) -> Mapping[str, Any]:
        return FINDS

    def detect(self, frame: Frame) -> Detections:
        left = 20.0 + 60.0 * frame.time_s
        return Detections(np.array([[left, 100.0, left + 12.0, 130.0]]), np.array([0.9]), np.array([0]))


@pytest.fixture
def video(tmp_path: Path) -> Path:
    return make_video(tmp_path / "site.mp4", 34)


@pytest.fixture
def walk(site: Path) -> Path:
    settings = yaml.safe_load(site.read_text())
    settings["replace"]["detect"]["factory"] = "cli.test_zones:Walk"
    site.write_text(yaml.safe_dump(settings))
    return site


def zones_file(folder: Path, content: object = None) -> Path:
    path = folder / "plan.geojson"
    path.write_text(json.dumps(content or collection(feature("pit", "machine_only", coordinates=[RING]))))
    return path


def events_in(out: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in (out / "hazards.jsonl").read_text().splitlines()]


def test_a_worker_who_walks_through_a_zone_is_told_in_every_output(
    call: Call, video: Path, walk: Path, tmp_path: Path
) -> None:
    plan, out = zones_file(tmp_path), tmp_path / "out"
    code, printed, err = call("run", video, "--config", walk, "--zones", plan, "--out", out)
    assert (code, err) == (0, "")
    assert "in pit" in printed
    events = events_in(out)
    assert {(event["rule"], event["zone"], len(event["track_ids"])) for event in events} == {("zone", "pit", 1)}  # type: ignore[arg-type]
    assert [event["phase"] for event in (events[0], events[-1])] == ["opened", "closed"]
    assert "danger" in {event["severity"] for event in events}
    # He is in it from the time at which his feet pass x = 5 m to that at which they pass 8 m.
    danger_s = [event["time_s"] for event in events if event["severity"] == "danger" and event["phase"] != "closed"]
    enters_s, leaves_s = ((20.0 * x_m - 26.0) / 60.0 for x_m in (5.0, 8.0))
    assert enters_s < min(danger_s) < enters_s + 0.5  # type: ignore[type-var, operator]
    assert max(danger_s) < leaves_s + 0.6  # type: ignore[type-var, operator]
    record = json.loads((out / "run.json").read_text())
    assert record["counts"]["zones"] == {"pit": {"danger": 1}}
    assert record["settings"]["zones"] == str(plan)
    assert "zone pit" in PageReader.of((out / "report.html").read_text()).text
    (written,), (given,) = read_zones(out / "zones.geojson"), read_zones(plan)
    assert (written.name, written.kind) == (given.name, given.kind)
    np.testing.assert_array_equal(written.outline_m, given.outline_m)


def test_the_settings_name_zones_relative_to_themselves_and_a_run_without_them_is_as_before(
    call: Call, video: Path, walk: Path, tmp_path: Path
) -> None:
    options = ("--config", walk, "--outputs", "hazards,tracks")
    assert call("run", video, *options, "--out", tmp_path / "plain")[0] == 0
    assert not (tmp_path / "plain" / "zones.geojson").exists()
    assert events_in(tmp_path / "plain") == []
    zones_file(tmp_path)
    walk.write_text(walk.read_text() + "zones: plan.geojson\n")
    assert call("config", "check", walk)[0] == 0
    assert call("run", video, *options, "--out", tmp_path / "zones")[0] == 0
    assert {event["zone"] for event in events_in(tmp_path / "zones")} == {"pit"}
    code, _, err = call("run", video, *options, "--out", tmp_path, "--overwrite", "--zones", tmp_path / "zones.geojson")
    assert (code, "zones.geojson" in err) == (2, True)


def test_where_nobody_stated_the_site_frame_zones_are_unknown_and_a_warning_says_so(
    call: Call, video: Path, walk: Path, tmp_path: Path
) -> None:
    settings = yaml.safe_load(walk.read_text())
    settings["replace"]["ground"] = {"factory": "cli.test_zones:OwnGround"}
    walk.write_text(yaml.safe_dump(settings))
    plan, out = zones_file(tmp_path), tmp_path / "out"
    code, _, err = call("run", video, "--config", walk, "--zones", plan, "--outputs", "hazards", "--out", out)
    assert code == 0
    assert "zones were not watched in 34 of 34 frames with a ground map" in err
    told = [(event["rule"], event["severity"], event["phase"]) for event in events_in(out)]
    assert told == [("zone", "unknown", "opened"), ("zone", "unknown", "closed")]


class OwnGround(protocols.Ground):
    """A ground stage of somebody's own that says nothing of where its site frame lies."""

    def update(self, frame: Frame, detections: Detections, motion: object) -> GroundMap:
        matrix = np.array([[0.05, 0.0, 0.0], [0.0, -0.05, 12.0], [0.0, 0.0, 1.0]])
        return GroundMap(matrix, np.zeros((9, 9)), frame.size_px, "own", 0.05)


def test_zones_that_cannot_be_used_end_the_run_in_one_line_before_anything_is_written(
    call: Call, video: Path, walk: Path, tmp_path: Path
) -> None:
    degrees = [[8.5 + x / 71_000, 50.1 + y / 111_000] for x, y in RING]
    for content, message in (
        (collection(feature(kind="forbidden")), "found 'forbidden' in 'pit'"),
        (collection(feature(coordinates=[degrees])), "degrees of longitude and latitude"),
    ):
        path = zones_file(tmp_path, content)
        code, _, err = call("run", video, "--config", walk, "--zones", path, "--out", tmp_path / "out")
        assert code == 2
        assert message in err and err.count("\n") == 1
        assert not (tmp_path / "out").exists()
    code, _, err = call("run", video, "--config", walk, "--zones", tmp_path / "none", "--out", tmp_path / "out")
    assert (code, "no such file" in err) == (2, True)
    settings = yaml.safe_load(walk.read_text())
    settings["replace"]["hazard"] = {"factory": "standoff.stages.hazard:HazardMonitor"}
    walk.write_text(yaml.safe_dump(settings))
    code, _, err = call("run", video, "--config", walk, "--zones", zones_file(tmp_path), "--out", tmp_path / "out")
    assert (code, "zones beside a hazard stage of your own" in err) == (2, True)


def test_zones_in_degrees_are_placed_by_a_survey_in_degrees(
    call: Call, video: Path, walk: Path, tmp_path: Path
) -> None:
    survey = yaml.safe_load((tmp_path / "survey.yaml").read_text())
    origin_m = survey["points"][0]["m"]

    def degrees(place_m: list[float]) -> list[float]:
        return [8.5 + (place_m[0] - origin_m[0]) / 71_519.6, 50.1 + (place_m[1] - origin_m[1]) / 111_229.0]

    for point in survey["points"]:
        point["lonlat"] = degrees(point.pop("m"))
    (tmp_path / "survey.yaml").write_text(yaml.safe_dump(survey))
    plan = zones_file(tmp_path, collection(feature("pit", coordinates=[[degrees(place) for place in RING]])))
    out = tmp_path / "out"
    code, _, err = call("run", video, "--config", walk, "--zones", plan, "--outputs", "hazards", "--out", out)
    assert (code, err) == (0, "")
    (zone,) = read_zones(out / "zones.geojson")
    np.testing.assert_allclose(zone.rings_m[0], np.array(RING[:-1]) - origin_m, atol=0.01)
    assert "danger" in {event["severity"] for event in events_in(out)}
