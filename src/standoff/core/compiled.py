"""Loops compiled by numba, kept on disk between runs where there is a folder to keep them in.

What is to be compiled is written in loops over numbers: slices, masks and numpy's linear algebra take many seconds to
compile, which whoever runs a new installation waits for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit
from numba.core import event

from standoff.core.homography import FloatArray

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


def when_compiling(say: Callable[[], None]) -> None:
    """Call something once, as soon as a function has to be compiled: after an installation that takes half a minute."""
    event.register("numba:compile", _Once(say))


class _Once(event.Listener):  # type: ignore[misc]  # numba has no types
    def __init__(self, say: Callable[[], None]) -> None:
        self._say: Callable[[], None] | None = say

    def on_start(self, compiling: object) -> None:
        if self._say is not None:
            self._say()
            self._say = None

    def on_end(self, compiled: object) -> None:
        """Do nothing: that it goes on is seen."""


@compiled
def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve some linear equations with one matrix, by elimination with pivots.

    Args:
        matrix: (N, N), of a few rows.
        right: (N, M) right-hand sides.

    Returns:
        (N, M); not finite where the matrix is singular.
    """
    left, right = matrix.copy(), right.copy()
    _eliminate(left, right)
    size, columns = right.shape
    for column in range(columns):
        for row in range(size - 1, -1, -1):
            for k in range(row + 1, size):
                right[row, column] -= left[row, k] * right[k, column]
            right[row, column] /= left[row, row]
    return right


@compiled
def _eliminate(left: FloatArray, right: FloatArray) -> None:
    """Make the left side (N, N) of linear equations upper triangular, and the right one (N, M) accordingly."""
    size, columns = right.shape
    for k in range(size):
        pivot = k
        for row in range(k + 1, size):
            pivot = row if abs(left[row, k]) > abs(left[pivot, k]) else pivot
        for column in range(size):
            left[k, column], left[pivot, column] = left[pivot, column], left[k, column]
        for column in range(columns):
            right[k, column], right[pivot, column] = right[pivot, column], right[k, column]
        for row in range(k + 1, size):
            factor = left[row, k] / left[k, k]
            for column in range(k, size):
                left[row, column] -= factor * left[k, column]
            for column in range(columns):
                right[row, column] -= factor * right[k, column]
