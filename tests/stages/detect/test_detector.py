from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import onnx
import onnxruntime
import pytest

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import MissingDependency, ModelError
from standoff.core.types import Frame, ImageArray, Luma
from standoff.stages.detect import DetectParams, OnnxDetector, available_providers
from standoff.stages.detect.params import Provider
from standoff.stages.frames import frame_from_array
from standoff.training import export_darknet

MakeModel = Callable[[tuple[str, ...], tuple[int, int]], Path]
LABELS = ("person", "car")
WORKER, VEHICLE = CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["vehicle"].id
YELLOW, PURPLE, WHITE, DIM_YELLOW = (0, 255, 255), (255, 0, 255), (255, 255, 255), (0, 255, 204)


def _frame(size_px: tuple[int, int], *squares: tuple[int, int, int, tuple[int, int, int]]) -> Frame:
    """A black picture with squares: left, top, side, colour (BGR)."""
    image = np.zeros((size_px[1], size_px[0], 3), np.uint8)
    for left, top, side, colour in squares:
        image[top : top + side, left : left + side] = colour
    return frame_from_array(image)


@pytest.mark.parametrize(
    ("size_px", "input_px"),
    [((128, 128), (64, 64)), ((128, 64), (64, 64)), ((64, 128), (64, 64)), ((192, 128), (96, 64))],
)
def test_things_are_found_where_they_are_in_the_picture(
    make_model: MakeModel, size_px: tuple[int, int], input_px: tuple[int, int]
) -> None:
    detector = OnnxDetector(make_model(LABELS, input_px))
    found = detector.detect(_frame(size_px, (48, 32, 16, YELLOW), (16, 16, 16, PURPLE)))
    found = found[np.argsort(found.class_id)]
    assert found.class_id.tolist() == [WORKER, VEHICLE]
    np.testing.assert_allclose(found.xyxy_px, [[47.5, 31.5, 63.5, 47.5], [15.5, 15.5, 31.5, 31.5]], atol=1e-4)
    assert (found.score > 0.99).all()


def test_an_empty_picture_gives_no_detections(make_model: MakeModel) -> None:
    assert len(OnnxDetector(make_model(LABELS, (64, 64))).detect(_frame((128, 64)))) == 0


def test_boxes_without_area_inside_the_picture_are_dropped(make_model: MakeModel) -> None:
    everything = DetectParams(score_threshold=0.0, max_detections=10**6)
    found = OnnxDetector(make_model(LABELS, (64, 64)), everything).detect(_frame((128, 64)))
    assert len(found) == 8 * 4, "the grey bars above and below hold none"
    assert (found.xyxy_px[:, 2:] > found.xyxy_px[:, :2]).all()
    assert found.xyxy_px.min() >= -0.5
    assert (found.xyxy_px.max(axis=0) <= [127.5, 63.5, 127.5, 63.5]).all()


def test_a_class_may_have_its_own_threshold(make_model: MakeModel) -> None:
    model, frame = make_model(LABELS, (64, 64)), _frame((64, 64), (8, 8, 8, DIM_YELLOW), (32, 8, 8, (204, 0, 204)))
    assert len(OnnxDetector(model).detect(frame)) == 2
    strict = OnnxDetector(model, DetectParams(class_score_thresholds={"worker": 0.95})).detect(frame)
    assert strict.class_id.tolist() == [VEHICLE]
    assert len(OnnxDetector(model, DetectParams(score_threshold=0.95)).detect(frame)) == 0
    lenient = DetectParams(score_threshold=0.95, class_score_thresholds={"worker": 0.1})
    assert OnnxDetector(model, lenient).detect(frame).class_id.tolist() == [WORKER]


def test_a_label_that_is_ignored_gives_no_detection_but_is_listed(make_model: MakeModel) -> None:
    detector = OnnxDetector(make_model(("person", "kite"), (64, 64)))
    assert len(detector.detect(_frame((64, 64), (8, 8, 8, PURPLE)))) == 0
    assert detector.describe()["class_map"] == {"person": "worker"}
    assert detector.describe()["ignored_labels"] == ["kite"]


def test_two_labels_of_one_class_give_one_box(make_model: MakeModel) -> None:
    found = OnnxDetector(make_model(("truck", "car"), (64, 64))).detect(_frame((64, 64), (8, 8, 8, WHITE)))
    assert found.class_id.tolist() == [VEHICLE]


def test_the_surest_come_first_up_to_the_limit(make_model: MakeModel) -> None:
    frame = _frame((64, 64), (8, 8, 8, DIM_YELLOW), (32, 8, 8, YELLOW))
    found = OnnxDetector(make_model(LABELS, (64, 64)), DetectParams(max_detections=1)).detect(frame)
    np.testing.assert_allclose(found.xyxy_px, [[31.5, 7.5, 39.5, 15.5]], atol=1e-4)


