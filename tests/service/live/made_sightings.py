"""Frames as the messenger hears of them: a picture of 64 m by 36 m, a worker and an excavator on the ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from service.live.made_news import moment

from standoff.config import ReceiverSettings
from standoff.core.geographic import GeographicOrigin
from standoff.core.types import GroundMap, WatchedGround
from standoff.core.watched_ground import COLUMNS, ROWS, WATCHED
from standoff.messages import DevicePosition
from standoff.service.live.recipients import Recipients
from standoff.service.live.sighting import SeenTrack, Sighting

SIZE_PX = (640, 360)
WORKER_M, EXCAVATOR_M = (20.0, 10.0), (24.0, 10.0)
NOW_S = moment().s


def track(track_id: int, kind: str, xy_m: tuple[float, float], sigma_m: float = 0.3) -> SeenTrack:
    return SeenTrack(track_id, kind, xy_m, (sigma_m**2, 0.0, sigma_m**2))


def ground(frame_stated: bool = True) -> GroundMap:
    """Return a map of ten centimetres a pixel: x to the right, y upwards from the picture's lower left corner."""
    to_ground = np.array([[0.1, 0.0, 0.0], [0.0, -0.1, 36.0], [0.0, 0.0, 1.0]])
    return GroundMap(to_ground, np.eye(9) * 1e-9, SIZE_PX, "surveyed", 0.1, frame_stated=frame_stated)


def watched(cells: int = WATCHED, right_half: int = WATCHED) -> WatchedGround:
    found = np.full((ROWS, COLUMNS), cells, np.int8)
    found[:, COLUMNS // 2 :] = right_half
    return WatchedGround(found, np.where(found == WATCHED, 1.0, np.nan))


def sighting(stream: str = "gate", **changes: Any) -> Sighting:
    """Return a frame that was watched just now."""
    told: dict[str, Any] = {
        "session": "s-1",
        "frame": 180,
        "time_s": 12.5,
        "is_live": True,
        "captured_s": NOW_S - 0.1,
        "delay": "told",
        "seen_s": NOW_S,
        "ground": ground(),
        "is_placed": True,
        "watched": watched(),
        "size_px": SIZE_PX,
        "tracks": (track(1, "worker", WORKER_M), track(2, "excavator", EXCAVATOR_M)),
        "zones": (),
        "open_hazards": (),
    }
    return Sighting(stream, **{**told, **changes})


def at(xy_m: tuple[float, float], sigma_m: float = 0.3, age_ms: float = 0.0) -> DevicePosition:
    return DevicePosition(sigma_m, *xy_m, age_ms=age_ms)


def recipients(
    receivers: Mapping[str, Mapping[str, Any]],
    *sightings: Sighting,
    origins: Mapping[str, GeographicOrigin | None] | None = None,
    streams: tuple[str, ...] = ("gate",),
    **positions: DevicePosition,
) -> Recipients:
    """Return who knows these devices; a position of each arrived just now."""
    settings = {name: ReceiverSettings(**parts) for name, parts in receivers.items()}
    made = Recipients(settings, origins or {}, streams)
    for one in sightings:
        made.take_sighting(one)
    for device, position in positions.items():
        assert made.take_position(device, position, NOW_S)
    made.match(NOW_S)
    return made
