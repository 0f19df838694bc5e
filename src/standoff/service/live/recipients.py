"""Who is warned: devices matched to tracks on the ground, or told of a zone, a stream or all."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from standoff.config import ReceiverSettings
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.geographic import GeographicOrigin
from standoff.messages import DevicePosition, HazardNews, Supervision
from standoff.messages.events import Because
from standoff.service.live.sighting import SeenTrack, Sighting

_FRESH_S: Final = 2.0
"""Of a stream's newest frame; what is older tells nothing of now."""
_POSITION_LASTS_S: Final = 5.0
_GATE: Final = 9.21
_REMEMBERED_GATE: Final = 16.0
"""Squared distances in standard errors within which 99 and 99.97 per cent of right matches lie (two dimensions)."""
_SPEED_MPS: Final[Mapping[str, float]] = {"worker": 1.5, "machine": 3.0}
"""How fast a wearer may go: a position grows unsure by so much."""
_FLOOR_M: Final = 0.3
_NEAR_M: Final = 8.0
_ENOUGH_SHARE: Final = 0.9
_LEAST_SHARE: Final = 0.05
_LONGEST_REASON: Final = 500

NO_POSITION: Final = "your position is not known"
NOT_SEEN: Final = "nobody is seen where you are"
NOT_PLACED: Final = "no stream can tell where the site frame lies"
NO_STREAM: Final = "no stream watches"
NOTHING_WATCHED: Final = "hardly any ground is watched"
DELAY_UNKNOWN: Final = "it is not known how late the pictures are"

TrackKey = tuple[str, str, int]
"""Stream, session and track."""


@dataclass
class DeviceState:
    """What is known of a device.

    Attributes:
        position: Where it said that it is.
        at_s: When that was true, monotonic.
        tracks: Which may be its wearer's.
        unmatched: Whether it has a position and no track.
    """

    position: DevicePosition | None = None
    at_s: float = -math.inf
    tracks: frozenset[TrackKey] = field(default_factory=frozenset)
    unmatched: bool = False


class Told(NamedTuple):
    """A device that is told of a hazard.

    Attributes:
        device: Its name.
        because: Why.
    """

    device: str
    because: Because


