"""Where each track stands on the ground: Tracks and a ground map in, GroundPositions out."""

from standoff.stages.locate.locator import Locator
from standoff.stages.locate.params import Anchor, LocateParams

__all__ = [
    "Anchor",
    "LocateParams",
    "Locator",
]
