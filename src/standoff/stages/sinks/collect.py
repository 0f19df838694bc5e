"""What the report needs of a run, gathered frame by frame in a bounded amount of memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from standoff.core.hazard_life import HazardLife
from standoff.core.hazards import Pair
from standoff.core.lengths import UNITS
from standoff.core.types import Frame, FrameResult, GroundMap, Hazard, ImageArray, NoGroundMap
from standoff.core.zones import Zone
from standoff.stages.sinks.blurring import PeopleWatch, blur
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.params import ReportParams, ShowParams
from standoff.stages.sinks.series import Series, Trail
from standoff.stages.sinks.worst_moments import WorstMoments

_MOST_HAZARDS = 5000
_MOST_PATHS = 150
_BACKGROUND_WIDTH_PX = 960


class RunSummary:
    """Gather curves, paths, hazards and worst moments.

    Args:
        params: How much of each is kept.
        zones: Of the site.
        show: The unit of lengths, and whether people are made unrecognisable.
    """

    def __init__(self, params: ReportParams, zones: tuple[Zone, ...] = (), show: ShowParams | None = None) -> None:
        show = show or ShowParams()
        self.zones, self.unit, self.is_blurred = zones, UNITS[show.unit], show.blur
        self._people = PeopleWatch(wanted=show.blur)
        self._most_pairs = params.pairs
        self.mapped_frames = self.placed_frames = 0
        self.hazards_left_out = 0
        self.moments = WorstMoments(params.moments, params.moment_width_px)
        self.site = Series()
        self.no_map = Series()
        self.watched_share = Series()
        self.pairs: dict[Pair, Series] = {}
        self.pair_names: dict[Pair, tuple[str, str]] = {}
        self.paths: dict[int, Trail] = {}
        self.hazards: dict[str, HazardLife] = {}
        self.first_s = self.last_s = float("nan")
        self.stream_id = ""
        self.size_px = (0, 0)
        self.background: tuple[ImageArray, GroundMap] | None = None

    def add(self, result: FrameResult) -> None:
        """Take one frame."""
        frame, pairs = result.frame, result.proximities
        if not self.stream_id:
            self.first_s, self.stream_id, self.size_px = frame.time_s, frame.stream_id, frame.size_px
        self.last_s = frame.time_s
        measurements = FrameMeasurements.of(result, self.zones, self._people.update(result))
        self._add_ground(frame, measurements)
        # Of frames that share a sample the one with the least share is kept, as is the closest of a pair.
        self.watched_share.add(frame.time_s, result.watched.share, float("nan"), float("nan"))
        names = measurements.names()
        self._add_paths(measurements, names)
        self._add_pairs(measurements, names)
        self._add_hazards(result.hazards, measurements, names)
        self.moments.offer(frame, measurements)
        measured = np.flatnonzero(np.isfinite(pairs.gap_m))
        if len(measured):
            k = measured[np.argmin(pairs.gap_m[measured])]
            self.site.add(frame.time_s, float(pairs.gap_m[k]), float(pairs.distance_m[k]), float(pairs.sigma_m[k]))
        else:
            self.site.add(frame.time_s, float("nan"), float("nan"), float("nan"))

    def _add_ground(self, frame: Frame, measurements: FrameMeasurements) -> None:
        ground = measurements.ground
        if isinstance(ground, NoGroundMap):
            self.no_map.add(frame.time_s, float("nan"), float("nan"), float("nan"))
            return
        self.mapped_frames += 1
        self.placed_frames += int(ground.frame_stated)
        self.no_map.add(frame.time_s, 0.0, 0.0, 0.0)
        if self.background is None:
            width = min(_BACKGROUND_WIDTH_PX, frame.size_px[0])
            height = round(width * frame.size_px[1] / frame.size_px[0])
            picture = frame.picture.resized_bgr(width, height).copy()
            blur(picture, measurements.hidden_px, np.array([0.0, 0.0, *frame.size_px]))
            self.background = (picture, ground)

    def _add_paths(self, measurements: FrameMeasurements, names: Mapping[int, str]) -> None:
        tracks, xy_m = measurements.tracks, measurements.positions.xy_m.tolist()
        rows = zip(tracks.track_id.tolist(), tracks.class_id.tolist(), xy_m, strict=True)
        for track_id, class_id, (x_m, y_m) in rows:
            if track_id not in self.paths:
                self.paths[track_id] = Trail(names[track_id], class_id)
            self.paths[track_id].add(x_m, y_m)
        if len(self.paths) > 2 * _MOST_PATHS:
            longest = sorted(self.paths, key=lambda track_id: len(self.paths[track_id]), reverse=True)
            self.paths = {track_id: self.paths[track_id] for track_id in sorted(longest[:_MOST_PATHS])}

    def _add_pairs(self, measurements: FrameMeasurements, names: Mapping[int, str]) -> None:
        pairs = measurements.proximities
        keys = zip(pairs.track_a.tolist(), pairs.track_b.tolist(), strict=True)
        numbers = zip(pairs.gap_m.tolist(), pairs.distance_m.tolist(), pairs.sigma_m.tolist(), strict=True)
        for key, (gap_m, distance_m, sigma_m) in zip(keys, numbers, strict=True):
            if key not in self.pairs:
                if not self._has_room(gap_m):
                    continue
                self.pairs[key] = Series()
                self.pair_names[key] = (names.get(key[0], str(key[0])), names.get(key[1], str(key[1])))
            self.pairs[key].add(measurements.time_s, gap_m, distance_m, sigma_m)

    def _has_room(self, gap_m: float) -> bool:
        """Return whether a pair is close enough to be kept, and drop the farthest one for it."""
        if not np.isfinite(gap_m):
            return False
        if len(self.pairs) < self._most_pairs:
            return True
        farthest = max(reversed(self.pairs), key=self._closest_m)
        closest = self.pairs[farthest].closest
        if closest is not None and closest.gap_m <= gap_m:
            return False
        del self.pairs[farthest], self.pair_names[farthest]
        return True

    def worst_pairs(self) -> list[Pair]:
        """Return the kept pairs, closest first."""
        return sorted(self.pairs, key=self._closest_m)

    def _closest_m(self, pair: Pair) -> float:
        closest = self.pairs[pair].closest
        return closest.gap_m if closest else float("inf")

    def _add_hazards(self, events: Iterable[Hazard], measurements: FrameMeasurements, names: Mapping[int, str]) -> None:
        for event in events:
            if event.hazard_id not in self.hazards and len(self.hazards) < _MOST_HAZARDS:
                called = tuple(names.get(track_id, f"track {track_id}") for track_id in event.track_ids)
                self.hazards[event.hazard_id] = HazardLife.begun(event, called)
            else:
                self.take_event(event)
        pairs = measurements.proximities
        if not measurements.hazards:
            return
        for k, key in enumerate(zip(pairs.track_a.tolist(), pairs.track_b.tolist(), strict=True)):
            hazard = measurements.hazards.get(key)
            if hazard is not None and hazard.hazard_id in self.hazards:
                numbers = float(pairs.distance_m[k]), float(pairs.gap_m[k]), float(pairs.sigma_m[k])
                self.hazards[hazard.hazard_id].measure(*numbers)

    @property
    def placed_zones(self) -> tuple[Zone, ...]:
        """The zones, where all paths on the ground can be compared with them."""
        return self.zones if 0 < self.mapped_frames == self.placed_frames else ()

    def of_zone(self, zone: Zone) -> list[HazardLife]:
        """Return the hazards of a zone."""
        return [hazard for hazard in self.hazards.values() if hazard.zone == zone.name]

    def take_event(self, event: Hazard) -> None:
        """Take an event of a known hazard."""
        life = self.hazards.get(event.hazard_id)
        if life is None:
            self.hazards_left_out += int(event.phase == "opened")
            return
        life.take(event)
