from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numba import njit
from tolerances import GEOMETRY_REL

from standoff.core.compiled import solved, when_compiling

PROGRAM = """
from numba.core import caching
caching.CacheImpl._locator_classes = []
from standoff.core.compiled import compiled

@compiled
def ratio(a: float, b: float) -> float:
    return a / b

assert ratio(1.0, 4.0) == 0.25
assert ratio(1.0, 0.0) == float("inf")
"""


def test_without_a_folder_for_compiled_code_it_is_compiled_anew() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_who_waits_for_something_to_be_compiled_is_told_once_and_not_of_what_is_compiled_already() -> None:
    told: list[str] = []
    when_compiling(lambda: told.append("compiling"))
    solved(np.eye(2), np.ones((2, 1)))
    before = len(told)
    for constant in (1.0, 2.0):
        assert njit(lambda value, constant=constant: value + constant)(1.0) == 1.0 + constant
        assert told == ["compiling"]
    assert before <= 1


@pytest.mark.parametrize("size", [2, 6, 9])
def test_linear_equations_are_solved_as_by_numpy(size: int) -> None:
    rng = np.random.default_rng(size)
    matrix, right = rng.normal(size=(size, size)), rng.normal(size=(size, 3))
    np.testing.assert_allclose(solved(matrix, right), np.linalg.solve(matrix, right), rtol=GEOMETRY_REL)
    # Nothing to divide by without pivots.
    np.fill_diagonal(matrix, 0.0)
    np.testing.assert_allclose(solved(matrix, right), np.linalg.solve(matrix, right), rtol=GEOMETRY_REL)


def test_a_singular_matrix_solves_nothing() -> None:
    assert not np.isfinite(solved(np.ones((2, 2)), np.eye(2))).all()
