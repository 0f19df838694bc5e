"""Milliseconds a frame that the outputs cost at 1080p with ten tracks; encoding apart, as a stated baseline."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import cv2
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from stages.sinks.fake_site import FakeSite

from standoff.core.protocols import Sink
from standoff.core.types import FrameResult, ImageArray, Outcome
from standoff.drawing.encoder import VideoFile
from standoff.stages.sinks import (
    FRAMES,
    PROXIMITY,
    TRACKS,
    Composer,
    FrameMeasurements,
    HazardSink,
    ReportSink,
    TableSink,
)

SIZE = (1920, 1080)
_Item = TypeVar("_Item")


@pytest.fixture(scope="module")
def results() -> list[FrameResult]:
    return list(FakeSite(SIZE, tracks=10).results(20))


def _each(items: list[_Item], action: Callable[[_Item], object]) -> Callable[[], None]:
    endless = itertools.cycle(items)

    def act() -> None:
        action(next(endless))

    return act


def _composing(composer: Composer, results: list[FrameResult]) -> Callable[[], None]:
    measured_frames: list[tuple[ImageArray, FrameMeasurements]] = []
    for result in results:
        picture = result.frame.picture.resized_bgr(*composer.picture_size_px)
        measured_frames.append((picture, FrameMeasurements.of(result)))
    return _each(measured_frames, lambda item: composer.compose(*item))


def test_composing_the_annotated_picture(benchmark: BenchmarkFixture, results: list[FrameResult]) -> None:
    benchmark(_composing(Composer(SIZE), results))


def test_composing_with_thirty_tracks(benchmark: BenchmarkFixture) -> None:
    benchmark(_composing(Composer(SIZE), list(FakeSite(SIZE, tracks=30).results(10))))


def test_baseline_halving_the_picture_with_opencv(benchmark: BenchmarkFixture, results: list[FrameResult]) -> None:
    benchmark(_each(results, lambda result: cv2.resize(result.frame.image, (960, 540), interpolation=cv2.INTER_AREA)))


def test_baseline_encoding_the_composed_picture(
    benchmark: BenchmarkFixture, tmp_path: Path, results: list[FrameResult]
) -> None:
    composer, time_s = Composer(SIZE), itertools.count(0.0, 0.04)
    picture = composer.compose(
        results[0].frame.picture.resized_bgr(*composer.picture_size_px), FrameMeasurements.of(results[0])
    )
    file = VideoFile(tmp_path / "annotated.mp4", composer.size_px, crf=23, preset="superfast")
    benchmark(lambda: file.write(picture, next(time_s)))
    file.close()


def test_all_other_outputs(benchmark: BenchmarkFixture, tmp_path: Path, results: list[FrameResult]) -> None:
    sinks: list[Sink] = [
        TableSink(tmp_path / "tracks.parquet", TRACKS),
        TableSink(tmp_path / "proximity.parquet", PROXIMITY),
        TableSink(tmp_path / "frames.parquet", FRAMES),
        HazardSink(tmp_path / "hazards.jsonl"),
        ReportSink(tmp_path / "report.html"),
    ]

    def write(result: FrameResult) -> None:
        for sink in sinks:
            sink.write(result)

    benchmark(_each(results, write))
    for sink in sinks:
        sink.close(Outcome("complete"))
