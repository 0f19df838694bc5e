"""What an operator must fix, as exceptions.

    StandoffError              every error below; one line: expected, found, what to do
    ├── SourceError            the video, image folder or stream cannot be read
    │   ├── SourceTruncated    it ended before its own header says it should
    │   └── FrameSizeChanged   the picture's size changed in mid-stream
    ├── ModelError             a Darknet cfg, weights or ONNX model does not fit
    ├── GroundError            points, quadrilateral or camera file do not define a ground map
    ├── ConfigError            the configuration is wrong
    ├── OutputError            the output folder cannot be used
    ├── SimulationError        a simulated clip cannot be rendered
    ├── DataError              an evaluation's truth or run folder cannot be used
    └── MissingDependency      an optional package or system library is not installed

A failed *estimate* is never an exception: see `standoff.core.types.NoGroundMap`.
"""

from __future__ import annotations

from typing import Any


class StandoffError(Exception):
    """Say in one line what was expected, what was found and what to do.

    Args:
        expected: What would have been right, without a verb ("a video file").
        found: What is there instead.
        fix: What the reader should do, an imperative sentence without full stop.
    """

    def __init__(self, *, expected: str, found: str, fix: str) -> None:
        self.expected = expected
        self.found = found
        self.fix = fix
        line = f"expected {expected}, found {found}. {fix[:1].upper()}{fix[1:]}."
        super().__init__(" ".join(line.split()))

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (type(self), self.expected, self.found, self.fix)


def _again(kind: type[StandoffError], expected: str, found: str, fix: str) -> StandoffError:
    """Rebuild an error that came from another process."""
    return kind(expected=expected, found=found, fix=fix)


class SourceError(StandoffError):
    """The video, image folder or stream cannot be read."""


class SourceTruncated(SourceError):
    """The source ended before its own header says it should."""


class FrameSizeChanged(SourceError):
    """The picture's size changed in mid-stream."""


class ModelError(StandoffError):
    """A Darknet cfg, its weights, or an ONNX model does not fit."""


class GroundError(StandoffError):
    """Points, a quadrilateral or a camera file do not define a ground map."""


class ConfigError(StandoffError):
    """The configuration is wrong."""


class OutputError(StandoffError):
    """The output folder cannot be used."""


class DataError(StandoffError):
    """An evaluation's truth, pictures or run folder cannot be used."""


class SimulationError(StandoffError):
    """A simulated clip cannot be rendered."""


class MissingDependency(StandoffError):
    """An optional package or system library is not installed."""
