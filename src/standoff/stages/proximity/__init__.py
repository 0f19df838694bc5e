"""How far apart people and machines are: GroundPositions in, Proximities out."""

from standoff.stages.proximity.excuses import Excuses
from standoff.stages.proximity.meter import ProximityMeter, machines_near_people, side_classes
from standoff.stages.proximity.params import ProximityParams

__all__ = [
    "Excuses",
    "ProximityMeter",
    "ProximityParams",
    "machines_near_people",
    "side_classes",
]
