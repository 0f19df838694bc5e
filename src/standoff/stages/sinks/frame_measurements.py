"""What there is to draw in one frame: the measurements without the pixels, and which hazards are open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from standoff.core.classes import CLASSES
from standoff.core.hazards import GRAVENESS, Pair, worse
from standoff.core.homography import FloatArray
from standoff.core.types import (
    FrameResult,
    GroundMap,
    GroundPositions,
    Hazard,
    NoGroundMap,
    Proximities,
    Severity,
    Tracks,
    WatchedGround,
)
from standoff.core.watched_shares import around_tracks, percent_text
from standoff.core.zones import Zone
from standoff.drawing.palette import Tone, class_tone

_WELL_WATCHED = 0.9
"""Where this share of the circle about a machine is watched, nothing is said of it."""
_WORTH_SAYING = 0.05
_MOST_REASONS = 2


@dataclass(frozen=True, slots=True)
class FrameMeasurements:
    """One frame's measurements.

    Attributes:
        frame_index: Position in the source.
        time_s: Presentation timestamp.
        size_px: (width, height) of the full-size picture that all pixels belong to.
        ground: The map, or why there is none.
        tracks: Live tracks.
        positions: Row i belongs to track i.
        proximities: All configured pairs.
        hazards: Open hazards by pair.
        machine_hazards: Open hazards of machines near which somebody may stand whom no track shows.
        zones: All of the site.
        zone_hazards: Open hazards of zones.
        hidden_px: (N, 4) boxes of the picture to be made unrecognisable, in full-size pixels.
        watched: Where on the ground a worker would be found.
        stream_hazards: Open hazards of the stream as a whole.
    """

    frame_index: int
    time_s: float
    size_px: tuple[int, int]
    ground: GroundMap | NoGroundMap
    tracks: Tracks
    positions: GroundPositions
    proximities: Proximities
    hazards: Mapping[Pair, Hazard]
    machine_hazards: tuple[Hazard, ...] = ()
    zones: tuple[Zone, ...] = ()
    zone_hazards: tuple[Hazard, ...] = ()
    hidden_px: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))
    watched: WatchedGround = field(default_factory=WatchedGround)
    stream_hazards: tuple[Hazard, ...] = ()

    @classmethod
    def of(
        cls,
        result: FrameResult,
        zones: tuple[Zone, ...] = (),
        hidden_px: FloatArray | None = None,
    ) -> FrameMeasurements:
        """Keep what is drawn of a result; the frame's pixels are let go."""
        return cls(
            frame_index=result.frame.index,
            time_s=result.frame.time_s,
            size_px=result.frame.size_px,
            ground=result.ground,
            tracks=result.tracks,
            positions=result.positions,
            proximities=result.proximities,
            hazards=result.open_hazards.by_pair(),
            machine_hazards=result.open_hazards.of_machines(),
            zones=zones,
            zone_hazards=result.open_hazards.in_zones() if zones else (),
            hidden_px=np.zeros((0, 4)) if hidden_px is None else hidden_px,
            watched=result.watched,
            stream_hazards=result.open_hazards.of_stream(),
        )

    @property
    def placed_zones(self) -> tuple[Zone, ...]:
        """The zones that can be found in this frame: somebody stated where its site frame lies."""
        return self.zones if isinstance(self.ground, GroundMap) and self.ground.frame_stated else ()

    def zone_tone(self, zone: Zone) -> Tone:
        """Return the colour of a zone: of its gravest open hazard, else that of zones."""
        severities: list[Severity] = [hazard.severity for hazard in self.zone_hazards if hazard.zone == zone.name]
        return max(severities, key=GRAVENESS.index) if severities else "zone"

    def zone_words(self) -> dict[int, str]:
        """Return what is wrong with each track that has a hazard in a zone: "in pit", "near gate", "perhaps in pit"."""
        words: dict[int, list[str]] = {}
        for hazard in self.zone_hazards:
            unknown = hazard.phase == "unknown" or hazard.severity == "unknown"
            where = "perhaps in" if unknown else "in" if hazard.severity == "danger" else "near"
            for track_id in hazard.track_ids:
                words.setdefault(track_id, []).append(f"{where} {hazard.zone}")
        return {track_id: ", ".join(dict.fromkeys(texts)) for track_id, texts in words.items()}

    def machine_words(self) -> dict[int, str]:
        """Return why each machine with a hazard of its own has one: "somebody may stand near it"."""
        return {track_id: hazard.reason for hazard in self.machine_hazards for track_id in hazard.track_ids}

    def unknown_words(self) -> str:
        """Return why the whole picture is unknown, or much of it: for a bar across it; "" where it is not."""
        if isinstance(self.ground, NoGroundMap):
            return f"NO MEASUREMENT: {self.ground.reason}"
        reasons = "; ".join(dict.fromkeys(hazard.reason for hazard in self.stream_hazards))
        return f"UNKNOWN: {reasons}" if reasons else ""

    def watched_words(self, *, hatched: bool = False) -> str:
        """Return how much of the ground is watched, and why the rest is not; "" where nobody judged, or without map.

        Args:
            hatched: The rest is hatched in the picture, which is told.
        """
        if not self.watched.judged or isinstance(self.ground, NoGroundMap):
            return ""
        words = f"{percent_text(self.watched.share)} of the ground watched"
        shares = self.watched.unwatched
        reasons = [reason for reason in shares if shares[reason] >= _WORTH_SAYING][:_MOST_REASONS] or list(shares)[:1]
        return f"{words}; rest{' (hatched)' * hatched}: {', '.join(reasons)}" if reasons else words

    def around_words(self) -> dict[int, str]:
        """Return what to say of each machine with ground about it that is not watched: "60 % around it watched"."""
        around = around_tracks(self.watched, len(self.tracks))
        return {
            int(self.tracks.track_id[row]): f"{percent_text(around[row])} around it watched"
            for row in np.flatnonzero(around < _WELL_WATCHED)
        }

    def track_tones(self) -> list[Tone]:
        """Return the colour of each track: of its gravest hazard, else of its class; grey when it has no position."""
        gravest: dict[int, Severity] = {}
        for hazard in (*self.hazards.values(), *self.machine_hazards, *self.zone_hazards):
            for track_id in hazard.track_ids:
                gravest[track_id] = worse(hazard.severity, gravest.get(track_id, "unknown"))
        tones: list[Tone] = []
        for row, track_id in enumerate(self.tracks.track_id.tolist()):
            measured = bool(self.positions.valid[row])
            at_ease: Tone = class_tone(int(self.tracks.class_id[row])) if measured else "unknown"
            tones.append(gravest.get(track_id, at_ease))
        return tones

    def names(self) -> dict[int, str]:
        """Return how each track is called in pictures: its class and id.

        Class names have spaces here: "wheel loader 4".
        """
        ids_and_classes = zip(self.tracks.track_id.tolist(), self.tracks.class_id.tolist(), strict=True)
        return {track_id: track_name(track_id, class_id) for track_id, class_id in ids_and_classes}

    def feet_px(self) -> FloatArray:
        """Return (M, 2) where each track stands, in full-size picture pixels.

        The measured ground position, seen through the camera; the bottom centre of the box where there is none.
        """
        xyxy = self.tracks.xyxy_px
        feet = np.column_stack([(xyxy[:, 0] + xyxy[:, 2]) / 2.0, xyxy[:, 3]])
        if isinstance(self.ground, GroundMap) and len(feet):
            seen, in_front = self.ground.to_image(self.positions.xy_m)
            measured = in_front & self.positions.valid
            feet[measured] = seen[measured]
        return feet


def track_name(track_id: int, class_id: int) -> str:
    """Return what a track is called.

    >>> track_name(4, 2)
    'wheel loader 4'
    """
    return f"{CLASSES[class_id].name.replace('_', ' ')} {track_id}"