def test_slices_find_the_small_and_the_whole_frame_keeps_the_large(make_model: MakeModel) -> None:
    model, frame = make_model(LABELS, (64, 64)), _frame((512, 512), (300, 68, 4, YELLOW), (64, 320, 64, PURPLE))
    assert OnnxDetector(model).detect(frame).class_id.tolist() == [VEHICLE]
    sliced = OnnxDetector(model, DetectParams(slices=(4, 4), slice_overlap=0.0)).detect(frame)
    workers, vehicles = sliced[sliced.class_id == WORKER], sliced[sliced.class_id == VEHICLE]
    # A slice of 128 px is seen at half its size, so a cell is 16 px of the picture.
    np.testing.assert_allclose(workers.xyxy_px, [[287.5, 63.5, 303.5, 79.5]], atol=1e-4)
    assert [63.5, 319.5, 127.5, 383.5] in np.round(vehicles.xyxy_px, 3).tolist()


class _SmallPicture:
    """A picture that must never be converted at full size."""

    width_px, height_px = 1920, 1080

    def bgr(self) -> ImageArray:
        raise AssertionError("full-size pixels were asked for")

    def resized_bgr(self, width_px: int, height_px: int) -> ImageArray:
        return np.zeros((height_px, width_px, 3), np.uint8)

    def gray(self) -> ImageArray:
        raise AssertionError("full-size pixels were asked for")

    def luma(self) -> Luma:
        raise AssertionError("full-size pixels were asked for")

    def halved_gray(self, times: int) -> ImageArray:
        raise AssertionError("full-size pixels were asked for")


def test_detection_never_converts_full_size_pixels(make_model: MakeModel) -> None:
    OnnxDetector(make_model(LABELS, (64, 64))).detect(Frame("a", 0, 0.0, _SmallPicture()))


def test_the_description_says_what_was_used(make_model: MakeModel) -> None:
    model = make_model(LABELS, (96, 64))
    description = OnnxDetector(model, DetectParams(provider="cpu", intra_op_threads=1)).describe()
    assert description["input_size_px"] == [96, 64]
    assert description["classes"] == ["person", "car"]
    assert description["class_map"] == {"person": "worker", "car": "vehicle"}
    assert description["providers"] == ["CPUExecutionProvider"]
    assert len(description["sha256"]) == 64
    json.dumps(description)


@pytest.mark.parametrize("provider", ["cuda", "tensorrt", "openvino"])
def test_a_provider_that_is_not_installed_is_refused(make_model: MakeModel, provider: Provider) -> None:
    if provider in available_providers():
        pytest.skip(f"{provider} is installed here")
    with pytest.raises(MissingDependency, match=rf"the {provider} execution provider, found only cpu\. Install onnx"):
        OnnxDetector(make_model(LABELS, (64, 64)), DetectParams(provider=provider))


def test_a_provider_that_is_installed_but_does_not_start_is_refused(
    make_model: MakeModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "openvino" in available_providers():
        pytest.skip("openvino is installed here")
    installed = ["OpenVINOExecutionProvider", "CPUExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: installed)
    with (
        pytest.warns(UserWarning, match="not in available provider names"),
        pytest.raises(MissingDependency, match="does not start and leaves CPUExecutionProvider"),
    ):
        OnnxDetector(make_model(LABELS, (64, 64)), DetectParams(provider="openvino"))


@pytest.mark.parametrize("content", [b"", b"not a model", b"\x08\x07"])
def test_what_is_no_onnx_file_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.onnx").write_bytes(content)
    with pytest.raises(
        ModelError, match=r"an ONNX model at .*found what ONNX Runtime [\d.]+ cannot load \(.+\)\. Copy"
    ) as caught:
        OnnxDetector(tmp_path / "a.onnx")
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.onnx", tmp_path):
        with pytest.raises(ModelError, match="found no such file"):
            OnnxDetector(path)


def _changed(model: Path, folder: Path, metadata: dict[str, str | None]) -> Path:
    """Copy a model with other metadata; None removes a text."""
    copy = onnx.load(str(model))
    texts: dict[str, str | None] = {entry.key: entry.value for entry in copy.metadata_props} | metadata
    del copy.metadata_props[:]
    onnx.helper.set_model_props(copy, {key: value for key, value in texts.items() if value is not None})
    onnx.save(copy, str(folder / "changed.onnx"))
    return folder / "changed.onnx"


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ({"standoff_format": None}, "an ONNX file without their metadata"),
        ({"standoff_format": "2"}, "model format 1 in .*'2'"),
        ({"classes": None}, "readable model metadata .*KeyError"),
        ({"classes": "[1"}, "readable model metadata .*JSONDecodeError"),
        ({"input_size_px": "[64]"}, "readable model metadata .*ValueError"),
        ({"sources": "[]"}, "readable model metadata"),
        ({"preprocessing": '{"colour": "BGR"}'}, "preprocessing .*BGR"),
        ({"input_size_px": "[64, 96]"}, r"\[1, 3, 96, 64\].*found.*\[1, 3, 64, 64\]"),
        ({"classes": '["person"]'}, r"\[1, 64, 6\].*found.*\[1, 64, 7\]"),
        ({"classes": '["kite", "sheep"]'}, "found kite, sheep"),
    ],
)
def test_metadata_that_does_not_fit_is_refused_in_one_line(
    make_model: MakeModel, tmp_path: Path, metadata: dict[str, str | None], message: str
) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        OnnxDetector(_changed(make_model(LABELS, (64, 64)), tmp_path, metadata))
    assert "\n" not in str(caught.value)


