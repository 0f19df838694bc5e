"""What the messenger is told of each frame: who is where, and which ground is watched."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from standoff.clips import map_of, map_values
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.core.types import FrameResult, GroundMap, NoGroundMap, WatchedGround
from standoff.core.watched_ground import COLUMNS, NO_GROUND, REASONS, ROWS, WATCHED, CellArray, cells_at
from standoff.messages import WatchedZone
from standoff.messages.events import Delay

OUT_OF_SIGHT = "outside the picture"


@dataclass(frozen=True, slots=True)
class SeenTrack:
    """A track that has a place on the ground.

    Attributes:
        track_id: Of the session.
        kind: Name of its class.
        xy_m: Site frame.
        covariance_m2: Of the place: xx, xy, yy.
    """

    track_id: int
    kind: str
    xy_m: tuple[float, float]
    covariance_m2: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A frame that was watched to its end.

    Attributes:
        stream: Name of the stream.
        session: Of its monitor.
        frame: Its number.
        time_s: Of the stream.
        is_live: Whether the stream was live then.
        captured_s: When the picture was taken, monotonic; None: unknown.
        delay: How that is known.
        seen_s: When it had been watched to its end, monotonic.
        ground: The map, or why there is none.
        is_placed: Whether somebody stated where the site frame lies, so that places of devices can be found in it.
        watched: Which ground is watched.
        size_px: (width, height) of the picture.
        tracks: Who has a place.
        zones: Whether each zone is watched.
        open_hazards: Ids.
    """

    stream: str
    session: str
    frame: int
    time_s: float
    is_live: bool
    captured_s: float | None
    delay: Delay
    seen_s: float
    ground: GroundMap | NoGroundMap
    is_placed: bool
    watched: WatchedGround
    size_px: tuple[int, int]
    tracks: tuple[SeenTrack, ...]
    zones: tuple[WatchedZone, ...]
    open_hazards: tuple[str, ...]

    def unwatched_at(self, xy_m: tuple[float, float]) -> str:
        """Return why a worker who stands somewhere would not be found; "" where he would.

        Args:
            xy_m: Site frame.
        """
        (cell,) = ground_cells(self.ground, self.watched, self.size_px, np.array([xy_m])).tolist()
        if isinstance(self.ground, NoGroundMap):
            return self.ground.reason or REASONS[1]
        return OUT_OF_SIGHT if cell == NO_GROUND else REASONS[cell]

    def words(self) -> dict[str, Any]:
        """Return it in JSON's types."""
        return {
            "stream": self.stream,
            "session": self.session,
            "frame": self.frame,
            "time_s": self.time_s,
            "is_live": self.is_live,
            "captured_s": self.captured_s,
            "delay": self.delay,
            "seen_s": self.seen_s,
            "map": map_values(self.ground),
            "is_placed": self.is_placed,
            "cells": base64.b64encode(self.watched.cells.tobytes()).decode() if self.watched.judged else "",
            "size_px": self.size_px,
            "tracks": [[one.track_id, one.kind, one.xy_m, one.covariance_m2] for one in self.tracks],
            "zones": [[one.name, one.share, one.reason] for one in self.zones],
            "open_hazards": self.open_hazards,
        }

    @classmethod
    def read(cls, words: dict[str, Any]) -> Self:
        """Return what `words` told."""
        width_px, height_px = words["size_px"]
        return cls(
            words["stream"],
            words["session"],
            words["frame"],
            words["time_s"],
            words["is_live"],
            words["captured_s"],
            words["delay"],
            words["seen_s"],
            map_of(words["map"], (width_px, height_px)),
            words["is_placed"],
            _watched_of(words["cells"]),
            (width_px, height_px),
            tuple(SeenTrack(one, kind, tuple(xy_m), tuple(parts)) for one, kind, xy_m, parts in words["tracks"]),
            tuple(WatchedZone(*one) for one in words["zones"]),
            tuple(words["open_hazards"]),
        )


def ground_cells(
    ground: GroundMap | NoGroundMap, watched: WatchedGround, size_px: tuple[int, int], points_m: FloatArray
) -> CellArray:
    """Return (N,) what is true of the ground at places (N, 2), as `cells_at`; no ground where there is no map."""
    if isinstance(ground, NoGroundMap):
        return np.full(len(points_m), NO_GROUND, dtype=np.int8)
    points_px, valid = ground.to_image(points_m)
    return cells_at(watched, np.where(valid[:, None], points_px, np.nan), size_px)


def seen_tracks(result: FrameResult) -> tuple[SeenTrack, ...]:
    """Return the tracks of a frame that have a place."""
    positions = result.positions
    rows = np.flatnonzero(positions.valid).tolist()
    covariance = positions.covariance_m2
    return tuple(
        SeenTrack(
            int(positions.track_id[row]),
            CLASSES[int(positions.class_id[row])].name,
            (float(positions.xy_m[row, 0]), float(positions.xy_m[row, 1])),
            (float(covariance[row, 0, 0]), float(covariance[row, 0, 1]), float(covariance[row, 1, 1])),
        )
        for row in rows
    )


def share_watched(name: str, cells: CellArray) -> WatchedZone:
    """Return how much of a zone is watched, by what is true of places all over it."""
    counts = {int(cell): int(number) for cell, number in zip(*np.unique(cells, return_counts=True), strict=True)}
    watched = counts.pop(WATCHED, 0)
    worst = max(counts, key=lambda cell: counts[cell], default=WATCHED)
    reason = OUT_OF_SIGHT if worst == NO_GROUND else REASONS[worst]
    return WatchedZone(name, round(watched / max(len(cells), 1), 3), reason if watched < len(cells) else "")


def _watched_of(cells: str) -> WatchedGround:
    if not cells:
        return WatchedGround()
    found = np.frombuffer(base64.b64decode(cells), np.int8).reshape(ROWS, COLUMNS)
    return WatchedGround(found, np.where(found == WATCHED, 1.0, np.nan))