class Recipients:
    """Knows the devices, where they are, and which tracks may be theirs.

    Args:
        receivers: By device.
        origins: By stream, where its site frame begins on the earth; None: nobody said.
        stream_names: All streams of the site.
    """

    def __init__(
        self,
        receivers: Mapping[str, ReceiverSettings],
        origins: Mapping[str, GeographicOrigin | None],
        stream_names: tuple[str, ...],
    ) -> None:
        self._receivers, self._origins, self._streams = dict(receivers), dict(origins), stream_names
        self._devices = {name: DeviceState() for name in receivers}
        self._sightings: dict[str, Sighting] = {}
        self._conditions: dict[str, str] = {}

    @property
    def devices(self) -> tuple[str, ...]:
        """Names of all devices."""
        return tuple(self._receivers)

    def inherit(self, before: Recipients) -> None:
        """Take over what was known before settings changed, of devices that are still there."""
        self._sightings = {name: one for name, one in before._sightings.items() if name in self._streams}
        for name in self._devices.keys() & before._devices.keys():
            self._devices[name] = before._devices[name]

    def take_sighting(self, sighting: Sighting) -> None:
        """Take a stream's newest frame."""
        self._sightings[sighting.stream] = sighting

    def take_condition(self, stream: str, reason: str) -> None:
        """Take why a stream is not live; empty where it is."""
        self._conditions[stream] = reason

    def take_position(self, device: str, position: DevicePosition, arrived_s: float) -> bool:
        """Take where a device is; return whether the device is known."""
        state = self._devices.get(device)
        if state is None:
            return False
        state.position, state.at_s = position, arrived_s - position.age_ms / 1e3
        return True

    def match(self, now_s: float) -> None:
        """Find out which tracks may be whose; call it before the questions below."""
        for name, state in self._devices.items():
            wearer = self._receivers[name].wearer
            state.tracks = frozenset() if wearer == "nobody" else self._candidates(state, wearer, now_s)
            is_known = state.position is not None and now_s - state.at_s <= _POSITION_LASTS_S
            state.unmatched = wearer != "nobody" and is_known and not state.tracks

    def told_of(self, hazard: HazardNews) -> list[Told]:
        """Return who is told of a hazard, each device once."""
        keys = {(hazard.stream, hazard.session, track) for track in hazard.track_ids}
        found: list[Told] = []
        for name, receiver in self._receivers.items():
            state = self._devices[name]
            because: Because | None = None
            if state.tracks & keys:
                because = "position"
            elif state.unmatched and self._is_near(state, hazard):
                because = "near"
            elif hazard.zone and hazard.zone in receiver.zones:
                because = "zone"
            elif hazard.stream in receiver.streams:
                because = "stream"
            elif receiver.everything:
                because = "everything"
            if because is not None:
                found.append(Told(name, because))
        return found

    def supervision(self, device: str, sequence: int, now_s: float) -> Supervision:
        """Return whether a device's wearer would be warned, by frames that have just been watched."""
        receiver, state = self._receivers[device], self._devices[device]
        streams, reason = (
            self._over_places(receiver, now_s)
            if receiver.wearer == "nobody"
            else self._over_wearer(state, receiver.wearer, now_s)
        )
        # Of many streams not all reasons fit into a message.
        return Supervision(
            device, sequence, not reason, reason[:_LONGEST_REASON], tuple(sorted(streams)), len(state.tracks)
        )

    def _over_wearer(self, state: DeviceState, wearer: str, now_s: float) -> tuple[set[str], str]:
        """Return which streams see a wearer, and why nobody would warn him; "" where somebody would."""
        if state.position is None or now_s - state.at_s > _POSITION_LASTS_S:
            return set(), NO_POSITION
        reasons: list[str] = []
        seeing: set[str] = set()
        for stream in self._streams:
            why = self._unsupervised_by(stream, state, now_s)
            if why:
                reasons.append(why)
            else:
                seeing.add(stream)
        return seeing, "" if seeing else "; ".join(dict.fromkeys(reasons)) or NO_STREAM

    def _unsupervised_by(self, stream: str, state: DeviceState, now_s: float) -> str:
        sighting = self._sightings.get(stream)
        if why := self._not_watching(stream, now_s):
            return why
        assert sighting is not None
        if not sighting.is_placed:
            return f"{stream}: {NOT_PLACED}"
        place = self._place(state, stream)
        if place is None:
            return f"{stream}: {NOT_PLACED}"
        if unwatched := sighting.unwatched_at(place):
            return f"{stream}: {unwatched}"
        return "" if any(key[0] == stream for key in state.tracks) else f"{stream}: {NOT_SEEN}"

    def _over_places(self, receiver: ReceiverSettings, now_s: float) -> tuple[set[str], str]:
        """Return which streams watch what a device is told of, and why not all of it is watched; "" where it is."""
        zones = set(receiver.zones)
        wanted = set(self._streams) if receiver.everything else set(receiver.streams)
        watching = {stream for stream in self._streams if not self._not_watching(stream, now_s)}
        for stream in sorted(wanted):
            if why := self._not_watching(stream, now_s):
                return watching & wanted, why
        for zone in sorted(zones):
            found = [
                (one.share, one.reason, stream)
                for stream in watching
                for one in self._sightings[stream].zones
                if one.name == zone
            ]
            if not found:
                return watching, f"{zone}: {NO_STREAM}"
            share, reason, _ = max(found)
            if share < _ENOUGH_SHARE:
                return watching, f"{zone}: {reason}"
            wanted |= {stream for share, _, stream in found}
        return watching & wanted, "" if watching & wanted else NO_STREAM

    def _not_watching(self, stream: str, now_s: float) -> str:
        """Return why a stream warns nobody at the moment; "" where it does."""
        sighting = self._sightings.get(stream)
        if reason := self._conditions.get(stream, ""):
            return f"{stream}: {reason}"
        if sighting is None or now_s - sighting.seen_s > _FRESH_S:
            return f"{stream}: no frame is watched"
        if not sighting.is_live:
            return f"{stream}: it is not live"
        if sighting.delay == "unknown":
            return f"{stream}: {DELAY_UNKNOWN}"
        if not sighting.ground:
            return f"{stream}: {getattr(sighting.ground, 'reason', '') or 'no ground map'}"
        if sighting.watched.judged and sighting.watched.share < _LEAST_SHARE:
            return ": ".join([stream, NOTHING_WATCHED, *[*sighting.watched.unwatched][:1]])
        return ""

    def _candidates(self, state: DeviceState, wearer: str, now_s: float) -> frozenset[TrackKey]:
        if state.position is None or now_s - state.at_s > _POSITION_LASTS_S:
            return frozenset()
        found: set[TrackKey] = set()
        for stream, sighting in self._sightings.items():
            place = self._place(state, stream)
            if place is None or not sighting.is_placed or now_s - sighting.seen_s > _FRESH_S:
                continue
            # The drift between the two moments, and the place's own error.
            apart_s = abs((sighting.captured_s or sighting.seen_s) - state.at_s)
            spread_m = math.hypot(state.position.sigma_m, _SPEED_MPS[wearer] * apart_s, _FLOOR_M)
            for track in sighting.tracks:
                key = (stream, sighting.session, track.track_id)
                gate = _REMEMBERED_GATE if key in state.tracks else _GATE
                if (track.kind == "worker") == (wearer == "worker") and _apart(track, place, spread_m) <= gate:
                    found.add(key)
        return frozenset(found)

    def _place(self, state: DeviceState, stream: str) -> tuple[float, float] | None:
        """Return where a device is in a stream's site frame; None where nobody can tell."""
        position = state.position
        if position is None:
            return None
        if position.x_m is not None and position.y_m is not None:
            return position.x_m, position.y_m
        origin = self._origins.get(stream)
        if origin is None or position.longitude_deg is None or position.latitude_deg is None:
            return None
        x_m, y_m = origin.to_metres(np.array([[position.longitude_deg, position.latitude_deg]]))[0].tolist()
        return x_m, y_m

    def _is_near(self, state: DeviceState, hazard: HazardNews) -> bool:
        """Return whether a wearer whom no track shows may be part of a hazard all the same."""
        sighting, place = self._sightings.get(hazard.stream), self._place(state, hazard.stream)
        if sighting is None or place is None or state.position is None or sighting.session != hazard.session:
            return False
        spread_m = 3.0 * state.position.sigma_m
        tracks = [track for track in sighting.tracks if track.track_id in hazard.track_ids]
        return any(math.dist(track.xy_m, place) <= _reach_m(track, hazard) + spread_m for track in tracks)


def _reach_m(track: SeenTrack, hazard: HazardNews) -> float:
    """Return how far from a track of a hazard its other side may be; of a machine alone, as far as it reaches."""
    if hazard.zone or len(hazard.track_ids) > 1:
        return _NEAR_M
    return max(_NEAR_M, CLASS_BY_NAME[track.kind].action_radius_m + CLASS_BY_NAME["worker"].action_radius_m)


def _apart(track: SeenTrack, place: tuple[float, float], spread_m: float) -> float:
    """Return the squared distance of a place from a track, in standard errors of both."""
    xx, xy, yy = track.covariance_m2
    a, c = xx + spread_m**2, yy + spread_m**2
    dx, dy = place[0] - track.xy_m[0], place[1] - track.xy_m[1]
    determinant = a * c - xy * xy
    return (c * dx * dx - 2.0 * xy * dx * dy + a * dy * dy) / determinant
