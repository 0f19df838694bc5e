"""Models in the layouts that Ultralytics documents for its exports, read without a description."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest
import tolerances
from stages.detect.exported_models import (
    EVERYTHING,
    KEYPOINTS,
    MASKS,
    empty,
    metadata,
    random_boxes,
    random_chances,
    save_exported,
    tell,
)
from stages.detect.onnx_models import PICTURE, Array, Shape, save_graph

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError
from standoff.core.types import Detections
from standoff.stages.detect import DetectParams, OnnxDetector
from standoff.stages.frames import frame_from_array

WORKER, VEHICLE = CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["vehicle"].id
SIZES = [(96, 64), (64, 160)]
MORE = {"detect": 0, "segment": MASKS, "pose": KEYPOINTS * 3, "obb": 1}


def _found(model: Path, size_px: tuple[int, int]) -> Detections:
    """Look at a picture twice as large as the input, and of its shape."""
    return OnnxDetector(model, EVERYTHING).detect(empty((2 * size_px[0], 2 * size_px[1])))


def _same(found: Detections, centre_size: Array, probability: Array) -> None:
    """Compare with boxes in input pixels, of which a picture has two each way, and 0 is its first pixel's centre."""
    x, y, w, h = centre_size.T
    xyxy_px = np.stack([x - w / 2, y - h / 2, x + w / 2, y + h / 2], axis=1) * 2 - 0.5
    score = probability[:, :2].max(axis=1)
    order = np.argsort(-score, kind="stable")
    assert len(found) == len(score)
    np.testing.assert_allclose(found.score, score[order], rtol=1e-5)
    np.testing.assert_allclose(found.xyxy_px, xyxy_px[order], atol=1e-3)
    np.testing.assert_array_equal(found.class_id, np.where(probability[:, :2].argmax(axis=1), VEHICLE, WORKER)[order])


@pytest.mark.parametrize("task", MORE)
@pytest.mark.parametrize("size_px", SIZES)
@pytest.mark.parametrize("unit", ["pixels", "parts"])
def test_columns_of_boxes_and_probabilities_are_read(
    tmp_path: Path, task: str, size_px: tuple[int, int], unit: str
) -> None:
    random = np.random.default_rng(0)
    boxes, chances, more = random_boxes(random, 84, size_px), random_chances(random, 84), np.zeros((84, MORE[task]))
    scale = np.tile(size_px, 2) if unit == "parts" else 1
    rows = np.concatenate([boxes / scale, chances, more], axis=1)
    model = save_exported(tmp_path / "m.onnx", rows.T[None], size_px, task)
    _same(_found(model, size_px), boxes, chances)
    description = OnnxDetector(model).describe()
    assert (description["family"], description["task"]) == ("yolov8", task)
    assert bool(description["warnings"]) == (unit == "parts")


@pytest.mark.parametrize("task", MORE)
@pytest.mark.parametrize("size_px", SIZES)
@pytest.mark.parametrize("unit", ["pixels", "parts"])
def test_a_table_that_was_turned_over_is_read_as_the_columns_that_it_was(
    tmp_path: Path, task: str, size_px: tuple[int, int], unit: str
) -> None:
    random = np.random.default_rng(1)
    cells = size_px[0] * size_px[1] * 21 // 1024
    boxes, chances = random_boxes(random, cells, size_px), random_chances(random, cells)
    scale = np.tile(size_px, 2) if unit == "parts" else 1
    rows = np.concatenate([boxes / scale, chances, np.zeros((cells, MORE[task]))], axis=1)
    model = save_exported(tmp_path / "m.onnx", rows[None], size_px, task)
    _same(_found(model, size_px), boxes, chances)
    assert OnnxDetector(model).describe()["family"] == "yolov8"


