"""Milliseconds, how they spread, and the machine that they were measured on."""

from __future__ import annotations

import os
import platform
from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Self

import numpy as np

from standoff.core.types import FrameResult
from standoff.files.versions import library_versions

NOT_OUR_WORK = frozenset({"frames", "detect", "sinks.video"})
"""Decoding, inference, and the sink that encodes video; drawing for it is timed as a sink of its own."""

_WARM_UP_SHARE = 0.1
_MOST_WARM_UP = 20


@dataclass(frozen=True, slots=True)
class Spread:
    """How long something takes.

    Attributes:
        median_ms: Half of the times are shorter.
        p10_ms: A tenth is shorter.
        p90_ms: A tenth is longer.
        samples: How many times it was measured.
    """

    median_ms: float
    p10_ms: float
    p90_ms: float
    samples: int

    @classmethod
    def of(cls, times_ms: Iterable[float]) -> Self:
        """Summarise one or more times.

        Raises:
            ValueError: There are none.

        >>> Spread.of([3.0, 1.0, 2.0]).median_ms
        2.0
        """
        times = np.fromiter(times_ms, dtype=np.float64)
        if not times.size:
            raise ValueError("no times to summarise")
        p10, median, p90 = np.percentile(times, [10, 50, 90])
        return cls(float(median), float(p10), float(p90), times.size)

    def to_dict(self) -> dict[str, float]:
        """Return plain values, rounded to a tenth of a microsecond."""
        return {
            "median_ms": round(self.median_ms, 4),
            "p10_ms": round(self.p10_ms, 4),
            "p90_ms": round(self.p90_ms, 4),
            "samples": self.samples,
        }


@dataclass(frozen=True, slots=True)
class StageTimes:
    """Each frame's milliseconds by stage, warm-up left out.

    Attributes:
        frames: `FrameResult.stage_ms` of frame after frame.
    """

    frames: tuple[Mapping[str, float], ...]

    def by_stage(self) -> dict[str, Spread]:
        """Return each stage's spread over the frames on which it ran, in the order of the pipeline."""
        names = dict.fromkeys(name for frame in self.frames for name in frame)
        return {name: Spread.of(frame[name] for frame in self.frames if name in frame) for name in names}

    def own_work(self) -> Spread:
        """Return what the monitor itself costs a frame: all but decoding, inference and video encoding."""
        return Spread.of(
            sum(duration_ms for stage, duration_ms in frame.items() if stage not in NOT_OUR_WORK)
            for frame in self.frames
        )

    def total(self) -> Spread:
        """Return what a frame costs in all."""
        return Spread.of(sum(frame.values()) for frame in self.frames)


def collect_times(results: Iterable[FrameResult], most_frames: int | None = None) -> StageTimes:
    """Read results to the end, or up to `most_frames` of them, and keep their times.

    The first tenth, 20 frames at most, warms up caches and compilers and is left out.

    Raises:
        ValueError: There is not one result.
    """
    iterator = iter(results)
    frames = [dict(result.stage_ms) for result in islice(iterator, most_frames)]
    if isinstance(iterator, Generator):
        iterator.close()
    if not frames:
        raise ValueError("no results to time")
    warm_up = min(_MOST_WARM_UP, int(len(frames) * _WARM_UP_SHARE))
    return StageTimes(tuple(frames[warm_up:]))


@dataclass(frozen=True, slots=True)
class Baseline:
    """Somebody else's way to do the same work on the same input, in the same run.

    Attributes:
        name: What is done.
        ours: How standoff does it.
        theirs: How the baseline does it.
        ours_ms: Time of ours.
        theirs_ms: Time of theirs.
    """

    name: str
    ours: str
    theirs: str
    ours_ms: Spread
    theirs_ms: Spread

    @property
    def ratio(self) -> float:
        """Median of theirs over median of ours: above 1, ours is the faster one."""
        return self.theirs_ms.median_ms / self.ours_ms.median_ms

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "name": self.name,
            "ours": self.ours,
            "theirs": self.theirs,
            "ours_ms": self.ours_ms.to_dict(),
            "theirs_ms": self.theirs_ms.to_dict(),
            "ratio": round(self.ratio, 3),
        }


def machine() -> dict[str, Any]:
    """Name the machine: processor, cores that this process may use, how busy it was, versions."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "load_1_min": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
        "versions": library_versions(),
    }


def _processor(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() in {"model name", "Model"}:
                return value.strip()
    return platform.processor() or platform.machine()
