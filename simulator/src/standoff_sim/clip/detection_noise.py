"""What a detector would make of a frame, drawn from its truth: misses, edges that are off, scores, false alarms.

The parameters are those of the detector that comes with standoff, fitted by `examples/detection_noise/fit.py`, and of
the networks that tell ground points in its boxes, by `fit_points.py` beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.special import expit, ndtr

from standoff.clips import FOOT_COLUMNS
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff_sim.clip.truth import Row

USUAL_SIZE_PX = 32.0
"""Square root of a box's area at which `found` and `score` begin to count."""
LEAST_SCORE = 0.1
"""Of `standoff.stages.detect.DetectParams`: what is less sure is not passed on."""
_SURE = 0.999
_LATENT = 6  # four edges, score, presence
_POINT_LATENT = 3  # the point across and down, its stated error
_SMALLEST_PX = 2.0


@dataclass(frozen=True, slots=True)
class ClassNoise:
    """How the detector errs about one group of classes.

    Size is log2 of the square root of the visible box's area over `USUAL_SIZE_PX`; hidden is 1 less the visible share.

    Attributes:
        found: Log odds of being found: at the usual size in full view, change with size, change with hidden.
        edge_bias: Mean error of left, top, right and bottom, as a share of the box's width or height; > 0 outwards.
        edge_share: Standard deviation of the errors of the same edges, as a share of the width or height.
        edge_px: Standard deviation of a further error; px.
        score: Log odds of the score of what is found: as of `found`.
        score_sigma: Standard deviation around them.
        false_per_frame: Mean number of detections of nothing, of each class of the group.
        false_size: Mean and standard deviation of their size.
        false_score: Mean and standard deviation of the log odds of their score.
    """

    found: tuple[float, float, float]
    edge_bias: tuple[float, float, float, float]
    edge_share: tuple[float, float, float, float]
    edge_px: float
    score: tuple[float, float, float]
    score_sigma: float
    false_per_frame: float
    false_size: tuple[float, float]
    false_score: tuple[float, float]


@dataclass(frozen=True, slots=True)
class PointNoise:
    """How the ground points of one class err.

    Attributes:
        stated: Median of the stated standard errors, across and down, as shares of the box's longer side.
        spread: Standard deviation of their logarithm from one entity to another.
        bias: Mean error, right and down, likewise.
        off: Standard deviation of the errors, across and down, in stated standard errors.
    """

    stated: tuple[float, float]
    spread: float
    bias: tuple[float, float]
    off: tuple[float, float]


GROUPS: Mapping[str, str] = MappingProxyType(
    {
        "worker": "worker", "excavator": "machine", "wheel_loader": "machine", "dump_truck": "machine",
        "roller_or_dozer": "machine", "vehicle": "vehicle", "reference": "reference",
    }
)  # fmt: skip
"""Class to the row of `NOISE`."""

MEMORY_S = 0.48
"""Time after which an error of the box of one entity is forgotten to 1/e."""
MISS_MEMORY_S = 2.51
"""The same of whether it is found."""

NOISE: Mapping[str, ClassNoise] = MappingProxyType(
    {
        "worker": ClassNoise(
            found=(2.508, 1.278, -4.213),
            edge_bias=(-0.034, 0.015, -0.007, -0.013),
            edge_share=(0.106, 0.076, 0.13, 0.114),
            edge_px=1.15,
            score=(2.085, 1.193, -1.096),
            score_sigma=1.46,
            false_per_frame=6.135,
            false_size=(-1.3, 0.59),
            false_score=(-1.02, 0.98),
        ),
        "machine": ClassNoise(
            found=(0.576, 2.008, -5.125),
            edge_bias=(0.006, 0.014, 0.024, 0.031),
            edge_share=(0.074, 0.077, 0.075, 0.077),
            edge_px=3.39,
            score=(1.026, 1.579, -5.072),
            score_sigma=1.72,
            false_per_frame=0.338,
            false_size=(0.9, 0.71),
            false_score=(-0.69, 1.24),
        ),
        "vehicle": ClassNoise(
            found=(2.881, 1.673, -3.25),
            edge_bias=(-0.043, -0.024, -0.035, -0.048),
            edge_share=(0.107, 0.086, 0.118, 0.101),
            edge_px=1.41,
            score=(2.201, 1.11, -2.146),
            score_sigma=1.49,
            false_per_frame=3.987,
            false_size=(-0.75, 0.59),
            false_score=(-0.67, 1.3),
        ),
        "reference": ClassNoise(
            found=(3.754, 1.815, -3.553),
            edge_bias=(0.029, 0.005, 0.025, 0.002),
            edge_share=(0.061, 0.039, 0.057, 0.067),
            edge_px=1.69,
            score=(3.985, 1.297, -3.351),
            score_sigma=1.86,
            false_per_frame=0.4,
            false_size=(-0.09, 0.77),
            false_score=(-0.87, 0.9),
        ),
    }
)
"""By group: of `standoff/models/site.onnx` on 460 frames of 22 rendered films, at full, half and a third of their size:
9,107 workers, 10,318 machines, 31,111 vehicles and 2,760 reference objects, tilings counted. Seventeen are
`busy` from 10 to 74 m, many of whose workers and vehicles are small."""

