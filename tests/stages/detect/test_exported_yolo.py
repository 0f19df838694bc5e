"""Models in the layouts that Ultralytics documents for its exports, read without a description."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnx
import pytest
import tolerances
import yaml
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated
from stages.detect.onnx_models import PICTURE, Array, Shape, describe, save_constant, save_graph

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError
from standoff.core.types import Detections, Frame
from standoff.stages.detect import DetectParams, OnnxDetector
from standoff.stages.detect.self_description import SelfDescription
from standoff.stages.frames import frame_from_array

WORKER, VEHICLE = CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["vehicle"].id
NAMES = ("person", "car", "kite")
EVERYTHING = DetectParams(score_threshold=0.0, nms_iou=1.0, max_detections=10**6)
SIZES = [(96, 64), (64, 160)]
MASKS, KEYPOINTS = 4, 17
MORE = {"detect": 0, "segment": MASKS, "pose": KEYPOINTS * 3, "obb": 1}


def _metadata(size_px: tuple[int, int] | None, names: tuple[str, ...] = NAMES, /, **more: str) -> dict[str, str]:
    """What an export writes; sizes are height and width."""
    said = {"description": "a model", "stride": "32", "names": str(dict(enumerate(names))), "task": "detect"}
    if size_px is not None:
        said["imgsz"] = str([size_px[1], size_px[0]])
    return said | more


def _tell(model: Path, metadata: dict[str, str]) -> Path:
    """Put texts into a model's metadata."""
    loaded = onnx.load(str(model))
    onnx.helper.set_model_props(loaded, metadata)
    onnx.save(loaded, str(model))
    return model


def _boxes(random: np.random.Generator, count: int, size_px: tuple[int, int]) -> Array:
    """(count, 4) centre and size of boxes inside the input."""
    centre = random.uniform(0.3, 0.7, (count, 2)) * size_px
    return np.concatenate([centre, random.uniform(4, 16, (count, 2))], axis=1)


def _chances(random: np.random.Generator, count: int, columns: int = len(NAMES)) -> Array:
    return random.uniform(0.01, 1, (count, columns))


def _found(model: Path, size_px: tuple[int, int]) -> Detections:
    """Look at a picture twice as large as the input, and of its shape."""
    return OnnxDetector(model, EVERYTHING).detect(_empty((2 * size_px[0], 2 * size_px[1])))


def _empty(size_px: tuple[int, int]) -> Frame:
    return frame_from_array(np.zeros((size_px[1], size_px[0], 3), np.uint8))


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


def _save(path: Path, rows: Array, size_px: Any, task: str = "detect", **more: str) -> Path:
    outputs = {"output0": rows.astype(np.float32)}
    if task == "segment":
        outputs["output1"] = np.zeros((1, MASKS, 8, 8), np.float32)
    told = {"kpt_shape": f"[{KEYPOINTS}, 3]"} if task == "pose" else {}
    is_open = isinstance(size_px[0], str)
    return _tell(
        save_constant(path, outputs, size_px), _metadata(None if is_open else size_px, task=task, **told, **more)
    )


@pytest.mark.parametrize("task", MORE)
@pytest.mark.parametrize("size_px", SIZES)
@pytest.mark.parametrize("unit", ["pixels", "parts"])
def test_columns_of_boxes_and_probabilities_are_read(
    tmp_path: Path, task: str, size_px: tuple[int, int], unit: str
) -> None:
    random = np.random.default_rng(0)
    boxes, chances, more = _boxes(random, 84, size_px), _chances(random, 84), np.zeros((84, MORE[task]))
    scale = np.tile(size_px, 2) if unit == "parts" else 1
    rows = np.concatenate([boxes / scale, chances, more], axis=1)
    model = _save(tmp_path / "m.onnx", rows.T[None], size_px, task)
    _same(_found(model, size_px), boxes, chances)
    description = OnnxDetector(model).description
    assert (description["family"], description["task"]) == ("yolov8", task)
    assert bool(description["warnings"]) == (unit == "parts")


