"""How far apart people and machines are: GroundPositions in, Proximities out."""

from standoff.stages.proximity.meter import ProximityMeter
from standoff.stages.proximity.params import ProximityParams

__all__ = ["ProximityMeter", "ProximityParams"]
