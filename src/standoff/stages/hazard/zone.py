"""Who is where he must not be: positions and zones in, the life of each hazard out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from standoff.core.classes import CLASSES, Role
from standoff.core.homography import FloatArray
from standoff.core.roles import ROLE_OF_CLASS
from standoff.core.types import GroundMap, GroundPositions, Hazard, NoGroundMap
from standoff.core.zones import NOT_PLACED, Zone
from standoff.stages.hazard.absence import AbsenceWatch
from standoff.stages.hazard.inside_zone import probability_inside
from standoff.stages.hazard.latch import NOT_MEASURED, NOT_WATCHED, TRACK_LOST, UNMEASURED, LastPhase, Reading
from standoff.stages.hazard.levels import SURE
from standoff.stages.hazard.life_cycle import HazardLifeCycle, Limit
from standoff.stages.hazard.newcomers import Newcomers
from standoff.stages.hazard.params import HazardParams

PLACED = "the zones can be found again"
_HELP = "a survey, a marker, or a reference with first_corner_px would tell"

_IN, _PERHAPS, _HARDLY = 0.5 - 1e-9, 0.1, 0.05
"""Probabilities of being inside: from which it is danger, above which a warning, and below which that may end. On a
straight edge it is one half but for rounding, and that is danger."""

_SURE_SIGMAS = 6.0
"""So far from the edge nothing is left to be integrated."""

_FASTEST_MPS = {Role.PERSON: 4.0, Role.EQUIPMENT: 8.0}
"""Running and driving, as the tracker takes them: how far somebody may have gone since he was last located."""

_PERSON, _MACHINE = ([*Role].index(role) for role in (Role.PERSON, Role.EQUIPMENT))

Key = tuple[str, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class _Stand:
    """Where one entity is to one zone.

    Attributes:
        reading: Distance and gap; NaN where it could not be located.
        near: The zone or what is near it.
        breached: The zone.
        reason: Why it could not be located; empty where it was.
        may_be_there: Whether it is near, or may have come there since it was last located.
    """

    reading: Reading
    near: Limit
    breached: Limit
    reason: str
    may_be_there: bool


class ZoneRule:
    """Raise, follow and close the hazards of one stream's zones.

    An entity is where its position is: a machine's middle. It is danger where that is inside with a probability of 0.5
    or more, and a warning within `zone_warn_m` of the zone or above 0.1. In a crossing nothing is wrong with one: there
    a worker and a machine are a hazard together, as grave as the one of them that is further out. Who cannot be located
    but may have come into a zone since is unknown; so are all zones where nobody stated where the site frame lies.

    Args:
        zones: In any order.
        params: Settings.
    """

    def __init__(self, zones: Sequence[Zone], params: HazardParams) -> None:
        self._zones = sorted(zones, key=lambda zone: zone.name)
        self._params = params
        self._unplaced = AbsenceWatch(params, PLACED, "zone")
        self._watches: dict[Key, HazardLifeCycle] = {}
        self._last: dict[int, tuple[float, FloatArray]] = {}
        self._newcomers = Newcomers[int]()
        self._mapped_frames = self._unplaced_frames = 0

    @property
    def warnings(self) -> list[str]:
        """What there is to say of the whole stream so far."""
        if not self._unplaced_frames:
            return []
        share = f"{self._unplaced_frames} of {self._mapped_frames} frames with a ground map"
        return [f"zones were not watched in {share}: {NOT_PLACED}; {_HELP}"]

    def update(
        self, time_s: float, positions: GroundPositions, ground: GroundMap | NoGroundMap, *, rare: bool
    ) -> list[Hazard | None]:
        """Take one frame and return its events, those of the stream first, then by zone and track.

        Args:
            time_s: Presentation timestamp.
            positions: Of all tracks.
            ground: The frame's map, or why there is none.
            rare: The last look was so long ago that what holds is said at once.
        """
        if not self._zones:
            return []
        if isinstance(ground, NoGroundMap):
            return self._miss_all(time_s, positions, "")
        self._mapped_frames += 1
        self._unplaced_frames += not ground.frame_stated
        events = [self._unplaced.update(time_s, "" if ground.frame_stated else NOT_PLACED)]
        if not ground.frame_stated:
            return events + self._miss_all(time_s, positions, NOT_PLACED)
        self._remember(time_s, positions)
        new = self._newcomers.among(time_s, positions.track_id[positions.valid].tolist())
        alive = set(positions.track_id.tolist())
        for zone in self._zones:
            stands = self._stands(time_s, zone, positions, new)
            watched = dict(self._watched(zone, positions, stands))
            of_zone = {key for key in self._watches if key[0] == zone.name}
            for key in sorted(of_zone | {(zone.name, tracks) for tracks, may_open in watched.items() if may_open}):
                if key[1] in watched:
                    if key not in self._watches:
                        self._watches[key] = HazardLifeCycle("zone", key[1], self._params, zone.name)
                    events.append(_follow(self._watches[key], time_s, [stands[track] for track in key[1]], rare))
                else:
                    reason = NOT_WATCHED if alive >= set(key[1]) else TRACK_LOST
                    events.append(self._watches[key].lose(time_s, reason))
        self._forget_idle(alive)
        return events

    def end(self, time_s: float, reason: str, phase: LastPhase = "closed") -> list[Hazard | None]:
        """End everything that is open, and forget it."""
        events = [self._unplaced.end(time_s, reason, phase)]
        for key in sorted(self._watches):
            events += [self._watches[key].finish(time_s), self._watches[key].end(time_s, reason, phase)]
        self._unplaced, self._watches, self._last = AbsenceWatch(self._params, PLACED, "zone"), {}, {}
        self._newcomers = Newcomers[int]()
        return events

    def _miss_all(self, time_s: float, positions: GroundPositions, reason: str) -> list[Hazard | None]:
        """Take that no zone can be watched in this frame; something else says so."""
        reasons = dict(zip(positions.track_id.tolist(), positions.reason.tolist(), strict=True))
        events: list[Hazard | None] = []
        for key in sorted(self._watches):
            watch, why = self._watches[key], [reasons.get(track) for track in key[1]]
            if None in why:
                events.append(watch.lose(time_s, TRACK_LOST))
            else:
                told = reason or next(filter(None, why), NOT_MEASURED)
                events.append(watch.miss(time_s, told, may_open=False))
        self._forget_idle(set(reasons))
        return events

    def _remember(self, time_s: float, positions: GroundPositions) -> None:
        """Take note of where everybody is, and forget who is gone."""
        rows = zip(positions.track_id.tolist(), positions.valid.tolist(), positions.xy_m, strict=True)
        seen = {track: (time_s, xy_m) if valid else self._last.get(track) for track, valid, xy_m in rows}
        self._last = {track: last for track, last in seen.items() if last is not None}

    def _forget_idle(self, alive: set[int]) -> None:
        self._watches = {
            key: watch
            for key, watch in self._watches.items()
            if watch.is_open or (alive >= set(key[1]) and not watch.is_idle)
        }

    def _stands(self, time_s: float, zone: Zone, positions: GroundPositions, new: set[int]) -> dict[int, _Stand]:
        """Return where each track is to a zone."""
        warn_m, hysteresis_m = self._params.zone_warn_m, self._params.hysteresis_m
        gap_m, sigma_m, inside = _measured(zone, positions)
        near = (gap_m < warn_m) | (inside > _PERHAPS)
        near_clear = (gap_m > warn_m + hysteresis_m) & (inside < _HARDLY)
        breached = inside >= _IN
        breached_clear = ~breached & (gap_m > hysteresis_m)
        stands = {}
        for row, track in enumerate(positions.track_id.tolist()):
            located = bool(positions.valid[row])
            gap = float(gap_m[row])
            stands[track] = _Stand(
                Reading(max(gap, 0.0), gap, float(sigma_m[row])) if located else UNMEASURED,
                Limit(bool(near[row]), bool(near_clear[row])),
                Limit(bool(breached[row]), bool(breached_clear[row]), track in new and bool(inside[row] >= SURE)),
                "" if located else positions.reason[row] or NOT_MEASURED,
                bool(near[row]) if located else self._may_be_in(time_s, zone, track, int(positions.class_id[row])),
            )
        return stands

    def _may_be_in(self, time_s: float, zone: Zone, track: int, class_id: int) -> bool:
        """Tell whether somebody who cannot be located may be in or near a zone; who never was may be anywhere."""
        if track not in self._last:
            return True
        seen_s, xy_m = self._last[track]
        gone_m = _FASTEST_MPS.get(CLASSES[class_id].role, 0.0) * (time_s - seen_s)
        return float(zone.gap_m(xy_m[None])[0][0]) < self._params.zone_warn_m + gone_m

    def _watched(
        self, zone: Zone, positions: GroundPositions, stands: dict[int, _Stand]
    ) -> Iterator[tuple[tuple[int, ...], bool]]:
        """Yield whom a zone is watched for, one track or two, and whether a hazard of theirs may be in the making."""
        role = ROLE_OF_CLASS[positions.class_id]
        persons, machines = (positions.track_id[role == one].tolist() for one in (_PERSON, _MACHINE))
        if zone.kind != "crossing":
            for track in persons if zone.kind == "machine_only" else persons + machines:
                yield (track,), stands[track].may_be_there
            return
        for person in persons:
            for machine in machines:
                # Of two that were never located the pair itself is unknown already.
                known = person in self._last or machine in self._last
                may_open = known and stands[person].may_be_there and stands[machine].may_be_there
                yield (min(person, machine), max(person, machine)), may_open


def _measured(zone: Zone, positions: GroundPositions) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (N,) each: metres to a zone, negative inside, their standard error, and the probability of being inside.

    NaN where an entity could not be located.
    """
    gap_m, across = zone.gap_m(positions.xy_m)
    covariance_m2 = positions.covariance_m2
    sigma_m = np.sqrt(np.einsum("ni,nij,nj->n", across, covariance_m2, across))
    inside = np.where(np.isnan(gap_m), np.nan, (gap_m < 0).astype(np.float64))
    widest_m = np.sqrt(np.trace(covariance_m2, axis1=1, axis2=2))
    doubtful = np.abs(gap_m) < _SURE_SIGMAS * widest_m
    if doubtful.any():
        inside[doubtful] = probability_inside(zone.outline_m, positions.xy_m[doubtful], covariance_m2[doubtful])
    return gap_m, sigma_m, inside


def _follow(watch: HazardLifeCycle, time_s: float, stands: list[_Stand], rare: bool) -> Hazard | None:
    """Tell a watch of one or two what it watches; of two, what both share is as near as the one further out."""
    located = [one for one in stands if not one.reason]
    outside = [one for one in located if one.near.clear]
    if len(located) < len(stands) and not outside:
        reason = next(one.reason for one in stands if one.reason)
        return watch.miss(time_s, reason, may_open=True)
    furthest = max(outside or located, key=lambda one: one.reading.gap_m)
    near = Limit(all(one.near.passed for one in located), any(one.near.clear for one in located))
    breached = Limit(
        all(one.breached.passed for one in located),
        any(one.breached.clear for one in located),
        all(one.breached.sure for one in stands),
    )
    return watch.measure(time_s, furthest.reading, near, breached, at_once=rare or breached.sure)