POINT_MEMORY_S = 5.0
"""Time after which the part of a ground point's error that lasts is forgotten to 1/e: in the films of `POINT_NOISE`
half of what two frames 0.2 s apart share is left after some three seconds."""
POINT_WHITE_SHARE = 0.3
"""Share of its variance that is another in every frame."""

POINT_NOISE: Mapping[str, PointNoise] = MappingProxyType(
    {
        "worker": PointNoise(stated=(0.076, 0.106), spread=0.33, bias=(0.014, -0.027), off=(0.81, 0.82)),
        "excavator": PointNoise(stated=(0.074, 0.073), spread=0.15, bias=(0.002, -0.02), off=(0.52, 0.6)),
        "wheel_loader": PointNoise(stated=(0.067, 0.071), spread=0.1, bias=(0.006, -0.013), off=(0.46, 0.57)),
        "dump_truck": PointNoise(stated=(0.109, 0.108), spread=0.46, bias=(-0.035, 0.021), off=(0.58, 0.41)),
        "roller_or_dozer": PointNoise(stated=(0.066, 0.066), spread=0.16, bias=(0.008, -0.012), off=(0.72, 0.68)),
        "vehicle": PointNoise(stated=(0.109, 0.105), spread=0.29, bias=(-0.007, -0.001), off=(0.64, 0.44)),
    }
)
"""By class: of the shipped networks of ground points in boxes of `site.onnx`, on 17 films of the preset `busy` with 120
workers, 20 excavators, 50 other machines and 82 vehicles (1640, 360, 802 and 1146 points)."""

_Look = tuple[list[float], float, int, tuple[float, ...] | None]
"""Box, score, class, and the ground point as `_FOOT` names it."""
_FOOT = tuple(column[0] for column in FOOT_COLUMNS)


