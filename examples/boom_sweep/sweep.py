"""Who stands where an excavator's boom cannot come soon, and its tail does not either: a rule that was left out."""

from __future__ import annotations

from typing import Final

import numpy as np

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import GroundPositions, IntArray

_FASTEST_RADPS: Final = np.deg2rad(66.0)
_STARTS_RADPS2: Final = np.deg2rad(45.0)
"""Crawlers of 20-25 t swing at 11 rpm at most, and need a second and a half to get there."""
_TAIL_M: Final = 3.2
"""How far the counterweight reaches behind the centre of swing."""
_BUCKET_M: Final = 0.8
"""Half of a wide bucket."""
_SURE_RAD: Final = np.deg2rad(25.0)
_SIGMAS: Final = 2.0
_STANDS_S: Final = 5.0


def out_of_sweep(
    positions: GroundPositions, boom: FloatArray, machine: IntArray, person: IntArray, ahead_s: float
) -> BoolArray:
    """Tell (K,) who is outside of the sector that the boom can sweep.

    That is the direction of the boom and, on both sides, a bucket and the person's own radius as seen from the centre
    of swing, two standard errors of the direction and of the places, and how far the boom can turn: from its rate, two
    standard errors faster, it speeds up as fast as it can. Nobody is outside who is in reach of the counterweight, or
    whose machine does not stand, or whose direction or rate is not surely known now.

    Args:
        positions: Of all tracks.
        boom: (M, 4) of all tracks, as `boom.Booms.update` tells; without one nobody is outside.
        machine: (K,) rows.
        person: (K,) rows.
        ahead_s: How far ahead.
    """
    direction_rad, sigma_rad, rate_radps, rate_sigma_radps = boom[machine].T
    offset_m = positions.xy_m[person] - positions.xy_m[machine]
    distance_m = np.hypot(*offset_m.T)
    spread_m2 = np.trace(positions.covariance_m2[machine] + positions.covariance_m2[person], axis1=1, axis2=2)
    near_m = positions.radius_m[person] + _SIGMAS * np.sqrt(spread_m2)
    stands = (positions.standing_s[machine] >= _STANDS_S) & (sigma_rad <= _SURE_RAD)
    beyond_tail = stands & (distance_m > _TAIL_M + near_m)
    width_rad = np.arcsin(np.where(beyond_tail, np.minimum((near_m + _BUCKET_M) / distance_m, 1.0), np.nan))
    turn_rad = furthest_turn(np.abs(rate_radps) + _SIGMAS * rate_sigma_radps, ahead_s)
    apart_rad = np.abs(np.angle(np.exp(1j * (np.arctan2(offset_m[:, 1], offset_m[:, 0]) - direction_rad))))
    outside: BoolArray = apart_rad > width_rad + _SIGMAS * sigma_rad + turn_rad
    return outside


def furthest_turn(rate_radps: FloatArray, ahead_s: float) -> FloatArray:
    """Return (K,) how far a boom can turn, speeding up from a rate (K,) that is no less than nought.

    >>> np.rad2deg(furthest_turn(np.deg2rad([0.0, 66.0, 90.0]), 1.0)).round(1).tolist()
    [22.5, 66.0, 66.0]
    """
    rate_radps = np.minimum(rate_radps, _FASTEST_RADPS)
    speeding_s = np.minimum((_FASTEST_RADPS - rate_radps) / _STARTS_RADPS2, ahead_s)
    turned: FloatArray = (rate_radps + 0.5 * _STARTS_RADPS2 * speeding_s) * speeding_s
    turned += (ahead_s - speeding_s) * _FASTEST_RADPS
    return turned
