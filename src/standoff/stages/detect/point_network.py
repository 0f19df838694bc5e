"""Where the things in a detector's boxes stand, told by a second, small network that sees one box at a time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.boxes import unknown_points
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray, IntArray
from standoff.stages.detect.model_card import POINTS_OUTPUT
from standoff.stages.detect.params import Provider
from standoff.stages.detect.point_crops import POINT_CLASSES, point_crop, point_squares_px
from standoff.stages.detect.runtime import ONNX_ERRORS, open_session, told_by_runtime

_FORMAT_KEY: Final = "standoff_ground_points"
_FORMAT: Final = "1"
TELLS_KEY: Final = "tells"
"""In the metadata: the classes of which the network is asked; left out or empty: all that it has learnt."""
CROPS_INPUT: Final = "crops"
CLASS_INPUT: Final = "class_index"

_CUT_OFF_TIMES: Final = 2.0
"""How much larger the errors are of what goes on outside the picture than the network says: 1.9 times where rendered
scenes of the split `val` have 38 such boxes."""
_EDGE_PX: Final = 2.0


def point_metadata(tells: Sequence[str]) -> dict[str, str]:
    """Return the texts by which a file is known as a network of ground points.

    Args:
        tells: Classes of which it will be asked; empty: all.
    """
    return {_FORMAT_KEY: _FORMAT, "classes": json.dumps(POINT_CLASSES), TELLS_KEY: json.dumps(list(tells))}


class PointNetwork:
    """A loaded network of ground points.

    Args:
        path: ONNX file that `standoff train-points` wrote.
        provider: What computes.
        intra_op_threads: Threads on the CPU; 0: as many as cores.

    Raises:
        ModelError: The file is no such network.
        MissingDependency: The execution provider is not there.
    """

    def __init__(self, path: Path, provider: Provider, intra_op_threads: int) -> None:
        self._session = open_session(path, provider, intra_op_threads)
        self._name = path.name
        texts = self._session.get_modelmeta().custom_metadata_map
        if texts.get(_FORMAT_KEY) != _FORMAT or json.loads(texts.get("classes", "[]")) != list(POINT_CLASSES):
            raise ModelError(
                expected=f"a network of ground points at {path}",
                found="another one" if _FORMAT_KEY not in texts else "one of another version of standoff",
                fix="make it with `standoff train-points`, or leave detect.ground_points out",
            )
        self._index_of_class = np.full(len(CLASS_BY_NAME), -1)
        for name in json.loads(texts.get(TELLS_KEY, "[]")) or POINT_CLASSES:
            self._index_of_class[CLASS_BY_NAME[name].id] = POINT_CLASSES.index(name)

    def points(self, image: ImageArray, xyxy_px: FloatArray, class_id: IntArray) -> tuple[FloatArray, FloatArray]:
        """Say where things stand.

        Args:
            image: (H, W, 3) blue first.
            xyxy_px: (N, 4) boxes in it.
            class_id: (N,) ids of `CLASSES`.

        Returns:
            (N, 2) points in the same pixels, perhaps outside, and (N, 2) their standard errors; NaN of what has none.

        Raises:
            ModelError: The network cannot be run.
        """
        points, sigma = unknown_points(len(class_id)), unknown_points(len(class_id))
        rows = np.flatnonzero(self._index_of_class[class_id] >= 0)
        if not len(rows):
            return points, sigma
        squares = point_squares_px(xyxy_px[rows])
        crops = np.stack([point_crop(image, square) for square in squares])[..., ::-1]
        feed = {
            CROPS_INPUT: np.ascontiguousarray(crops.transpose(0, 3, 1, 2), dtype=np.float32) / np.float32(255.0),
            CLASS_INPUT: self._index_of_class[class_id[rows]],
        }
        try:
            told = np.asarray(self._session.run([POINTS_OUTPUT], feed)[0], dtype=np.float64)
        except ONNX_ERRORS as error:
            found = told_by_runtime(error)
            raise ModelError(expected=f"{self._name} to run", found=found, fix="copy the file again") from error
        points[rows] = squares[:, :2] + told[:, :2] * squares[:, 2:] - 0.5
        unseen = np.where(_cut_off(xyxy_px[rows], image.shape[:2]), _CUT_OFF_TIMES, 1.0)
        sigma[rows] = told[:, 2:] * squares[:, 2:] * unseen[:, None]
        return points, sigma


def _cut_off(xyxy_px: FloatArray, shape: tuple[int, ...]) -> BoolArray:
    """Tell (N,) which boxes reach the edge of a picture of this (height, width)."""
    low = xyxy_px[:, :2] < _EDGE_PX - 0.5
    high = xyxy_px[:, 2:] > np.array(shape[::-1]) - 0.5 - _EDGE_PX
    return np.asarray((low | high).any(axis=1))
