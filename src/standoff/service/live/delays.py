"""How late each stream's pictures come, as `standoff latency` measured it."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from standoff.core.errors import DataError
from standoff.files.json_text import read_json, write_json

_FILE: Final = "delays.json"


@dataclass(frozen=True, slots=True)
class MeasuredDelay:
    """From what a camera sees to its arrival here.

    Attributes:
        delay_s: The median.
        worst_s: The largest that was seen.
        pictures: How many showed the clock.
        address: Of the stream then; another address has another delay.
        measured_at: When, UTC.
    """

    delay_s: float
    worst_s: float
    pictures: int
    address: str
    measured_at: str


def read_delays(folder: Path) -> dict[str, MeasuredDelay]:
    """Return what was measured, by stream; nothing where nobody has.

    Args:
        folder: Of the service's state.

    Raises:
        DataError: The file holds something else.
    """
    path = folder / _FILE
    if not path.is_file():
        return {}
    told = read_json(path, "delays, as `standoff latency` writes them", DataError)
    try:
        delays = {str(name): MeasuredDelay(**one) for name, one in told.items()}
        if not all(math.isfinite(one.delay_s) and one.delay_s >= 0 for one in delays.values()):
            raise ValueError("a delay that is none")
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise DataError(expected=f"delays in {path}", found=str(error), fix="measure again") from None
    return delays


def keep_delay(folder: Path, stream: str, measured: MeasuredDelay) -> MeasuredDelay:
    """Keep what was measured of a stream, and return it; what a damaged file held is gone.

    Raises:
        OutputError: It cannot be written.
    """
    known: dict[str, MeasuredDelay] = {}
    with suppress(DataError):
        known = read_delays(folder)
    delays = {**known, stream: measured}
    write_json(folder / _FILE, {name: asdict(one) for name, one in delays.items()})
    return measured
