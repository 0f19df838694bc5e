"""Loops compiled by numba, kept on disk between runs where there is a folder to keep them in."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays at its first call; division by zero gives infinity, as in numpy.

    Without a folder that can be written to (a read-only container) it is compiled anew in every process.
    """
    try:
        cached: Callable[P, R] = njit(cache=True, error_model="numpy")(function)
    except RuntimeError:
        cached = njit(error_model="numpy")(function)
    return cached