@pytest.mark.parametrize("task", ["detect", "segment"])
@pytest.mark.parametrize("size_px", SIZES)
@pytest.mark.parametrize("unit", ["pixels", "parts"])
def test_rows_with_objectness_are_read(tmp_path: Path, task: str, size_px: tuple[int, int], unit: str) -> None:
    random = np.random.default_rng(1)
    boxes, chances, objectness = (
        random_boxes(random, 99, size_px),
        random_chances(random, 99),
        random_chances(random, 99, 1),
    )
    scale = np.tile(size_px, 2) if unit == "parts" else 1
    rows = np.concatenate([boxes / scale, objectness, chances, np.zeros((99, MORE[task]))], axis=1)
    model = save_exported(tmp_path / "m.onnx", rows[None], size_px, task)
    _same(_found(model, size_px), boxes, objectness * chances)
    detector = OnnxDetector(model)
    assert detector.describe()["family"] == "yolov5"
    told = ["the boxes of m.onnx come as parts of its input, 0 to 1, not in pixels: read as such"]
    assert detector.describe()["warnings"] == (told if unit == "parts" else [])


@pytest.mark.parametrize("task", ["detect", "segment", "pose"])
@pytest.mark.parametrize("size_px", SIZES)
def test_what_an_end_to_end_network_chose_is_read_and_not_thinned_out(
    tmp_path: Path, task: str, size_px: tuple[int, int]
) -> None:
    random = np.random.default_rng(2)
    boxes, score, label = random_boxes(random, 9, size_px), random_chances(random, 9, 1), random.integers(0, 2, (9, 1))
    x, y, w, h = boxes.T
    corners = np.stack([x - w / 2, y - h / 2, x + w / 2, y + h / 2], axis=1)
    rows = np.concatenate([corners, score, label, np.zeros((9, MORE[task]))], axis=1)
    rows = np.concatenate([rows, np.zeros((291, rows.shape[1]))])  # what is not found
    model = save_exported(tmp_path / "m.onnx", rows[None], size_px, task)
    _same(_found(model, size_px), boxes, score * (label == [[0, 1, 2]]))


@pytest.mark.parametrize("size_px", SIZES)
def test_ultralytics_rt_detr_is_read_in_a_stretched_picture(tmp_path: Path, size_px: tuple[int, int]) -> None:
    random = np.random.default_rng(3)
    boxes, chances = random_boxes(random, 300, size_px), random_chances(random, 300)
    rows = np.concatenate([boxes / np.tile(size_px, 2), chances], axis=1)
    model = save_exported(tmp_path / "m.onnx", rows[None], size_px)
    _same(_found(model, size_px), boxes, chances)
    (tall,) = {OnnxDetector(model, EVERYTHING).detect(empty((size_px[0], 9 * size_px[1]))).xyxy_px.max()}
    assert tall > 5 * size_px[1], "boxes reach over the whole height"
    assert OnnxDetector(model).describe()["warnings"] == []


@pytest.mark.parametrize("layout", ["columns", "ends"])
def test_the_box_of_a_turned_box_is_the_one_around_it(tmp_path: Path, layout: str) -> None:
    random = np.random.default_rng(4)
    size_px, count = (96, 64), 40
    boxes, angle_rad = random_boxes(random, count, size_px), random.uniform(-np.pi / 4, 3 * np.pi / 4, (count, 1))
    around = []
    for (x, y, w, h), angle in zip(boxes, angle_rad[:, 0], strict=True):
        corners = cv2.boxPoints(((x, y), (w, h), np.degrees(angle)))
        low, high = corners.min(axis=0), corners.max(axis=0)
        around.append([*(low + high) / 2, *(high - low)])
    chances = random_chances(random, count)
    rows = np.concatenate([boxes, chances, angle_rad], axis=1).T
    if layout == "ends":
        chances = chances * (np.arange(3) == 0)
        rows = np.concatenate([boxes, chances[:, :1], np.zeros((count, 1)), angle_rad], axis=1)
    model = save_exported(tmp_path / "m.onnx", rows[None], size_px, "obb")
    _same(_found(model, size_px), np.array(around), chances)


