from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import given
from hypothesis import strategies as st
from square_detector import SIZE_PX, draw_squares, write_data, write_detector
from tolerances import HALF_WEIGHTS, INT8_SCORE

from standoff.core.errors import DataError, ModelError, OutputError
from standoff.core.finding import WorkerFinding
from standoff.files.fingerprint import file_sha256
from standoff.labels import LabelledData, LabelledPicture, Split, read_data
from standoff.labels.site_classes import to_site_classes
from standoff.stages.detect import DetectParams, Letterbox, ModelCard, Network, OnnxDetector
from standoff.stages.frames import frame_from_array
from standoff.training.quantization import quantize
from standoff.training.quantization.gate import LEAST_TRUTHS, ClassLoss, Loss
from standoff.training.quantization.half_precision import store_half
from standoff.training.quantization.int8 import Int8Network, Method
from standoff.training.quantization.onnx_file import read_own_model, tell_finding
from standoff.training.quantization.quantize import (
    QuantizationPlan,
    QuantizationRefused,
    QuantizationReport,
    divide_pictures,
    quantize_model,
)


@contextmanager
def _quiet(what: str, total: int) -> Generator[Callable[[], None], None, None]:
    yield lambda: None


@pytest.fixture(scope="module")
def squares(tmp_path_factory: pytest.TempPathFactory) -> LabelledData:
    return to_site_classes(read_data(write_data(tmp_path_factory.mktemp("data"), train=20, val=40)))


def _quantize(
    model: Path, data: LabelledData, plan: QuantizationPlan | None = None
) -> tuple[QuantizationReport, onnx.ModelProto]:
    out = model.with_name("int8.onnx")
    report = quantize_model(model, data, out, plan or QuantizationPlan(calibration_pictures=10), _quiet)
    return report, onnx.load(str(out))


@pytest.mark.parametrize("method", ["minmax", pytest.param("entropy", marks=pytest.mark.live), "percentile"])
def test_an_int8_model_finds_what_the_float_model_finds(tmp_path: Path, squares: LabelledData, method: Method) -> None:
    model = write_detector(tmp_path, passing=2)
    plan = QuantizationPlan(calibration_pictures=10, method=method)
    report, _ = _quantize(model, squares, plan)
    assert not report.best.loss.complaints
    assert report.calibration_pictures == 10 and report.deciding_pictures == 40
    float_model, int8_model = (OnnxDetector(path, DetectParams(0.01)) for path in (model, tmp_path / "int8.onnx"))
    for seed in range(3):
        frame = frame_from_array(draw_squares(np.random.default_rng(seed), 6)[0])
        expected, found = float_model.detect(frame), int8_model.detect(frame)
        found_score = {
            tuple(box): score for box, score in zip(found.xyxy_px.round().tolist(), found.score, strict=True)
        }
        for box, score in zip(expected.xyxy_px.round().tolist(), expected.score.tolist(), strict=True):
            assert score < 0.1 or found_score[tuple(box)] == pytest.approx(score, abs=INT8_SCORE)


def test_weights_are_int8_by_channel_and_the_decoding_stays_in_float(tmp_path: Path, squares: LabelledData) -> None:
    _, int8 = _quantize(write_detector(tmp_path, passing=2), squares)
    graph = int8.graph
    makers = {name: node for node in graph.node for name in node.output}
    tensors = {tensor.name: tensor for tensor in graph.initializer}
    for node in graph.node:
        if node.op_type == "Conv":
            weight = makers[node.input[1]]
            assert weight.op_type == "DequantizeLinear"
            assert tensors[weight.input[0]].data_type == onnx.TensorProto.INT8
            assert tensors[weight.input[1]].dims == [tensors[weight.input[0]].dims[0]]
        if node.op_type in ("Sigmoid", "Exp", "Slice"):
            assert makers[node.input[0]].op_type not in ("QuantizeLinear", "DequantizeLinear")


def test_the_card_goes_along_and_names_the_float_model(tmp_path: Path, squares: LabelledData) -> None:
    model = write_detector(tmp_path)
    _, int8 = _quantize(model, squares)
    before, after = (
        ModelCard.from_metadata({entry.key: entry.value for entry in one.metadata_props}, "model")
        for one in (onnx.load(str(model)), int8)
    )
    assert after == replace(before, sources={**before.sources, "squares.onnx": file_sha256(model)})


def test_layers_that_cannot_be_quantised_stay_in_float(tmp_path: Path, squares: LabelledData) -> None:
    model = write_detector(tmp_path, passing=12, loud=[0])
    report, _ = _quantize(model, squares)
    assert [bool(attempt.loss.complaints) for attempt in report.attempts] == [True, True, True, False]
    loud = Int8Network(model, tmp_path).layers[:2]
    assert set(loud) < set(report.best.recipe.float_layers)


