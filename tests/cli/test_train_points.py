from __future__ import annotations

from pathlib import Path

from cli.calling import Call


def test_pictures_that_are_not_there_are_refused_and_nothing_is_written(tmp_path: Path, call: Call) -> None:
    code, _, error = call("train-points", tmp_path / "none", "--out", tmp_path / "points.onnx")
    assert (code, error.count("\n")) == (2, 1)
    assert not (tmp_path / "points.onnx").exists()


def test_a_class_that_has_no_ground_point_is_refused(tmp_path: Path, call: Call) -> None:
    code, _, error = call("train-points", tmp_path, "--out", tmp_path / "points.onnx", "--only", "reference")
    assert (code, error.count("\n")) == (2, 1) and "reference" in error
