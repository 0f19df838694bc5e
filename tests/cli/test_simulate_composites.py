from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from cli.calling import Call

_SMALL = ("--images", 1, "--size", "160x90", "--processes", 1, "--quiet")


def test_one_command_makes_a_data_set(opengl: None, call: Call, tmp_path: Path) -> None:
    (tmp_path / "ground").mkdir()
    photo = np.random.default_rng(0).integers(80, 120, (300, 500, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "ground" / "a-1.jpg"), photo)
    out = tmp_path / "out"
    code, text, _ = call("simulate", "composites", "--backgrounds", f"{tmp_path}/ground:nadir", *_SMALL, "--out", out)
    assert code == 0 and "1 pictures" in text
    assert [path.name for path in out.glob("images/train/*")] == ["c0-a-00000.jpg"]
    assert (out / "data.yaml").is_file() and (out / "labels" / "train" / "c0-a-00000.txt").is_file()


@pytest.mark.parametrize(
    "words",
    [
        ("--backgrounds", "absent"),
        ("--backgrounds", "absent.yaml"),
        ("--backgrounds", ".:sideways"),
        ("--backgrounds", ".", "--seed", -1),
        ("--backgrounds", ".", "--size", "wide"),
    ],
)
def test_a_wrong_option_is_one_line_and_writes_nothing(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[object, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = call("simulate", "composites", "--images", 1, *words, "--out", tmp_path / "out")
    assert code == 2 and out == "" and len(err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
