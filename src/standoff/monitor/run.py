"""A monitor between a source and its sinks, from the first frame to the record of how it ended."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Generator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final

from standoff.core.errors import OutputError, StandoffError
from standoff.core.protocols import Described, Sink, Source
from standoff.core.stage_durations import Durations
from standoff.core.types import FrameResult, Outcome
from standoff.monitor.fan_out import FanOut
from standoff.monitor.look_ahead import Ahead, look_ahead, one_by_one
from standoff.monitor.monitor import Monitor
from standoff.monitor.record import RecordKeeper, RunRecord

STOPPED = "stopped before the end of the source"

_LOG = logging.getLogger(__name__)


class Run:
    """Pull frames from a source through a monitor to sinks; iterate over it once, and it is done.

    Args:
        source: Closed at the end.
        monitor: Of this stream.
        sinks: By name; closed at the end, however it comes.
        folder: What holds the record, and is nobody else's while the run goes on; None: there is none.
        overlaps: Read and detect one frame ahead and write one behind, in threads. Results and their order are the
            same; the times of stages are longer, because they share the cores.

    Attributes:
        source: Where the frames come from.
        monitor: The stages.
        folder: As given.
    """

    def __init__(
        self,
        source: Source,
        monitor: Monitor,
        sinks: Mapping[str, Sink] | None = None,
        folder: RecordKeeper | None = None,
        *,
        overlaps: bool = False,
    ) -> None:
        self.source, self.monitor, self.folder = source, monitor, folder
        self._overlaps = overlaps
        self._time_s = 0.0
        self._fan_out = FanOut(sinks or {})
        self._stages: defaultdict[str, Durations] = defaultdict(Durations)

    @property
    def record(self) -> RunRecord:
        """What the record of the folder says, or should say where it could not be written.

        Raises:
            ValueError: The run has no folder.
        """
        if self.folder is None:
            raise ValueError("a run without a folder keeps no record")
        return self.folder.record

    @property
    def sink_errors(self) -> Mapping[str, str]:
        """Message of each output that gave up so far, by name."""
        return self._fan_out.errors

    @property
    def warnings(self) -> list[str]:
        """What is odd about the source, the set-up and what was seen so far, a clause each."""
        return warnings_of(self.source, *self.monitor.stages.values())

    def __iter__(self) -> Generator[FrameResult, None, None]:
        """Yield each frame's result after the sinks have it, with their times; close everything however it ends."""
        outcome, lost = Outcome("complete"), ""
        try:
            yield from self._overlapping() if self._overlaps else self._one_by_one()
        except (KeyboardInterrupt, GeneratorExit):
            outcome = Outcome("interrupted", STOPPED)
            raise
        except BaseException as error:
            lost = str(error) or type(error).__name__
            outcome = Outcome("failed", lost)
            raise
        finally:
            try:
                outcome = replace(outcome, hazards=self.monitor.close(self._time_s, lost=lost))
            finally:
                self._end(outcome)

    def _one_by_one(self) -> Generator[FrameResult, None, None]:
        for ahead in one_by_one(self.source.frames()):
            result = self._step(ahead)
            yield self._timed(result, self._fan_out.write(result))

    def _overlapping(self) -> Generator[FrameResult, None, None]:
        """Do the same with the next frame read and the last one written meanwhile."""
        with (
            ThreadPoolExecutor(1, "write") as writer,
            closing(look_ahead(self.source.frames(), self.monitor)) as frames,
        ):
            written: tuple[FrameResult, Future[dict[str, float]]] | None = None
            for ahead in frames:
                result = self._step(ahead)
                before, written = written, (result, writer.submit(self._fan_out.write, result))
                if before is not None:
                    yield self._timed(before[0], before[1].result())
            if written is not None:
                yield self._timed(written[0], written[1].result())

    def _step(self, ahead: Ahead) -> FrameResult:
        self._time_s = ahead.frame.time_s
        result = self.monitor.step(ahead.frame, ahead.seen)
        return replace(result, stage_ms={**ahead.read_ms, **result.stage_ms})

    def _timed(self, result: FrameResult, sink_ms: Mapping[str, float]) -> FrameResult:
        """Count the times of a frame, and return its result with those of its sinks."""
        stage_ms = {**result.stage_ms, **sink_ms}
        for stage, duration_ms in stage_ms.items():
            self._stages[stage].add(duration_ms)
        return replace(result, stage_ms=stage_ms)

    def _end(self, outcome: Outcome) -> None:
        about = {} if self.folder is None else self.folder.record.about
        # What the source lost, and what the stages saw, is known only now; one that cannot be opened says nothing.
        with suppress(StandoffError):
            about = {**about, **describe_run(self.source, self.monitor)}
        ended = replace(outcome, about=about, counts=self.monitor.counts)
        self._fan_out.close(ended)
        self.source.close()
        if self.folder is not None:
            ended = replace(ended, sink_errors=dict(self._fan_out.errors))
            try:
                self.folder.finish(ended, {name: durations.summary() for name, durations in self._stages.items()})
            except OutputError as error:
                _LOG.error("output record stopped: %s", error)
                self._fan_out.errors["record"] = str(error)


ABOUT: Final[Mapping[str, str]] = MappingProxyType(
    {
        "settings": "all settings of the run, defaults filled in; `standoff config show` says what each means",
        "files": "SHA-256 of each file that the settings name, by the setting",
        "source": "what the film or folder of pictures is, and what could not be read of it",
        "model": "what the detector says of itself: its file and hash among it",
        "ground": "what the ground map rests on, and how sure it is",
        "watched": "what was taken for granted of the detector where ground is judged",
        "alarms": "hours of the workers in sight, alarms, and alarms for each worker and hour (null: too little seen)",
        "warnings": "what is odd about the source, the set-up and what was seen, a clause each",
    }
)
"""What a run says of its parts in its record: headings and what stands under them."""


def describe_run(source: Source, monitor: Monitor) -> dict[str, Any]:
    """Return what is known of a run, for its record and its report: before the first frame, or after the last."""
    return {
        "source": source.describe(),
        "model": monitor.detector.describe(),
        "ground": monitor.ground.describe(),
        "watched": monitor.watcher.describe(),
        "alarms": monitor.hazard.describe().get("alarms"),
        "warnings": warnings_of(source, *monitor.stages.values()),
    }


def warnings_of(*parts: Described) -> list[str]:
    """Return what is odd about some parts and about what they saw so far, a clause each."""
    return [text for part in parts for text in part.describe().get("warnings", ())]
