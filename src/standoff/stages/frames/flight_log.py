"""A drone's log beside its film (SubRip): whole and understood, or refused with a reason."""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.telemetry import Telemetry
from standoff.files.plain_text import UnknownEncoding, decoded
from standoff.stages.frames.flight_text import UnreadableText, dialect_of, read_block
from standoff.stages.frames.instruments import PROFESSIONAL, InstrumentErrors, telemetry_of

READINGS = (
    "height_m", "pitch_deg", "roll_deg", "heading_deg", "latitude_deg", "longitude_deg", "altitude_m", "focal_mm_35",
)  # fmt: skip
"""Columns of a log, named as the fields of `Telemetry`."""

_TURNING = frozenset({"roll_deg", "heading_deg", "longitude_deg"})
_HEADER = re.compile(
    r"^[ \t]*(\d+)[ \t]*\n\s*(?:(\d+:\d\d:\d\d[,.]\d{3}) --> (\d+:\d\d:\d\d[,.]\d{3})[ \t]*\n?|(?=\d{4}\.\d))",
    re.MULTILINE,
)
_DATE = re.compile(r"(\d{4})[.-](\d{1,2})[.-](\d{1,2}) (\d\d):(\d\d):(\d\d)(?:[.,](\d{3}))?")
_COUNT = re.compile(r"FrameCnt\s*:\s*(\d+)")
_DEGREE_M = 111_200.0  # of latitude, and of longitude at the equator
_PLACE_DIGITS = (4, 5, 6)
_SIMULATED_STEM = "video"
_GAP_S = 2.5
_SLACK_S, _SLACK_SHARE = 1.5, 0.02
_SLACK_FRAMES = 2
_LARGEST_BYTES = 256 << 20


class _Block(NamedTuple):
    number: int
    span: tuple[str, str] | None
    text: str


@dataclass(frozen=True, slots=True)
class NoFlightLog:
    """A file gives no readings, and why. Falsy.

    Attributes:
        name: The file's.
        reason: A clause.
    """

    name: str
    reason: str

    def __bool__(self) -> bool:
        return False

    def __str__(self) -> str:
        return f"{self.name} is not used: {self.reason}"


@dataclass(frozen=True, slots=True, eq=False)
class FlightLog:
    """What a drone wrote during a film. Truthy.

    Attributes:
        name: The file's.
        dialect: See `flight_text`.
        time_s: (N,) when each block starts, from the film's start, increasing.
        end_s: When the last one ends.
        values: (N, 8) by `READINGS`; NaN where the drone had none.
        errors: Of the instruments; of the place also by the digits it is written with.
        remarks: What is odd about the log itself, a clause each.
        is_zoomed_digitally: Whether pictures are cut-outs of the lens's for some of the time.
    """

    name: str
    dialect: str
    time_s: FloatArray
    end_s: float
    values: FloatArray
    errors: InstrumentErrors = PROFESSIONAL
    remarks: tuple[str, ...] = ()
    is_zoomed_digitally: bool = False

    def __post_init__(self) -> None:
        self.time_s.setflags(write=False)
        self.values.setflags(write=False)

    def column(self, name: str) -> FloatArray:
        """Return (N,) one of `READINGS`."""
        return self.values[:, READINGS.index(name)]

    def at(self, time_s: float) -> Telemetry | None:
        """Return the readings for a moment, interpolated; None outside the log and inside its gaps.

        A reading is NaN where one of its two neighbours is. The last block's hold until it ends.
        """
        if not self.time_s[0] <= time_s < self.end_s:
            return None
        before = int(np.searchsorted(self.time_s, time_s, side="right")) - 1
        after = min(before + 1, len(self.time_s) - 1)
        gap_s = self.time_s[after] - self.time_s[before]
        if gap_s > _GAP_S:
            return None
        share = (time_s - self.time_s[before]) / gap_s if gap_s > 0 else 0.0
        readings = {
            name: _between(first, second, share, turning=name in _TURNING)
            for name, first, second in zip(
                READINGS, self.values[before].tolist(), self.values[after].tolist(), strict=True
            )
        }
        return telemetry_of(readings, time_s, self.name, self.errors)

    def told_focal_mm_35(self) -> FloatArray:
        """Return all focal lengths that it tells, in terms of 35 mm film; none where it does not tell throughout."""
        focal = self.column("focal_mm_35")
        return focal if np.isfinite(focal).all() else np.zeros(0)

    @property
    def has_attitude(self) -> bool:
        """Whether it tells the camera's angles at any time."""
        return bool(np.isfinite(self.column("pitch_deg")).any())

    def without_attitude(self) -> FlightLog:
        """Return the log without the camera's angles."""
        values = self.values.copy()
        values[:, [READINGS.index(name) for name in ("pitch_deg", "roll_deg", "heading_deg")]] = np.nan
        return replace(self, values=values)

    def disagreements(self, duration_s: float | None, frames: int | None) -> tuple[str, ...]:
        """Say where the log does not fit a film.

        Args:
            duration_s: Of the film; None: unknown.
            frames: Pictures of the film; None: unknown.
        """
        found = list(self.remarks)
        if duration_s:
            found += self._misfits(duration_s, frames)
        focal = self.told_focal_mm_35()
        if len(focal) and focal.max() > 1.02 * focal.min():
            found.append(f"the focal length changes from {focal.min():g} to {focal.max():g} mm: the lens zooms")
        return tuple(f"{self.name}: {clause}" for clause in found)

    def _misfits(self, duration_s: float, frames: int | None) -> list[str]:
        """Say how its length or its number of blocks differs from the film's, at most one of the two."""
        slack_s = max(_SLACK_S, _SLACK_SHARE * duration_s)
        if self.time_s[0] > slack_s or self.end_s < duration_s - slack_s:
            return [f"it covers {self.time_s[0]:.1f} to {self.end_s:.1f} s of a film of {duration_s:.1f} s"]
        if self.end_s > duration_s + slack_s:
            return [f"it goes on to {self.end_s:.1f} s, but the film ends at {duration_s:.1f} s"]
        blocks = len(self.time_s)
        if frames and self._is_per_frame(frames / duration_s):
            slack_frames = max(_SLACK_FRAMES, _SLACK_SHARE * frames)
            if abs(blocks - frames) > slack_frames:
                return [f"it has {blocks} blocks, but the film {frames} frames"]
        return []

    def _is_per_frame(self, rate_fps: float) -> bool:
        """Tell whether there is a block for each frame, rather than one a second."""
        return len(self.time_s) > 1 and float(np.median(np.diff(self.time_s))) * rate_fps < 1.5

    def describe(self) -> dict[str, Any]:
        """Return what it is, for the record."""
        return {
            "origin": self.name,
            "dialect": self.dialect,
            "blocks": len(self.time_s),
            "from_s": float(self.time_s[0]),
            "to_s": self.end_s,
            "sha256": hashlib.sha256(self.time_s.tobytes() + self.values.tobytes()).hexdigest(),
            "readings": [name for name in READINGS if np.isfinite(self.column(name)).any()],
        }


