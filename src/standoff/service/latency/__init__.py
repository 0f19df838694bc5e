"""How late a stream's pictures come: its camera films a clock that this machine shows."""

from standoff.service.latency.clock_picture import clock_picture, read_clock
from standoff.service.latency.measure import measure_latency

__all__ = ["clock_picture", "measure_latency", "read_clock"]