def test_the_picture_is_red_first_from_0_to_1_in_the_middle_of_114(tmp_path: Path) -> None:
    # Cells of 32 px whose score is their mean red.
    nodes = [
        onnx.helper.make_node("AveragePool", [PICTURE], ["mean"], kernel_shape=[32, 32], strides=[32, 32]),
        onnx.helper.make_node("Slice", ["mean", "zero", "one", "axis"], ["red"]),
        onnx.helper.make_node("Reshape", ["red", "flat"], ["score"]),
        onnx.helper.make_node("Concat", ["boxes", "score"], ["output0"], axis=1),
    ]
    centres = np.array([[16, 16], [48, 16], [16, 48], [48, 48]], np.float32)
    boxes = np.concatenate([centres, np.full((4, 2), 20, np.float32)], axis=1).T[None]
    constants: dict[str, Array] = {"boxes": boxes, "flat": np.array([1, 1, 4])}
    constants |= {"zero": np.array([0]), "one": np.array([1]), "axis": np.array([1])}
    shape: Shape = (1, 3, 64, 64)
    outputs = {"output0": (np.float32, (1, 5, 4))}
    model = save_graph(tmp_path / "m.onnx", nodes, {PICTURE: (np.float32, shape)}, outputs, constants)
    tell(model, metadata((64, 64), ("person",)))
    image = np.zeros((32, 64, 3), np.uint8)
    image[:, 32:, 2] = 255
    found = OnnxDetector(model, EVERYTHING).detect(frame_from_array(image))
    # Half of each cell is picture, which lies in the middle, and half is what is around it.
    np.testing.assert_allclose(found.score, [(1 + 114 / 255) / 2] * 2 + [114 / 255 / 2] * 2, atol=tolerances.ONNX_LOGIT)
    assert (found.xyxy_px[:2, 0] > 32).all()


def _bright_rows(path: Path, dark: Array, bright: Array) -> Path:
    """Write a network that gives one table for a black or grey picture, and the other for a white one."""
    nodes = [
        onnx.helper.make_node("ReduceMin", [PICTURE], ["least"], keepdims=0),
        onnx.helper.make_node("Floor", ["least"], ["white"]),
        onnx.helper.make_node("Mul", ["change", "white"], ["more"]),
        onnx.helper.make_node("Add", ["dark", "more"], ["output0"]),
    ]
    constants = {"dark": dark, "change": bright - dark}
    inputs = {PICTURE: (np.float32, (1, 3, 64, 64))}
    save_graph(path, nodes, inputs, {"output0": (np.float32, dark.shape)}, constants)
    return tell(path, metadata((64, 64)))


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ([8, 8, 40, 40, 0.5, 1.5], r"labels 0 to 2 in the sixth column, of 3 classes from m\.onnx, found 0 to 1\.5"),
        ([8, 8, 40, 40, 0.5, 3], r"labels 0 to 2 in the sixth column, .*found 0 to 3"),
        ([40, 40, 8, 8, 0.5, 1], "boxes whose right lies right of their left, .*found one of -32x-32"),
        ([0.1, 0.1, 0.5, 0.5, 0.5, 1], r"boxes in pixels of the input .*found none beyond 0\.5"),
        ([8, 8, 40, 40, 1.5, 1], r"probabilities, 0 to 1, .*found 0 to 1\.5"),
    ],
)
def test_rows_that_turn_out_not_to_be_choices_are_an_error(tmp_path: Path, row: list[float], message: str) -> None:
    dark, bright = np.zeros((1, 9, 6), np.float32), np.zeros((1, 9, 6), np.float32)
    bright[0, 0] = row
    detector = OnnxDetector(_bright_rows(tmp_path / "m.onnx", dark, bright))
    assert len(detector.detect(empty((64, 64)))) == 0
    with pytest.raises(ModelError, match=message):
        detector.detect(frame_from_array(np.full((64, 64, 3), 255, np.uint8)))


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "classes"),
    [
        *(
            (name, ["person", "car", "truck"])
            for name in ("v8", "v8_nodesc", "v10", "v10_nodesc", "v5norm", "rtdetr_ultra")
        ),
        ("bom2", ["excavator", "worker", "vehicle"]),
    ],
)
def test_the_models_of_public_reports_find_what_they_say(shared_data: Path, name: str, classes: list[str]) -> None:
    detector = OnnxDetector(shared_data / "public_reports" / "onnx" / f"{name}.onnx", DetectParams(score_threshold=0.3))
    assert detector.describe()["classes"] == classes
    found = detector.detect(empty((320, 320)))
    # The surest stands in the middle, 30 px wide and 60 high; RT-DETR's is a tenth by a fifth.
    expected = [144, 128, 176, 192] if name == "rtdetr_ultra" else [145, 130, 175, 190]
    np.testing.assert_allclose(found.xyxy_px[0], np.array(expected) - 0.5, atol=1e-3)
