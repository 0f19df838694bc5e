"""When a distance becomes an alarm: Proximities in, Hazard events out."""

from standoff.stages.hazard.monitor import HazardMonitor
from standoff.stages.hazard.params import HazardParams

__all__ = ["HazardMonitor", "HazardParams"]
