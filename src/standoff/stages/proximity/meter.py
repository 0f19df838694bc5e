"""Distance, gap, standard error and closing speed of every configured pair of tracks."""

from __future__ import annotations

import math

import numpy as np

from standoff.core import protocols
from standoff.core.classes import CLASS_BY_NAME, CLASSES, Role
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.roles import IS_EQUIPMENT, IS_PERSON
from standoff.core.types import GroundMap, GroundPositions, IntArray, NoGroundMap, Proximities
from standoff.stages.proximity.excuses import Excuses
from standoff.stages.proximity.outliers import PaperFilter
from standoff.stages.proximity.params import ProximityParams
from standoff.stages.proximity.prediction import predict

Pair = tuple[int, int]


class ProximityMeter(protocols.ProximityMeter):
    """Measure the pairs of tracks of one stream.

    Distances are measured on the ground plane, centre to centre. In the paper's words that is Eq. 6:
    the map's `scale_m_per_px` times the distance in pixels on the rectified plane.

    Args:
        params: Settings; the defaults when left out.
    """

    def __init__(self, params: ProximityParams | None = None) -> None:
        self._params = params or ProximityParams()
        self._watched = _watched_classes(self._params.pairs)
        self._filters: dict[Pair, PaperFilter] = {}
        self._excuses = Excuses(self._params)

    def update(self, time_s: float, positions: GroundPositions, ground: GroundMap | NoGroundMap) -> Proximities:
        """Measure all pairs of one frame.

        Args:
            time_s: Presentation timestamp.
            positions: Where the tracks are.
            ground: The frame's map, for the outlier threshold in pixels.

        Returns:
            One row for each configured pair of live tracks, by track ids; NaN where a position is invalid.
            What is remembered of a pair ends with either of its tracks. The standard error of a
            distance that the outlier filter replaced includes how far it was moved.
        """
        a, b = self._pair_rows(positions)
        offset_m = positions.xy_m[b] - positions.xy_m[a]
        measured_m = np.hypot(offset_m[:, 0], offset_m[:, 1])
        distance_m = self._filtered(positions.track_id[a], positions.track_id[b], measured_m, ground)
        moved_m = distance_m - measured_m
        sigma_m = np.hypot(_distance_sigma(positions, a, b, offset_m, measured_m), moved_m)
        reach_m = positions.radius_m[a] + positions.radius_m[b]
        gap_m = distance_m - reach_m
        ahead = predict(positions, a, b, reach_m, self._params.horizon_s)
        closing_mps = _closing_speed(positions.velocity_mps[b] - positions.velocity_mps[a], offset_m, measured_m)
        return Proximities(
            track_a=positions.track_id[a],
            track_b=positions.track_id[b],
            distance_m=distance_m,
            gap_m=gap_m,
            sigma_m=sigma_m,
            closing_mps=closing_mps,
            time_to_contact_s=time_to_contact(gap_m, closing_mps),
            **ahead._asdict(),
            excuse=self._excuses.update(positions, a, b, measured_m),
            filtered=np.abs(moved_m) > 0.0,
        )

    def reset(self) -> None:
        """Forget all pairs."""
        self._filters = {}
        self._excuses = Excuses(self._params)

    def _pair_rows(self, positions: GroundPositions) -> tuple[IntArray, IntArray]:
        """Return the rows of both tracks of each configured pair, smaller id first, sorted by ids."""
        by_id = np.argsort(positions.track_id)
        class_id = positions.class_id[by_id]
        first, second = np.nonzero(np.triu(self._watched[np.ix_(class_id, class_id)], k=1))
        return by_id[first], by_id[second]

    def _filtered(
        self, track_a: IntArray, track_b: IntArray, distance_m: FloatArray, ground: GroundMap | NoGroundMap
    ) -> FloatArray:
        """Return (K,) distances after the outlier filter; NaN stays NaN and ends what was remembered."""
        if self._params.outlier_filter == "off":
            return distance_m
        threshold_m = self._threshold_m(ground)
        filters: dict[Pair, PaperFilter] = {}
        filtered_m = distance_m.copy()
        for row, pair in enumerate(zip(track_a.tolist(), track_b.tolist(), strict=True)):
            if not math.isnan(distance_m[row]):
                filters[pair] = self._filters.get(pair) or PaperFilter()
                filtered_m[row] = filters[pair].update(float(distance_m[row]), threshold_m)
        self._filters = filters
        return filtered_m

    def _threshold_m(self, ground: GroundMap | NoGroundMap) -> float:
        """Return the outlier threshold; infinite where nothing is to be replaced."""
        if self._params.outlier_threshold_m is not None:
            return self._params.outlier_threshold_m
        if self._params.outlier_threshold_px is None or isinstance(ground, NoGroundMap):
            return math.inf
        return self._params.outlier_threshold_px * ground.scale_m_per_px


