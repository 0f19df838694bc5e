"""What the processes of a service say of themselves, put together."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

import cv2
import numpy as np

from standoff.service.live.shared import PictureSlot, SharedRecord
from standoff.service.live.workplace import Workplace
from standoff.service.status.answers import (
    DeviceAnswer,
    HealthAnswer,
    OpenHazardAnswer,
    Overall,
    ProcessAnswer,
    Quantiles,
    ShelfAnswer,
    StatusAnswer,
    StreamAnswer,
    TrackAnswer,
)

_ANSWERING_S: Final = 2.0
_WIDEST_PX: Final = 960
_JPEG_QUALITY: Final = 80
_NOT_ANALYSED: Final = "its analysis does not answer"


class Overview:
    """Reads what is in a workplace; holds nobody up, and changes nothing.

    Args:
        workplace: Of the service.
    """

    def __init__(self, workplace: Workplace) -> None:
        self._workplace = workplace
        self._records: dict[str, SharedRecord] = {}
        self._slots: dict[str, PictureSlot] = {}

    def status(self) -> StatusAnswer:
        """Return all of it."""
        site, now_s = self._workplace.plan(), time.monotonic()
        processes = self._processes(now_s)
        answering = {one.name for one in processes if one.is_answering}
        messenger = (self._words("messenger") or {}) if "messenger" in answering else {}
        streams = [self._stream(name, now_s, "analysis" in answering) for name in site.streams]
        devices = [_device(name, messenger.get("devices", {}).get(name)) for name in site.live.receivers]
        connected = bool(messenger.get("is_connected"))
        problems = [f"{one.name} does not answer" for one in processes if not one.is_answering]
        problems += [] if connected else [f"the broker {site.live.broker.address} is not connected"]
        failing = bool(problems)
        problems += [f"{one.name}: {one.reason or one.state}" for one in streams if not one.is_watched]
        overall: Overall = "failing" if failing else "degraded" if problems else "ok"
        return StatusAnswer(
            site=site.live.site,
            at_unix_s=time.time(),
            overall=overall,
            problems=problems,
            streams=streams,
            devices=devices,
            shelves=[ShelfAnswer(**one) for one in messenger.get("shelves", ())],
            processes=processes,
            broker=site.live.broker.address,
            broker_connected=connected,
            letters=messenger.get("letters", {}),
            to_wrist_ms=_quantiles(messenger.get("to_wrist_ms")),
            sent_to_shown_ms=_quantiles(messenger.get("sent_to_shown_ms")),
        )

    def health(self) -> HealthAnswer:
        """Return whether the service works."""
        status = self.status()
        return HealthAnswer(overall=status.overall, problems=status.problems)

    def picture(self, stream: str) -> tuple[bytes, float] | None:
        """Return a stream's newest picture as JPEG, and how many seconds ago it came; None: there is none.

        The newest that was analysed, where there is one: what was seen belongs to it.
        """
        if stream not in self._workplace.plan().streams:
            return None
        analysed = self._slots.setdefault(f"{stream}-analysed", self._workplace.analysed(stream))
        slot = self._slots.setdefault(stream, self._workplace.pictures(stream))
        taken = analysed.newest() or slot.newest()
        if taken is None:
            return None
        frame = taken.frame
        width_px = min(frame.width, _WIDEST_PX)
        height_px = max(2, round(frame.height * width_px / frame.width))
        pixels = frame.to_ndarray(width=width_px, height=height_px, format="bgr24")
        _, encoded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        return np.asarray(encoded).tobytes(), time.monotonic() - taken.about["arrived_s"]

    def _processes(self, now_s: float) -> list[ProcessAnswer]:
        supervisor = self._words("supervisor") or {}
        found = []
        for name, starts in supervisor.get("starts", {}).items():
            stream = name.removeprefix("capture-")
            words = self._capture(stream) if name.startswith("capture-") else self._words(name)
            alive = words is not None and now_s - words["beat_s"] <= _ANSWERING_S
            found.append(ProcessAnswer(name=name, is_answering=alive, starts=starts))
        return found

    def _stream(self, name: str, now_s: float, is_analysed: bool) -> StreamAnswer:
        words = self._read(f"analysis-{name}", lambda: self._workplace.stream_record(name)) or {}
        about = self._slots.setdefault(name, self._workplace.pictures(name)).about()
        state, reason = words.get("state", "connecting"), words.get("reason", "it begins")
        if not is_analysed:
            state, reason = "lost", _NOT_ANALYSED
        captured_s = words.get("captured_s")
        return StreamAnswer(
            name=name,
            state=state,
            reason=reason,
            is_watched=state == "live",
            picture_age_ms=None if about is None else (now_s - about[1]["arrived_s"]) * 1e3,
            captured_age_ms=None if captured_s is None else (now_s - captured_s) * 1e3,
            delay=words.get("delay", "unknown"),
            size_px=words.get("size_px"),
            frames=words.get("frames", 0),
            not_looked_at=words.get("not_looked_at", 0),
            arrival_to_result_ms=_quantiles(words.get("arrival_to_result_ms")),
            detect_ms=_quantiles(words.get("detect_ms")),
            map=words.get("map", ""),
            map_reason=words.get("map_reason", ""),
            watched_share=words.get("watched_share"),
            unwatched=words.get("unwatched", {}),
            hazards=[OpenHazardAnswer(**one) for one in words.get("open", ())],
            tracks=[
                TrackAnswer(id=one["id"], kind=one["class"], xyxy_px=one["xyxy_px"]) for one in words.get("tracks", ())
            ],
        )

    def _capture(self, stream: str) -> Mapping[str, Any] | None:
        return self._read(f"capture-{stream}", lambda: self._workplace.capture_record(stream))

    def _words(self, process: str) -> Mapping[str, Any] | None:
        return self._read(process, lambda: self._workplace.record(process))

    def _read(self, name: str, made: Any) -> Mapping[str, Any] | None:  # noqa: ANN401 - a record, when it is asked for
        if name not in self._records:
            self._records[name] = made()
        return self._records[name].read()


def _quantiles(words: Mapping[str, Any] | None) -> Quantiles | None:
    return None if words is None else Quantiles(**words)


def _device(name: str, words: Mapping[str, Any] | None) -> DeviceAnswer:
    if words is None:
        return DeviceAnswer(name=name, supervised=False, reason="the messenger does not answer", streams=[])
    return DeviceAnswer(name=name, **words)
