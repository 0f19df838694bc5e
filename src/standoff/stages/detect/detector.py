"""Find people and machines in a frame with an ONNX model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnxruntime

from standoff.core import protocols
from standoff.core.class_map import map_classes
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.finding import KEY
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections, Frame, ImageArray, IntArray
from standoff.files.fingerprint import file_sha256
from standoff.stages.detect.candidates import Candidates
from standoff.stages.detect.feet import feet_of
from standoff.stages.detect.letterbox import Letterbox, resize
from standoff.stages.detect.network import Network
from standoff.stages.detect.params import DetectParams
from standoff.stages.detect.point_network import PointNetwork
from standoff.stages.detect.shipped import find_ground_points
from standoff.stages.detect.slices import Slice, held_whole_px, view_share, views
from standoff.stages.detect.suppression import join_cut, prefer_finer, suppress

_CUT_MARGIN_INPUT_PX = 4.0
"""A network places the edge of a thing that its input cuts off about half a fine cell from the border."""
_SAME_BOX_IOU: Final = 0.95
"""What finds each thing once may give the same box under two labels that are one class of the site."""
_COARSE_IOU: Final = 0.2
"""Of people 25 px tall, seen 12 px tall, whole frames and slices give boxes that overlap by 0.2 to 0.45: measured on
scaled-down PETS frames with yolo-fastest at 960x544, 2x2 slices: from precision 0.72 to 0.78 at recall 0.65."""


class OnnxDetector(protocols.Detector):
    """Detector that reads everything it must know from the model's file, or from the description beside it.

    Args:
        model_path: Made by `standoff export` or `standoff train`, or exported by Ultralytics; or any detector of a
            known family, with its description (see `standoff.stages.detect.interface`).
        params: Settings.

    Raises:
        ModelError: The file is not such a model, or none of its labels is a class of the site.
        MissingDependency: The execution provider is not there.
    """

    def __init__(self, model_path: str | Path, params: DetectParams | None = None) -> None:
        path = Path(model_path)
        self._params = params or DetectParams()
        self._network = Network(path, self._params.provider, self._params.intra_op_threads)
        self._name = path.name
        self._classes = self._network.interface.classes
        self._site_class_of = map_classes(self._classes, self._params.class_map, path.name)
        self._columns = self._columns_by_class()
        self._thresholds = self._thresholds_by_class()
        finds_once = self._network.interface.finds_once
        self._iou_in_view = max(self._params.nms_iou, _SAME_BOX_IOU) if finds_once else self._params.nms_iou
        self._sha256 = file_sha256(path)
        self._points_files = find_ground_points(self._params.ground_points)
        threads = self._params.intra_op_threads
        self._points = [PointNetwork(file, self._params.provider, threads) for file in self._points_files]

    def _columns_by_class(self) -> dict[int, IntArray]:
        """Site class id to the output columns of its labels, counted from the first class."""
        columns: dict[int, list[int]] = {}
        for column, label in enumerate(self._classes):
            if label in self._site_class_of:
                columns.setdefault(CLASS_BY_NAME[self._site_class_of[label]].id, []).append(column)
        return {class_id: np.array(own, dtype=np.int64) for class_id, own in columns.items()}

    def _thresholds_by_class(self) -> FloatArray:
        thresholds = np.full(len(CLASS_BY_NAME), self._params.score_threshold)
        for name, threshold in self._params.class_score_thresholds.items():
            thresholds[CLASS_BY_NAME[name].id] = threshold
        return thresholds

    def describe(self) -> dict[str, Any]:
        """Return facts for the record: the model, its labels and what became of them, and what computes."""
        return {
            "model": self._name,
            "sha256": self._sha256,
            "family": self._network.interface.family,
            "task": self._network.interface.task,
            "boxes": "parts of the input" if self._network.boxes_are_parts else "as usual in the family",
            "warnings": list(self._network.warnings),
            "input_size_px": list(self._network.interface.input_size_px),
            protocols.EACH_ALONE: True,
            "view_share": list(view_share(self._params.slices, self._params.slice_overlap)),
            KEY: dict(self._network.interface.finds_workers),
            "classes": list(self._classes),
            "class_map": dict(self._site_class_of),
            "ignored_labels": [label for label in self._classes if label not in self._site_class_of],
            "ground_points": [file.name for file in self._points_files],
            "providers": self._network.providers,
            "onnxruntime": onnxruntime.__version__,
        }

    def detect(self, frame: Frame) -> Detections:
        """Find what there is in a frame.

        Args:
            frame: Of any size. With slices its full-size picture is converted, otherwise never.

        Returns:
            Boxes inside the picture, surest first. Low scores are included: see `DetectParams`.

        Raises:
            ModelError: The network gives NaN, or what its family does not.
        """
        params = self._params
        seen = [self._look(frame, view) for view in views(frame.size_px, params.slices, params.slice_overlap)]
        found = [detections for detections, _ in seen]
        return found[0] if len(found) == 1 else self._joined(found, [cut for _, cut in seen], frame.size_px)

    def _joined(self, found: list[Detections], cut: list[BoolArray], frame_size_px: tuple[int, int]) -> Detections:
        """Make one of what the whole frame, which comes first, and its slices show."""
        params = self._params
        detections, is_cut = Detections.joined(found), np.concatenate(cut)
        is_whole_frame = np.arange(len(detections)) < len(found[0])
        held_px = held_whole_px(frame_size_px, params.slices, params.slice_overlap)
        is_small = (detections.xyxy_px[:, 2:] - detections.xyxy_px[:, :2] <= held_px).all(axis=1)
        detections, kept = prefer_finer(
            detections, is_whole_frame & is_small, ~is_whole_frame & ~is_cut, min(_COARSE_IOU, params.nms_iou)
        )
        detections = join_cut(detections[kept], is_cut[kept], params.cut_overlap)
        return suppress(detections, params.nms_iou, params.max_detections)

    def _look(self, frame: Frame, view: Slice) -> tuple[Detections, BoolArray]:
        """Detect in one view; tell which boxes its borders cut."""
        letterbox = self._network.letterbox((view.width_px, view.height_px))
        resized = _resized(frame, view, letterbox.inner_size_px)
        # The least threshold of all is the least that matters.
        candidates = self._network.candidates(resized, letterbox, self._thresholds.min())
        found = self._pointed(self._classified(candidates, letterbox), resized, letterbox)
        shift = np.array([view.left_px, view.top_px])
        found = replace(found, xyxy_px=found.xyxy_px + np.tile(shift, 2), foot_px=found.foot_px + shift)
        inner_px = letterbox.inner_size_px
        margin_px = (
            _CUT_MARGIN_INPUT_PX * view.width_px / inner_px[0],
            _CUT_MARGIN_INPUT_PX * view.height_px / inner_px[1],
        )
        return found, view.is_cut(found.xyxy_px, margin_px)

    def _pointed(self, found: Detections, resized: ImageArray, letterbox: Letterbox) -> Detections:
        """Let the networks of ground points say where things stand of which the detector does not."""
        untold = np.isnan(found.foot_px).any(axis=1)
        if not self._points or not untold.any():
            return found
        scale = letterbox.source_px_per_input_px
        boxes_px = (found.xyxy_px[untold] + 0.5) / np.tile(scale, 2) - 0.5
        foot_px, covariance_px2 = found.foot_px.copy(), found.foot_covariance_px2.copy()
        for network in self._points:
            points_px, sigma_px = network.points(resized, boxes_px, found.class_id[untold])
            told = np.isfinite(points_px).all(axis=1)
            rows = np.flatnonzero(untold)[told]
            foot_px[rows] = (points_px[told] + 0.5) * scale - 0.5
            covariance_px2[rows] = ((sigma_px[told] * scale) ** 2)[:, :, None] * np.eye(2)
        return replace(found, foot_px=foot_px, foot_covariance_px2=covariance_px2)

    def _classified(self, candidates: Candidates, letterbox: Letterbox) -> Detections:
        """Turn candidates into boxes of the view and classes of the site, without duplicates."""
        by_class = [candidates.probability[:, columns].max(axis=1) for columns in self._columns.values()]
        scores = np.stack(by_class, axis=1)
        best = scores.argmax(axis=1)
        score = np.minimum(scores[np.arange(len(scores)), best].astype(np.float64), 1.0)
        class_id = np.array(list(self._columns), dtype=np.int64)[best]
        xyxy_px = letterbox.to_source(candidates.xyxy_px)
        wanted = (score >= self._thresholds[class_id]) & (xyxy_px[:, 2:] > xyxy_px[:, :2]).all(axis=1)
        values = xyxy_px, score, class_id, *feet_of(candidates, letterbox)
        found = Detections(*(value[wanted] for value in values))
        return suppress(found, self._iou_in_view, self._params.max_detections)


def _resized(frame: Frame, view: Slice, size_px: tuple[int, int]) -> ImageArray:
    if (view.width_px, view.height_px) == frame.size_px:
        return frame.picture.resized_bgr(*size_px)
    part = frame.image[view.top_px : view.top_px + view.height_px, view.left_px : view.left_px + view.width_px]
    return resize(part, size_px)
