"""What happened in a run so far, counted once for everybody who tells of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from standoff.core.ground_map import NoGroundMap
from standoff.core.hazards import Hazard, Severity, worse
from standoff.core.watched_shares import WatchedShares

if TYPE_CHECKING:
    from standoff.core.types import FrameResult

ROW_COUNTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "frames": "frames read",
        "detected_frames": "frames in which the detector was asked",
        "frames_with_map": "frames with a ground map",
        "detections": "detections",
        "sure_detections": "detections so sure that a track should show them",
        "unfollowed_detections": "those of them that are in no track",
        "positions": "rows of tracks",
        "valid_positions": "rows of tracks that have a place on the ground",
        "distances": "rows of pairs",
        "measured_distances": "rows of pairs whose distance was measured",
        "filtered_distances": "rows of pairs whose distance the outlier filter replaced",
        "tracks": "distinct tracks",
        "pairs": "distinct pairs",
    }
)
"""What is counted once for each frame, by name, and what it counts."""

TALLIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "hazards": "hazards by the gravest that each was",
        "map_methods": "frames by how their map was found",
        "no_ground_map": "frames without a map, by the reason",
        "invalid_positions": "rows of tracks without a place, by the reason",
    }
)
"""What is counted by a word."""


class RunCounts:
    """Counts over all frames of one stream.

    Attributes:
        rows: How many frames, rows and distinct tracks and pairs there were, by name.
        map_methods: Frames by how their map was found.
        no_map: Frames without a map, by the reason.
        invalid: Positions that are not valid, by the reason.
        watched: How much of the ground was watched.
    """

    def __init__(self) -> None:
        self.rows: Counter[str] = Counter(dict.fromkeys(ROW_COUNTS, 0))
        self.map_methods: Counter[str] = Counter()
        self.no_map: Counter[str] = Counter()
        self.invalid: Counter[str] = Counter()
        self.watched = WatchedShares()
        self._severity: dict[str, Severity] = {}
        self._zone: dict[str, str] = {}
        self._live_tracks: set[int] = set()
        self._live_pairs: set[tuple[int, int]] = set()

    def add(self, result: FrameResult) -> None:
        """Count a frame."""
        positions, pairs = result.positions, result.proximities
        self.rows.update(
            frames=1,
            detected_frames=int(result.detected),
            frames_with_map=int(bool(result.ground)),
            detections=len(result.detections),
            sure_detections=len(result.unfollowed),
            unfollowed_detections=int(result.unfollowed.sum()),
            positions=len(positions),
            valid_positions=int(positions.valid.sum()),
            distances=len(pairs),
            measured_distances=int(np.isfinite(pairs.distance_m).sum()),
            filtered_distances=int(pairs.filtered.sum()),
        )
        self._add_new_ids(result)
        if isinstance(result.ground, NoGroundMap):
            self.no_map[result.ground.reason] += 1
        else:
            self.map_methods[result.ground.method] += 1
        self.invalid.update(positions.reason[~positions.valid].tolist())
        self.watched.add(result.watched)
        self.add_events(result.hazards)

    def _add_new_ids(self, result: FrameResult) -> None:
        """Count ids that the last frame did not have: a track is listed from its birth to its end."""
        pairs = result.proximities
        tracks = set(result.tracks.track_id.tolist())
        live_pairs = set(zip(pairs.track_a.tolist(), pairs.track_b.tolist(), strict=True))
        self.rows.update(tracks=len(tracks - self._live_tracks), pairs=len(live_pairs - self._live_pairs))
        self._live_tracks, self._live_pairs = tracks, live_pairs

    def add_events(self, events: Iterable[Hazard]) -> None:
        """Count what was said when no frame came: while nothing arrived, and at the end."""
        for event in events:
            so_far = self._severity.get(event.hazard_id, "unknown")
            self._severity[event.hazard_id] = worse(event.severity, so_far)
            if event.zone:
                self._zone[event.hazard_id] = event.zone

    @property
    def hazards(self) -> Counter[Severity]:
        """How many hazards there were, each by the gravest that it was."""
        return Counter(self._severity.values())

    @property
    def zones(self) -> dict[str, Counter[Severity]]:
        """The hazards of each zone that had any, likewise."""
        counts: dict[str, Counter[Severity]] = {}
        for hazard_id, zone in sorted(self._zone.items(), key=lambda one: one[1]):
            counts.setdefault(zone, Counter())[self._severity[hazard_id]] += 1
        return counts

    def to_dict(self) -> dict[str, Any]:
        """Return all counts but those of watched ground, for the record."""
        return {
            **self.rows,
            "hazards": self.hazards,
            **({"zones": zones} if (zones := self.zones) else {}),
            "map_methods": self.map_methods,
            "no_ground_map": self.no_map,
            "invalid_positions": self.invalid,
        }
