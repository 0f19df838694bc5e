"""What the paper measured, and where it says so."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Published:
    """One figure of the paper.

    Attributes:
        value: In `unit`.
        unit: "m", "%", "frames" or "s".
        where: Section, table or figure.
    """

    value: float
    unit: str
    where: str


PUBLISHED: Mapping[str, Published] = MappingProxyType(
    {
        "ale worker": Published(0.16, "m", "Table 3"),
        "ale wheel_loader": Published(0.37, "m", "Table 3"),
        "ale excavator": Published(0.31, "m", "Table 3"),
        "mobile failed": Published(37, "frames", "8.2: 37 of 398"),
        "mobile failed share": Published(100 * 37 / 398, "%", "8.2: 37 of 398"),
        "mobile made worker-wheel_loader": Published(0.33, "m", "6.1, Eq. 8"),
        "mobile mape worker-wheel_loader": Published(3.72, "%", "6.1, Eq. 9"),
        "mobile median worker-wheel_loader": Published(0.01, "m", "6.1, Fig. 11"),
        "mobile made worker-excavator": Published(0.89, "m", "6.1, Eq. 8"),
        "mobile mape worker-excavator": Published(4.85, "%", "6.1, Eq. 9"),
        "mobile median worker-excavator": Published(-0.16, "m", "6.1, Fig. 11"),
        "stationary-15 made worker-excavator": Published(0.632, "m", "6.2, Fig. 13"),
        "stationary-15 mape worker-excavator": Published(4.214, "%", "6.2, Fig. 13"),
        "stationary-20 made worker-excavator": Published(0.892, "m", "6.2, Fig. 13"),
        "stationary-20 mape worker-excavator": Published(4.462, "%", "6.2, Fig. 13"),
        "virtual failed": Published(0, "frames", "8.2, Fig. 14"),
        "board before": Published(93.51, "%", "5.2, Table 4"),
        "board after": Published(97.43, "%", "5.2, Table 5"),
        "board worst before": Published(68.32, "%", "5.2, Fig. 8, frame 110"),
        "board worst after": Published(93.33, "%", "5.2, Fig. 8, frame 110"),
        "rectification time": Published(0.25, "s", "8.3, on a Tesla K40"),
    }
)
"""By the name that a measured figure has, too."""

BENCHMARK_PRESETS = ("mobile",)
"""Clips for which the paper's substitute for the truth is made as well."""
