from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from labelled_sets import by_stem, kinds, write_picture, write_yolo
from PIL import ExifTags, Image, ImageOps

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
        ("0 20 15 20 15\n", "labels cannot be placed"),
        ("0 50 50 50 50\n", "labels cannot be placed"),
        (_GOOD + "0 1e300 0.5 1e300 1\n", "labels cannot be placed"),
        ("0 1.5 0.5 0.5 0.5\n", "labels cannot be placed"),
        ("0 0.5 0.5 0 0.5\n", "labels cannot be placed"),
        ("0 10 10 20 10 20 20 10 20\n", "labels cannot be placed"),
        ("0 0.5 0.5 0.5 0.5 0.87\n", "unreadable labels"),
        ("0 0.5 0.5 0.5 0.5 0.4 0.4 1 0.3 0.3 1\n", "unreadable labels"),
        ("0 0.1 0.1 0.4 0.1 0.4 0.4 0.1 0.4\n0 0.1 0.1 0.4 0.1 0.4 0.4 0.1 0.4\n0 0.1 0.1 0.4 0.", "unreadable labels"),
        ("0 0.1 0.1 0.4 0.1 0.4 0.4 0.1\n", "unreadable labels"),
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
        ("0 -1.9 0.5 1.9 1\n0 0.5 0.5 1 1\n", "box outside the picture", [[-0.5, -0.5, 39.5, 29.5]]),
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
    except BadPicture as error:
        if error.problem.kind == "contradictory labels":
            assert len({mark[:4] for mark in marks}) < len(marks)
        elif "first pixels" in error.problem.found:
            meant = np.array(labels) != "cloud"
            assert np.abs(xyxy_px[meant]).max() <= 2.0 < min(size_px) / 8
        else:
            left_top = np.maximum(xyxy_px[:, :2], -0.5)
            right_bottom = np.minimum(xyxy_px[:, 2:], np.array(size_px) - 0.5)
            meant = np.array(labels) != "cloud"
            assert meant.any()
            assert (right_bottom - left_top < 0.5)[meant].any(axis=1).all()
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


def _turned_picture(path: Path, orientation: int, size_px: tuple[int, int] = (40, 30)) -> npt.NDArray[np.uint8]:
    """Write a picture of noise that EXIF data turn, and return its stored pixels, blue first."""
    pixels = np.random.default_rng(orientation).integers(0, 256, (size_px[1], size_px[0], 3), dtype=np.uint8)
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path, exif=exif)
    return pixels[:, :, ::-1]


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_turned_picture_whose_labels_do_not_tell_for_which_they_are_is_left_out(
    tmp_path: Path, orientation: int
) -> None:
    folder = write_yolo(tmp_path, _FILL)
    pixels = _turned_picture(folder / "images" / "turned.png", orientation)
    (folder / "labels" / "turned.txt").write_text(_GOOD)
    data = read_data(tmp_path)
    if orientation == 1:
        assert data.problems == []
        np.testing.assert_array_equal(load_picture(by_stem(data)["turned"]), pixels)
        return
    (problem,) = data.problems
    assert (problem.kind, problem.path.name, problem.skipped_picture) == ("turned by EXIF data", "turned.png", True)
    assert set(by_stem(data)) == set(_FILL)


@pytest.mark.parametrize("orientation", range(2, 9))
def test_a_turned_picture_without_labels_is_upright_as_pillow_has_it(tmp_path: Path, orientation: int) -> None:
    folder = write_yolo(tmp_path, _FILL)
    path = folder / "images" / "turned.png"
    _turned_picture(path, orientation)
    (folder / "labels" / "turned.txt").write_text("")
    data = read_data(tmp_path)
    assert [(problem.kind, problem.skipped_picture) for problem in data.problems] == [("turned by EXIF data", False)]
    picture = by_stem(data)["turned"]
    with Image.open(path) as stored:
        expected = np.asarray(ImageOps.exif_transpose(stored))[:, :, ::-1]
    assert picture.size_px == expected.shape[1::-1]
    np.testing.assert_array_equal(load_picture(picture), expected)
    assert load_picture(picture, 2).shape[:2] == tuple(side // 2 for side in expected.shape[:2])


@pytest.mark.parametrize("stated_px", [(40, 30), (30, 40)])
@pytest.mark.parametrize("orientation", range(2, 9))
def test_the_size_that_labels_state_tells_how_a_turned_picture_lies_for_them(
    tmp_path: Path, orientation: int, stated_px: tuple[int, int]
) -> None:
    images = []
    for number in range(1, 5):
        path = tmp_path / f"{number}.png"
        stored = _turned_picture(path, orientation if number == 1 else 1)
        size_px = stated_px if number == 1 else (40, 30)
        images.append({"id": number, "file_name": path.name, "width": size_px[0], "height": size_px[1]})
        if number == 1:
            turned, upright = stored, np.asarray(ImageOps.exif_transpose(Image.open(path)))[:, :, ::-1]
    boxes = [{"image_id": number, "category_id": 1, "bbox": [2, 3, 10, 20]} for number in range(1, 5)]
    content = {"images": images, "annotations": boxes, "categories": [{"id": 1, "name": "worker"}]}
    (tmp_path / "labels.json").write_text(json.dumps(content))
    data = read_data(tmp_path / "labels.json")
    (problem,) = data.problems
    assert problem.path.name == "1.png"
    if orientation >= 5:
        expected = turned if stated_px == (40, 30) else upright
        np.testing.assert_array_equal(load_picture(by_stem(data)["1"]), expected)
        assert (problem.kind, problem.skipped_picture) == ("turned by EXIF data", False)
    else:
        kind = "turned by EXIF data" if stated_px == (40, 30) else "size differs from labels"
        assert (problem.kind, problem.skipped_picture) == (kind, True)


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
