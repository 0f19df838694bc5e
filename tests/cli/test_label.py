from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli.calling import Call
from square_detector import draw_squares, write_detector

from standoff.clips.reviews import Review, add_review


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for number in range(20):
        cv2.imwrite(str(folder / f"{number}.png"), draw_squares(np.random.default_rng(number), 6)[0])
    return folder


def test_frames_are_chosen_and_told(call: Call, pictures: Path, tmp_path: Path) -> None:
    model = write_detector(tmp_path)
    code, out, err = call("label", pictures, "--fps", 1, "--model", model, "--out", tmp_path / "out", "--frames", 6)
    assert code == 0, err
    assert "6 of 20 frames" in out and "contact_sheet.png" in out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"images", "coco.json", "label_studio.json", "contact_sheet.png"}
    images = json.loads((tmp_path / "out" / "coco.json").read_text())["images"]
    assert {image["file_name"] for image in images} == {path.name for path in (tmp_path / "out" / "images").iterdir()}


def test_only_the_format_asked_for_is_written(call: Call, pictures: Path, tmp_path: Path) -> None:
    words = ("label", pictures, "--fps", 1, "--model", write_detector(tmp_path), "--frames", 2, "--quiet")
    for layout, file in (("coco", "coco.json"), ("label-studio", "label_studio.json")):
        code, out, _ = call(*words, "--out", tmp_path / layout, "--format", layout)
        assert (code, out) == (0, "")
        assert {path.name for path in (tmp_path / layout).iterdir()} == {"images", file, "contact_sheet.png"}


def test_a_folder_is_replaced_only_when_told(call: Call, pictures: Path, tmp_path: Path) -> None:
    words = ("label", pictures, "--fps", 1, "--model", write_detector(tmp_path), "--out", tmp_path / "out", "--frames")
    assert call(*words, 3)[0] == 0
    code, _, err = call(*words, 2)
    assert code == 2 and "--overwrite" in err
    assert len(list((tmp_path / "out" / "images").iterdir())) == 3
    assert call(*words, 2, "--overwrite")[0] == 0
    assert len(list((tmp_path / "out" / "images").iterdir())) == 2


def test_frames_without_any_box_are_said_to_be_so(call: Call, tmp_path: Path) -> None:
    (tmp_path / "dark").mkdir()
    for number in range(4):
        cv2.imwrite(str(tmp_path / "dark" / f"{number}.png"), np.full((96, 128, 3), 20 * number, np.uint8))
    model = write_detector(tmp_path)
    code, out, _ = call("label", tmp_path / "dark", "--fps", 1, "--model", model, "--out", tmp_path / "out")
    assert code == 0
    assert "saw nothing" in out


def test_bad_input_of_label_leaves_no_folder(call: Call, pictures: Path, tmp_path: Path) -> None:
    model = write_detector(tmp_path)
    (tmp_path / "no.mp4").write_bytes(b"nothing" * 100)
    for words, told in (
        ((tmp_path / "none.mp4", "--model", model), "none.mp4"),
        ((tmp_path / "no.mp4", "--model", model), "no.mp4"),
        ((pictures, "--model", model), "fps"),
        ((pictures, "--fps", 1, "--model", tmp_path / "none.onnx"), "none.onnx"),
        ((pictures, "--fps", 1, "--model", model, "--threshold", 1), "--threshold"),
    ):
        code, out, err = call("label", *words, "--out", tmp_path / "out")
        assert (code, out, err.count("\n")) == (2, "", 1), err
        assert told in err
        assert not (tmp_path / "out").exists()


def test_what_was_called_a_false_alarm_comes_first(call: Call, pictures: Path, tmp_path: Path) -> None:
    model, run = write_detector(tmp_path), tmp_path / "run"
    run.mkdir()
    words = ("label", pictures, "--fps", 1, "--model", model, "--frames", 3, "--every", 5, "--review", run)
    code, _, err = call(*words, "--out", tmp_path / "none")
    assert code == 2 and "false alarms" in err and "standoff open" in err
    for hazard_id, verdict, time_s in (("a", "false_alarm", 7.0), ("b", "right", 9.0), ("c", "false_alarm", 13.0)):
        add_review(run, Review(hazard_id, verdict, time_s, "a\nlorry" if hazard_id == "a" else ""))  # type: ignore[arg-type]
    add_review(run, Review("c", "unsure", 13.0))
    code, out, err = call(*words, "--out", tmp_path / "out")
    assert code == 0, err
    names = {path.name for path in (tmp_path / "out" / "images").iterdir()}
    assert "pictures_000007.jpg" in names and "pictures_000013.jpg" not in names and len(names) == 3
    assert "false alarm" in out
