from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from labelled_sets import by_stem, kinds, write_picture, write_yolo
from PIL import Image

from standoff.core.errors import DataError
from standoff.labels import LabelledPicture, load_picture, read_data
from standoff.labels.checks import check_boxes
from standoff.labels.source import BadPicture, SourcePicture

_GOOD = "0 0.5 0.5 0.5 0.5\n"
_FILL = {f"good-{number}": _GOOD for number in range(3)}


def test_an_empty_label_file_is_a_picture_without_objects(tmp_path: Path) -> None:
    data = read_data(write_yolo(tmp_path, {"empty": "", "blank": "\n \n", "marked": _GOOD}))
    assert data.problems == []
    assert {stem: len(picture.xyxy_px) for stem, picture in by_stem(data).items()} == {
        "empty": 0,
        "blank": 0,
        "marked": 1,
    }


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        ("0 0.5 0.5 0.5\n", "unreadable labels"),
        ("0 0.5 0.5 0.5 wide\n", "unreadable labels"),
        ("0 nan 0.5 0.5 0.5\n", "unreadable labels"),
        ("0 inf 0.5 0.5 0.5\n", "unreadable labels"),
        (b"\xff\xfe\x00\x80", "unreadable labels"),
        ("2 0.5 0.5 0.5 0.5\n", "unknown class id"),
        ("-1 0.5 0.5 0.5 0.5\n", "unknown class id"),
        ("0.5 0.5 0.5 0.5 0.5\n", "unknown class id"),
        (_GOOD + "1 0.5 0.5 0.5 0.5\n", "contradictory labels"),
        (_GOOD + "1 0.5005 0.4995 0.5 0.5\n", "contradictory labels"),
    ],
)
def test_bad_labels_cost_their_picture(tmp_path: Path, content: str | bytes, kind: str) -> None:
    data = read_data(write_yolo(tmp_path, {**_FILL, "bad": content}))
    assert set(by_stem(data)) == set(_FILL)
    (problem,) = data.problems
    assert (problem.kind, problem.path.stem, problem.skipped_picture) == (kind, "bad", True)


@pytest.mark.parametrize(
    ("content", "kind", "left"),
    [
        (_GOOD + _GOOD, "box marked twice", [[9.5, 7.0, 29.5, 22.0]]),
        (_GOOD + "0 0.501 0.499 0.5 0.5\n", "box marked twice", [[9.5, 7.0, 29.5, 22.0]]),
        (_GOOD + "0 0.5 0.5 0 0.5\n", "box without area", [[9.5, 7.0, 29.5, 22.0]]),
        (_GOOD + "0 0.5 0.5 -0.1 0.5\n", "box without area", [[9.5, 7.0, 29.5, 22.0]]),
        (_GOOD + "0 1.5 0.5 0.5 0.5\n", "box outside the picture", [[9.5, 7.0, 29.5, 22.0]]),
        ("0 1.0 0.5 0.5 0.5\n", "box cut at the picture's edge", [[29.5, 7.0, 39.5, 22.0]]),
        ("0 1e300 0.5 1e300 1\n0 0.5 0.5 1 1\n", "box outside the picture", [[-0.5, -0.5, 39.5, 29.5]]),
    ],
)
def test_bad_boxes_are_mended_or_dropped_and_said(
    tmp_path: Path, content: str, kind: str, left: list[list[float]]
) -> None:
    data = read_data(write_yolo(tmp_path, {"odd": content}))
    np.testing.assert_allclose(by_stem(data)["odd"].xyxy_px, left, atol=1e-9)
    (problem,) = data.problems
    assert (problem.kind, problem.skipped_picture) == (kind, False)


def test_pictures_that_cannot_be_read_are_named_and_counted(tmp_path: Path) -> None:
    folder = write_yolo(tmp_path, {**_FILL, "corrupt": _GOOD, "gone": _GOOD})
    (folder / "images" / "corrupt.png").write_bytes(b"\x89PNG\r\n\x1a\n and then nothing")
    (folder / "labels" / "gone.txt").unlink()
    data = read_data(folder)
    assert {problem.path.name: problem.kind for problem in data.problems} == {
        "corrupt.png": "unreadable picture",
        "gone.png": "label file missing",
    }
    assert set(by_stem(data)) == set(_FILL)


def test_a_set_of_which_more_than_half_is_skipped_is_refused(tmp_path: Path) -> None:
    half = write_yolo(tmp_path / "half", {"a": _GOOD, "b": _GOOD, "c": "x", "d": "5 0 0 1 1"})
    assert len(kinds(read_data(half))) == 2
    worse = write_yolo(tmp_path / "worse", {"a": _GOOD, "b": "x", "c": "x"})
    with pytest.raises(DataError, match=r"1 usable and 2 not: unreadable labels \(2"):
        read_data(worse)