@pytest.mark.parametrize("task", ["detect", "segment"])
@pytest.mark.parametrize("size_px", SIZES)
@pytest.mark.parametrize("unit", ["pixels", "parts"])
def test_rows_with_objectness_are_read(tmp_path: Path, task: str, size_px: tuple[int, int], unit: str) -> None:
    random = np.random.default_rng(1)
    boxes, chances, objectness = _boxes(random, 99, size_px), _chances(random, 99), _chances(random, 99, 1)
    scale = np.tile(size_px, 2) if unit == "parts" else 1
    rows = np.concatenate([boxes / scale, objectness, chances, np.zeros((99, MORE[task]))], axis=1)
    model = _save(tmp_path / "m.onnx", rows[None], size_px, task)
    _same(_found(model, size_px), boxes, objectness * chances)
    detector = OnnxDetector(model)
    assert detector.description["family"] == "yolov5"
    told = ["the boxes of m.onnx come as parts of its input, 0 to 1, not in pixels: read as such"]
    assert detector.description["warnings"] == (told if unit == "parts" else [])


@pytest.mark.parametrize("task", ["detect", "segment", "pose"])
@pytest.mark.parametrize("size_px", SIZES)
def test_what_an_end_to_end_network_chose_is_read_and_not_thinned_out(
    tmp_path: Path, task: str, size_px: tuple[int, int]
) -> None:
    random = np.random.default_rng(2)
    boxes, score, label = _boxes(random, 9, size_px), _chances(random, 9, 1), random.integers(0, 2, (9, 1))
    x, y, w, h = boxes.T
    corners = np.stack([x - w / 2, y - h / 2, x + w / 2, y + h / 2], axis=1)
    rows = np.concatenate([corners, score, label, np.zeros((9, MORE[task]))], axis=1)
    rows = np.concatenate([rows, np.zeros((291, rows.shape[1]))])  # what is not found
    model = _save(tmp_path / "m.onnx", rows[None], size_px, task)
    _same(_found(model, size_px), boxes, score * (label == [[0, 1, 2]]))


@pytest.mark.parametrize("size_px", SIZES)
def test_ultralytics_rt_detr_is_read_in_a_stretched_picture(tmp_path: Path, size_px: tuple[int, int]) -> None:
    random = np.random.default_rng(3)
    boxes, chances = _boxes(random, 300, size_px), _chances(random, 300)
    rows = np.concatenate([boxes / np.tile(size_px, 2), chances], axis=1)
    model = _save(tmp_path / "m.onnx", rows[None], size_px)
    _same(_found(model, size_px), boxes, chances)
    (tall,) = {OnnxDetector(model, EVERYTHING).detect(_empty((size_px[0], 9 * size_px[1]))).xyxy_px.max()}
    assert tall > 5 * size_px[1], "boxes reach over the whole height"
    assert OnnxDetector(model).description["warnings"] == []


@pytest.mark.parametrize("layout", ["columns", "ends"])
def test_the_box_of_a_turned_box_is_the_one_around_it(tmp_path: Path, layout: str) -> None:
    random = np.random.default_rng(4)
    size_px, count = (96, 64), 40
    boxes, angle_rad = _boxes(random, count, size_px), random.uniform(-np.pi / 4, 3 * np.pi / 4, (count, 1))
    around = []
    for (x, y, w, h), angle in zip(boxes, angle_rad[:, 0], strict=True):
        corners = cv2.boxPoints(((x, y), (w, h), np.degrees(angle)))
        low, high = corners.min(axis=0), corners.max(axis=0)
        around.append([*(low + high) / 2, *(high - low)])
    chances = _chances(random, count)
    rows = np.concatenate([boxes, chances, angle_rad], axis=1).T
    if layout == "ends":
        chances = chances * (np.arange(3) == 0)
        rows = np.concatenate([boxes, chances[:, :1], np.zeros((count, 1)), angle_rad], axis=1)
    model = _save(tmp_path / "m.onnx", rows[None], size_px, "obb")
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
    _tell(model, _metadata((64, 64), ("person",)))
    image = np.zeros((32, 64, 3), np.uint8)
    image[:, 32:, 2] = 255
    found = OnnxDetector(model, EVERYTHING).detect(frame_from_array(image))
    # Half of each cell is picture, which lies in the middle, and half is what is around it.
    np.testing.assert_allclose(found.score, [(1 + 114 / 255) / 2] * 2 + [114 / 255 / 2] * 2, atol=tolerances.ONNX_LOGIT)
    assert (found.xyxy_px[:2, 0] > 32).all()


