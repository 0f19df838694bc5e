from __future__ import annotations

import json
import re
import textwrap
from pathlib import Path

import numpy as np
import onnx
import pytest
import yaml
from stages.detect.onnx_models import (
    PICTURE,
    Array,
    describe,
    save_bright_cells,
    save_constant,
    save_graph,
    save_rtdetr,
)

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError
from standoff.core.types import Detections, Frame
from standoff.stages.detect import DetectParams, OnnxDetector, interface
from standoff.stages.frames import frame_from_array

WORKER, VEHICLE = CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["vehicle"].id
LABELS = ("person", "car", "kite")
EVERYTHING = DetectParams(score_threshold=0.0, nms_iou=1.0, max_detections=10**6)
SIZES = [(64, 64), (96, 64), (64, 160)]


def _empty(size_px: tuple[int, int]) -> Frame:
    return frame_from_array(np.zeros((size_px[1], size_px[0], 3), np.uint8))


def _random_rows(seed: int, size_px: tuple[int, int], count: int) -> Array:
    """(1, N, 8) decoded rows of whole boxes."""
    random = np.random.default_rng(seed)
    rows = np.empty((1, count, 5 + len(LABELS)), np.float32)
    rows[0, :, :2] = random.uniform(0.3, 0.7, (count, 2)) * size_px
    rows[0, :, 2:4] = random.uniform(4, 16, (count, 2))
    rows[0, :, 4:] = random.uniform(0, 1, (count, 1 + len(LABELS)))
    return rows


def _same(found: Detections, xyxy_px: Array, probability: Array) -> None:
    """Compare with boxes in picture pixels and the probability of each label, without a threshold."""
    score = probability[:, :2].max(axis=1)
    order = np.argsort(-score, kind="stable")
    assert len(found) == len(score)
    np.testing.assert_allclose(found.score, score[order], rtol=1e-6)
    np.testing.assert_allclose(found.xyxy_px, xyxy_px[order], atol=1e-4)
    np.testing.assert_array_equal(found.class_id, np.where(probability.argmax(axis=1), VEHICLE, WORKER)[order])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size_px", SIZES)
def test_yolov3_rows_are_boxes_in_input_pixels(tmp_path: Path, size_px: tuple[int, int], seed: int) -> None:
    rows = _random_rows(seed, size_px, 40)
    model = describe(
        save_constant(tmp_path / "m.onnx", {"rows": rows}, size_px), f"family: yolov3\nclasses: {[*LABELS]}"
    )
    found = OnnxDetector(model, EVERYTHING).detect(_empty((2 * size_px[0], 2 * size_px[1])))
    x, y, w, h = rows[0, :, :4].astype(np.float64).T
    # Twice as large, and 0 is the centre of the first pixel.
    expected = np.stack([x - w / 2, y - h / 2, x + w / 2, y + h / 2], axis=1) * 2 - 0.5
    _same(found, expected, rows[0, :, 4:5] * rows[0, :, 5:7])