def test_a_model_that_loses_too_much_is_refused_and_nothing_is_written(tmp_path: Path, squares: LabelledData) -> None:
    model = write_detector(tmp_path, passing=6, loud=range(7))
    before = sorted(tmp_path.iterdir())
    with pytest.raises(QuantizationRefused, match="mAP falls from") as refused:
        _quantize(model, squares)
    assert sorted(tmp_path.iterdir()) == before
    report = refused.value.report
    assert report is not None and len(report.attempts) == 5
    assert report.to_dict()["accepted"] is False


def test_a_corrupt_picture_is_left_out_and_named(tmp_path: Path) -> None:
    folder = write_data(tmp_path / "data", train=6, val=30)
    cut = folder / "annotations" / "val_007.png"
    cut.write_bytes(cut.read_bytes()[:-2000])
    cut_too = folder / "annotations" / "train_000.png"
    cut_too.write_bytes(cut_too.read_bytes()[:-2000])
    report, _ = _quantize(write_detector(tmp_path), to_site_classes(read_data(folder)))
    assert report.unreadable == (cut_too, cut)
    assert report.deciding_pictures == 29


def test_only_pictures_that_can_be_read_calibrate(
    tmp_path: Path, squares: LabelledData, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = squares.splits["train"][:10]
    lost = tuple(replace(picture, path=tmp_path / "gone.png") for picture in train[:4])
    harmed: list[int] = []

    def by_harm(self: Int8Network, ranges: object, inputs: list[object], step: object) -> tuple[str, ...]:
        harmed.append(len(inputs))
        return self.layers

    monkeypatch.setattr(Int8Network, "by_harm", by_harm)
    data = LabelledData(squares.classes, {**squares.splits, "train": lost + train[4:]}, ())
    report, _ = _quantize(write_detector(tmp_path, passing=12, loud=[0]), data)
    assert report.calibration_pictures == 6 and harmed == [3]
    data = LabelledData(squares.classes, {**squares.splits, "train": lost}, ())
    with pytest.raises(DataError, match="found none of 4"):
        _quantize(write_detector(tmp_path), data)


def test_a_class_with_few_truths_is_named_and_does_not_decide(tmp_path: Path, squares: LabelledData) -> None:
    def thinned(picture: LabelledPicture, keep_vehicles: bool) -> LabelledPicture:
        kept = (picture.class_id == 0) | keep_vehicles
        return replace(
            picture,
            xyxy_px=picture.xyxy_px[kept],
            class_id=picture.class_id[kept],
            ignored=picture.ignored[kept],
            foot_px=picture.foot_px[kept],
        )

    val = tuple(thinned(picture, number < 4) for number, picture in enumerate(squares.splits["val"]))
    data = LabelledData(squares.classes, {**squares.splits, "val": val}, ())
    report, _ = _quantize(write_detector(tmp_path), data)
    counted = {one.name: one.counted for one in report.best.loss.classes}
    assert counted == {"worker": True, "vehicle": False}
    assert report.best.loss.before == report.best.loss.classes[0].before


def test_with_too_few_truths_nothing_is_decided(tmp_path: Path, squares: LabelledData) -> None:
    data = LabelledData(squares.classes, {**squares.splits, "val": squares.splits["val"][:5]}, ())
    with pytest.raises(DataError, match=f"at least {LEAST_TRUTHS}"):
        _quantize(write_detector(tmp_path), data)


def test_an_int8_model_is_not_quantised_again(tmp_path: Path, squares: LabelledData) -> None:
    _quantize(write_detector(tmp_path), squares)
    with pytest.raises(ModelError, match="int8"):
        quantize_model(tmp_path / "int8.onnx", squares, tmp_path / "again.onnx", QuantizationPlan(), _quiet)


def test_a_model_of_somebody_else_is_not_quantised(tmp_path: Path, squares: LabelledData) -> None:
    model = onnx.load(str(write_detector(tmp_path)))
    del model.metadata_props[:]
    onnx.save(model, str(tmp_path / "other.onnx"))
    with pytest.raises(ModelError, match="exported by standoff"):
        quantize_model(tmp_path / "other.onnx", squares, tmp_path / "int8.onnx", QuantizationPlan(), _quiet)


def test_a_folder_that_is_not_there_is_found_out_at_once(tmp_path: Path, squares: LabelledData) -> None:
    with pytest.raises(OutputError, match="existing folder"):
        quantize_model(write_detector(tmp_path), squares, tmp_path / "no" / "int8.onnx", QuantizationPlan(), _quiet)


def test_calibration_sees_what_the_detector_sees(
    tmp_path: Path, squares: LabelledData, monkeypatch: pytest.MonkeyPatch
) -> None:
    fed: list[np.ndarray] = []
    seen = Letterbox.network_input

    def listen(self: Letterbox, *arguments: object) -> np.ndarray:
        fed.append(seen(self, *arguments))  # type: ignore[arg-type]
        return fed[-1]

    monkeypatch.setattr(Letterbox, "network_input", listen)
    detector = OnnxDetector(write_detector(tmp_path))
    rng = np.random.default_rng(0)
    for width, height in ((128, 96), (200, 100), (64, 96), (127, 96)):
        image = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
        path = tmp_path / f"{width}x{height}.png"
        path.write_bytes(_png(image))
        picture = replace(squares.splits["val"][0], path=path, size_px=(width, height))
        detector.detect(frame_from_array(image))
        (laid,) = quantize._inputs([picture], SIZE_PX, lambda: None)
        np.testing.assert_array_equal(laid, fed[-2])


def _png(image: np.ndarray) -> bytes:
    import cv2

    return bytes(cv2.imencode(".png", image)[1])


@given(
    train=st.integers(0, 30),
    val=st.lists(st.sampled_from("abcdef"), min_size=0, max_size=30),
    wanted=st.integers(1, 40),
    split=st.sampled_from(["train", "val"]),
)
def test_no_scene_calibrates_and_decides(train: int, val: list[str], wanted: int, split: Split) -> None:
    data = _data({"train": [f"t{number % 7}" for number in range(train)], "val": val, "test": []})
    try:
        calibrating, deciding = divide_pictures(data, QuantizationPlan(split=split, calibration_pictures=wanted))
    except DataError:
        available = [picture.group for picture in data.splits[split]]
        assert not available or (len(set(available)) == 1 and (split == "train" or not train))
        return
    assert 0 < len(calibrating) <= wanted
    assert not {one.group for one in calibrating} & {one.group for one in deciding}
    assert set(deciding) <= set(data.splits[split]) and deciding


def test_calibration_is_spread_over_the_whole_split() -> None:
    data = _data({"train": [f"t{number}" for number in range(19)], "val": ["v"], "test": []})
    calibrating, _ = divide_pictures(data, QuantizationPlan(calibration_pictures=10))
    assert [one.path.stem for one in calibrating] == [f"train{number}" for number in range(0, 19, 2)]


def _data(groups: dict[Split, list[str]]) -> LabelledData:
    def picture(split: str, number: int, group: str) -> LabelledPicture:
        none = np.zeros(0, np.int64)
        return LabelledPicture(
            Path(f"{split}{number}.png"), (8, 8), np.zeros((0, 4)), none, none.astype(np.bool_), group, "drawn"
        )

    splits = {
        split: tuple(picture(split, number, group) for number, group in enumerate(names))
        for split, names in groups.items()
    }
    return LabelledData(("worker",), splits, ())


def _loss(*falls: float, counted: bool = True) -> Loss:
    classes = tuple(ClassLoss(f"c{k}", 60, 0.9, 0.9 - fall, 0.3, 0.8, 0.8, counted) for k, fall in enumerate(falls))
    return Loss(classes, 0.9, 0.9 - sum(falls) / len(falls))


def test_one_point_of_map_and_two_of_a_class_are_allowed_and_no_more() -> None:
    assert not _loss(0.01).complaints
    assert not _loss(0.02, 0.0).complaints
    assert _loss(0.0101).complaints == ("mAP falls from 90.0 to 89.0",)
    assert _loss(0.021, -0.01).complaints == ("AP of c0 falls from 90.0 to 87.9",)
    few = _loss(0.1, -0.1, counted=False)
    assert not few.complaints, "of 60, one truth and one step of the eleven are 10.8 points"
    assert _loss(0.11, -0.11, counted=False).complaints == ("AP of c0 falls from 90.0 to 79.0",)
    assert _loss(float("nan")).complaints


def test_ground_points_may_be_a_tenth_worse_and_no_more() -> None:
    def worse(before: float, after: float) -> Loss:
        return Loss((ClassLoss("worker", 60, 0.9, 0.9, 0.3, 0.8, 0.8, True, before, after),), 0.9, 0.9)

    assert not worse(0.1, 0.111).complaints and not worse(0.1, 0.05).complaints
    assert worse(0.1, 0.113).complaints == ("worker: ground points off by 0.113 box heights, not 0.100",)
    assert worse(0.1, 0.113).excess > 1.0 > worse(0.1, 0.111).excess
    assert not worse(math.nan, math.nan).complaints


@given(st.lists(st.floats(-0.1, 0.1), min_size=1, max_size=4), st.integers(0, 3), st.floats(0.001, 0.1))
def test_losing_more_is_never_forgiven(falls: list[float], row: int, more: float) -> None:
    worse = list(falls)
    worse[row % len(falls)] += more
    assert not _loss(*falls).complaints or _loss(*worse).complaints
    assert _loss(*worse).excess >= _loss(*falls).excess


def test_half_precision_halves_the_file_and_keeps_results(tmp_path: Path) -> None:
    model = write_detector(tmp_path, passing=2)
    store_half(model, tmp_path / "half.onnx")
    onnx.checker.check_model(onnx.load(str(tmp_path / "half.onnx")))
    metadata = [dict(_session(path).get_modelmeta().custom_metadata_map) for path in (model, tmp_path / "half.onnx")]
    assert metadata[0] == metadata[1]
    for seed in range(3):
        frame = frame_from_array(draw_squares(np.random.default_rng(seed), 6)[0])
        expected, found = (OnnxDetector(path).detect(frame) for path in (model, tmp_path / "half.onnx"))
        np.testing.assert_allclose(found.score, expected.score, atol=HALF_WEIGHTS)
        np.testing.assert_allclose(found.xyxy_px / 128, expected.xyxy_px / 128, atol=HALF_WEIGHTS)


def test_nothing_is_computed_in_half_precision(tmp_path: Path) -> None:
    """ONNX Runtime folds the casts when it loads the model: what it runs has float32 weights again."""
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(tmp_path / "run.onnx")
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
    half = write_detector(tmp_path, passing=2, half=True)
    onnxruntime.InferenceSession(str(half), options, providers=["CPUExecutionProvider"])
    graph = onnx.load(str(tmp_path / "run.onnx")).graph
    assert not [node for node in graph.node if node.op_type == "Cast"]
    assert not [tensor for tensor in graph.initializer if tensor.data_type == onnx.TensorProto.FLOAT16]


def test_half_precision_weights_can_be_quantised(tmp_path: Path, squares: LabelledData) -> None:
    report, int8 = _quantize(write_detector(tmp_path, half=True), squares)
    assert not report.best.loss.complaints
    assert not [tensor for tensor in int8.graph.initializer if tensor.data_type == onnx.TensorProto.FLOAT16]


def test_a_file_that_is_half_already_is_left_alone(tmp_path: Path) -> None:
    half = write_detector(tmp_path, half=True)
    content = half.read_bytes()
    with pytest.raises(ModelError, match="smaller already"):
        store_half(half, half)
    assert half.read_bytes() == content


def test_weights_too_large_for_half_precision_are_refused(tmp_path: Path) -> None:
    model = onnx.load(str(write_detector(tmp_path)))
    weight = next(tensor for tensor in model.graph.initializer if len(tensor.dims) == 4)
    weight.CopyFrom(onnx.numpy_helper.from_array(onnx.numpy_helper.to_array(weight) * np.float32(1e9), weight.name))
    onnx.save(model, str(tmp_path / "loud.onnx"))
    with pytest.raises(ModelError, match="half precision"):
        store_half(tmp_path / "loud.onnx", tmp_path / "half.onnx")
    assert not (tmp_path / "half.onnx").exists()


def _session(path: Path) -> onnxruntime.InferenceSession:
    return onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])


