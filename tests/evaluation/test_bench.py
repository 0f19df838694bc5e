from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from stages.frames.coded_video import Recipe, coded_picture, write_video

from standoff.config import Replacement, Settings
from standoff.core.errors import SourceError
from standoff.core.types import FrameResult, GroundMap
from standoff.evaluation.bench import bench_source
from standoff.evaluation.bench_baselines import decoding_baseline, picture_baselines
from standoff.evaluation.bench_workload import BenchSite, DrawingSink, SiteFilm, monitor_workload
from standoff.evaluation.timing import Baseline, Spread, StageTimes, collect_times, machine
from standoff.monitor import Monitor, Run
from standoff.stages.frames import SourceParams
from standoff.stages.hazard import HazardMonitor
from standoff.stages.locate import Locator
from standoff.stages.motion import MotionEstimator
from standoff.stages.proximity import ProximityMeter
from standoff.stages.track import Tracker
from standoff.stages.watched import GroundWatcher
from standoff.testing import ScriptedDetector

SMALL_PX = (480, 270)


def run_of(site: BenchSite, kind: Literal["surveyed", "reference"], frames: int = 20) -> Run:
    monitor = Monitor(
        detector=ScriptedDetector({index: site.detections(index) for index in range(frames)}),
        motion=MotionEstimator(),
        ground=site.ground(kind),
        tracker=Tracker(),
        locator=Locator(),
        watcher=GroundWatcher(),
        proximity=ProximityMeter(),
        hazard=HazardMonitor(),
    )
    return Run(SiteFilm(site, frames), monitor, {"drawing": DrawingSink()})


def test_a_spread_is_what_numpy_says() -> None:
    times_ms = np.random.default_rng(0).gamma(2.0, 3.0, 101)
    spread = Spread.of(times_ms)
    assert (spread.median_ms, spread.samples) == (np.median(times_ms), 101)
    assert (spread.p10_ms, spread.p90_ms) == (np.percentile(times_ms, 10), np.percentile(times_ms, 90))
    with pytest.raises(ValueError, match="no times"):
        Spread.of([])


def test_own_work_leaves_out_decoding_inference_and_encoding() -> None:
    stage_ms = {
        "frames": 100.0,
        "detect": 200.0,
        "ground": 1.0,
        "track": 2.0,
        "sinks.video": 400.0,
        "sinks.drawing": 4.0,
    }
    times = StageTimes((stage_ms, {"frames": 100.0, "track": 3.0}))
    assert times.own_work().median_ms == (7.0 + 3.0) / 2
    assert times.total().median_ms == (707.0 + 103.0) / 2
    assert list(times.by_stage()) == list(stage_ms)
    assert times.by_stage()["detect"].samples == 1


def test_a_ratio_above_one_means_that_ours_is_faster() -> None:
    assert Baseline("work", "ours", "theirs", Spread.of([2.0]), Spread.of([5.0])).ratio == 2.5


def test_collecting_stops_the_run_and_leaves_the_warm_up_out() -> None:
    (result,) = run_of(BenchSite(SMALL_PX, 4), "surveyed", frames=1)
    stopped = []

    def endless() -> Iterator[FrameResult]:
        try:
            for number in range(1000):
                yield replace(result, stage_ms={"track": float(number)})
        finally:
            stopped.append(True)

    times = collect_times(endless(), most_frames=40)
    assert [frame["track"] for frame in times.frames] == list(range(4, 40))
    assert stopped == [True]
    with pytest.raises(ValueError, match="no results"):
        collect_times([])


@pytest.mark.parametrize("kind", ["surveyed", "reference"])
@pytest.mark.parametrize("size_px", [(1920, 1080), (1280, 720)])
def test_the_made_up_site_is_measured_as_it_is(
    kind: Literal["surveyed", "reference"], size_px: tuple[int, int]
) -> None:
    site = BenchSite(size_px, 10)
    *_, last = run_of(site, kind)
    assert isinstance(last.ground, GroundMap)
    moving = last.positions.class_id != 6
    assert moving.sum() == 10
    assert last.positions.valid[moving].all()
    assert len(last.proximities) == 24
    assert np.isfinite(last.proximities.distance_m).all()
    grid_m = np.array([[-5.0, 22.0], [5.0, 22.0], [5.0, 32.0], [-5.0, 32.0]])
    seen_m, valid = last.ground.to_ground(site.to_image(grid_m))
    assert valid.all()
    assert np.linalg.norm(seen_m - grid_m, axis=1).max() < (0.01 if kind == "surveyed" else 1.0)


def test_the_workload_runs_all_stages_and_outputs_on_every_frame() -> None:
    times = monitor_workload(SMALL_PX, tracks=5, frames=12)
    by_stage = times.by_stage()
    assert {"ground", "track", "locate", "proximity", "hazard", "sinks.drawing", "sinks.report"} <= by_stage.keys()
    assert {spread.samples for spread in by_stage.values()} == {11}
    assert 0 < times.own_work().median_ms < times.total().median_ms


def test_baselines_do_the_same_work_as_often(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mp4", 12, Recipe(size_px=(320, 240)))
    decoding = decoding_baseline(path, frames=10)
    assert decoding.ours_ms.samples == decoding.theirs_ms.samples == 30
    for baseline in picture_baselines(path, frames=10, width_px=64):
        assert baseline.ours_ms.samples == baseline.theirs_ms.samples == 10
        assert baseline.ratio > 0


def test_a_source_that_only_we_can_read_has_no_baseline(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mp4", 3)
    with pytest.raises(SourceError):
        decoding_baseline(path.with_name("other.mp4"))


def test_the_machine_is_named() -> None:
    named = machine()
    assert named["processor"]
    assert named["cores"] >= 1
    assert {"python", "numpy", "av", "onnxruntime"} <= named["versions"].keys()


@pytest.mark.live
@pytest.mark.parametrize("kind", ["video", "folder"])
def test_a_source_is_timed_with_all_its_outputs_and_nothing_is_left_behind(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # that the made-up site is measured as it is in 1080p, another test says
    monkeypatch.setattr("standoff.evaluation.bench.monitor_workload", partial(monitor_workload, SMALL_PX, 5))
    if kind == "video":
        source, fps = write_video(tmp_path / "v.mp4", 12), None
    else:
        import cv2

        source, fps = tmp_path / "site", 10.0
        source.mkdir()
        for index in range(12):
            cv2.imwrite(str(source / f"{index}.png"), coded_picture(index))
    blind = Replacement(factory="evaluation.blind_detector:BlindDetector")
    settings = Settings(replace={"detect": blind}, source=SourceParams(fps=fps))
    report = bench_source(source, settings, frames=8, workload_frames=10).to_dict()
    json.dumps(report, allow_nan=False)
    assert report["stages"]["track"]["samples"] == 8
    assert {"sinks.drawing", "sinks.video", "sinks.tracks"} <= report["stages"].keys()
    assert report["machine"]["processor"]
    assert report["whole"]["frames"] == 7
    assert report["whole"]["frames_per_s"] > 0
    assert report["source"]["frames_expected"] == 12
    assert report["workload_1080p_10_tracks"].keys() == {"surveyed", "reference"}
    assert len(report["baselines"]) == (4 if kind == "video" else 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == [source.name]