_CORNER = st.floats(-60.0, 100.0)
_BOX = st.tuples(_CORNER, _CORNER, _CORNER, _CORNER, st.sampled_from(["worker", "digger", "tree", "cloud"]))


@given(st.lists(_BOX, max_size=6), st.tuples(st.integers(1, 60), st.integers(1, 60)))
def test_whatever_is_marked_what_is_left_lies_inside_and_has_an_area(
    marks: list[tuple[float, float, float, float, str]], size_px: tuple[int, int]
) -> None:
    xyxy_px = np.array([mark[:4] for mark in marks], np.float64).reshape(-1, 4)
    labels = tuple(mark[4] for mark in marks)
    picture = SourcePicture(Path("p.png"), size_px, labels, xyxy_px, np.zeros(len(marks), np.bool_))
    try:
        boxes = check_boxes(picture, {"worker": 0, "digger": 1, "tree": None})
    except BadPicture:
        assert len({mark[:4] for mark in marks}) < len(marks)
        return
    assert (boxes.xyxy_px >= -0.5).all()
    assert (boxes.xyxy_px <= np.tile(size_px, 2) - 0.5).all()
    assert (boxes.xyxy_px[:, :2] < boxes.xyxy_px[:, 2:]).all()
    assert len(boxes.xyxy_px) == len(boxes.class_id) == len(boxes.ignored) <= len(labels) - labels.count("cloud")
    # nothing is lost without a word
    lost = len(labels) - labels.count("cloud") - len(boxes.xyxy_px)
    assert bool(lost) <= bool(boxes.problems)
    # what was checked once is in order
    again = replace(
        picture,
        labels=tuple(
            "tree" if ignored else ("worker", "digger")[number]
            for number, ignored in zip(boxes.class_id, boxes.ignored, strict=True)
        ),
        foot_px=boxes.foot_px,
        xyxy_px=boxes.xyxy_px,
        ignored=boxes.ignored,
    )
    clipped_alike = len({tuple(box) for box in boxes.xyxy_px.tolist()}) < len(boxes.xyxy_px)
    if not clipped_alike:
        assert check_boxes(again, {"worker": 0, "digger": 1, "tree": None}).problems == ()


def _labelled(path: Path, size_px: tuple[int, int]) -> LabelledPicture:
    none = np.zeros(0, np.int64)
    return LabelledPicture(path, size_px, np.zeros((0, 4)), none, none.astype(np.bool_), "g", "s")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_pictures_are_taken_as_stored_whatever_exif_says(tmp_path: Path, orientation: int) -> None:
    pixels = np.random.default_rng(orientation).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    exif = Image.Exif()
    exif[274] = orientation
    (tmp_path / "images").mkdir()
    Image.fromarray(pixels).save(tmp_path / "images" / "turned.png", exif=exif)
    (tmp_path / "images" / "turned.txt").write_text(_GOOD)
    (tmp_path / "classes.txt").write_text("worker\n")
    picture = by_stem(read_data(tmp_path))["turned"]
    assert picture.size_px == (40, 30)
    np.testing.assert_array_equal(load_picture(picture), pixels[:, :, ::-1])


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".bmp", ".webp", ".tif"])
def test_pictures_load_as_opencv_reads_them(tmp_path: Path, suffix: str) -> None:
    path = write_picture(tmp_path / f"p{suffix}", (50, 20))
    np.testing.assert_array_equal(load_picture(_labelled(path, (50, 20))), cv2.imread(str(path)))


def test_a_grey_and_a_transparent_picture_have_three_channels(tmp_path: Path) -> None:
    for mode in ("L", "RGBA", "P"):
        path = tmp_path / f"{mode}.png"
        Image.new(mode, (9, 7)).save(path)
        assert load_picture(_labelled(path, (9, 7))).shape == (7, 9, 3)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".bmp", ".webp"])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.95])
def test_half_a_picture_is_refused(tmp_path: Path, suffix: str, share: float) -> None:
    path = write_picture(tmp_path / f"p{suffix}", (80, 60))
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * share)])
    with pytest.raises(DataError, match=f"p{suffix}"):
        load_picture(_labelled(path, (80, 60)))


def test_a_picture_of_another_size_than_its_header_said_is_refused(tmp_path: Path) -> None:
    path = write_picture(tmp_path / "p.png", (80, 60))
    with pytest.raises(DataError, match="found 80x60"):
        load_picture(_labelled(path, (60, 80)))
    path.unlink()
    with pytest.raises(DataError, match="No such file"):
        load_picture(_labelled(path, (80, 60)))
