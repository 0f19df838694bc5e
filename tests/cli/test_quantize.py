from __future__ import annotations

import json
from pathlib import Path

import onnx
from cli.calling import Call
from square_detector import write_data, write_detector

from standoff.stages.detect import OnnxDetector


def test_a_detector_is_quantised_and_the_table_says_how_good_it_is(call: Call, tmp_path: Path) -> None:
    model, data = write_detector(tmp_path, passing=1), write_data(tmp_path / "data", train=8, val=25)
    code, out, err = call("quantize", model, "--data", data, "--out", tmp_path / "int8.onnx", "--calibration", 8)
    assert code == 0, err
    assert "AP worker" in out and "median ms" in out and "minmax calibration" in out
    assert OnnxDetector(tmp_path / "int8.onnx").describe()["family"] == "yolov3"


def test_what_loses_too_much_is_refused_in_one_line_and_reported(call: Call, tmp_path: Path) -> None:
    model = write_detector(tmp_path, passing=4, loud=range(5))
    data = write_data(tmp_path / "data", train=8, val=25)
    code, out, err = call("quantize", model, "--data", data, "--out", tmp_path / "int8.onnx", "--json")
    assert code == 2
    assert err.count("\n") == 1 and "mAP falls from" in err
    report = json.loads(out)
    assert report["accepted"] is False
    assert report["mean_ap11"]["float"] - report["mean_ap11"]["int8"] > 0.01
    assert not (tmp_path / "int8.onnx").exists()


def test_bad_input_of_quantize_is_told_in_one_line(call: Call, tmp_path: Path) -> None:
    model, data = write_detector(tmp_path), write_data(tmp_path / "data", train=4, val=6)
    other = onnx.load(str(model))
    del other.metadata_props[:]
    onnx.save(other, str(tmp_path / "other.onnx"))
    (tmp_path / "text.onnx").write_text("no model")
    for words, told in (
        ((tmp_path / "none.onnx", "--data", data), "none.onnx"),
        ((tmp_path / "text.onnx", "--data", data), "text.onnx"),
        ((tmp_path / "other.onnx", "--data", data), "exported by standoff"),
        ((model, "--data", tmp_path / "nothing"), "nothing"),
        ((model, "--data", data, "--split", "test"), "0 in test"),
        ((model, "--data", data), "at least 50"),
    ):
        code, out, err = call("quantize", *words, "--out", tmp_path / "int8.onnx")
        assert (code, out, err.count("\n")) == (2, "", 1), err
        assert told in err
        assert not (tmp_path / "int8.onnx").exists()


def test_export_can_halve_the_file(call: Call, tmp_path: Path) -> None:
    write_detector(tmp_path)
    words = [part for suffix in ("cfg", "weights", "names") for part in (f"--{suffix}", tmp_path / f"squares.{suffix}")]
    code, _, err = call("export", *words, "--out", tmp_path / "half.onnx", "--half")
    assert code == 0, err
    types = {tensor.data_type for tensor in onnx.load(str(tmp_path / "half.onnx")).graph.initializer}
    assert onnx.TensorProto.FLOAT16 in types
    assert OnnxDetector(tmp_path / "half.onnx").describe()["classes"] == ["worker", "vehicle"]
