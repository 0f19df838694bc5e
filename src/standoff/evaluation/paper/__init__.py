"""The paper's tests on clips with exact truth: every figure of the paper beside what this monitor measures.

from standoff.clips import load_clip
from standoff.evaluation.paper import MonitorSetup, evaluate_clip

for figure in evaluate_clip(load_clip("clips/mobile"), MonitorSetup(method="oriented")).figures():
    print(figure.label, figure.paper, figure.measured, figure.unit)
"""

from standoff.evaluation.paper.monitor_setup import MonitorSetup
from standoff.evaluation.paper.pooled import PooledMap, pool
from standoff.evaluation.paper.report import write_report
from standoff.evaluation.paper.result import ClipResult, PaperFigure, evaluate_clip
from standoff.evaluation.paper.truth_detector import BoxError

__all__ = [
    "BoxError",
    "ClipResult",
    "MonitorSetup",
    "PaperFigure",
    "PooledMap",
    "evaluate_clip",
    "pool",
    "write_report",
]
