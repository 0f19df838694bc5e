"""A small network that tells where the thing in a box stands: for every detector, ours or another.

It sees one box at a time, with some of what is around, as it would be cut out of any picture, with the first layers of
a detector. What a detector's own heads learn slowly, because each thing is one cell of a picture among thousands, it
learns in less than an hour on one core.
"""

from standoff.training.ground_point.crops import Patches, as_found, read_patches
from standoff.training.ground_point.network import read_eyes
from standoff.training.ground_point.train import (
    PointError,
    PointTraining,
    measure_points,
    train_points,
    write_points,
)

__all__ = [
    "Patches",
    "PointError",
    "PointTraining",
    "as_found",
    "measure_points",
    "read_eyes",
    "read_patches",
    "train_points",
    "write_points",
]