@pytest.mark.parametrize(
    ("names", "classes"),
    [
        ("['person', 'car', 'kite']", NAMES),
        ("{2: 'kite', 0: 'person', 1: 'car'}", NAMES),
        ("\ufeff{0: '\ufeffperson', 1: ' car', 2: 'kite'}", NAMES),
    ],
)
def test_names_are_read_in_any_form(names: str, classes: tuple[str, ...]) -> None:
    said = SelfDescription.from_metadata({"names": names}, "m.onnx")
    assert said is not None
    assert said.classes == classes


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ({"names": "{0: 'a', 2: 'b'}"}, "ids other than 0 to 1 in names"),
        ({"names": "{}"}, "names that are neither a list nor ids with names"),
        ({"names": "(((("}, r"found '\(\(\(\('"),
        ({"names": "__import__('os')"}, "found '__import__"),
        ({"task": "classify"}, r"task 'classify', which gives no boxes \(known: detect, segment, pose, obb\)"),
        ({"imgsz": "[0, 640]"}, r"imgsz \[0, 640\], which is no height and width"),
        ({"imgsz": "'big'"}, "'big', which are not whole numbers"),
    ],
)
def test_what_cannot_be_read_of_the_metadata_is_named(metadata: dict[str, str], message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        SelfDescription.from_metadata(_metadata((64, 64)) | metadata, "m.onnx")
    assert "\n" not in str(caught.value)
    assert "Write a description beside it" in str(caught.value)


def test_layouts_of_one_shape_are_told_apart_by_their_numbers(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    size_px, model = (64, 64), tmp_path / "m.onnx"

    def family(rows: Array, names: tuple[str, ...], **more: str) -> str:
        save_constant(model, {"output0": rows.astype(np.float32)}, size_px)
        return str(OnnxDetector(_tell(model, _metadata(size_px, names, **more))).description["family"])

    cells = 64 + 16 + 4
    boxes = _boxes(random, 3 * cells, size_px)
    one = np.concatenate([boxes, _chances(random, 3 * cells, 2)], axis=1)[None]
    assert family(one, ("person",)) == "yolov5"
    chosen = np.zeros((1, 300, 6))
    chosen[0, :, :4] = [8, 8, 40, 40]
    chosen[0, :, 4] = 0.5
    assert family(chosen, ("person",)) == "yolov10"
    assert family(chosen, ("person", "car")) == "yolov10"
    parts = np.concatenate([np.full((300, 4), 0.5), _chances(random, 300, 2)], axis=1)[None]
    assert family(parts, ("person", "car")) == "detr"
    assert family(np.zeros((1, 300, 6)), ("person", "car")) == "yolov10"
    parts[..., 5] = 1
    with pytest.raises(ModelError, match=r"ones that may be either\. .*say in m\.yaml what it is"):
        family(parts, ("person", "car"))
    assert family(parts, ("person", "car"), end2end="True") == "yolov10"
    describe(model, "family: detr")
    assert family(parts, ("person", "car")) == "detr"


def test_an_open_input_takes_the_size_that_the_metadata_or_the_description_says(tmp_path: Path) -> None:
    rows = np.concatenate([_boxes(np.random.default_rng(6), 84, (96, 64)), np.full((84, 3), 0.5)], axis=1).T[None]
    model = _save(tmp_path / "m.onnx", rows, ("w", "h"))
    with pytest.raises(ModelError, match="no input_size, which the graph leaves open; such as `input_size: 640x640`"):
        OnnxDetector(model)
    describe(model, "input_size: 64x96")
    assert OnnxDetector(model).description["input_size_px"] == [64, 96]
    model.with_suffix(".yaml").unlink()
    _tell(model, _metadata((96, 64)))
    assert OnnxDetector(model).description["input_size_px"] == [96, 64]


def test_a_description_that_contradicts_the_model_gives_way_and_is_told(tmp_path: Path) -> None:
    rows = np.concatenate([_boxes(np.random.default_rng(7), 84, (64, 64)), np.full((84, 3), 0.5)], axis=1).T[None]
    model = describe(_save(tmp_path / "m.onnx", rows, (64, 64)), f"family: yolov3\nclasses: {[*NAMES]}")
    description = OnnxDetector(model).description
    assert description["family"] == "yolov8"
    assert description["warnings"] == [
        "m.yaml says family: yolov3, but the outputs of m.onnx are those of family: yolov8, as its own metadata says; "
        "read as those"
    ]
    describe(model, "family: yolov3\nclasses: [person]")
    with pytest.raises(ModelError, match=r"one output of rows \(1, N, 5 \+ classes\) with 1 classes"):
        OnnxDetector(model)


def test_classes_of_a_description_go_before_those_of_the_model(tmp_path: Path) -> None:
    rows = np.concatenate([_boxes(np.random.default_rng(8), 84, (64, 64)), np.full((84, 3), 0.5)], axis=1).T[None]
    model = describe(_save(tmp_path / "m.onnx", rows, (64, 64)), "classes: [kite, excavator, person]")
    assert OnnxDetector(model).description["class_map"] == {"excavator": "excavator", "person": "worker"}


def _rows_of(columns: int, count: int) -> Array:
    rows = np.zeros((1, count, columns), np.float32)
    rows[..., :4] = [30, 30, 50, 50]
    rows[..., 4:] = 0.5
    return rows


@pytest.mark.parametrize(
    ("output", "family"),
    [
        (_rows_of(7, 84).transpose(0, 2, 1), "yolov8"),
        (_rows_of(8, 3 * 84), "yolov5"),
        (np.concatenate([_rows_of(5, 300), np.zeros((1, 300, 1), np.float32)], axis=2), "yolov10"),
    ],
)
def test_the_hint_for_a_model_that_says_nothing_leads_to_one_that_works(
    tmp_path: Path, output: Array, family: str
) -> None:
    loaded = onnx.load(str(save_constant(tmp_path / "m.onnx", {"output0": output}, (64, 64))))
    for axis, side in zip(loaded.graph.output[0].type.tensor_type.shape.dim, output.shape, strict=True):
        axis.dim_value = side
    onnx.save(loaded, str(tmp_path / "m.onnx"))
    with pytest.raises(ModelError) as caught:
        OnnxDetector(tmp_path / "m.onnx")
    hint = str(caught.value).partition("such as ")[2].partition("}")[0] + "}"
    assert yaml.safe_load(hint)["family"] == family
    describe(tmp_path / "m.onnx", hint)
    (tmp_path / "labels.txt").write_text("\ufeff" + "\n".join(NAMES), encoding="utf-8")
    description = OnnxDetector(tmp_path / "m.onnx").description
    assert (description["family"], description["classes"]) == (family, [*NAMES])


def test_labels_in_another_encoding_are_named(tmp_path: Path) -> None:
    save_constant(tmp_path / "m.onnx", {"output0": _rows_of(7, 84)}, (64, 64))
    describe(tmp_path / "m.onnx", "family: yolov3\nclasses: labels.txt")
    (tmp_path / "labels.txt").write_bytes("person\nträger".encode("cp1252"))
    with pytest.raises(ModelError, match=r"labels\.txt, .* with byte 0xE4 in line 2, which is 'ä' in Windows-1252"):
        OnnxDetector(tmp_path / "m.onnx")


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
    return _tell(path, _metadata((64, 64)))


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
    assert len(detector.detect(_empty((64, 64)))) == 0
    with pytest.raises(ModelError, match=message):
        detector.detect(frame_from_array(np.full((64, 64, 3), 255, np.uint8)))


def test_of_no_class_that_is_of_use_one_line_tells_what_to_say(tmp_path: Path) -> None:
    names = tuple(f"kite {number}" for number in range(30))
    save_constant(tmp_path / "m.onnx", {"output0": _rows_of(34, 84).transpose(0, 2, 1)}, (64, 64))
    model = _tell(tmp_path / "m.onnx", _metadata((64, 64), names))
    with pytest.raises(ModelError) as caught:
        OnnxDetector(model)
    line = str(caught.value)
    assert "kite 11 and 18 more. Say in a settings file which label is which class" in line
    assert "detect: {class_map: {kite 0: worker}}" in line
    found = OnnxDetector(model, DetectParams(class_map={"kite 29": "worker"})).description
    assert found["class_map"] == {"kite 29": "worker"}


@pytest.mark.parametrize(
    ("content", "name", "message"),
    [
        (b"PK\x03\x04rest", "m.onnx", r"a checkpoint of PyTorch, or another archive\. Export it to ONNX"),
        (b"\x80\x02}", "m.pt", "a checkpoint of PyTorch"),
        (b"\0" * 20, "m.weights", "weights of Darknet. Make an ONNX file of it: `standoff export"),
    ],
)
def test_what_is_known_not_to_be_onnx_is_named(tmp_path: Path, content: bytes, name: str, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ModelError, match=message):
        OnnxDetector(tmp_path / name)


@pytest.mark.parametrize(("word", "instead"), [(b"images", b"im\xffges"), (b"person", b"p\xffrson")])
def test_a_name_that_is_no_text_is_refused_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], word: bytes, instead: bytes
) -> None:
    model = _save(tmp_path / "m.onnx", _rows_of(7, 84).transpose(0, 2, 1), (64, 64))
    model.write_bytes(model.read_bytes().replace(word, instead))
    with pytest.raises(ModelError, match="names or metadata in it that are not UTF-8"):
        OnnxDetector(model)
    assert capfd.readouterr() == ("", "")


