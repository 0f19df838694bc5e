"""Joint values: kept within a machine's limits, filled up from its rest position."""

from __future__ import annotations

from collections.abc import Mapping

UNBOUNDED_DEG = (-36000.0, 36000.0)
"""A joint that turns on and on."""
UNBOUNDED_M = (-1e5, 1e5)
"""A distance travelled."""


def settle(
    joints: Mapping[str, float], limits: Mapping[str, tuple[float, float]], rest: Mapping[str, float]
) -> dict[str, float]:
    """Return a value for every joint: the given one held within its limits, else the rest position's, else 0.

    Raises:
        ValueError: A given joint does not exist.

    >>> settle({"lift_deg": 99.0}, {"lift_deg": (-40.0, 45.0), "steer_deg": (-38.0, 38.0)}, {"steer_deg": 5.0})
    {'lift_deg': 45.0, 'steer_deg': 5.0}
    """
    unknown = sorted(joints.keys() - limits.keys())
    if unknown:
        raise ValueError(f"no such joint: {', '.join(unknown)}; there are {', '.join(limits)}")
    return {
        name: min(max(float(joints.get(name, rest.get(name, 0.0))), low), high) for name, (low, high) in limits.items()
    }
