from __future__ import annotations

import subprocess
import sys

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
