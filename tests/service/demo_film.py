"""The demo's film, whose every metre is known."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

DEMO = Path(str(files("standoff"))) / "demo"
SIDE_M, HEIGHT_M = 2.89, 0.42
"""Of its footing."""
CLICK_PX = 2.0
"""Standard deviation of where a hand clicks, in each coordinate."""
