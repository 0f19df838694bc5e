"""One stream's capture: a process that decodes, keeps the newest picture, and can be killed at any moment."""

from __future__ import annotations

import math
import os
import time
from dataclasses import dataclass
from typing import Final, NamedTuple

import av
import cv2
import numpy as np

from standoff.core.errors import SourceError
from standoff.core.stream_watch import CapturePhase
from standoff.core.types import ImageArray
from standoff.service.live.backoff import Backoff
from standoff.service.live.log import log_of
from standoff.service.live.shared import PictureSlot
from standoff.service.live.workplace import Workplace
from standoff.stages.frames import LiveAddress, LivePicture, LiveStream, StreamRefused

BEAT_S: Final = 0.1
_STUCK_S: Final = 6.0
"""libav's own time limits are shorter: whoever is held up longer is held up for ever."""
STUCK_CODE: Final = 70
_PLAUSIBLE_S: Final = 60.0
_AHEAD_S: Final = 1.0
_TOLD_LASTS_S: Final = 60.0
_LONGEST_REASON: Final = 300
"""Whatever its letters are, it fits into the record."""
_SAMPLED: Final = 4
"""Every fourth pixel of every fourth row."""
_CHANGED_LEVELS: Final = 8
_CHANGED_SAMPLES: Final = 4


@dataclass(frozen=True, slots=True)
class CapturePlan:
    """What a capture is to do.

    Attributes:
        stream_id: Name of the stream.
        address: Where it is.
    """

    stream_id: str
    address: LiveAddress


class Capture:
    """Connects for ever, and puts each picture into the slot.

    Args:
        plan: What to do.
        workplace: Where its words and pictures go.
    """

    def __init__(self, plan: CapturePlan, workplace: Workplace) -> None:
        self._plan, self._workplace = plan, workplace
        self._log = log_of("capture", stream=plan.stream_id)
        self._slot = workplace.pictures(plan.stream_id)
        self._record = workplace.capture_record(plan.stream_id)
        self._phase: CapturePhase = "connecting"
        self._reason, self._connections = "", 0
        self._progress_s = time.monotonic()
        self._rest_until_s = 0.0

    def run(self) -> None:
        """Go on until the process that started it is gone."""
        self._workplace.repeat(self._beat, BEAT_S)
        backoff = Backoff()
        while True:
            self._say("connecting", self._reason)
            try:
                self._connect(backoff)
                reason = "the sender ended the stream"
            except StreamRefused as error:
                reason = error.found
                self._say("refused", reason)
            except SourceError as error:
                reason = error.found
            except (OSError, av.FFmpegError) as error:
                reason = self._plan.address.masked(getattr(error, "strerror", None) or str(error))
            is_refused = self._phase == "refused"
            pause_s = 0.0 if self._is_replayed_to_its_end(reason) else backoff.failed(time.monotonic())
            self._log.info("not connected", reason=reason, pause_s=round(pause_s, 2))
            self._say("refused" if is_refused else "backing_off", reason)
            self._rest(pause_s)

    def _connect(self, backoff: Backoff) -> None:
        """Pass on what comes over one connection, until it ends."""
        with LiveStream(self._plan.address) as stream:
            self._connections += 1
            self._say("waiting_for_keyframe", "waiting for a picture that is whole")
            passage = Passage(self._connections, ToldDelay.of_slot(self._slot))
            for picture in stream:
                self._progress_s = time.monotonic()
                self._slot.put(picture.frame, passage.about(picture, time.monotonic(), time.time()))
                self._workplace.ring("analysis", "picture")
                if self._phase != "receiving":
                    backoff.succeeded()
                    self._log.info("connected", connection=self._connections)
                    self._say("receiving", "")

    def _is_replayed_to_its_end(self, reason: str) -> bool:
        return self._plan.address.scheme == "replay" and reason == "the sender ended the stream"

    def _rest(self, pause_s: float) -> None:
        self._rest_until_s = time.monotonic() + pause_s
        time.sleep(pause_s)
        self._progress_s = time.monotonic()

    def _say(self, phase: CapturePhase, reason: str) -> None:
        self._progress_s = time.monotonic()
        self._phase, self._reason = phase, reason
        self._write()

    def _write(self) -> None:
        words = {
            "phase": self._phase,
            "reason": self._reason[:_LONGEST_REASON],
            "beat_s": time.monotonic(),
            "pid": os.getpid(),
        }
        self._record.write({**words, "connections": self._connections})

    def _beat(self) -> None:
        """Say that it is alive; end the process where it is stuck."""
        if time.monotonic() - max(self._progress_s, self._rest_until_s) > _STUCK_S:
            self._log.error("stuck; begins anew", phase=self._phase)
            os._exit(STUCK_CODE)
        self._write()


