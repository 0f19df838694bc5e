from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from evaluation.detection.drawn_detections import CLASSES, random_scenes

from standoff.evaluation.detection.accuracy_time import draw_accuracy_time
from standoff.evaluation.detection.coco import coco_figures
from standoff.evaluation.detection.comparison import Comparison
from standoff.evaluation.detection.detector_trial import DetectorSetup, TrialResult
from standoff.evaluation.detection.points import PointScores
from standoff.evaluation.detection.score import score_detections

TIMES_MS = {"net-960x544": 60.0, "net-640x384": 20.0, "other": 33.0, "net-640x384 2x2": 99.0}


def result(label: str, time_ms: float, seed: int) -> TrialResult:
    truth, found = random_scenes(seed)
    return TrialResult(
        candidate=DetectorSetup(label, Path("x.onnx"), (1, 1)),
        model={},
        score=score_detections(truth, found, CLASSES),
        coco=coco_figures(truth, found, CLASSES),
        times_ms=np.array([time_ms]),
        ale_m={},
        points=PointScores((), ()),
        unseen=(),
    )


@pytest.mark.parametrize("seed", [0, 5])
def test_input_sizes_of_one_network_are_one_line_in_the_order_of_time(seed: int) -> None:
    results = tuple(result(label, time_ms, seed + row) for row, (label, time_ms) in enumerate(TIMES_MS.items()))
    figure = draw_accuracy_time(Comparison("drawn", 12, 6, results, chance=None))
    of_all, of_small = figure.axes
    times_ms, accuracy = zip(*(np.asarray(line.get_data()).tolist() for line in of_all.lines), strict=True)
    assert times_ms == ([20.0, 60.0], [33.0], [99.0])
    assert accuracy[0] == [results[1].score.mean_ap11, results[0].score.mean_ap11]
    assert np.asarray(of_small.lines[1].get_ydata()).tolist() == [results[2].coco.classes[0].ap50_by_height[1]]
    told = sorted(text.get_text() for text in of_all.texts)
    assert told == ["640x384", "net 960x544", "net-640x384 2x2", "other"]
    figure.draw_without_rendering()
