"""Printed targets: markers of known size on sheets of paper, with all that people need to put them together rightly."""

from standoff.targets.sheet import PAPERS, SIZE_LIMITS_M, Paper, Target, Tile, tiles
from standoff.targets.write import write_target

__all__ = ["PAPERS", "SIZE_LIMITS_M", "Paper", "Target", "Tile", "tiles", "write_target"]
