"""`standoff bench`: milliseconds a stage on a given source, beside baselines measured in the same run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from standoff.config import Settings
from standoff.evaluation.bench_baselines import (
    decoding_baseline,
    detection_baseline,
    picture_baselines,
    ransac_baseline,
)
from standoff.evaluation.bench_workload import DrawingSink, monitor_workload
from standoff.evaluation.timing import Baseline, StageTimes, Throughput, collect_times, machine, time_through
from standoff.monitor import open_run
from standoff.stages.detect import OnnxDetector, find_model
from standoff.stages.frames import open_source

OWN_WORK_LIMIT_MS = 10.0
"""What the monitor itself may cost a frame at 1080p with ten tracks."""

_DETECTION_FRAMES = 20


@dataclass(frozen=True, slots=True)
class BenchReport:
    """What was measured.

    Attributes:
        machine: Where.
        source: On what.
        stages: Each frame's times on the source.
        whole: How fast all of it is, reading, detecting and writing side by side.
        workload: Each frame's times on the made-up site at 1080p with ten tracks, by kind of ground stage.
        baselines: Somebody else's times for the same work.
    """

    machine: dict[str, Any]
    source: dict[str, Any]
    stages: StageTimes
    whole: Throughput
    workload: dict[str, StageTimes]
    baselines: tuple[Baseline, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "machine": self.machine,
            "source": self.source,
            **_times(self.stages),
            "whole": self.whole.to_dict(),
            "workload_1080p_10_tracks": {kind: _times(times) for kind, times in self.workload.items()},
            "own_work_limit_ms": OWN_WORK_LIMIT_MS,
            "baselines": [baseline.to_dict() for baseline in self.baselines],
        }


def _times(times: StageTimes) -> dict[str, Any]:
    return {
        "stages": {stage: spread.to_dict() for stage, spread in times.by_stage().items()},
        "own_work": times.own_work().to_dict(),
        "total": times.total().to_dict(),
    }


def bench_source(
    source: Path,
    settings: Settings,
    *,
    frames: int = 300,
    workload_frames: int = 200,
    darknet: tuple[Path, Path] | None = None,
) -> BenchReport:
    """Run everything that is configured on a source, outputs included, and time it.

    Decoding goes on in threads of its own, so that the time of stage `frames` is what is waited for it.
    Pixels are converted in the stage that first asks for them.

    Args:
        source: Video file or folder of pictures.
        settings: What to run; its outputs go to a folder that is removed afterwards.
        frames: At most so many.
        workload_frames: How many of the made-up site.
        darknet: cfg and weights of the model, for OpenCV's time on the same network.

    Raises:
        StandoffError: Something of it cannot be used.
    """
    with TemporaryDirectory() as folder:
        drawing = {"drawing": DrawingSink(settings.video)} if "video" in settings.outputs else {}
        run = open_run(source, Path(folder) / "run", settings, more_sinks=drawing, overlaps=False)
        described = dict(run.source.describe())
        stages = collect_times(run, frames)
        whole = time_through(open_run(source, Path(folder) / "whole", settings), frames)
    return BenchReport(
        machine=machine(),
        source=described,
        stages=stages,
        whole=whole,
        workload={
            "surveyed": monitor_workload(frames=workload_frames),
            "reference": monitor_workload(frames=workload_frames, ground="reference"),
        },
        baselines=(
            *_picture_baselines(source, settings, frames),
            ransac_baseline(),
            *_detection_baselines(source, settings, darknet),
        ),
    )


def _picture_baselines(source: Path, settings: Settings, frames: int) -> Iterator[Baseline]:
    if source.is_file():
        yield decoding_baseline(source, frames)
    yield from picture_baselines(source, fps=settings.source.fps, frames=frames)


def _detection_baselines(source: Path, settings: Settings, darknet: tuple[Path, Path] | None) -> Iterator[Baseline]:
    if darknet is None:
        return
    detector = OnnxDetector(find_model(settings.model), settings.detect)
    width_px, height_px = detector.describe()["input_size_px"]
    with open_source(source, fps=settings.source.fps, start_s=settings.source.start_s) as opened:
        frames = list(islice(opened, _DETECTION_FRAMES))
    yield detection_baseline(detector, frames, *darknet, size_px=(width_px, height_px))
