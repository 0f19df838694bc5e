"""What entities do: scripts that turn places into motions, with the accelerations of real machines and people.

Each takes a generator, the models, places and a duration, and returns one motion for each model, in order. The same
generator gives the same motions. Motions cover 0 to the duration; some begin before, so that the clip starts in the
midst of the work.
"""

from standoff_sim.behaviour.digging import digging, grading, truck_loading
from standoff_sim.behaviour.earthmoving import (
    dozing,
    driving_through,
    heaping,
    idle,
    loader_loading,
    rolling,
    spreading,
)
from standoff_sim.behaviour.encounters import crossing_behind, keep_distance, near_miss
from standoff_sim.behaviour.errands import driving_off, errand, riding, staying
from standoff_sim.behaviour.hauling import hauling
from standoff_sim.behaviour.people import (
    carrying_between,
    pair_talking,
    standing_working,
    stooping,
    walking_past,
)
from standoff_sim.behaviour.stances import random_stance

__all__ = [
    "carrying_between",
    "crossing_behind",
    "digging",
    "dozing",
    "driving_off",
    "driving_through",
    "errand",
    "grading",
    "hauling",
    "heaping",
    "idle",
    "keep_distance",
    "loader_loading",
    "near_miss",
    "pair_talking",
    "random_stance",
    "riding",
    "rolling",
    "spreading",
    "standing_working",
    "staying",
    "stooping",
    "truck_loading",
    "walking_past",
]
