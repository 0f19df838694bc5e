"""Find people and machines in a frame with an ONNX model that describes itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnxruntime

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections, Frame, ImageArray, IntArray
from standoff.stages.detect.class_map import map_classes
from standoff.stages.detect.letterbox import Letterbox
from standoff.stages.detect.model_card import INPUT_NAME, OUTPUT_NAME, ModelCard, file_sha256
from standoff.stages.detect.params import DetectParams
from standoff.stages.detect.runtime import open_session
from standoff.stages.detect.slices import View, views
from standoff.stages.detect.suppression import join_cut, suppress

_CUT_MARGIN_INPUT_PX = 4.0
"""A network places the edge of a thing that its input cuts off about half a fine cell from the border."""


class OnnxDetector:
    """Detector that reads everything it must know from the model's file.

    Args:
        model_path: Made by `standoff export`.
        params: Settings.

    Raises:
        ModelError: The file is not such a model, or none of its labels is a class of the site.
        MissingDependency: The execution provider is not there.
    """

    def __init__(self, model_path: str | Path, params: DetectParams | None = None) -> None:
        path = Path(model_path)
        self._params = params or DetectParams()
        self._session = open_session(path, self._params.provider, self._params.intra_op_threads)
        self._name = path.name
        self._card = ModelCard.from_metadata(self._session.get_modelmeta().custom_metadata_map, path.name)
        _check_graph(self._session, self._card, path.name)
        self._site_class_of = map_classes(self._card.classes, self._params.class_map, path.name)
        self._columns = self._columns_by_class()
        self._thresholds = self._thresholds_by_class()
        self._sha256 = file_sha256(path)

    def _columns_by_class(self) -> dict[int, IntArray]:
        """Site class id to the output columns of its labels, counted from the first class."""
        columns: dict[int, list[int]] = {}
        for column, label in enumerate(self._card.classes):
            if label in self._site_class_of:
                columns.setdefault(CLASS_BY_NAME[self._site_class_of[label]].id, []).append(column)
        return {class_id: np.array(own, dtype=np.int64) for class_id, own in columns.items()}

    def _thresholds_by_class(self) -> FloatArray:
        thresholds = np.full(len(CLASS_BY_NAME), self._params.score_threshold)
        for name, threshold in self._params.class_score_thresholds.items():
            thresholds[CLASS_BY_NAME[name].id] = threshold
        return thresholds

    @property
    def description(self) -> dict[str, Any]:
        """Facts for the record: the model, its labels and what became of them, and what computes."""
        return {
            "model": self._name,
            "sha256": self._sha256,
            "input_size_px": list(self._card.input_size_px),
            "classes": list(self._card.classes),
            "class_map": dict(self._site_class_of),
            "ignored_labels": [label for label in self._card.classes if label not in self._site_class_of],
            "providers": list(self._session.get_providers()),
            "onnxruntime": onnxruntime.__version__,
        }

    def detect(self, frame: Frame) -> Detections:
        """Find what there is in a frame.

        Args:
            frame: Of any size. With slices its full-size picture is converted, otherwise never.

        Returns:
            Boxes inside the picture, surest first. Low scores are included: see `DetectParams`.

        Raises:
            ModelError: The network gives NaN.
        """
        params = self._params
        seen = [self._look(frame, view) for view in views(frame.size_px, params.slices, params.slice_overlap)]
        detections = _stacked([found for found, _ in seen])
        if len(seen) > 1:
            detections = join_cut(detections, np.concatenate([cut for _, cut in seen]), params.cut_overlap)
            detections = suppress(detections, params.nms_iou, params.max_detections)
        return detections

    def _look(self, frame: Frame, view: View) -> tuple[Detections, BoolArray]:
        """Detect in one view; tell which boxes its borders cut."""
        letterbox = Letterbox.fit((view.width_px, view.height_px), self._card.input_size_px)
        network_input = letterbox.network_input(_resized(frame, view, letterbox.inner_size_px))
        (output,) = self._session.run([OUTPUT_NAME], {INPUT_NAME: network_input})
        found = self._read_output(output[0], letterbox)
        shift = np.array([view.left_px, view.top_px, view.left_px, view.top_px])
        found = Detections(found.xyxy_px + shift, found.score, found.class_id)
        margin_px = _CUT_MARGIN_INPUT_PX * view.width_px / letterbox.inner_size_px[0]
        return found, view.is_cut(found.xyxy_px, margin_px)

    def _read_output(self, rows: np.ndarray[Any, np.dtype[np.float32]], letterbox: Letterbox) -> Detections:
        """Turn (N, 5 + classes) rows into boxes of the view, without duplicates."""
        # No class can be surer than the object itself; NaN stays in, to be noticed.
        rows = rows[~(rows[:, 4] < self._thresholds.min())]
        if np.isnan(rows).any():
            raise ModelError(
                expected=f"numbers from {self._name}", found="NaN", fix="export the model again from sound weights"
            )
        labels = rows[:, 5:] * rows[:, 4:5]
        scores = np.stack([labels[:, columns].max(axis=1) for columns in self._columns.values()], axis=1)
        best = scores.argmax(axis=1)
        score = scores[np.arange(len(scores)), best].astype(np.float64)
        class_id = np.array(list(self._columns), dtype=np.int64)[best]
        centre, half = rows[:, 0:2].astype(np.float64), rows[:, 2:4].astype(np.float64) / 2.0
        xyxy_px = letterbox.to_source(np.concatenate([centre - half, centre + half], axis=1))
        wanted = (score >= self._thresholds[class_id]) & (xyxy_px[:, 2:] > xyxy_px[:, :2]).all(axis=1)
        found = Detections(xyxy_px[wanted], score[wanted], class_id[wanted])
        return suppress(found, self._params.nms_iou, self._params.max_detections)


def _resized(frame: Frame, view: View, size_px: tuple[int, int]) -> ImageArray:
    if (view.width_px, view.height_px) == frame.size_px:
        return frame.picture.resized_bgr(*size_px)
    part = frame.image[view.top_px : view.top_px + view.height_px, view.left_px : view.left_px + view.width_px]
    shrinks = size_px[0] < view.width_px
    resized = cv2.resize(part, size_px, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    return np.asarray(resized, dtype=np.uint8)


def _stacked(parts: list[Detections]) -> Detections:
    return Detections(
        np.concatenate([part.xyxy_px for part in parts]),
        np.concatenate([part.score for part in parts]),
        np.concatenate([part.class_id for part in parts]),
    )


def _check_graph(session: onnxruntime.InferenceSession, card: ModelCard, name: str) -> None:
    width_px, height_px = card.input_size_px
    found = {node.name: node.shape for node in (*session.get_inputs(), *session.get_outputs())}
    rows = next(iter(found.get(OUTPUT_NAME, [])[1:2]), "N")
    expected = {INPUT_NAME: [1, 3, height_px, width_px], OUTPUT_NAME: [1, rows, 5 + len(card.classes)]}
    if found != expected:
        raise ModelError(
            expected=f"the tensors {expected} in {name}, as its metadata says",
            found=f"{found}",
            fix="make the file with `standoff export`",
        )
