"""Models with standoff's metadata: their results must not change while others learn to be read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnx
import pytest
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, quantize_static
from onnxruntime.transformers.float16 import convert_float_to_float16
from stages.detect.onnx_models import Array, save_graph

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError
from standoff.core.finding import WorkerFinding
from standoff.core.types import Frame
from standoff.stages.detect import DetectParams, OnnxDetector
from standoff.stages.detect.letterbox import Letterbox
from standoff.stages.detect.model_card import ModelCard
from standoff.stages.frames import frame_from_array

MakeModel = Callable[[tuple[str, ...], tuple[int, int]], Path]
LABELS = ("person", "car", "kite")
WORKER, VEHICLE = CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["vehicle"].id


def _save_own(path: Path, rows: Array, size_px: tuple[int, int], picture_type: type[np.generic] = np.float32) -> Path:
    save_graph(
        path,
        [onnx.helper.make_node("Identity", ["rows"], ["boxes"])],
        {"picture": (picture_type, (1, 3, size_px[1], size_px[0]))},
        {"boxes": (rows.dtype, rows.shape)},
        {"rows": rows},
    )
    model = onnx.load(str(path))
    onnx.helper.set_model_props(model, ModelCard(LABELS, (), size_px, {}).to_metadata())
    onnx.save(model, str(path))
    return path


def _as_before_other_families(rows: Array, source_px: tuple[int, int], size_px: tuple[int, int]) -> tuple[Array, ...]:
    """Boxes, scores and classes as format 1 was read before there were others, with a threshold of 0.1."""
    scale = min(size_px[0] / source_px[0], size_px[1] / source_px[1])
    inner_px = [max(1, round(side * scale)) for side in source_px]
    offset_px = np.array([(size - inner) // 2 for size, inner in zip(size_px, inner_px, strict=True)] * 2, np.float64)
    rows = rows[~(rows[:, 4] < 0.1)]
    by_label = rows[:, 5:] * rows[:, 4:5]
    score, class_id = by_label[:, :2].max(axis=1).astype(np.float64), by_label[:, :2].argmax(axis=1)
    class_id = np.array([WORKER, VEHICLE])[class_id]
    centre, half = rows[:, 0:2].astype(np.float64), rows[:, 2:4].astype(np.float64) / 2.0
    xyxy = np.concatenate([centre - half, centre + half], axis=1)
    source = np.array([*source_px, *source_px], np.float64)
    xyxy = np.clip((xyxy - offset_px) * (source / np.array([*inner_px, *inner_px], np.float64)), 0.0, source) - 0.5
    wanted = (score >= 0.1) & (xyxy[:, 2:] > xyxy[:, :2]).all(axis=1)
    xyxy, score, class_id = xyxy[wanted], score[wanted], class_id[wanted]
    xywh = np.concatenate([xyxy[:, :2], xyxy[:, 2:] - xyxy[:, :2]], axis=1)
    kept = np.asarray(
        cv2.dnn.NMSBoxesBatched(xywh.tolist(), score.tolist(), class_id.tolist(), -1.0, DetectParams().nms_iou)
    )
    kept = kept[np.argsort(-score[kept], kind="stable")][:300]
    return xyxy[kept], score[kept], class_id[kept]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("source_px", [(1920, 1080), (333, 517), (64, 64)])
def test_boxes_are_the_same_to_the_last_bit(tmp_path: Path, source_px: tuple[int, int], seed: int) -> None:
    random, size_px = np.random.default_rng(seed), (96, 64)
    rows = random.uniform(0, 1, (1, 500, 8)).astype(np.float32)
    rows[0, :, :2] *= size_px
    rows[0, :, 2:4] *= 30
    model = _save_own(tmp_path / "m.onnx", rows, size_px)
    found = OnnxDetector(model).detect(frame_from_array(np.zeros((source_px[1], source_px[0], 3), np.uint8)))
    expected = _as_before_other_families(rows[0], source_px, size_px)
    for one, other in zip((found.xyxy_px, found.score, found.class_id), expected, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("source_px", [(192, 108), (50, 90), (96, 64)])
def test_the_network_sees_the_same_to_the_last_bit(source_px: tuple[int, int]) -> None:
    letterbox = Letterbox.fit(source_px, (96, 64))
    width_px, height_px = letterbox.inner_size_px
    resized = np.random.default_rng(0).integers(0, 256, (height_px, width_px, 3), dtype=np.uint8)
    expected = np.full((1, 3, 64, 96), 0.5, np.float32)
    left, top = letterbox.offset_px
    inner = cv2.dnn.blobFromImage(resized, 1.0 / 255.0, swapRB=True)
    expected[:, :, top : top + height_px, left : left + width_px] = inner
    np.testing.assert_array_equal(letterbox.network_input(resized), expected)


def _squares() -> Frame:
    image = np.zeros((64, 128, 3), np.uint8)
    image[32:48, 48:64], image[16:32, 16:32] = (0, 255, 255), (255, 0, 255)
    return frame_from_array(image)


def _check_squares(model: Path) -> None:
    found = OnnxDetector(model, DetectParams(score_threshold=0.5)).detect(_squares())
    found = found[np.argsort(found.class_id)]
    assert found.class_id.tolist() == [WORKER, VEHICLE]
    np.testing.assert_allclose(found.xyxy_px, [[47.5, 31.5, 63.5, 47.5], [15.5, 15.5, 31.5, 31.5]], atol=0.1)


@pytest.mark.parametrize("keeps_io", [True, False])
def test_a_model_in_float16_runs(make_model: MakeModel, tmp_path: Path, keeps_io: bool) -> None:
    model = onnx.load(str(make_model(LABELS[:2], (64, 64))))
    half = convert_float_to_float16(model, keep_io_types=keeps_io)
    assert (half.graph.input[0].type.tensor_type.elem_type == onnx.TensorProto.FLOAT) == keeps_io
    onnx.save(half, str(tmp_path / "half.onnx"))
    _check_squares(tmp_path / "half.onnx")


class _Pictures(CalibrationDataReader):  # type: ignore[misc]
    """Shows the quantiser black, white and colours."""

    def __init__(self) -> None:
        random = np.random.default_rng(0)
        shape = (1, 3, 64, 64)
        pictures = [np.zeros(shape), np.ones(shape), random.uniform(0, 1, shape), random.integers(0, 2, shape)]
        self._left = [picture.astype(np.float32) for picture in pictures]

    def get_next(self) -> dict[str, Any] | None:
        return {"picture": self._left.pop()} if self._left else None


def test_a_model_in_int8_runs(make_model: MakeModel, tmp_path: Path) -> None:
    source, quantized = make_model(LABELS[:2], (64, 64)), tmp_path / "int8.onnx"
    quantize_static(str(source), str(quantized), _Pictures(), QuantFormat.QDQ, op_types_to_quantize=["Conv"])
    assert "QuantizeLinear" in {node.op_type for node in onnx.load(str(quantized)).graph.node}
    _check_squares(quantized)


def test_a_graph_that_takes_bytes_gets_levels(tmp_path: Path) -> None:
    brightest = save_graph(
        tmp_path / "m.onnx",
        [
            onnx.helper.make_node("Cast", ["picture"], ["floats"], to=onnx.TensorProto.FLOAT),
            onnx.helper.make_node("ReduceMean", ["floats"], ["mean"], keepdims=0),
            onnx.helper.make_node("Div", ["mean", "white"], ["objectness"]),
            onnx.helper.make_node("Mul", ["unsure", "objectness"], ["score"]),
            onnx.helper.make_node("Add", ["box", "score"], ["boxes"]),
        ],
        {"picture": (np.uint8, (1, 3, 64, 64))},
        {"boxes": (np.float32, (1, 1, 8))},
        {
            "white": np.array(255, np.float32),
            "box": np.array([[[32, 32, 8, 8, 0, 1, 0, 0]]], np.float32),
            "unsure": np.array([[[0, 0, 0, 0, 1, 0, 0, 0]]], np.float32),
        },
    )
    model = onnx.load(str(brightest))
    onnx.helper.set_model_props(model, ModelCard(LABELS, (), (64, 64), {}).to_metadata())
    onnx.save(model, str(brightest))
    found = OnnxDetector(brightest).detect(frame_from_array(np.full((64, 64, 3), 200, np.uint8)))
    np.testing.assert_allclose(found.score, [200 / 255], rtol=1e-6)


def test_the_metadata_goes_before_a_yaml_file_of_the_same_name(make_model: MakeModel, tmp_path: Path) -> None:
    copy = tmp_path / "model.onnx"
    copy.write_bytes(make_model(LABELS[:2], (64, 64)).read_bytes())
    copy.with_suffix(".yaml").write_text("learning_rate: 0.001")  # of the run that made it, say
    _check_squares(copy)


def test_an_input_that_nobody_can_fill_is_refused(tmp_path: Path) -> None:
    model = _save_own(tmp_path / "m.onnx", np.zeros((1, 4, 8), np.float32), (64, 64), np.int64)
    with pytest.raises(ModelError, match=r"one input \(1, 3, height, width\) in m\.onnx, .* found picture .*int64"):
        OnnxDetector(model)


def _card(path: Path, card: ModelCard) -> Path:
    model = onnx.load(str(path))
    onnx.helper.set_model_props(model, card.to_metadata())
    onnx.save(model, str(path))
    return path


def test_a_file_tells_how_small_a_worker_it_finds_if_somebody_measured_it(tmp_path: Path) -> None:
    path = _save_own(tmp_path / "m.onnx", np.zeros((1, 4, 8), np.float32), (64, 64))
    assert not WorkerFinding.of_detector(OnnxDetector(path).describe()).measured
    told = {"height_px": (10.0, 20.0), "share": (0.5, 0.9)}
    _card(path, ModelCard(LABELS, (), (64, 64), {}, told))
    detector = OnnxDetector(path, DetectParams(slices=(2, 1), slice_overlap=0.0))
    finding = WorkerFinding.of_detector(detector.describe())
    assert finding == WorkerFinding((10.0, 20.0), (0.5, 0.9), (64, 64), (0.5, 1.0), measured=True)


@pytest.mark.parametrize(
    "told",
    [
        {"height_px": (20.0, 10.0), "share": (0.5, 0.9)},
        {"height_px": (10.0, 20.0), "share": (0.5,)},
        {"height_px": (10.0, 20.0), "share": (0.5, 1.2)},
        {"height_px": (0.0, 20.0), "share": (0.5, 0.9)},
        {"height_px": (10.0, 20.0)},
    ],
)
def test_a_card_that_tells_nonsense_of_workers_is_refused(tmp_path: Path, told: dict[str, tuple[float, ...]]) -> None:
    path = _save_own(tmp_path / "m.onnx", np.zeros((1, 4, 8), np.float32), (64, 64))
    with pytest.raises(ModelError, match="readable model metadata"):
        OnnxDetector(_card(path, ModelCard(LABELS, (), (64, 64), {}, told)))