def test_a_graph_with_other_tensors_is_refused(make_model: MakeModel, tmp_path: Path) -> None:
    model = onnx.load(str(make_model(LABELS, (64, 64))))
    identity = onnx.helper.make_node("Identity", ["x"], ["boxes"])
    flat = [onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [7]) for name in ("x", "boxes")]
    graph = onnx.helper.make_graph([identity], "other", flat[:1], flat[1:])
    other = onnx.helper.make_model(graph, opset_imports=model.opset_import, ir_version=model.ir_version)
    onnx.helper.set_model_props(other, {entry.key: entry.value for entry in model.metadata_props})
    onnx.save(other, str(tmp_path / "other.onnx"))
    with pytest.raises(ModelError, match=r"the tensors .*'picture'.* found .*'x': \[7\]"):
        OnnxDetector(tmp_path / "other.onnx")


def test_a_network_that_gives_nan_is_an_error_not_an_empty_site(make_model: MakeModel, tmp_path: Path) -> None:
    model = onnx.load(str(make_model(LABELS, (64, 64))))
    for tensor in model.graph.initializer:
        values = np.full_like(onnx.numpy_helper.to_array(tensor), np.nan)
        if tensor.data_type == onnx.TensorProto.FLOAT:
            tensor.CopyFrom(onnx.numpy_helper.from_array(values, tensor.name))
    onnx.save(model, str(tmp_path / "nan.onnx"))
    with pytest.raises(ModelError, match=r"numbers from nan\.onnx, found NaN"):
        OnnxDetector(tmp_path / "nan.onnx").detect(_frame((64, 64)))


@pytest.mark.shared
def test_people_in_a_real_picture_are_found_once_with_and_without_slices(shared_data: Path, tmp_path: Path) -> None:
    folder, name = shared_data / "weights" / "yolo-fastest-1.1-xl", "yolo-fastest-1.1-xl"
    files = folder / f"{name}.cfg", folder / f"{name}.weights", folder / "coco.names"
    export_darknet(*files, (384, 288), tmp_path / "a.onnx")
    video = cv2.VideoCapture(str(shared_data / "pets2009" / "vtest.avi"))
    _, image = video.read()
    video.release()
    for slices in ((1, 1), (2, 2)):
        params = DetectParams(score_threshold=0.5, slices=slices)
        found = OnnxDetector(tmp_path / "a.onnx", params).detect(frame_from_array(np.asarray(image, np.uint8)))
        workers = found[found.class_id == WORKER].xyxy_px
        for foot_px in ((661.0, 319.0), (268.0, 304.0), (515.0, 228.0)):  # read off the picture
            near = np.abs((workers[:, [0, 3]] + workers[:, [2, 3]]) / 2 - foot_px).max(axis=1) < 12
            assert near.sum() == 1


def test_a_small_thing_seen_roughly_in_the_frame_and_well_in_a_slice_is_one_thing(make_model: MakeModel) -> None:
    model, frame = make_model(LABELS, (64, 64)), _frame((512, 512), (20, 20, 20, YELLOW))
    roughly = OnnxDetector(model).detect(frame)
    np.testing.assert_allclose(roughly.xyxy_px, [[-0.5, -0.5, 63.5, 63.5]], atol=1e-4)
    # A cell of a slice is 42.75 px: it overlaps the frame's cell of 64 px by 0.446, which is no duplicate.
    sliced = OnnxDetector(model, DetectParams(slices=(2, 2), slice_overlap=0.5)).detect(frame)
    np.testing.assert_allclose(sliced.xyxy_px, [[-0.5, -0.5, 42.25, 42.25]], atol=1e-4)
