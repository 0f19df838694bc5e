"""Which pairs are worth a line in a picture with thirty tracks, and what the line says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.lengths import LengthUnit
from standoff.core.roles import PERSON_ROLE, ROLE_OF_CLASS
from standoff.core.types import IntArray
from standoff.drawing.palette import Tone
from standoff.stages.sinks.frame_measurements import FrameMeasurements

_UNMEASURED_WITHIN_SHARE = 0.35  # of the picture's width: beyond, an unknown distance is no news
_RANK: dict[Tone, int] = {"danger": 0, "warning": 1, "unknown": 2, "light": 3}


@dataclass(frozen=True, slots=True)
class PairLine:
    """A line to draw.

    Attributes:
        row_a: Row of one end among the tracks.
        row_b: Row of the other.
        tone: Severity of the pair's hazard, "unknown" when unmeasured, "light" otherwise.
        text: The distance with its standard error, or "unknown"; and why it is no hazard, if it is none however near.
        dashed: True where the distance is not of this frame: unmeasured, or an end coasts.
    """

    row_a: int
    row_b: int
    tone: Tone
    text: str
    dashed: bool


def pair_lines(
    measurements: FrameMeasurements, feet_px: FloatArray, within_m: float, unit: LengthUnit
) -> list[PairLine]:
    """Choose the pairs to draw, gravest first.

    Every pair with an open hazard; for each person (each entity, in pairs without one) the nearest measured
    pair within `within_m`, and the nearest in the picture that cannot be measured.

    Args:
        measurements: What there is.
        feet_px: (M, 2) where each track stands in the picture.
        within_m: Largest distance of a pair without a hazard.
        unit: What the lines say distances in.
    """
    pairs, tracks = measurements.proximities, measurements.tracks
    if not len(pairs):
        return []
    row_of = {track_id: row for row, track_id in enumerate(tracks.track_id.tolist())}
    keys = list(zip(pairs.track_a.tolist(), pairs.track_b.tolist(), strict=True))
    rows = np.array([(row_of[a], row_of[b]) for a, b in keys])
    measured = np.isfinite(pairs.distance_m)
    apart_px = np.linalg.norm(feet_px[rows[:, 0]] - feet_px[rows[:, 1]], axis=1)
    wanted = _nearest_of_each_owner(rows, tracks.class_id, pairs.distance_m, measured & (pairs.distance_m <= within_m))
    in_sight = apart_px <= _UNMEASURED_WITHIN_SHARE * measurements.size_px[0]
    wanted |= _nearest_of_each_owner(rows, tracks.class_id, apart_px, ~measured & in_sight)
    wanted |= np.array([key in measurements.hazards for key in keys])
    lines = [_line(measurements, k, keys[k], rows[k], unit) for k in np.flatnonzero(wanted).tolist()]
    return sorted(lines, key=lambda line: _RANK[line.tone])


def _nearest_of_each_owner(rows: IntArray, class_id: IntArray, apart: FloatArray, eligible: BoolArray) -> BoolArray:
    owns = ROLE_OF_CLASS[class_id[rows]] == PERSON_ROLE
    owns[~owns.any(axis=1)] = True
    nearest = np.zeros(len(rows), dtype=bool)
    order = np.argsort(apart, kind="stable")
    ends, owning = rows.tolist(), owns.tolist()
    seen: set[int] = set()
    for k in order[eligible[order]].tolist():
        owners = {row for row, owner in zip(ends[k], owning[k], strict=True) if owner and row not in seen}
        nearest[k] = bool(owners)
        seen |= owners
    return nearest


def _line(measurements: FrameMeasurements, k: int, key: tuple[int, int], rows: IntArray, unit: LengthUnit) -> PairLine:
    pairs = measurements.proximities
    hazard = measurements.hazards.get(key)
    measured = bool(np.isfinite(pairs.distance_m[k]))
    tone: Tone = hazard.severity if hazard else ("light" if measured else "unknown")
    distance = unit.distance(pairs.distance_m[k], pairs.sigma_m[k], filtered=bool(pairs.filtered[k]))
    return PairLine(
        row_a=int(rows[0]),
        row_b=int(rows[1]),
        tone=tone,
        text=f"{distance}: {pairs.excuse[k]}" if pairs.excuse[k] else distance,
        dashed=not (measured and measurements.tracks.observed[rows].all()),
    )
