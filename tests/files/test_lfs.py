"""Wherever a file is read that may lie in Git LFS, its pointer is called what it is."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from pointers import POINTER

from standoff.core.errors import StandoffError
from standoff.files.lfs import is_pointer
from standoff.labels.pictures import canvas_of
from standoff.labels.source import BadPicture
from standoff.stages.detect import OnnxDetector
from standoff.stages.frames import open_source
from standoff.stages.ground import read_boards

READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "model": ("m.onnx", OnnxDetector),
    "film": ("film.mp4", lambda path: open_source(path).describe()),
    "picture": ("0.jpg", lambda path: open_source(path.parent, fps=1.0).describe()),
    "board": ("0.jpg", lambda path: read_boards([path], (7, 6))),
}


@pytest.mark.parametrize("kind", READERS)
def test_a_pointer_is_named_with_what_to_do(tmp_path: Path, kind: str) -> None:
    name, read = READERS[kind]
    (tmp_path / name).write_text(POINTER)
    with pytest.raises(StandoffError) as caught:
        read(tmp_path / name)
    line = str(caught.value)
    assert "\n" not in line
    assert re.search(rf"{re.escape(name)}.*a Git LFS pointer, not the file[.:] [Rr]un `git lfs pull`", line)


def test_a_labelled_picture_that_is_a_pointer_is_counted_with_the_reason(tmp_path: Path) -> None:
    path = tmp_path / "0.jpg"
    path.write_text(POINTER)
    with pytest.raises(BadPicture, match="a Git LFS pointer, not the file"):
        canvas_of(path, None, marked=True)


def test_what_is_no_pointer_is_none(tmp_path: Path) -> None:
    contents = {"a": b"", "b": b"version 2\n", "c": POINTER.encode()[:30], "d": b"\xef\xbb\xbf" * 99}
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
        assert not is_pointer(tmp_path / name)
    assert not is_pointer(tmp_path)
    assert not is_pointer(tmp_path / "none")