def _between(first: float, second: float, share: float, *, turning: bool) -> float:
    """Interpolate, the short way round where an angle turns over at 180 degrees."""
    if share == 0.0:
        return first
    step = (second - first + 180.0) % 360.0 - 180.0 if turning else second - first
    value = first + share * step
    return (value + 180.0) % 360.0 - 180.0 if turning else value


def read_flight_log(path: Path) -> FlightLog | NoFlightLog:
    """Read a log, or say why it is not used.

    A log with a block that is cut off is refused as a whole: what else is missing or garbled cannot be told.
    """
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise UnreadableText("it is too large for a drone's log")
        return _parsed(path.name, _text(path.read_bytes()))
    except OSError as error:
        return NoFlightLog(path.name, f"it cannot be read ({error.strerror})")
    except UnreadableText as error:
        return NoFlightLog(path.name, str(error))


def _text(content: bytes) -> str:
    """Return a log's text; letters of another 8-bit alphabet in it, beside its numbers, do no harm."""
    try:
        return decoded(content)
    except UnknownEncoding as encoding:
        if "UTF" in str(encoding):
            raise UnreadableText(f"it is in {encoding}, not in UTF-8") from encoding
        return content.decode("utf-8-sig", errors="replace")


def _parsed(name: str, text: str) -> FlightLog:
    blocks = _blocks(text)
    if not blocks:
        raise UnreadableText("it is empty" if not text.strip() else "it holds no subtitle")
    dialect = dialect_of(blocks[0].text)
    if dialect is None:
        raise UnreadableText("it is in no dialect of a drone that is known")
    if len(blocks) == 1 and not blocks[0].text.rstrip().endswith("</font>"):
        raise UnreadableText("of a single block it cannot be told whether it is whole")
    expected: frozenset[str] | None = None
    values = np.full((len(blocks), len(READINGS)), np.nan)
    for row, block in enumerate(blocks):
        try:
            readings, names = read_block(block.text, dialect)
        except UnreadableText as error:
            raise UnreadableText(f"block {block.number}: {error}") from error
        expected = names if expected is None else expected
        if missing := expected - names:
            raise UnreadableText(f"block {block.number} lacks {', '.join(sorted(missing)[:3])}: it is cut off")
        values[row] = [readings.get(column, math.nan) for column in READINGS]
    time_s, end_s, remarks = _times(blocks)
    places = values[:, [READINGS.index("latitude_deg"), READINGS.index("longitude_deg")]]
    errors = replace(PROFESSIONAL, position_m=math.hypot(PROFESSIONAL.position_m, _rounding_m(places)))
    log = FlightLog(name, dialect, time_s, end_s, values, errors, (*remarks, *_restarts(blocks)))
    if expected is not None and "focal_len" in expected and not len(log.told_focal_mm_35()):
        remark = "the picture is zoomed digitally for some of the time: its focal length is not known"
        return replace(log, remarks=(*log.remarks, remark), is_zoomed_digitally=True)
    return log