@pytest.mark.shared
def test_a_real_network_is_halved_to_half_its_size(tmp_path: Path, shared_data: Path) -> None:
    from standoff.training import export_darknet

    folder = shared_data / "weights" / "yolo-fastest-1.1-xl"
    cfg, weights = (folder / f"yolo-fastest-1.1-xl.{suffix}" for suffix in ("cfg", "weights"))
    export_darknet(cfg, weights, folder / "coco.names", (320, 320), tmp_path / "float.onnx")
    store_half(tmp_path / "float.onnx", tmp_path / "half.onnx")
    assert (tmp_path / "half.onnx").stat().st_size < 0.53 * (tmp_path / "float.onnx").stat().st_size
    shutil.copy(tmp_path / "half.onnx", tmp_path / "copy.onnx")
    assert Network(tmp_path / "copy.onnx", "cpu", 1).interface.classes[0] == "person"


def test_what_was_measured_of_workers_stands_in_the_file_and_goes_along(tmp_path: Path) -> None:
    model = write_detector(tmp_path)
    before, finding = read_own_model(model)[1], WorkerFinding((10.0, 20.0), (0.5, 0.9), measured=True)
    tell_finding(model, finding)
    assert read_own_model(model)[1] == replace(before, finds_workers={"height_px": (10.0, 20.0), "share": (0.5, 0.9)})
    store_half(model, tmp_path / "half.onnx")
    assert WorkerFinding.of_detector(OnnxDetector(tmp_path / "half.onnx").describe()).share == (0.5, 0.9)
    with pytest.raises(DataError, match="20 workers"):
        tell_finding(model, WorkerFinding())
