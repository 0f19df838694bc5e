from __future__ import annotations

from pathlib import Path

from cli.calling import Call
from training.test_join import write_models


def test_the_verb_joins_and_explains_a_mistake(call: Call, tmp_path: Path) -> None:
    first, second = write_models(tmp_path, 1, 2)
    out = tmp_path / "joined.onnx"
    code, text, _ = call("join", first, f"{second}=all, worker:0.5", "--out", out)
    assert code == 0 and "joined.onnx" in text and out.is_file()
    code, _, err = call("join", first, f"{second}=crane", "--out", tmp_path / "none.onnx")
    assert code == 2 and "crane" in err and not (tmp_path / "none.onnx").exists()
    code, _, err = call("join", first, f"{second}=worker:half", "--out", tmp_path / "none.onnx")
    assert code == 2 and "CLASS:FACTOR" in err
