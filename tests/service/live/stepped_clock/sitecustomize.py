"""A wall clock that a test sets: `time.time` is off by what a file says; the monotonic clock goes on.

Python reads this file before anything else where its folder is on the path.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

_true, _path = time.time, Path(os.environ.get("STEPPED_CLOCK", os.devnull))


def _stepped() -> float:
    try:
        return _true() + float(_path.read_text(encoding="ascii") or 0.0)
    except (OSError, ValueError):
        return _true()


time.time = _stepped
