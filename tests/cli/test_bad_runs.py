"""A source or an option that cannot be used is one line, exit status 2, and nothing on the disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli.calling import Call
from cli.test_cli import video as video


def _empty(folder: Path) -> Path:
    (folder / "empty.mp4").touch()
    return folder / "empty.mp4"


def _text(folder: Path) -> Path:
    (folder / "text.mp4").write_text("not a film\n" * 100)
    return folder / "text.mp4"


def _folder_with_strangers(folder: Path) -> Path:
    (folder / "pictures").mkdir()
    cv2.imwrite(str(folder / "pictures" / "1.png"), np.zeros((240, 320, 3), np.uint8))
    (folder / "pictures" / "notes.txt").write_text("hello")
    return folder / "pictures"


@pytest.mark.parametrize(
    ("make", "telling"),
    [
        (lambda folder: folder / "none.mp4", "none.mp4"),
        (_empty, "empty"),
        (_text, "text.mp4"),
        (_folder_with_strangers, "notes.txt"),
    ],
)
def test_a_bad_source_is_one_line_exit_2_and_no_folder(
    call: Call, site: Path, tmp_path: Path, make: Callable[[Path], Path], telling: str
) -> None:
    code, out, err = call("run", make(tmp_path), "--config", site, "--fps", 10, "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert err.startswith("standoff: expected ") and err.count("\n") == 1
    assert telling in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "telling"),
    [
        (("--ground", "square:nonsense"), "--ground square:SIDE"),
        (("--ground", "square:-1"), "square_m"),
        (("--ground", "polygon:0,0,2,0,1"), "6 lengths with commas for --ground polygon:X,Y"),
        (("--ground", "polygon:0,0,2,0,1,1,1"), "8 lengths with commas"),
        (("--ground", "polygon:0,0,1,1,1,0,0,1"), "cross each other"),
        (("--ground", "regular:2,1.5"), "3 to 12 corners"),
        (("--reference-box", "1,2,3"), "4 numbers"),
        (("--ground", "none", "--reference-box", "1,2,3,4"), "--ground square:SIDE"),
        (("--ground", "missing.yaml"), "missing.yaml"),
        (("--camera", "missing.yaml"), "missing.yaml"),
        (("--outputs", "film"), "film"),
        (("--every", "0"), "every"),
        (("--start", "100"), "100"),
        (("--config", "missing.yaml"), "missing.yaml"),
    ],
)
def test_a_bad_option_is_one_line_exit_2_and_no_folder(
    call: Call, video: Path, site: Path, tmp_path: Path, words: tuple[str, ...], telling: str
) -> None:
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out", *words)
    assert (code, out) == (2, "")
    assert err.startswith("standoff: expected ") and err.count("\n") == 1
    assert telling in err
    assert not (tmp_path / "out").exists()
