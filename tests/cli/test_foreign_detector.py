"""A run with a model that somebody else exported, and what others' libraries have to say meanwhile."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
import yaml
from cli.calling import Call
from cli.test_cli import make_video
from stages.detect.onnx_models import save_constant


def _save_model(path: Path, names: tuple[str, str]) -> Path:
    """Write a network in the layout of YOLOv8 that sees two things, wherever it looks."""
    rows = np.zeros((1, 6, 84), np.float32)
    rows[0, :, 0] = [20, 32, 6, 16, 0.9, 0.0]
    rows[0, :, 1] = [44, 36, 16, 16, 0.0, 0.8]
    model = onnx.load(str(save_constant(path, {"output0": rows}, (64, 64))))
    said = {"names": str(dict(enumerate(names))), "task": "detect", "imgsz": "[64, 64]", "stride": "32"}
    onnx.helper.set_model_props(model, said)
    onnx.save(model, str(path))
    return path


GUESS = "standoff: warning: nobody measured how small a worker the detector finds: which ground is watched is a guess\n"


@pytest.fixture
def settings(site: Path) -> Path:
    """Settings of a site, without its scripted detector."""
    plain = yaml.safe_load(site.read_text())
    del plain["replace"]
    site.write_text(yaml.safe_dump(plain), encoding="utf-8")
    return site


def test_a_run_with_a_model_of_ultralytics_needs_no_description(call: Call, settings: Path, tmp_path: Path) -> None:
    film = make_video(tmp_path / "site.mp4", 3)
    words = ("run", film, "--config", settings, "--out", tmp_path / "out", "--outputs", "detections", "--quiet")
    model = _save_model(tmp_path / "m.onnx", ("person", "excavator"))
    assert call(*words, "--model", model) == (0, "", GUESS)
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["model"]["family"] == "yolov8"
    assert record["model"]["class_map"] == {"person": "worker", "excavator": "excavator"}
    assert record["watched"]["measured"] is False and len(record["warnings"]) == 1


def test_names_of_ones_own_need_a_class_map_and_one_line_says_so(call: Call, settings: Path, tmp_path: Path) -> None:
    film = make_video(tmp_path / "site.mp4", 3)
    words = ("run", film, "--config", settings, "--out", tmp_path / "out", "--outputs", "detections", "--quiet")
    model = _save_model(tmp_path / "m.onnx", ("ouvrier", "pelle"))
    code, out, err = call(*words, "--model", model)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "found ouvrier, pelle. Say in a settings file which label is which class" in err
    told = {"class_map": {"ouvrier": "worker", "pelle": "excavator"}}
    settings.write_text(yaml.safe_dump(yaml.safe_load(settings.read_text()) | {"detect": told}), encoding="utf-8")
    assert call(*words, "--model", model) == (0, "", GUESS)


def test_a_description_that_contradicts_the_model_is_told_and_recorded(
    call: Call, settings: Path, tmp_path: Path
) -> None:
    film = make_video(tmp_path / "site.mp4", 3)
    model = _save_model(tmp_path / "m.onnx", ("person", "excavator"))
    model.with_suffix(".yaml").write_text("family: yolov3\nclasses: [person, excavator]")
    words = ("--config", settings, "--out", tmp_path / "out", "--outputs", "detections", "--quiet")
    code, _, err = call("run", film, *words, "--model", model)
    assert (code, err.count("\n"), GUESS in err) == (0, 2, True)
    assert "warning: m.yaml says family: yolov3, but" in err
    assert "family: yolov8" in json.loads((tmp_path / "out" / "run.json").read_text())["warnings"][0]


def test_other_libraries_neither_report_nor_speak(tmp_path: Path) -> None:
    # Where nothing can be written, ONNX Runtime's telemetry and matplotlib's cache would both complain.
    code = """
import logging, os, sys
from standoff.cli.app import _options
_options(version=False)
import standoff.stages.detect
logging.getLogger("matplotlib").warning("of the cache")
logging.getLogger("standoff.anything").warning("of the site")
sys.exit(os.environ["ORT_DISABLE_TELEMETRY"] != "1")
"""
    nowhere = str(tmp_path / "none" / "home")
    hidden = ("ORT_DISABLE_TELEMETRY", "XDG_CACHE_HOME")
    environment = {name: value for name, value in os.environ.items() if name not in hidden} | {"HOME": nowhere}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "standoff: of the site\n")
    assert not Path(nowhere).exists()