_WHOLE = {
    "names": str(dict(enumerate(NAMES))),
    "imgsz": "[64, 96]",
    "task": "pose",
    "kpt_shape": "[17, 3]",
    "end2end": "True",
}


@given(
    st.sampled_from(sorted(_WHOLE)).flatmap(lambda key: st.tuples(st.just(key), mutated(st.just(_WHOLE[key].encode()))))
)
@examples(200)
def test_damaged_metadata_is_read_or_refused_in_one_line(change: tuple[str, bytes]) -> None:
    key, content = change
    metadata = _WHOLE | {key: content.decode("utf-8", "replace")}
    try:
        said = SelfDescription.from_metadata(metadata, "m.onnx")
    except ModelError as error:
        assert "\n" not in str(error)
    else:
        assert said is not None
        assert said.classes
        assert said.keypoint_values >= 0


@pytest.fixture(scope="module")
def whole_model(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    rows = np.concatenate([_boxes(np.random.default_rng(9), 21, (32, 32)), np.full((21, 3), 0.5)], axis=1).T[None]
    return _save(tmp_path_factory.mktemp("whole") / "m.onnx", rows, (32, 32)).read_bytes()


@given(st.data())
@examples(200)
def test_a_damaged_model_is_read_or_refused_in_one_line(
    whole_model: bytes, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.onnx"
    path.write_bytes(data.draw(mutated(st.just(whole_model))))
    try:
        OnnxDetector(path, EVERYTHING).detect(_empty((32, 32)))
    except ModelError as error:
        assert "\n" not in str(error)


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
    assert detector.description["classes"] == classes
    found = detector.detect(_empty((320, 320)))
    # The surest stands in the middle, 30 px wide and 60 high; RT-DETR's is a tenth by a fifth.
    expected = [144, 128, 176, 192] if name == "rtdetr_ultra" else [145, 130, 175, 190]
    np.testing.assert_allclose(found.xyxy_px[0], np.array(expected) - 0.5, atol=1e-3)