def _watched_classes(pairs: tuple[tuple[str, str], ...]) -> BoolArray:
    """Return (C, C), symmetric: which classes are measured against which."""
    watched = np.zeros((len(CLASSES), len(CLASSES)), dtype=np.bool_)
    for side_a, side_b in pairs:
        members = np.outer(_members(side_a), _members(side_b))
        watched |= members | members.T
    return watched


def machines_near_people(pairs: tuple[tuple[str, str], ...]) -> BoolArray:
    """Return (C,) by class id: which machines are measured against people."""
    return np.asarray(_watched_classes(pairs)[IS_PERSON].any(axis=0) & IS_EQUIPMENT)


def side_classes(side: str) -> frozenset[str]:
    """Return the names of the classes that a side of a configured pair stands for.

    Args:
        side: A class name, "person", "equipment", or "any" for both roles.

    >>> sorted(side_classes("person"))
    ['worker']
    """
    if side in CLASS_BY_NAME:
        return frozenset({side})
    roles = {Role.PERSON, Role.EQUIPMENT} if side == "any" else {Role(side)}
    return frozenset(site_class.name for site_class in CLASSES if site_class.role in roles)


def _members(side: str) -> BoolArray:
    """Return (C,) which classes a side of a configured pair stands for."""
    names = side_classes(side)
    return np.array([site_class.name in names for site_class in CLASSES])


def _distance_sigma(
    positions: GroundPositions, a: IntArray, b: IntArray, offset_m: FloatArray, distance_m: FloatArray
) -> FloatArray:
    """Return (K,) standard error of the distance along the pair, the shared error of the map taken once.

    Where two entities are nearer than the error of their offset the direction between them is unknown,
    and the largest error in any direction is taken.
    """
    shared = positions.map_factor_m[a] @ positions.map_factor_m[b].transpose(0, 2, 1)
    covariance = positions.covariance_m2[a] + positions.covariance_m2[b] - shared - shared.transpose(0, 2, 1)
    along_xx, across, along_yy = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    half_trace = (along_xx + along_yy) / 2.0
    largest = half_trace + np.hypot((along_xx - along_yy) / 2.0, across)
    directed = distance_m**2 > 2.0 * half_trace
    x, y = np.where(directed, offset_m.T / np.where(directed, distance_m, 1.0), np.nan)
    along = x * x * along_xx + 2.0 * x * y * across + y * y * along_yy
    sigma_m: FloatArray = np.sqrt(np.maximum(np.where(directed, along, largest), 0.0))
    return sigma_m


def _closing_speed(relative_mps: FloatArray, offset_m: FloatArray, distance_m: FloatArray) -> FloatArray:
    """Return (K,) how fast each distance shrinks; NaN where a velocity or the direction is unknown."""
    along = (relative_mps * offset_m).sum(axis=1)
    closing_mps: FloatArray = -along / np.where(distance_m > 0, distance_m, np.nan)
    return closing_mps


def time_to_contact(gap_m: FloatArray, closing_mps: FloatArray) -> FloatArray:
    """Return when two action radii touch if the closing speed stays as it is.

    Args:
        gap_m: (K,); NaN where not measured.
        closing_mps: (K,) > 0 approaching; NaN while unknown.

    Returns:
        (K,) seconds: 0 where they touch already, whatever the speed; inf where they never will; NaN where
        that is unknown.

    >>> time_to_contact(np.array([6.0, 6.0, -1.0]), np.array([2.0, -2.0, np.nan]))
    array([ 3., inf,  0.])
    """
    approaching = closing_mps > 0
    at_speed = gap_m / np.where(approaching, closing_mps, np.nan)
    never = np.where(np.isnan(gap_m) | np.isnan(closing_mps), np.nan, np.inf)
    seconds: FloatArray = np.where(gap_m <= 0, 0.0, np.where(approaching, at_speed, never))
    return seconds
