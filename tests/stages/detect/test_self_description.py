"""What exported models say of themselves, what is said beside them, and what becomes of damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated
from stages.detect.exported_models import (
    EVERYTHING,
    NAMES,
    empty,
    even_rows,
    metadata,
    random_boxes,
    random_chances,
    save_exported,
    tell,
)
from stages.detect.onnx_models import Array, describe, save_constant

from standoff.core.errors import ModelError
from standoff.stages.detect import DetectParams, OnnxDetector
from standoff.stages.detect.self_description import SelfDescription


@pytest.mark.parametrize(
    ("names", "classes"),
    [
        ("['person', 'car', 'kite']", NAMES),
        ("{2: 'kite', 0: 'person', 1: 'car'}", NAMES),
        ('{"0": "person", "1": "car", "2": "kite"}', NAMES),
        ("\ufeff{0: '\ufeffperson', 1: ' car', 2: 'kite'}", NAMES),
    ],
)
def test_names_are_read_in_any_form(names: str, classes: tuple[str, ...]) -> None:
    said = SelfDescription.from_metadata({"names": names}, "m.onnx")
    assert said is not None
    assert said.classes == classes


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ({"names": "{0: 'a', 2: 'b'}"}, "ids other than 0 to 1 in names"),
        ({"names": "{0: 'a', '0': 'b'}"}, "ids other than 0 to 1 in names"),
        ({"names": "{'a': 0}"}, "ids other than 0 to 0 in names"),
        ({"names": "{}"}, "names that are neither a list nor ids with names"),
        ({"names": "(((("}, r"found '\(\(\(\('"),
        ({"names": "__import__('os')"}, "found '__import__"),
        ({"task": "classify"}, r"task 'classify', which gives no boxes \(known: detect, segment, pose, obb\)"),
        ({"imgsz": "[0, 640]"}, r"imgsz \[0, 640\], which is no height and width"),
        ({"imgsz": "'big'"}, "'big', which are not whole numbers"),
    ],
)
def test_what_cannot_be_read_of_the_metadata_is_named(texts: dict[str, str], message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        SelfDescription.from_metadata(metadata((64, 64)) | texts, "m.onnx")
    assert "\n" not in str(caught.value)
    assert "Write a description beside it" in str(caught.value)


def test_layouts_of_one_shape_are_told_apart_by_their_numbers(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    size_px, model = (64, 64), tmp_path / "m.onnx"

    def family(rows: Array, names: tuple[str, ...], **more: str) -> str:
        save_constant(model, {"output0": rows.astype(np.float32)}, size_px)
        return str(OnnxDetector(tell(model, metadata(size_px, names, **more))).describe()["family"])

    cells = 64 + 16 + 4
    boxes = random_boxes(random, 3 * cells, size_px)
    one = np.concatenate([boxes, random_chances(random, 3 * cells, 2)], axis=1)[None]
    assert family(one, ("person",)) == "yolov5"
    chosen = np.zeros((1, 300, 6))
    chosen[0, :, :4] = [8, 8, 40, 40]
    chosen[0, :, 4] = 0.5
    assert family(chosen, ("person",)) == "yolov10"
    assert family(chosen, ("person", "car")) == "yolov10"
    parts = np.concatenate([np.full((300, 4), 0.5), random_chances(random, 300, 2)], axis=1)[None]
    assert family(parts, ("person", "car")) == "detr"
    assert family(np.zeros((1, 300, 6)), ("person", "car")) == "yolov10"
    parts[..., 5] = 1
    with pytest.raises(ModelError, match=r"ones that may be either\. .*say in m\.yaml what it is"):
        family(parts, ("person", "car"))
    assert family(parts, ("person", "car"), end2end="True") == "yolov10"
    describe(model, "family: detr")
    assert family(parts, ("person", "car")) == "detr"


def test_an_open_input_takes_the_size_that_the_metadata_or_the_description_says(tmp_path: Path) -> None:
    rows = np.concatenate([random_boxes(np.random.default_rng(6), 84, (96, 64)), np.full((84, 3), 0.5)], axis=1).T[None]
    model = save_exported(tmp_path / "m.onnx", rows, ("w", "h"))
    with pytest.raises(ModelError, match="no input_size, which the graph leaves open; such as `input_size: 640x640`"):
        OnnxDetector(model)
    describe(model, "input_size: 64x96")
    assert OnnxDetector(model).describe()["input_size_px"] == [64, 96]
    model.with_suffix(".yaml").unlink()
    tell(model, metadata((96, 64)))
    assert OnnxDetector(model).describe()["input_size_px"] == [96, 64]


def test_a_description_that_contradicts_the_model_gives_way_and_is_told(tmp_path: Path) -> None:
    rows = np.concatenate([random_boxes(np.random.default_rng(7), 84, (64, 64)), np.full((84, 3), 0.5)], axis=1).T[None]
    model = describe(save_exported(tmp_path / "m.onnx", rows, (64, 64)), f"family: yolov3\nclasses: {[*NAMES]}")
    description = OnnxDetector(model).describe()
    assert description["family"] == "yolov8"
    assert description["warnings"] == [
        "m.yaml says family: yolov3, but the outputs of m.onnx are those of family: yolov8, as its own metadata says; "
        "read as those"
    ]
    describe(model, "family: yolov3\nclasses: [person]")
    with pytest.raises(ModelError, match=r"one output of rows \(1, N, 5 \+ classes\) with 1 classes"):
        OnnxDetector(model)


def test_classes_of_a_description_go_before_those_of_the_model(tmp_path: Path) -> None:
    rows = np.concatenate([random_boxes(np.random.default_rng(8), 84, (64, 64)), np.full((84, 3), 0.5)], axis=1).T[None]
    model = describe(save_exported(tmp_path / "m.onnx", rows, (64, 64)), "classes: [kite, excavator, person]")
    assert OnnxDetector(model).describe()["class_map"] == {"excavator": "excavator", "person": "worker"}


@pytest.mark.parametrize(
    ("output", "family"),
    [
        (even_rows(7, 84).transpose(0, 2, 1), "yolov8"),
        (even_rows(8, 3 * 84), "yolov5"),
        (np.concatenate([even_rows(5, 300), np.zeros((1, 300, 1), np.float32)], axis=2), "yolov10"),
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
    description = OnnxDetector(tmp_path / "m.onnx").describe()
    assert (description["family"], description["classes"]) == (family, [*NAMES])


def test_labels_in_another_encoding_are_named(tmp_path: Path) -> None:
    save_constant(tmp_path / "m.onnx", {"output0": even_rows(7, 84)}, (64, 64))
    describe(tmp_path / "m.onnx", "family: yolov3\nclasses: labels.txt")
    (tmp_path / "labels.txt").write_bytes("person\nträger".encode("cp1252"))
    with pytest.raises(ModelError, match=r"labels\.txt, found Windows-1252"):
        OnnxDetector(tmp_path / "m.onnx")


def test_of_no_class_that_is_of_use_one_line_tells_what_to_say(tmp_path: Path) -> None:
    names = tuple(f"kite {number}" for number in range(30))
    save_constant(tmp_path / "m.onnx", {"output0": even_rows(34, 84).transpose(0, 2, 1)}, (64, 64))
    model = tell(tmp_path / "m.onnx", metadata((64, 64), names))
    with pytest.raises(ModelError) as caught:
        OnnxDetector(model)
    line = str(caught.value)
    assert "kite 11 and 18 more. Say in a settings file which label is which class" in line
    assert "detect: {class_map: {kite 0: worker}}" in line
    found = OnnxDetector(model, DetectParams(class_map={"kite 29": "worker"})).describe()
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
    model = save_exported(tmp_path / "m.onnx", even_rows(7, 84).transpose(0, 2, 1), (64, 64))
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


@given(st.data())
@examples(200)
def test_damaged_metadata_is_read_or_refused_in_one_line(data: st.DataObject) -> None:
    key = data.draw(st.sampled_from(sorted(_WHOLE)))
    content = data.draw(mutated(st.just(_WHOLE[key].encode())))
    texts = _WHOLE | {key: content.decode("utf-8", "replace")}
    try:
        said = SelfDescription.from_metadata(texts, "m.onnx")
    except ModelError as error:
        assert "\n" not in str(error)
    else:
        assert said is not None
        assert said.classes
        assert said.keypoint_values >= 0


@pytest.fixture(scope="module")
def whole_model(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    rows = np.concatenate([random_boxes(np.random.default_rng(9), 21, (32, 32)), np.full((21, 3), 0.5)], axis=1).T[None]
    return save_exported(tmp_path_factory.mktemp("whole") / "m.onnx", rows, (32, 32)).read_bytes()


@given(st.data())
@examples(200)
def test_a_damaged_model_is_read_or_refused_in_one_line(
    whole_model: bytes, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.onnx"
    path.write_bytes(data.draw(mutated(st.just(whole_model))))
    try:
        OnnxDetector(path, EVERYTHING).detect(empty((32, 32)))
    except ModelError as error:
        assert "\n" not in str(error)
