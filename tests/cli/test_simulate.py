from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import moderngl
import pytest
from cli.calling import Call
from laws import few

from standoff_sim.clip.presets import MAX_SEED, PRESETS

_CLIP = ("--frames", 1, "--size", "160x90", "--processes", 1)
_SET = ("simulate", "dataset", "--images", 1, "--size", "160x90", "--processes", 1, "--seed", 24)


@pytest.fixture(autouse=True)
def bare_sites(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out most of what lies about on a site: its making takes longest."""
    bare = {name: replace(preset, clutter=0.05) for name, preset in PRESETS.items()}
    monkeypatch.setattr("standoff_sim.clip.presets.PRESETS", bare)


def _is_one_line(text: str) -> bool:
    return len(text.strip().splitlines()) == 1 and "Traceback" not in text


def test_the_list_names_every_preset(call: Call) -> None:
    code, out, _ = call("simulate", "--list")
    assert code == 0
    assert all(name in out for name in PRESETS)


def test_without_anything_it_explains_itself(call: Call) -> None:
    code, out, _ = call("simulate")
    assert code == 0
    assert "Usage: standoff simulate" in out


@pytest.mark.parametrize(
    "words",
    [
        ("no-such-preset",),
        ("mobile", "--size", "161x90"),
        ("mobile", "--size", "wide"),
        ("mobile", "--seed", -1),
        ("mobile", "--seed", MAX_SEED + 1),
        ("mobile", "--frames", 0),
        ("mobile", "--fps", 0),
        ("mobile", "--altitude", 3),
        ("mobile", "--pitch", 95),
        ("mobile", "--stature", 0.9),
        ("mobile", "--stooping", 1.5),
        ("dataset", "--images", 1, "--size", "160x91"),
        ("dataset", "--images", 1, "--seed", MAX_SEED + 1),
    ],
)
def test_a_wrong_option_is_one_line_and_writes_nothing(call: Call, tmp_path: Path, words: tuple[object, ...]) -> None:
    code, out, err = call("simulate", *words, "--out", tmp_path / "out")
    assert code == 2 and out == "" and _is_one_line(err)
    assert list(tmp_path.iterdir()) == []


def test_an_install_without_the_simulator_is_told_so_in_one_line() -> None:
    # In a process of its own: the verbs are joined when the command line is imported.
    code = """
import importlib.metadata, importlib.util
joined, found = importlib.metadata.entry_points, importlib.util.find_spec
importlib.metadata.entry_points = lambda **kind: () if kind.get("group") == "standoff.verbs" else joined(**kind)
importlib.util.find_spec = lambda name, *more: None if name == "standoff_sim" else found(name, *more)
import sys
sys.argv = ["standoff", "simulate", "mobile", "--seed", "3"]
from standoff.cli import main
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "no package standoff-sim" in done.stderr and "pip install ./simulator" in done.stderr


@pytest.mark.parametrize("words", [("mobile", *_CLIP), _SET[1:]])
def test_a_machine_without_opengl_is_told_so_in_one_line(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[object, ...]
) -> None:
    def fail(**_: object) -> None:
        raise RuntimeError("libEGL.so.1 not loaded")

    monkeypatch.setattr(moderngl, "create_standalone_context", fail)
    monkeypatch.setattr(moderngl, "create_context", fail)
    code, _, err = call("simulate", *words, "--out", tmp_path / "out")
    assert code == 2 and _is_one_line(err) and "EGL" in err
    assert list(tmp_path.iterdir()) == []


def test_a_clip_appears_silently_and_is_replaced_only_when_asked(opengl: None, call: Call, tmp_path: Path) -> None:
    words = ("simulate", "stationary-15", "--out", tmp_path / "clip", *_CLIP)
    code, out, err = call(*words)
    assert code == 0 and "video.mp4" in out
    assert err == "", "no progress bar where there is no terminal"
    before = (tmp_path / "clip" / "truth.parquet").read_bytes()
    code, _, err = call(*words, "--seed", 1)
    assert code == 2 and _is_one_line(err) and "--overwrite" in err
    assert (tmp_path / "clip" / "truth.parquet").read_bytes() == before
    assert call(*words, "--seed", 1, "--overwrite")[0] == 0
    assert (tmp_path / "clip" / "truth.parquet").read_bytes() != before


@pytest.mark.live
def test_the_truth_alone_needs_no_opengl_and_says_what_it_is(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(moderngl, "create_context")
    monkeypatch.delattr(moderngl, "create_standalone_context")
    code, out, err = call("simulate", "virtual", "--truth-only", "--out", tmp_path / "clip", *_CLIP)
    assert code == 0 and "without pictures" in out and err == ""
    assert (tmp_path / "clip" / "detections.parquet").is_file()
    assert not (tmp_path / "clip" / "video.mp4").exists()


@pytest.mark.parametrize("layout", few(["yolo", "coco"]))
def test_a_data_set_appears(opengl: None, call: Call, tmp_path: Path, layout: str) -> None:
    code, out, err = call(*_SET, "--layout", layout, "--out", tmp_path / "set")
    assert code == 0 and out.startswith("1 picture") and err == ""
    assert len(list((tmp_path / "set" / "images").glob("*/*.jpg"))) == 1
    assert (tmp_path / "set" / ("labels" if layout == "yolo" else "annotations")).is_dir()


def test_a_folder_with_files_is_kept(call: Call, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    code, _, err = call(*_SET, "--out", tmp_path, "--overwrite")
    assert code == 2 and _is_one_line(err) and "mine.txt" in err
    assert (tmp_path / "mine.txt").read_text() == "keep"
