"""`standoff bench`: milliseconds for each stage, beside baselines measured in the same run."""

from __future__ import annotations


def bench() -> None:
    """X."""
