"""The clock that all processes of a service share, and its name."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Protocol

_BOOT_ID: Final = Path("/proc/sys/kernel/random/boot_id")


class Moment(NamedTuple):
    """A moment by both clocks of a machine.

    Attributes:
        clock: Names the start of the machine since which it counts.
        s: Monotonic; nobody sets it.
        unix_s: Since 1970, by a clock that somebody may set.
    """

    clock: str
    s: float
    unix_s: float

    def since(self, earlier: Moment) -> float:
        """Return how many seconds lie between two moments; of another start of the machine the wall clock tells."""
        return self.s - earlier.s if self.clock == earlier.clock else self.unix_s - earlier.unix_s


class Now(Protocol):
    """Tells the moment."""

    def __call__(self) -> Moment:
        """Return it."""
        ...


def clock_name() -> str:
    """Return a name of this start of the machine."""
    try:
        return _BOOT_ID.read_text(encoding="ascii").strip()[:13]
    except OSError:
        return f"{time.time() - time.monotonic():.0f}"


@dataclass(frozen=True, slots=True)
class ServiceClock:
    """The clock of this machine.

    Attributes:
        name: Of its start.
    """

    name: str

    @classmethod
    def of_machine(cls) -> ServiceClock:
        """Return it."""
        return cls(clock_name())

    def __call__(self) -> Moment:
        """Return the moment."""
        return Moment(self.name, time.monotonic(), time.time())
