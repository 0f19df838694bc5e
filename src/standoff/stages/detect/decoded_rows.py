"""From what a network of ours says, decoded, to boxes in the picture: without a file, while it is being trained."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from standoff.core.types import Detections
from standoff.stages.detect.feet import feet_of
from standoff.stages.detect.letterbox import Letterbox
from standoff.stages.detect.outputs import read_rows
from standoff.stages.detect.params import DetectParams
from standoff.stages.detect.suppression import suppress

_LEAST_SCORE: Final = 0.01
_MOST_ROWS: Final = 1000
_PARAMS: Final = DetectParams()


def detections_in_rows(
    rows: npt.NDArray[np.float32], points: npt.NDArray[np.float32], letterbox: Letterbox
) -> Detections:
    """Turn what a network says into boxes and ground points of the picture, without duplicates.

    Args:
        rows: (N, 5 + classes) of a decoded network.
        points: (N, 4) of them, or (N, 0).
        letterbox: Where the picture lies in the network's input.
    """
    surest = np.argsort(-rows[:, 4], kind="stable")[:_MOST_ROWS]
    outputs = [rows[None, surest], *([points[None, surest]] if points.size else [])]
    candidates = read_rows(outputs, _LEAST_SCORE)
    xyxy_px = letterbox.to_source(candidates.xyxy_px)
    class_id = candidates.probability.argmax(axis=1)
    score = candidates.probability.max(axis=1).astype(np.float64)
    wanted = (score >= _LEAST_SCORE) & (xyxy_px[:, 2:] > xyxy_px[:, :2]).all(axis=1)
    return suppress(
        Detections(xyxy_px, score, class_id, *feet_of(candidates, letterbox))[wanted],
        _PARAMS.nms_iou,
        _PARAMS.max_detections,
    )
