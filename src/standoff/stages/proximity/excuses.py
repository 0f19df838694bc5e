"""Why a pair that is near is no hazard: stated rules, each said in every output and each to be switched off.

An alarm that is always on is as good as none, so three ordinary things are told from danger: a machine that is parked,
a person in its cab, and people who work together with a machine because somebody said so. The gap stays what it is.

An excavator is never taken to be parked: it stands while it swings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from standoff.core.classes import CAB_WITHIN_M
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.roles import IS_EQUIPMENT
from standoff.core.types import PARKED, GroundPositions, IntArray, TextArray
from standoff.stages.proximity.params import ProximityParams

IN_CAB = "in the cab"
TOGETHER = "work together"

_CAB_TRAVEL_M: Final = 4.0
"""Nobody who walks beside it keeps so near while it drives so far."""

Pair = tuple[int, int]


@dataclass(slots=True)
class _Ride:
    """How far a machine went with somebody on it.

    Attributes:
        at_m: Where it was last.
        travelled_m: Since the two are together.
    """

    at_m: FloatArray
    travelled_m: float = 0.0


class Excuses:
    """Remember who rides on what.

    Args:
        params: Which rules hold.
    """

    def __init__(self, params: ProximityParams) -> None:
        self._params = params
        self._together = {tuple(sorted(pair)) for pair in params.together}
        self._rides: dict[Pair, _Ride] = {}

    def update(self, positions: GroundPositions, a: IntArray, b: IntArray, distance_m: FloatArray) -> TextArray:
        """Return (K,) why each pair is no hazard; empty where it may be one.

        Args:
            positions: Of all tracks.
            a: (K,) rows of the one side.
            b: (K,) rows of the other.
            distance_m: (K,); NaN where it is not measured, which is never excused.
        """
        excuse: TextArray = np.full(len(a), "", dtype=object)
        machine = np.where(IS_EQUIPMENT[positions.class_id[a]], a, b)
        mixed = IS_EQUIPMENT[positions.class_id[a]] != IS_EQUIPMENT[positions.class_id[b]]
        excuse[mixed & positions.parked(self._params.parked_after_s)[machine]] = PARKED
        excuse[mixed & self._riding(positions, a, b, machine, distance_m)] = IN_CAB
        if self._together:
            excuse[[pair in self._together for pair in _ids(positions, a, b)]] = TOGETHER
        excuse[np.isnan(distance_m)] = ""
        return excuse

    def _riding(
        self, positions: GroundPositions, a: IntArray, b: IntArray, machine: IntArray, distance_m: FloatArray
    ) -> BoolArray:
        """Tell (K,) who has stayed on a machine while it drove; forget who left."""
        rides: dict[Pair, _Ride] = {}
        riding = np.zeros(len(a), dtype=np.bool_)
        if not self._params.cabs:
            return riding
        # Among hundreds of pairs hardly any is so near.
        (rows,) = np.nonzero(~(distance_m > CAB_WITHIN_M))
        for row, pair in zip(rows.tolist(), _ids(positions, a[rows], b[rows]), strict=True):
            ride = self._rides.get(pair)
            if np.isnan(distance_m[row]):
                # Hidden for a moment: nobody has left.
                if ride is not None:
                    rides[pair] = ride
                continue
            at_m = positions.xy_m[machine[row]]
            ride = ride or _Ride(at_m)
            moved_m = float(np.linalg.norm(at_m - ride.at_m))
            if moved_m >= CAB_WITHIN_M / 4.0:
                # In strides, because the noise of a place that stands would add up.
                ride = _Ride(at_m, ride.travelled_m + moved_m)
            rides[pair] = ride
            riding[row] = ride.travelled_m >= _CAB_TRAVEL_M
        self._rides = rides
        return riding


def _ids(positions: GroundPositions, a: IntArray, b: IntArray) -> Iterator[Pair]:
    return zip(positions.track_id[a].tolist(), positions.track_id[b].tolist(), strict=True)
