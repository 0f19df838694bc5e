"""A stream that is watched: its stages (`Monitor`), where results go (`FanOut`, `LiveQueue`), and a whole film.

from standoff.config import load_settings
from standoff.monitor import open_run
for result in open_run("site.mp4", "out", load_settings(Path("site.yaml"))):
    ...
"""

from standoff.monitor.build import build_monitor
from standoff.monitor.fan_out import FanOut
from standoff.monitor.live_queue import LiveQueue, QueueState
from standoff.monitor.monitor import Monitor
from standoff.monitor.opening import open_run
from standoff.monitor.record import RecordKeeper, RunRecord
from standoff.monitor.run import ABOUT, Run, warnings_of
from standoff.monitor.same_run import check_resumable, looks_name, other_film, other_means

__all__ = [
    "ABOUT",
    "FanOut",
    "LiveQueue",
    "Monitor",
    "QueueState",
    "RecordKeeper",
    "Run",
    "RunRecord",
    "build_monitor",
    "check_resumable",
    "looks_name",
    "open_run",
    "other_film",
    "other_means",
    "warnings_of",
]