def _raw_yolox(seed: int, size_px: tuple[int, int], strides_px: tuple[int, ...]) -> tuple[Array, Array]:
    """Raw rows, and the same decoded as YOLOX's demo describes it, cell by cell."""
    random = np.random.default_rng(seed)
    raw, decoded = [], []
    for stride_px in strides_px:
        for row in range(size_px[1] // stride_px):
            for column in range(size_px[0] // stride_px):
                x, y = random.uniform(0.1, 0.9, 2)
                w, h = random.uniform(-1.5, 0, 2)
                chances = random.uniform(0, 1, 1 + len(LABELS))
                raw.append([x, y, w, h, *chances])
                centre = [(x + column) * stride_px, (y + row) * stride_px]
                decoded.append([*centre, np.exp(w) * stride_px, np.exp(h) * stride_px, *chances])
    return np.array([raw], np.float32), np.array([decoded], np.float32)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size_px", SIZES)
@pytest.mark.parametrize("strides_px", [(8, 16, 32), (8, 16, 32, 64)])
@pytest.mark.parametrize("is_decoded", [False, True])
def test_yolox_is_read_decoded_or_not(
    tmp_path: Path, size_px: tuple[int, int], strides_px: tuple[int, ...], seed: int, is_decoded: bool
) -> None:
    raw, decoded = _raw_yolox(seed, size_px, strides_px)
    model = save_constant(tmp_path / "m.onnx", {"output": decoded if is_decoded else raw}, ("h", "w"))
    describe(model, f"family: yolox\nclasses: [{', '.join(LABELS)}]\ninput_size: {size_px[0]}x{size_px[1]}")
    # Half as large: the picture fills the upper left quarter of the input; what lies elsewhere is cut away.
    found = OnnxDetector(model, EVERYTHING).detect(_empty((size_px[0], size_px[1] // 2)))
    x, y, w, h, objectness = decoded[0, :, :5].astype(np.float64).T
    expected = np.stack([x - w / 2, y - h / 2, x + w / 2, y + h / 2], axis=1)
    expected = np.clip(expected, 0, [size_px[0], size_px[1] // 2] * 2) - 0.5
    inside = expected[:, 3] > expected[:, 1]
    _same(found, expected[inside], (objectness[:, None] * decoded[0, :, 5:7])[inside])


@pytest.mark.parametrize("picture_type", [np.float32, np.float16, np.uint8])
@pytest.mark.parametrize("size_px", [(64, 64), (96, 32)])
def test_yolox_sees_blue_first_from_0_to_255_at_the_top_left(
    tmp_path: Path, size_px: tuple[int, int], picture_type: type[np.generic]
) -> None:
    blue = 0
    model = save_bright_cells(tmp_path / "m.onnx", size_px, blue, picture_type)
    detector = OnnxDetector(describe(model, "family: yolox\nclasses: [worker]"), DetectParams(score_threshold=0.6))
    image = np.zeros((size_px[1] // 2, size_px[0], 3), np.uint8)
    image[8:16, 24:32] = (255, 0, 0)  # one fine cell
    image[0:8, 40:48] = (0, 255, 255)  # not blue
    found = detector.detect(frame_from_array(image))
    # Around the picture there are 114 of 255: less than the threshold, but more than nothing.
    np.testing.assert_allclose(found.xyxy_px, [[23.5, 7.5, 31.5, 15.5]], atol=1e-3)
    np.testing.assert_allclose(found.score, [1.0], atol=1e-3)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size_px", SIZES)
def test_rt_detr_and_d_fine_are_read_from_labels_boxes_and_scores(
    tmp_path: Path, size_px: tuple[int, int], seed: int
) -> None:
    random = np.random.default_rng(seed)
    labels, scores = random.integers(0, 2, (1, 30)), random.uniform(0, 1, (1, 30))
    parts = np.concatenate([random.uniform(0.3, 0.7, (1, 30, 2)), random.uniform(0.05, 0.5, (1, 30, 2))], axis=2)
    model = save_rtdetr(tmp_path / "m.onnx", labels, parts, scores, size_px)
    describe(model, "family: detr\nclasses: labels.txt")
    (tmp_path / "labels.txt").write_text("\n".join(LABELS))
    # Another aspect ratio than the input's: the picture is stretched.
    picture_px = (300, 90)
    found = OnnxDetector(model, EVERYTHING).detect(_empty(picture_px))
    x, y, w, h = (parts[0] * [*picture_px, *picture_px]).T
    expected = np.stack([x - w / 2, y - h / 2, x + w / 2, y + h / 2], axis=1) - 0.5
    _same(found, expected, np.where(labels[0][:, None] == [0, 1, 2], scores[0].astype(np.float32)[:, None], 0))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size_px", SIZES)
@pytest.mark.parametrize("float_type", [np.float32, np.float16])
@pytest.mark.parametrize(("boxes", "logits"), [("pred_boxes", "logits"), ("dets", "labels")])
def test_a_detr_is_read_before_its_sigmoid(
    tmp_path: Path, size_px: tuple[int, int], seed: int, float_type: type[np.generic], boxes: str, logits: str
) -> None:
    random = np.random.default_rng(seed)
    labels = [*LABELS, "no object"]  # four: logits and boxes have the same shape
    values = random.normal(0, 3, (1, 30, 4)).astype(float_type)
    parts = np.concatenate([random.uniform(0.3, 0.7, (1, 30, 2)), random.uniform(0.05, 0.5, (1, 30, 2))], axis=2)
    parts = parts.astype(float_type)
    model = save_constant(tmp_path / "m.onnx", {logits: values, boxes: parts}, size_px, float_type)
    found = OnnxDetector(describe(model, yaml.safe_dump({"family": "detr", "classes": labels})), EVERYTHING).detect(
        _empty((300, 90))
    )
    x, y, w, h = (parts[0].astype(np.float64) * [300, 90, 300, 90]).T
    expected = np.stack([x - w / 2, y - h / 2, x + w / 2, y + h / 2], axis=1) - 0.5
    _same(found, expected, 1 / (1 + np.exp(-values[0, :, :2].astype(np.float64))))


def test_a_detr_keeps_neighbours_that_overlap_but_gives_no_box_twice(tmp_path: Path) -> None:
    parts = np.array([[[0.5, 0.5, 0.2, 0.4], [0.5, 0.5, 0.2, 0.4], [0.54, 0.5, 0.2, 0.4]]])
    labels, scores = np.array([[0, 1, 0]]), np.array([[0.9, 0.6, 0.8]])
    model = save_rtdetr(tmp_path / "m.onnx", labels, parts, scores, (64, 64))
    detector = OnnxDetector(describe(model, "family: detr\nclasses: [car, truck]"))
    np.testing.assert_allclose(detector.detect(_empty((100, 100))).score, [0.9, 0.8], rtol=1e-6)


def test_what_slices_of_a_detr_see_is_joined(tmp_path: Path) -> None:
    # Each view says that something fills its middle; the boxes of neighbours overlap, those of one view do not.
    parts, one = np.array([[[0.5, 0.5, 0.9, 0.9]]]), np.ones((1, 1))
    model = save_rtdetr(tmp_path / "m.onnx", np.zeros((1, 1)), parts, one, (64, 64))
    describe(model, "family: detr\nclasses: [excavator]")
    sliced = OnnxDetector(model, DetectParams(slices=(2, 1), slice_overlap=0.8)).detect(_empty((640, 640)))
    assert len(sliced) == 1


def test_the_record_says_what_family_it_was(tmp_path: Path) -> None:
    rows = _random_rows(0, (64, 64), 4)
    model = describe(
        save_constant(tmp_path / "m.onnx", {"rows": rows}, (64, 64)), "family: yolov3\nclasses: [car, a, b]"
    )
    description = OnnxDetector(model).describe()
    assert description["family"] == "yolov3"
    assert description["input_size_px"] == [64, 64]
    json.dumps(description)


_LIKE_ROWS = {"output": np.zeros((1, 84, 8), np.float32)}  # 64 + 16 + 4 cells of 64 x 64 px


@pytest.mark.parametrize(
    ("outputs", "size_px", "suggested"),
    [
        (_LIKE_ROWS, (64, 64), "{family: yolox, classes: labels.txt}"),
        (_LIKE_ROWS, (96, 64), "{family: yolov3, classes: labels.txt}"),
        (_LIKE_ROWS, ("w", "h"), "{family: yolox, classes: labels.txt, input_size: 640x640}"),
        ({**_LIKE_ROWS, "boxes": np.zeros((1, 84, 4), np.float32)}, (64, 64), "{family: detr, classes: labels.txt}"),
    ],
)
def test_a_model_that_nothing_describes_is_refused_with_the_description_to_write(
    tmp_path: Path, outputs: dict[str, Array], size_px: tuple[int, int], suggested: str
) -> None:
    model = save_constant(tmp_path / "m.onnx", outputs, size_px)
    with pytest.raises(ModelError, match=re.escape(f"Write m.yaml, such as {suggested}")) as caught:
        OnnxDetector(model)
    assert "\n" not in str(caught.value)
    assert yaml.safe_load(suggested)["classes"] == "labels.txt"


ROWS = {"output": _random_rows(0, (64, 64), 84)}
LOGITS = {"logits": np.zeros((1, 9, 3), np.float32), "boxes": np.full((1, 9, 4), 0.5, np.float32)}
YOLOX = "family: yolox\nclasses: [person, car, kite]\n"
YOLOV3 = "family: yolov3\nclasses: [person, car, kite]\n"
DETR = "family: detr\nclasses: [person, car, kite]\n"
OPEN = ("w", "h")


@pytest.mark.parametrize(
    ("outputs", "size_px", "text", "message"),
    [
        (ROWS, (64, 64), "", "m.yaml, found no `key: value` lines"),
        (ROWS, (64, 64), "a: [", "m.yaml.*not YAML"),
        (ROWS, (64, 64), "family: yolox", "found no classes"),
        (
            ROWS,
            (64, 64),
            "family: ssd\nclasses: [a]",
            "family ssd, .* none of yolov3, yolov5, yolov8, yolov10, yolox, detr",
        ),
        (ROWS, (64, 64), YOLOX + "colours: bgr", r"unknown colours \(known: family, classes"),
        (ROWS, (64, 64), YOLOX + "colour: hsv", "colour hsv, which is none of rgb, bgr"),
        (ROWS, (64, 64), YOLOX + "pad: 300", "pad 300, which is not a level"),
        (ROWS, (64, 64), YOLOX + "mean: [1, 2]", "mean .*three numbers"),
        (ROWS, (64, 64), YOLOX + "std: [1, 0, 1]", "std .*above 0"),
        (ROWS, (64, 64), YOLOX + "outputs: {row: output}", "outputs .*some of rows, boxes"),
        (ROWS, (64, 64), YOLOX + "input_size: 64", "input_size 64, which is not like 640x640"),
        (ROWS, (64, 64), YOLOX + "input_size: 96x64", "input_size 96x64, but the graph takes 64x64"),
        (ROWS, (64, 64), "family: yolox\nclasses: {a: 1}", "neither a list of labels nor a file"),
        (ROWS, (64, 64), "family: yolox\nclasses: [no, true]", "the name True, which is no text; put it in quotes"),
        (ROWS, (64, 64), "family: yolox\nfamily: detr", "line 2: the key `family` a second time, after line 1"),
        (ROWS, (64, 64), "family: yolox\nclasses: none.txt", "no such file"),
        (ROWS, OPEN, YOLOX, "no input_size, which the graph leaves open"),
        (
            ROWS,
            (64, 64),
            "family: yolox\nclasses: [person, car]",
            r"with 2 classes .* found output \(1, 84, 8\) float32",
        ),
        (ROWS, (64, 64), YOLOX + "outputs: {rows: boxes}", r"one output of rows .* found output \(1, 84, 8\)"),
        (ROWS, OPEN, YOLOX + "input_size: 96x64", "126 or 127 rows of a YOLOX with input 96x64 .*found 84"),
        ({"output": ROWS["output"][0]}, (64, 64), YOLOX, r"one output of rows .* found output \(84, 8\)"),
        ({"output": ROWS["output"] * np.float32(np.nan)}, (64, 64), YOLOX, "numbers .*found NaN in output"),
        ({"output": ROWS["output"] - 1}, (64, 64), YOLOV3, "probabilities, 0 to 1, .*found -"),
        (ROWS, (64, 64), DETR, r"one output of rows \(1, N, 4 \+ classes\)"),
        (LOGITS, (64, 64), "family: detr\nclasses: [person, car]", r"one output of logits .*2 classes"),
        ({**LOGITS, "boxes": LOGITS["boxes"] * 90}, (64, 64), DETR, "boxes as parts of the input.*found 45"),
        ({**LOGITS, "labels": np.zeros((1, 9), np.int64)}, (64, 64), DETR, "integer input .* found none"),
        (LOGITS, (64, 64), YOLOX, r"one output of rows .*logits \(1, 9, 3\)"),
    ],
)
def test_a_description_that_does_not_fit_is_refused_in_one_line(
    tmp_path: Path, outputs: dict[str, Array], size_px: tuple[int | str, int | str], text: str, message: str
) -> None:
    model = describe(save_constant(tmp_path / "m.onnx", outputs, size_px), text)
    with pytest.raises(ModelError, match=message) as caught:
        OnnxDetector(model)
    assert "\n" not in str(caught.value)


def test_labels_beyond_the_classes_are_refused(tmp_path: Path) -> None:
    parts = np.full((1, 3, 4), 0.5)
    model = save_rtdetr(tmp_path / "m.onnx", np.array([[0, 2, 1]]), parts, np.ones((1, 3)), (64, 64))
    with pytest.raises(ModelError, match=r"labels 0 to 1, of 2 classes .*found 0 to 2"):
        OnnxDetector(describe(model, "family: detr\nclasses: [person, car]"))


def test_the_example_in_the_code_describes_a_yolox(tmp_path: Path) -> None:
    text = "\n".join(line for line in (interface.__doc__ or "").splitlines() if line.startswith("    "))
    (tmp_path / "coco.names").write_text("\n".join(LABELS))
    (tmp_path / "m.yaml").write_text(textwrap.dedent(text))
    read = interface.read_description(tmp_path / "m.yaml")
    assert (read.family, read.classes, read.input_size_px) == ("yolox", LABELS, (640, 640))
    known = read.over(interface.Interface("yolox", LABELS, (640, 640)))
    assert known.preprocessing == interface.USUAL["yolox"]
    assert read.output_names == {"rows": "output"}


def test_bytes_and_a_mean_contradict(tmp_path: Path) -> None:
    model = save_bright_cells(tmp_path / "m.onnx", (64, 64), 0, np.uint8)
    with pytest.raises(ModelError, match=r"no mean and no std for .*the levels themselves"):
        OnnxDetector(describe(model, "family: yolox\nclasses: [worker]\nmean: [1, 1, 1]"))


def test_a_size_that_the_graph_cannot_compute_is_refused_in_one_line(tmp_path: Path) -> None:
    # The rows of 64 x 64 px joined with those of another size.
    model = onnx.load(str(save_bright_cells(tmp_path / "m.onnx", (64, 64), 0, np.float32)))
    for axis in (2, 3):
        model.graph.input[0].type.tensor_type.shape.dim[axis].dim_param = f"side{axis}"
    onnx.save(model, str(tmp_path / "m.onnx"))
    describe(tmp_path / "m.onnx", "family: yolox\nclasses: [worker]\ninput_size: 96x64")
    with pytest.raises(
        ModelError, match="to take a picture of 96x64, found what ONNX Runtime cannot compute"
    ) as caught:
        OnnxDetector(tmp_path / "m.onnx")
    assert "\n" not in str(caught.value)


def _save_unsound(path: Path, outputs: dict[str, Array], brightest: float) -> Path:
    """Write a network whose outputs are multiplied by brightest level / `brightest`: 0/0 for a black picture."""
    nodes = [
        onnx.helper.make_node("ReduceMax", [PICTURE], ["seen"], keepdims=0),
        onnx.helper.make_node("Div", ["seen", "seen"], ["one"]),
        onnx.helper.make_node("Div", ["seen", "brightest"], ["part"]),
        onnx.helper.make_node("Mul", ["one", "part"], ["factor"]),
    ]
    nodes += [onnx.helper.make_node("Mul", [f"{name}_value", "factor"], [name]) for name in outputs]
    return save_graph(
        path,
        nodes,
        {PICTURE: (np.float32, (1, 3, 64, 64))},
        {name: (value.dtype, value.shape) for name, value in outputs.items()},
        {f"{name}_value": value for name, value in outputs.items()} | {"brightest": np.array(brightest, np.float32)},
    )


@pytest.mark.parametrize(
    ("outputs", "text", "trial_level"), [(ROWS, YOLOX, 127.0), (ROWS, YOLOV3, 127 / 255), (LOGITS, DETR, 127 / 255)]
)
def test_numbers_that_turn_out_not_to_be_are_an_error(
    tmp_path: Path, outputs: dict[str, Array], text: str, trial_level: float
) -> None:
    detector = OnnxDetector(describe(_save_unsound(tmp_path / "m.onnx", outputs, trial_level), text))
    with pytest.raises(
        ModelError, match=r"numbers from m\.onnx, found NaN\. Correct `family: \w+` or the rest of m\.yaml"
    ):
        detector.detect(_empty((64, 64)))


def test_probabilities_above_1_are_an_error_but_a_rounded_1_is_1(tmp_path: Path) -> None:
    sure = np.array([[[32, 32, 8, 8, 1, 1, 0, 0]]], np.float32)
    model = describe(_save_unsound(tmp_path / "m.onnx", {"rows": sure}, 127 / 255), YOLOV3)
    detector = OnnxDetector(model)
    assert detector.detect(frame_from_array(np.full((64, 64, 3), 128, np.uint8))).score.tolist() == [1.0]
    with pytest.raises(ModelError, match=r"probabilities, 0 to 1, from m\.onnx, found 0 to 4\.03"):
        detector.detect(frame_from_array(np.full((64, 64, 3), 255, np.uint8)))