def _rounding_m(places_deg: FloatArray) -> float:
    """Return the standard error that comes from writing places with few digits: with four, 3.2 m."""
    known = places_deg[np.isfinite(places_deg)]
    for digits in _PLACE_DIGITS:
        if np.abs(np.round(known, digits) - known).max(initial=0.0) < 1e-9:
            return float(_DEGREE_M * 10.0**-digits / math.sqrt(12.0)) if len(known) else 0.0
    return 0.0


def _blocks(text: str) -> list[_Block]:
    headers = list(_HEADER.finditer(text))
    ends = [*(header.start() for header in headers[1:]), len(text)][: len(headers)]
    return [
        _Block(int(header[1]), (header[2], header[3]) if header[2] else None, text[header.end() : end])
        for header, end in zip(headers, ends, strict=True)
    ]


def _times(blocks: list[_Block]) -> tuple[FloatArray, float, tuple[str, ...]]:
    """Return when each block starts, when the last one ends, and remarks."""
    spans = [block.span for block in blocks]
    remarks: tuple[str, ...] = ()
    if all(span is not None for span in spans):
        time_s = np.array([_seconds(span[0]) for span in spans if span is not None])
        last = spans[-1]
        end_s = _seconds(last[1]) if last is not None else math.nan
    elif any(span is not None for span in spans):
        raise UnreadableText(f"block {blocks[[s is None for s in spans].index(True)].number} has no time")
    else:
        # A second of the drone's clock may be written twice and the next one left out: only the mean step is sound.
        whole_s = (_date(blocks[-1]) - _date(blocks[0])).total_seconds()
        step_s = whole_s / (len(blocks) - 1) if len(blocks) > 1 else 1.0
        time_s, end_s = step_s * np.arange(len(blocks)), step_s * len(blocks)
        remarks = ("its blocks have no times of the film; they are spread over the time between its dates",)
    if (back := np.flatnonzero(np.diff(time_s) <= 0)).size:
        raise UnreadableText(f"block {blocks[back[0] + 1].number} is not later than the one before")
    return time_s, max(end_s, float(time_s[-1]) + 1e-3), remarks


def _seconds(clock: str) -> float:
    hours, minutes, seconds = clock.replace(",", ".").split(":")
    return int(hours) * 3600 + int(minutes) * 60 + float(seconds)


def _date(block: _Block) -> datetime:
    match = _DATE.search(block.text)
    try:
        if match is None:
            raise ValueError("none")
        year, month, day, hour, minute, second, millisecond = (int(part or 0) for part in match.groups())
        return datetime(year, month, day, hour, minute, second, 1000 * millisecond, tzinfo=UTC)
    except ValueError as error:
        raise UnreadableText(f"block {block.number} has neither a time nor a date") from error


def _restarts(blocks: list[_Block]) -> tuple[str, ...]:
    """Say where the drone began to count its frames anew: the logs of several films, one after another."""
    counts = [(block.number, int(match[1])) for block in blocks if (match := _COUNT.search(block.text)) is not None]
    for (_, before), (number, count) in pairwise(counts):
        if count < before:
            return (f"its count of frames starts anew at block {number}: it is the log of several films",)
    return ()


@dataclass(frozen=True, slots=True)
class FoundLog:
    """What was found for a film.

    Attributes:
        log: The log; None: none.
        warnings: Why a file that looks like one is not used.
    """

    log: FlightLog | None = None
    warnings: tuple[str, ...] = ()


def log_beside(film: Path) -> FoundLog:
    """Look for a log beside a film: named like it, or `telemetry.srt` in its folder as the simulator writes it."""
    named = [path for suffix in (".srt", ".SRT", ".Srt") if (path := film.with_suffix(suffix)).is_file()]
    if not named:
        common = film.parent / "telemetry.srt"
        if not common.is_file() or not film.is_file():
            return FoundLog()
        others = [path for path in film.parent.glob(f"*{film.suffix}") if path != film]
        if others and film.stem != _SIMULATED_STEM:
            return FoundLog(None, (f"{common.name} is not used: it lies beside {len(others) + 1} films",))
        named = [common]
    log = read_flight_log(named[0])
    return FoundLog(log) if isinstance(log, FlightLog) else FoundLog(None, (str(log),))