class ToldDelay(NamedTuple):
    """How late pictures come, by the sender's word.

    Attributes:
        delay_s: From capture to arrival.
        at_s: When it was told last, monotonic.
    """

    delay_s: float
    at_s: float

    @classmethod
    def of_slot(cls, slot: PictureSlot) -> ToldDelay | None:
        """Return what was told with the newest picture, by this process or one before it; None where nothing was."""
        found = slot.about()
        if found is None or found[1].get("delay_told_s") is None or found[1]["delay_s"] is None:
            return None
        return cls(found[1]["delay_s"], found[1]["delay_told_s"])


class Passage:
    """What is said with each picture of one connection.

    A sender's clock is its own: how far it is from this machine's is taken once, when its time is first told, and not
    again. Whoever sets a clock meanwhile changes no age.

    Args:
        connection: Its number.
        told: What an earlier connection was told of the delay: senders tell it some seconds after they begin, and in
            these seconds, too, somebody may be in danger.
    """

    def __init__(self, connection: int, told: ToldDelay | None = None) -> None:
        self._connection = connection
        self._wall_offset_s: float | None = None
        self._told = told
        self._stillness, self._changed_s = Stillness(), -math.inf

    def about(self, picture: LivePicture, now_s: float, unix_s: float) -> dict[str, float | int | str | None]:
        """Return it.

        Args:
            picture: That has just been decoded.
            now_s: Monotonic.
            unix_s: By the wall clock of this machine.
        """
        if self._stillness.has_changed(picture.frame):
            self._changed_s = now_s
        told = self._take_told(picture.told_unix_s, now_s, unix_s)
        return {
            "connection": self._connection,
            "stamp_s": picture.stamp_s,
            "arrived_s": now_s,
            "arrived_unix_s": unix_s,
            "changed_s": self._changed_s,
            # The last delay that was told holds for the next pictures, too: senders do not tell it of each.
            "delay_s": None if self._told is None or now_s - self._told.at_s > _TOLD_LASTS_S else self._told.delay_s,
            "delay_told_s": None if self._told is None else self._told.at_s,
            "told_unix_s": picture.told_unix_s if told else None,
            "told_by": "rtcp" if told else "arrival",
        }

    def _take_told(self, told_unix_s: float | None, now_s: float, unix_s: float) -> bool:
        """Return whether the sender told a time that can be; keep the delay that follows from it."""
        if told_unix_s is None:
            return False
        if self._wall_offset_s is None:
            if not -_AHEAD_S <= unix_s - told_unix_s <= _PLAUSIBLE_S:
                return False
            self._wall_offset_s = unix_s - now_s
        delay_s = now_s - (told_unix_s - self._wall_offset_s)
        if not -_AHEAD_S <= delay_s <= _PLAUSIBLE_S:
            return False
        self._told = ToldDelay(max(delay_s, 0.0), now_s)
        return True


class Stillness:
    """Tells whether pictures change: a camera that hangs, or a relay that repeats, sends the same one for ever.

    Coded anew, the same picture is never quite the same: a key frame differs from the picture before it in all places,
    a little, and the next few correct it. Something that moves, and the noise of a camera that is alive, change some
    places by more. Key frames after one another, of senders that send nothing else, are pictures like others.
    """

    def __init__(self) -> None:
        self._before: ImageArray | None = None
        self._was_key_frame = False

    def has_changed(self, frame: av.VideoFrame) -> bool:
        """Return whether a picture shows something else than the one before; the first one does."""
        plane = frame.planes[0]
        rows = np.frombuffer(plane, np.uint8)[: plane.line_size * frame.height].reshape(frame.height, plane.line_size)
        look = rows[::_SAMPLED, : frame.width : _SAMPLED].copy()
        before, self._before = self._before, look
        was_key_frame, self._was_key_frame = self._was_key_frame, bool(frame.key_frame)
        if before is None or before.shape != look.shape:
            return True
        changed = np.count_nonzero(cv2.absdiff(before, look) >= _CHANGED_LEVELS)
        return bool(changed >= _CHANGED_SAMPLES) and (was_key_frame or not frame.key_frame)


def run(workplace: Workplace, stream: str) -> None:
    """Capture a stream until the process that started this one is gone."""
    Capture(workplace.capture_plan(stream), workplace).run()
