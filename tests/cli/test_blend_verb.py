from __future__ import annotations

from pathlib import Path

from cli.calling import Call
from training.start.test_blend import write_weights


def test_the_verb_blends_and_explains_a_mistake(call: Call, tmp_path: Path) -> None:
    first, second = (write_weights(tmp_path, f"{seed}.weights", seed)[0] for seed in (1, 2))
    out, cfg = tmp_path / "c.weights", tmp_path / "small.cfg"
    assert call("blend", f"{first}=0.4", f"{second}=0.6", "--cfg", cfg, "--out", out)[0] == 0
    assert out.is_file()
    code, _, err = call("blend", f"{first}", "--cfg", cfg, "--out", out)
    assert code == 2 and "FILE.weights=SHARE" in err
