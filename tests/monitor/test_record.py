from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from stages.sinks.fake_site import FakeSite, ended

from standoff.core.errors import OutputError
from standoff.core.types import Outcome
from standoff.files.in_use import in_use
from standoff.monitor import RecordKeeper

NAN = float("nan")


def _refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is no JSON")


def test_the_record_says_running_until_the_end(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    about = {"configuration": {"detect": {"score": np.float64(0.4), "classes": (1, 2)}}, "x": NAN}
    folder = RecordKeeper(tmp_path, about)
    record = json.loads(path.read_text(), parse_constant=_refuse)
    assert record["status"] == "running"
    assert record["configuration"] == {"detect": {"score": 0.4, "classes": [1, 2]}}
    assert record["x"] is None
    assert {"standoff", "python", "numpy", "av", "onnxruntime", "platform"} <= set(record["versions"])
    folder.finish(Outcome("interrupted", "stopped by the operator", about={"x": 1}), {})
    record = json.loads(path.read_text())
    assert (record["status"], record["x"]) == ("interrupted", 1)
    assert [item.name for item in tmp_path.iterdir()] == ["run.json"]


def test_what_the_file_says_at_the_end_is_what_the_record_says(tmp_path: Path) -> None:
    folder = RecordKeeper(tmp_path, {})
    outcome = Outcome("failed", "model: out of memory", sink_errors={"video": "disk full"})
    stages = {"detect": {"median_ms": 20.0}}
    folder.finish(ended(FakeSite((64, 36)).results(100), outcome), stages)
    record = json.loads((tmp_path / "run.json").read_text(), parse_constant=_refuse)
    assert record == folder.record.to_dict()
    assert (record["status"], record["message"]) == ("failed", "model: out of memory")
    assert record["sink_errors"] == {"video": "disk full"}
    assert record["counts"]["no_ground_map"] == {"reference hidden & <not> found": 20}
    assert record["stages"] == stages


def test_the_folder_is_nobody_elses_until_the_end(tmp_path: Path) -> None:
    folder = RecordKeeper(tmp_path, {})
    with pytest.raises(OutputError, match="still going on"), in_use(tmp_path):
        pass
    folder.finish(Outcome("complete"), {})
    with in_use(tmp_path):
        pass
