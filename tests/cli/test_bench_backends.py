from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from cli.calling import Call
from square_detector import draw_squares, write_detector
from training.small_runs import CFG, write_data

from standoff.evaluation.backends import Agreement, ProviderTrial


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    folder = tmp_path / "pictures"
    folder.mkdir()
    for number in range(3):
        cv2.imwrite(str(folder / f"{number}.png"), draw_squares(rng, 8)[0])
    return folder


def test_a_line_a_provider_and_1_where_one_differs(
    call: Call, pictures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = write_detector(tmp_path)
    code, out, err = call("bench", pictures, "--providers", "--model", model, "--json", tmp_path / "found.json")
    assert code == 0, err
    assert "OK" in out
    found = json.loads((tmp_path / "found.json").read_text())
    assert [one["provider"] for one in found["providers"]] == ["cpu", "cuda", "tensorrt", "openvino"]
    assert found["providers"][0]["picture_ms"]["median_ms"] > 0
    far = ProviderTrial("cuda", Agreement(0.01, 0.0, 7))
    monkeypatch.setattr("standoff.evaluation.backends.compare_providers", lambda *_, **__: iter([far]))
    code, out, _ = call("bench", pictures, "--providers", "--model", model)
    assert code == 1 and "DIFFERS" in out


def test_a_training_step_of_a_plan_is_compared(call: Call, tmp_path: Path) -> None:
    write_data(tmp_path / "blocks")
    (tmp_path / "small.cfg").write_text(CFG)
    train = {"batch": 2, "size_px": [96, 64], "workers": 0, "augment": {"mosaic": 0.0}}
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump({"data": "blocks", "arch": "small.cfg", "train": train}))
    code, out, err = call("bench", "--training", tmp_path / "plan.yaml")
    assert code == 0, err
    assert "a training step of plan.yaml" in out and "OK" in out


def test_without_a_source_there_is_nothing_to_time(call: Call) -> None:
    code, _, err = call("bench")
    assert code == 2 and "Name one" in err
