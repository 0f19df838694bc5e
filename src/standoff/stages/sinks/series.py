"""Curves of any length in a bounded amount of memory; what is closest is never thinned out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray


@dataclass(slots=True)
class Sample:
    """The closest measurement of some consecutive frames.

    Attributes:
        start_s: Time of the first of them.
        end_s: Time of the last.
        time_s: Time of the closest.
        gap_m: Its gap; NaN when none was measured.
        distance_m: Its distance.
        sigma_m: Its standard error.
        frames: Number of frames.
        unmeasured: Number of frames without a measurement.
    """

    start_s: float
    end_s: float
    time_s: float
    gap_m: float
    distance_m: float
    sigma_m: float
    frames: int = 1
    unmeasured: int = 0

    def joined(self, later: Sample) -> Sample:
        """Return both as one sample."""
        closest = later if not self.gap_m <= later.gap_m and later.gap_m == later.gap_m else self
        return Sample(
            self.start_s,
            later.end_s,
            closest.time_s,
            closest.gap_m,
            closest.distance_m,
            closest.sigma_m,
            self.frames + later.frames,
            self.unmeasured + later.unmeasured,
        )


class Series:
    """Samples over time: at first one a frame, later one for two frames, four, ...

    Args:
        capacity: Most samples kept.
    """

    def __init__(self, capacity: int = 1200) -> None:
        self._capacity, self._frames_per_sample = capacity, 1
        self._samples: list[Sample] = []
        self.closest: Sample | None = None

    def add(self, time_s: float, gap_m: float, distance_m: float, sigma_m: float) -> None:
        """Add a frame; NaN where nothing was measured."""
        missing = not math.isfinite(gap_m)
        sample = Sample(time_s, time_s, time_s, gap_m, distance_m, sigma_m, unmeasured=int(missing))
        if not missing and (self.closest is None or gap_m < self.closest.gap_m):
            self.closest = sample
        if self._samples and self._samples[-1].frames < self._frames_per_sample:
            self._samples[-1] = self._samples[-1].joined(sample)
            return
        self._samples.append(sample)
        if len(self._samples) > self._capacity:
            pairs = zip(self._samples[0:-1:2], self._samples[1::2], strict=False)
            self._samples = [first.joined(second) for first, second in pairs] + (
                self._samples[-1:] if len(self._samples) % 2 else []
            )
            self._frames_per_sample *= 2

    def column(self, name: str) -> FloatArray:
        """Return one attribute of all samples, (N,)."""
        return np.array([getattr(sample, name) for sample in self._samples], dtype=np.float64)

    def unmeasured_spans_s(self) -> list[tuple[float, float]]:
        """Return (start, end) of each stretch in which frames went unmeasured, up to the next measured one."""
        spans: list[tuple[float, float]] = []
        for i, sample in enumerate(self._samples):
            if not sample.unmeasured:
                continue
            end_s = self._samples[i + 1].start_s if i + 1 < len(self._samples) else sample.end_s
            if spans and spans[-1][1] >= sample.start_s:
                spans[-1] = (spans[-1][0], end_s)
            else:
                spans.append((sample.start_s, end_s))
        return spans


class Trail:
    """Where a track went: thinned out evenly when it gets long; breaks are kept.

    Args:
        name: What the track is called.
        class_id: Its class.
        capacity: Most points kept.
    """

    def __init__(self, name: str, class_id: int, capacity: int = 800) -> None:
        self.name, self.class_id = name, class_id
        self._capacity, self._every, self._seen = capacity, 1, 0
        self._points: list[tuple[float, float]] = []

    def add(self, x_m: float, y_m: float) -> None:
        """Add a frame's position; NaN where it is unknown."""
        self._seen += 1
        if self._seen % self._every == 0 or (math.isnan(x_m) and self._points and not math.isnan(self._points[-1][0])):
            self._points.append((x_m, y_m))
        if len(self._points) > self._capacity:
            points = self.points_m
            is_break = np.isnan(points[:, 0])
            keep = np.arange(len(points)) % 2 == 0
            self._points = [tuple(p) for p in points[keep | is_break].tolist()]
            self._every *= 2

    def __len__(self) -> int:
        """Return the number of frames seen."""
        return self._seen

    @property
    def points_m(self) -> FloatArray:
        """(N, 2) site frame; rows of NaN where it was lost in between."""
        return np.array(self._points, dtype=np.float64).reshape(-1, 2)
