"""A detector, a film, a sink and a clock that do as they were told."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

from standoff.core.protocols import Detector, LiveSink, Source
from standoff.core.types import Detections, Frame, FrameResult, ImageArray, Outcome, Silence
from standoff.stages.frames import frame_from_array


class ScriptedDetector(Detector):
    """A detector that has been told what it will see.

    Args:
        script: What is seen, by the frame's index in the source; in frames that are not listed nothing is.
        description: What it says of itself, `class_map` for instance.
    """

    def __init__(self, script: Mapping[int, Detections], description: Mapping[str, Any] | None = None) -> None:
        self._script, self._description = dict(script), dict(description or {})

    def describe(self) -> Mapping[str, Any]:
        """Return as it was given."""
        return self._description

    def detect(self, frame: Frame) -> Detections:
        """Return what the script has for this frame."""
        return self._script.get(frame.index, Detections.empty())


class DrawnFilm(Source):
    """A film of pictures in memory.

    Args:
        pictures: (H, W, 3) uint8 each, blue first, all of one size.
        fps: Pictures a second.
        stream_id: Name of the stream.
        fails_after: Number of pictures after which it breaks; None: never.
        error: What it then raises.

    Attributes:
        shown: How many pictures it has given.
        is_closed: Whether it was closed.
    """

    def __init__(
        self,
        pictures: Sequence[ImageArray],
        fps: float = 10.0,
        stream_id: str = "drawn",
        fails_after: int | None = None,
        error: Exception | None = None,
    ) -> None:
        self._pictures, self._fps, self._stream_id = list(pictures), fps, stream_id
        self._fails_after, self._error = fails_after, error or OSError("the film breaks here")
        self.shown, self.is_closed = 0, False

    def describe(self) -> Mapping[str, Any]:
        """Return what it is, and how many pictures it has given so far."""
        return {"kind": "drawn film", "size_px": list(self.size_px), "shown": self.shown}

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of every frame."""
        height_px, width_px = self._pictures[0].shape[:2]
        return width_px, height_px

    @property
    def frame_count(self) -> int:
        """How many pictures it has."""
        return len(self._pictures)

    def frames(self) -> Iterator[Frame]:
        """Yield the pictures in order."""
        for index, picture in enumerate(self._pictures):
            if index == self._fails_after:
                raise self._error
            self.shown += 1
            yield frame_from_array(picture, index=index, time_s=index / self._fps, stream_id=self._stream_id)

    def close(self) -> None:
        """Take note of it."""
        self.is_closed = True


class MemorySink(LiveSink):
    """A sink that keeps everything, and can be told to fail.

    Args:
        fails_at: The number of results after which `write` fails; None: never.

    Attributes:
        results: Of every frame that was written.
        silences: What was told in between.
        outcomes: How it ended, once for each call of `close`.
    """

    def __init__(self, fails_at: int | None = None) -> None:
        self._fails_at = fails_at
        self.results: list[FrameResult] = []
        self.silences: list[Silence] = []
        self.outcomes: list[Outcome] = []

    def write(self, result: FrameResult) -> None:
        """Keep a result.

        Raises:
            OSError: As it was told.
        """
        if len(self.results) == self._fails_at:
            raise OSError("no space left on device")
        self.results.append(result)

    def tell(self, silence: Silence) -> None:
        """Keep it."""
        self.silences.append(silence)

    def close(self, outcome: Outcome) -> None:
        """Keep it."""
        self.outcomes.append(outcome)


class FakeClock:
    """A clock that stands still until somebody lets time pass.

    Args:
        utc: What it shows at first, aware; midday of some day by default.
    """

    def __init__(self, utc: datetime = datetime(2026, 1, 1, 12, tzinfo=UTC)) -> None:
        self._start, self._passed_s, self._set = utc, 0.0, timedelta(0)

    def pass_s(self, seconds: float) -> None:
        """Let time pass."""
        self._passed_s += seconds

    def set_by(self, change: timedelta) -> None:
        """Set the clock, as somebody or NTP may: UTC jumps, the monotonic time does not."""
        self._set += change

    def monotonic_s(self) -> float:
        """Return seconds since it was made."""
        return self._passed_s

    def utc(self) -> datetime:
        """Return aware UTC."""
        return self._start + self._set + timedelta(seconds=self._passed_s)