class NoisyDetector:
    """Draws detections frame after frame; errors of one entity go on for a while.

    Args:
        size_px: Width and height of the picture.
        rng: Decides.
        noise: By group of classes, for another detector.
        memory_s: Of the errors of boxes.
        miss_memory_s: Of misses.
        point_noise: Of ground points, by class; other classes have none.
    """

    def __init__(
        self, size_px: tuple[int, int], rng: np.random.Generator, noise: Mapping[str, ClassNoise] = NOISE,
        memory_s: float = MEMORY_S, miss_memory_s: float = MISS_MEMORY_S,
        point_noise: Mapping[str, PointNoise] = POINT_NOISE,
    ) -> None:  # fmt: skip
        self._size_px, self._rng, self._noise = np.array(size_px, np.float64), rng, noise
        self._point_noise = point_noise
        self._latent = _Remembered(rng, np.array([memory_s] * (_LATENT - 1) + [miss_memory_s]))
        # Boxes do not depend on whether there are points.
        self._point_rng = rng.spawn(1)[0]
        self._point_latent = _Remembered(self._point_rng, np.full(_POINT_LATENT, POINT_MEMORY_S))

    def detect(self, frame: int, time_s: float, entities: Sequence[Row]) -> list[Row]:
        """Return rows of `NOISY_DETECTIONS_SCHEMA`.

        Args:
            frame: Its index.
            time_s: Of the frame, later than that of the call before.
            entities: The frame's rows of `TRUTH_SCHEMA`.
        """
        found = [self._look(row, time_s) for row in entities if row["visible_px"]]
        boxes = [box for box in found if box is not None] + self._imagine()
        boxes.sort(key=lambda box: -box[1])
        return [
            {"frame": frame, "time_s": time_s, **dict(zip(("x1_px", "y1_px", "x2_px", "y2_px"), xyxy, strict=True))}
            | {"score": score, "class": CLASSES[class_id].name, "class_id": class_id}
            | dict(zip(_FOOT, foot or (None,) * len(_FOOT), strict=True))
            for xyxy, score, class_id, foot in boxes
        ]

    def _look(self, row: Row, time_s: float) -> _Look | None:
        """Return what is made of one entity, or None when it is missed."""
        noise = self._noise[GROUPS[row["class_name"]]]
        box_px = np.array([row[name] for name in ("x1_px", "y1_px", "x2_px", "y2_px")])
        sides_px = box_px[2:] - box_px[:2]
        features = np.array([1.0, size_of(sides_px), 1.0 - row["visible_share"]])
        latent = self._latent.now(row["entity_id"], time_s)
        if ndtr(latent[5]) > expit(features @ noise.found):
            return None
        along_px = np.tile(sides_px, 2)
        outwards_px = noise.edge_bias * along_px + latent[:4] * np.hypot(noise.edge_share * along_px, noise.edge_px)
        score = float(expit(features @ noise.score + noise.score_sigma * latent[4]))
        cut = self._cut(box_px + outwards_px * [-1, -1, 1, 1])
        foot = self._foot(row, float(sides_px.max()), time_s)
        return None if cut is None else (cut, float(np.clip(score, LEAST_SCORE, _SURE)), row["class_id"], foot)

    def _foot(self, row: Row, longer_px: float, time_s: float) -> tuple[float, ...] | None:
        """Return ground point, standard errors and covariance of one entity, as `_FOOT` names them."""
        noise = self._point_noise.get(row["class_name"])
        if noise is None:
            return None
        latent = self._point_latent.now(row["entity_id"], time_s)
        sigma_px = np.array(noise.stated) * longer_px * np.exp(noise.spread * latent[2])
        lasting, white = latent[:2], self._point_rng.normal(size=2)
        shares = np.sqrt([1.0 - POINT_WHITE_SHARE, POINT_WHITE_SHARE])
        off_px = np.array(noise.bias) * longer_px + (shares[0] * lasting + shares[1] * white) * noise.off * sigma_px
        return row["foot_x_px"] + off_px[0], row["foot_y_px"] + off_px[1], *sigma_px.tolist(), 0.0

    def _imagine(self) -> list[_Look]:
        """Return detections of nothing."""
        imagined: list[_Look] = []
        for site_class in CLASSES:
            noise = self._noise[GROUPS[site_class.name]]
            for _ in range(int(self._rng.poisson(noise.false_per_frame))):
                middle_px = self._rng.uniform(0.0, self._size_px)
                shape = 2.0 ** self._rng.normal(0.0, 0.4)
                side_px = USUAL_SIZE_PX * 2.0 ** self._rng.normal(*noise.false_size)
                half_px = 0.5 * side_px * np.array([shape, 1.0 / shape])
                cut = self._cut(np.concatenate([middle_px - half_px, middle_px + half_px]))
                score = float(np.clip(expit(self._rng.normal(*noise.false_score)), LEAST_SCORE, _SURE))
                if cut is not None:
                    # Where a network puts the foot of nothing was not measured.
                    imagined.append((cut, score, site_class.id, None))
        return imagined

    def _cut(self, box_px: FloatArray) -> list[float] | None:
        """Return a box cut at the picture's edge, or None when nothing worth a detection is left."""
        low, high = np.maximum(box_px[:2], -0.5), np.minimum(box_px[2:], self._size_px - 0.5)
        return [*low.tolist(), *high.tolist()] if (high - low >= _SMALLEST_PX).all() else None


class _Remembered:
    """Standard normal numbers of each entity that change slowly, each at its own pace."""

    def __init__(self, rng: np.random.Generator, memory_s: FloatArray) -> None:
        self._rng, self._memory_s = rng, memory_s
        self._last: dict[int, tuple[float, FloatArray]] = {}

    def now(self, entity_id: int, time_s: float) -> FloatArray:
        """Return the numbers of an entity, as many as memories, at a time not before the last."""
        fresh = self._rng.normal(size=len(self._memory_s))
        before_s, before = self._last.get(entity_id, (-np.inf, fresh))
        kept = np.exp((before_s - time_s) / self._memory_s)
        numbers: FloatArray = kept * before + np.sqrt(1.0 - kept**2) * fresh
        self._last[entity_id] = time_s, numbers
        return numbers


def size_of(sides_px: FloatArray) -> float:
    """Return a box's size as `ClassNoise` counts it, from (2,) width and height.

    >>> size_of(np.array([64.0, 64.0]))
    1.0
    """
    return float(np.log2(max(float(np.sqrt(sides_px[0] * sides_px[1])), 1.0) / USUAL_SIZE_PX))
