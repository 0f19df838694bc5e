"""How far off the ground map alone is: true places of feet through it, without boxes, trackers and filters.

Everything that is measured later inherits this error. It is given against level ground, where the map is to blame for
all of it, and with the ground as it is, where hills and pits add theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from standoff.clips import Clip
from standoff.core.homography import FloatArray
from standoff.evaluation.paper.mapped_points import MappedPoints
from standoff.evaluation.paper.monitored_clip import MonitoredClip
from standoff.evaluation.stated_errors import plane_sigmas, plane_sigmas2_around

NEAR_M = 20.0
"""Points within this distance of the reference's middle count."""

WRONG_M, WRONG_SIGMAS = 0.5, 5.0
"""Off by more than both is wrong and believed: an error that matters, and that the stated one does not cover."""


@dataclass(frozen=True, slots=True, eq=False)
class MapSamples:
    """Every point that counts, N of them.

    Attributes:
        error_m: (N,) distance from where it really is.
        sigmas: (N,) the same in the map's own standard errors (Mahalanobis).
        sigma_m: (N,) the map's standard error of one coordinate.
        beyond: Further points that have a map which puts them beyond its horizon.
    """

    error_m: FloatArray
    sigmas: FloatArray
    sigma_m: FloatArray
    beyond: int


@dataclass(frozen=True, slots=True)
class MapFigures:
    """The errors of points within 20 m of the reference; NaN where there is no point.

    Attributes:
        points: Measured, in all frames with a map.
        beyond: Points that a map puts beyond its horizon, not measured.
        median_m: Of the distance from the truth.
        p95_m: 95th percentile of the same.
        worst_m: Largest.
        inside_share: Of the points, inside the 95 % region that the map states.
        believed_wrong_share: Of the points, off by more than 0.5 m and more than five stated standard errors.
        sigma_m: Median of the stated standard error of one coordinate.
    """

    points: int
    beyond: int
    median_m: float
    p95_m: float
    worst_m: float
    inside_share: float
    believed_wrong_share: float
    sigma_m: float


@dataclass(frozen=True, slots=True)
class MapScore:
    """The map alone.

    Attributes:
        frames: Of the clip.
        without_map: Of these, without a map.
        frames_since_seen: From the first one on in which the whole reference was in the picture.
        without_map_since_seen: Of these, without a map.
        level: Against level ground.
        uneven: Against the ground as it is.
    """

    frames: int
    without_map: int
    frames_since_seen: int
    without_map_since_seen: int
    level: MapFigures
    uneven: MapFigures


def map_samples(clip: Clip, monitored: MonitoredClip, mapped: MappedPoints) -> MapSamples:
    """Collect the errors of one kind of points, of a clip with a reference object."""
    assert clip.reference is not None
    middle_m = clip.reference.corners_m.mean(axis=0)
    counts = np.linalg.norm(clip.xy_m - middle_m, axis=2) <= NEAR_M
    counts &= np.isfinite(clip.box_px).all(axis=2) & np.isfinite(monitored.scale_m_per_px)[:, None]
    measured = counts & np.isfinite(mapped.xy_m).all(axis=2)
    off_m = (mapped.xy_m - clip.xy_m)[measured]
    covariance_m2 = mapped.covariance_m2[measured]
    return MapSamples(
        error_m=np.linalg.norm(off_m, axis=1),
        sigmas=plane_sigmas(off_m, covariance_m2),
        sigma_m=np.sqrt(np.trace(covariance_m2, axis1=1, axis2=2) / 2.0),
        beyond=int((counts & ~measured).sum()),
    )


def figures_of(samples: Sequence[MapSamples]) -> MapFigures:
    """Return the figures of one clip's points, or of several clips' together."""
    error_m, sigmas, sigma_m = (
        np.concatenate([getattr(one, name) for one in samples]) for name in ("error_m", "sigmas", "sigma_m")
    )
    beyond = sum(one.beyond for one in samples)
    if not len(error_m):
        return MapFigures(0, beyond, *[float("nan")] * 6)
    return MapFigures(
        points=len(error_m),
        beyond=beyond,
        median_m=float(np.median(error_m)),
        p95_m=float(np.percentile(error_m, 95)),
        worst_m=float(error_m.max()),
        inside_share=float((sigmas**2 <= plane_sigmas2_around(0.95)).mean()),
        believed_wrong_share=float(((error_m > WRONG_M) & (sigmas > WRONG_SIGMAS)).mean()),
        sigma_m=float(np.median(sigma_m)),
    )


def score_map(clip: Clip, monitored: MonitoredClip) -> MapScore:
    """Score the map of every frame, of a clip with a reference object."""
    assert clip.reference is not None
    without = ~np.isfinite(monitored.scale_m_per_px)
    seen = clip.reference.inside(monitored.size_px) & (clip.reference.visible_share > 0.0)
    since_seen = np.logical_or.accumulate(seen)
    return MapScore(
        frames=len(without),
        without_map=int(without.sum()),
        frames_since_seen=int(since_seen.sum()),
        without_map_since_seen=int((without & since_seen).sum()),
        level=figures_of([map_samples(clip, monitored, monitored.level_feet)]),
        uneven=figures_of([map_samples(clip, monitored, monitored.true_feet)]),
    )
