from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import drawn_clip
import pytest
import tolerances
from stages.sinks.fake_site import FakeSite

from standoff.clips import load_clip
from standoff.core.errors import DataError
from standoff.core.types import Outcome
from standoff.evaluation.paper import MonitorSetup, evaluate_clip
from standoff.evaluation.paper.monitored_clip import open_clip_video
from standoff.evaluation.paper.truth_detector import TrueBoxes
from standoff.stages.sinks import TableSink, detections_table


def record_truth(clip_folder: Path, run: Path) -> Path:
    """Write the detections of a run whose detector knows the clip."""
    clip, any_result = load_clip(clip_folder), FakeSite((64, 36)).result(0)
    detector = TrueBoxes(clip)
    run.mkdir()
    with open_clip_video(clip) as source:
        sink = TableSink(run / "detections.parquet", detections_table(source.describe(), detector.describe()))
        for frame in source:
            sink.write(replace(any_result, frame=frame, detections=detector.detect(frame)))
    sink.close(Outcome("complete"))
    return run


def test_a_run_of_the_clip_stands_in_for_its_detector(clip_folder: Path, tmp_path: Path) -> None:
    run = record_truth(clip_folder, tmp_path / "run")
    result = evaluate_clip(load_clip(clip_folder), MonitorSetup("oriented", run)).to_dict()
    assert result["trial"]["detector"] == "recorded in run"
    workers = next(score for score in result["localisation"] if score["class_name"] == "worker")
    assert workers["detected"] == drawn_clip.FRAMES
    assert workers["position_mean_m"] < tolerances.DRAWN_SITE_M["oriented"]


def test_a_run_of_another_clip_is_refused(clip_folder: Path, tmp_path: Path) -> None:
    run = record_truth(clip_folder, tmp_path / "run")
    other = Path(shutil.copytree(clip_folder, tmp_path / "other"))
    with (other / "video.mp4").open("ab") as video:
        video.write(b"\0\0\0\x08free")
    with pytest.raises(DataError, match="with other content"):
        evaluate_clip(load_clip(other), MonitorSetup("oriented", run / "detections.parquet"))
