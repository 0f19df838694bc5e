"""Milliseconds of one core for judging one picture and its map, which happens every half second, beside one blur.

python -m pytest benchmarks/test_watched.py --benchmark-columns=min,median,iqr
"""

from __future__ import annotations

import time

import cv2
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from standoff.core.motions import NoCameraMotion
from standoff.core.types import Detections, GroundPositions, Tracks
from standoff.evaluation.bench_workload import BenchSite, SiteFilm
from standoff.stages.watched import GroundWatcher, WatchedParams

pytestmark = pytest.mark.benchmark(timer=time.process_time)

SIZES_PX = {"1080p": (1920, 1080), "4K": (3840, 2160)}


@pytest.mark.parametrize("size", SIZES_PX)
def test_judging_a_picture(benchmark: BenchmarkFixture, size: str) -> None:
    cv2.setNumThreads(1)
    site = BenchSite(SIZES_PX[size], 10)
    frame = next(SiteFilm(site, 1).frames())
    ground = site.ground("surveyed").update(frame, site.detections(0), NoCameraMotion("one picture"))
    watcher = GroundWatcher(WatchedParams(judge_every_s=0.0))
    nobody = Tracks.empty(), GroundPositions.empty()
    assert benchmark(watcher.update, frame, Detections.empty(), ground, *nobody).judged


def test_baseline_one_gaussian_blur_with_opencv(benchmark: BenchmarkFixture) -> None:
    cv2.setNumThreads(1)
    gray = np.random.default_rng(0).normal(120.0, 30.0, (540, 960)).astype(np.float32)
    assert benchmark(lambda: cv2.GaussianBlur(gray, (0, 0), 1.0)).shape == (540, 960)
