"""Labels as other programs write them: read, or left out by name; never a picture that is said to be empty."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from labelled_sets import by_stem, kinds, write_coco, write_picture, write_yolo

from standoff.core.errors import DataError
from standoff.labels import Split, read_data
from standoff.labels.places import readings_of
from standoff.labels.yolo_rows import Unplaceable, read_rows

_SIDES = (64, 48)
_SHARE = st.floats(0.0, 1.0)


def boxes_of(text: str) -> list[list[float]]:
    """Return left, top, right, bottom of a label file's rows, in shares."""
    rows = read_rows(text)
    boxes: list[list[float]] = np.hstack([rows[:, 1:3] - rows[:, 3:5] / 2, rows[:, 1:3] + rows[:, 3:5] / 2]).tolist()
    return boxes


# --- lines of YOLO ---


@given(st.lists(st.tuples(_SHARE, _SHARE), min_size=3, max_size=40), st.integers(0, 90))
def test_a_polygon_gives_the_box_around_it(corners: list[tuple[float, float]], number: int) -> None:
    text = f"{number} " + " ".join(f"{x:.17g} {y:.17g}" for x, y in corners)
    values = [float(value) for value in text.split()]
    if len(values) % 3 == 2 and set(values[7::3]) <= {0.0, 1.0, 2.0}:
        return  # keypoints look like this
    around = [*np.min(corners, axis=0), *np.max(corners, axis=0)]
    np.testing.assert_allclose(boxes_of(text), [around], atol=1e-12)
    assert read_rows(text)[0, 0] == number


@pytest.mark.parametrize("keypoints", [2, 3, 5, 17])
def test_rows_of_pose_estimation_give_their_box_and_no_ground_point(keypoints: int) -> None:
    points = " ".join("0.4 0.4 2" for _ in range(keypoints))
    rows = read_rows(f"0 0.5 0.5 0.2 0.3 {points}\n")
    assert rows[0, :5].tolist() == [0.0, 0.5, 0.5, 0.2, 0.3]
    assert np.isnan(rows[0, 5:]).all()


@pytest.mark.parametrize("keypoints", [(1, 2), (1, 3), (4, 2), (2, 3)])
def test_what_data_yaml_says_of_keypoints_tells_them_from_a_polygon(tmp_path: Path, keypoints: tuple[int, int]) -> None:
    for number in range(3):
        write_picture(tmp_path / "images" / f"{number}.png", _SIDES, seed=number)
        row = "0 0.5 0.5 0.25 0.5 " + " ".join(["0.25 0.75 1"[: 9 if keypoints[1] == 2 else 11]] * keypoints[0])
        (tmp_path / "images" / f"{number}.txt").write_text(row)
    content = {"train": "images", "names": ["worker"], "kpt_shape": list(keypoints)}
    (tmp_path / "data.yaml").write_text(yaml.safe_dump(content))
    picture = by_stem(read_data(tmp_path))["1"]
    assert picture.xyxy_px.tolist() == [[23.5, 11.5, 39.5, 35.5]]
    if keypoints[0] == 1:
        assert picture.foot_px.tolist() == [[15.5, 35.5]]
    else:
        assert np.isnan(picture.foot_px).all()
    (tmp_path / "data.yaml").write_text(yaml.safe_dump(content | {"kpt_shape": [9, 3]}))
    with pytest.raises(DataError, match="for 9 keypoints"):
        read_data(tmp_path)
    (tmp_path / "data.yaml").write_text(yaml.safe_dump(content | {"kpt_shape": "many"}))
    with pytest.raises(DataError, match="`kpt_shape`"):
        read_data(tmp_path)


@given(st.lists(st.floats(2.1, 4000), min_size=4, max_size=4), st.sampled_from([5, 9]))
def test_pixels_are_no_shares(numbers: list[float], count: int) -> None:
    row = "0 " + " ".join(map(str, (numbers * 2)[: count - 1]))
    with pytest.raises(Unplaceable, match="pixels"):
        read_rows(row)


@pytest.mark.parametrize("like", ["0 0.5 0.5 0.2 0.3", "0 0.1 0.1 0.4 0.1 0.4 0.4 0.1 0.4"])
def test_no_cut_in_a_last_line_gives_another_box(like: str) -> None:
    whole = f"{like}\n{like}\n{like}\n"
    last = len(whole) - len(like)
    for end in range(last + len("0"), len(whole)):
        try:
            found = boxes_of(whole[:end])
        except ValueError:
            continue
        # Within its last number a line cannot be told from a shorter number.
        assert whole[:end].count(" ") == whole.count(" ")
        assert found[:2] == boxes_of(whole)[:2]


# --- sets ---


def box_in(image_id: object, bbox: list[float], category_id: object = 1, **more: Any) -> dict[str, Any]:
    return {"image_id": image_id, "category_id": category_id, "bbox": bbox} | more


def test_ids_written_as_text_are_the_numbers(tmp_path: Path) -> None:
    path = write_coco(tmp_path, [box_in(str(number), [1, 2, 10, 20], "2") for number in (1, 2, 3, 4)])
    data = read_data(path)
    assert data.problems == []
    for picture in by_stem(data).values():
        assert picture.xyxy_px.tolist() == [[0.5, 1.5, 10.5, 21.5]]
        assert data.classes[picture.class_id[0]] == "excavator"


def test_pictures_whose_annotations_may_be_lost_are_no_negatives(tmp_path: Path) -> None:
    path = write_coco(tmp_path, [box_in(f"{number}.png", [1, 2, 10, 20]) for number in (1, 2, 3, 4)])
    with pytest.raises(DataError, match=r"4 not: labels cannot be placed .*4 of pictures that it does not list"):
        read_data(path)
    boxes = [box_in(1, [1, 2, 10, 20]), box_in(2, [1, 2, 10, 20]), box_in(77, [1, 2, 10, 20])]
    data = read_data(write_coco(tmp_path, boxes))
    assert set(by_stem(data)) == {"1", "2"}


@pytest.mark.parametrize("more", [{"segmentation": [[10, 12, 30, 12, 30, 28]]}, {"area": 320}], ids=["outline", "area"])
def test_corners_in_the_place_of_width_and_height_are_told_by_the_outline(tmp_path: Path, more: dict[str, Any]) -> None:
    path = write_coco(tmp_path, [box_in(number, [10, 12, 30, 28], **more) for number in (1, 2, 3, 4)])
    with pytest.raises(DataError, match="xyxy, not xywh"):
        read_data(path)
    data = read_data(write_coco(tmp_path, [box_in(number, [10, 12, 20, 16], **more) for number in (1, 2, 3, 4)]))
    assert data.problems == []
    assert by_stem(data)["1"].xyxy_px.tolist() == [[9.5, 11.5, 29.5, 27.5]]


def test_an_annotation_without_a_box_has_that_of_its_outline(tmp_path: Path) -> None:
    outline = {"segmentation": [[10, 12, 30, 12, 30, 28], [8, 20, 9, 21, 9, 22]]}
    boxes = [{"image_id": number, "category_id": 1, **outline} for number in (1, 2, 3, 4)]
    assert by_stem(read_data(write_coco(tmp_path, boxes)))["2"].xyxy_px.tolist() == [[7.5, 11.5, 29.5, 27.5]]


_OBJECTS = [(2, 3, 12, 20), (30, 10, 50, 40), (45, 20, 63, 47), (20, 2, 44, 30)]


def test_corners_in_the_place_of_width_and_height_are_told_by_where_they_end(tmp_path: Path) -> None:
    boxes = [box_in(number, list(corners)) for number, corners in enumerate(_OBJECTS, 1)]
    with pytest.raises(DataError, match="the right and the lower edge, xyxy"):
        read_data(write_coco(tmp_path / "coco", boxes))
    lines = {
        str(number): "0 " + " ".join(f"{value / side}" for value, side in zip(corners, _SIDES * 2, strict=True))
        for number, corners in enumerate(_OBJECTS)
    }
    with pytest.raises(DataError, match="the right and the lower edge, xyxy"):
        read_data(write_yolo(tmp_path / "yolo", lines))


def test_things_at_the_edge_are_no_corners(tmp_path: Path) -> None:
    boxes = [box_in(1, [50, 30, 20, 30]), box_in(2, [-5, -5, 20, 20]), box_in(3, [2, 2, 5, 5])]
    data = read_data(write_coco(tmp_path, boxes))
    assert kinds(data) == ["box cut at the picture's edge"] * 2
    assert len(by_stem(data)) == 4


def write_voc(folder: Path, objects: Mapping[str, tuple[float, ...]], size_px: tuple[int, int] = _SIDES) -> Path:
    """Write a Pascal VOC folder of one object a picture."""
    (folder / "Annotations").mkdir(parents=True)
    for stem, corners in objects.items():
        write_picture(folder / "JPEGImages" / f"{stem}.jpg", _SIDES)
        tags = zip(("xmin", "ymin", "xmax", "ymax"), corners, strict=True)
        box = "".join(f"<{tag}>{value}</{tag}>" for tag, value in tags)
        (folder / "Annotations" / f"{stem}.xml").write_text(
            f"<annotation><filename>C:\\me\\set\\{stem}.jpg</filename><size><width>{size_px[0]}</width>"
            f"<height>{size_px[1]}</height></size><object><name>car</name><bndbox>{box}</bndbox></object></annotation>"
        )
    return folder


def test_widths_in_the_place_of_edges_are_told(tmp_path: Path) -> None:
    objects = {str(number): (x1, y1, x2 - x1, y2 - y1) for number, (x1, y1, x2, y2) in enumerate(_OBJECTS)}
    with pytest.raises(DataError, match="a width and a height, xywh"):
        read_data(write_voc(tmp_path, objects))


def test_shares_in_the_place_of_pixels_are_told(tmp_path: Path) -> None:
    shares = {str(number): (0.1, 0.1, 0.5, 0.6) for number in range(4)}
    with pytest.raises(DataError, match=r"4 not: labels cannot be placed .*shares of the picture where pixels"):
        read_data(write_voc(tmp_path / "voc", shares))
    with pytest.raises(DataError, match=r"4 not: labels cannot be placed .*shares of the picture where pixels"):
        read_data(write_coco(tmp_path / "coco", [box_in(number, [0.1, 0.1, 0.4, 0.5]) for number in range(1, 5)]))


def test_sizes_with_their_sides_swapped_are_the_reason_that_is_told(tmp_path: Path) -> None:
    objects = {str(number): corners for number, corners in enumerate(_OBJECTS)}
    with pytest.raises(DataError, match=r"size differs from labels .*64x48 .* say 48x64, width and height swapped"):
        read_data(write_voc(tmp_path, objects, _SIDES[::-1]))


def test_class_ids_from_one_are_refused_and_those_of_a_list_that_begins_at_one_are_not(tmp_path: Path) -> None:
    good = "0.5 0.5 0.2 0.2\n"
    lines = {"a": f"1 {good}", "b": f"2 {good}", "c": f"1 {good}", "d": f"1 {good}"}
    with pytest.raises(DataError, match=r"class ids 0 to 1 .*found 1 to 2"):
        read_data(write_yolo(tmp_path / "yolo", lines))
    boxes = [box_in(number, [1, 2, 10, 20], number - 1) for number in (1, 2, 3)]
    with pytest.raises(DataError, match=r"class ids 1 to 3 .*found 0 to 2"):
        read_data(write_coco(tmp_path / "coco", boxes))
    categories = [{"id": 1, "name": "worker"}, {"id": 1, "name": "lorry"}]
    with pytest.raises(DataError, match="1 of worker and lorry"):
        read_data(write_coco(tmp_path / "twice", [box_in(1, [1, 2, 10, 20])], categories=categories))


def test_a_byte_order_mark_takes_no_class(tmp_path: Path) -> None:
    folder = write_yolo(tmp_path, {"a": b"\xef\xbb\xbf1 0.5 0.5 0.2 0.2\n", "b": "0 0.5 0.5 0.2 0.2\n"})
    (folder / "classes.txt").write_bytes(b"\xef\xbb\xbfworker\r\nexcavator\r\n")
    data = read_data(folder)
    assert data.classes == ("worker", "excavator")
    assert {stem: picture.class_id.tolist() for stem, picture in by_stem(data).items()} == {"a": [1], "b": [0]}


# --- paths of other computers ---


@pytest.mark.parametrize(
    ("train", "val"),
    [
        (r"images\train", r"images\val"),
        (r"C:\Users\me\set\images\train", r"C:\Users\me\set\images\val"),
        ("/content/set/images/train", "/content/set/images/val"),
        ("../set/images/train", "../set/images/val"),
        ("train.txt", "val.txt"),
    ],
)
@pytest.mark.parametrize("root", [None, ".", "/content/set", r"D:\sets\set"])
def test_pictures_are_beside_the_labels_whatever_computer_they_were_on(
    tmp_path: Path, train: str, val: str, root: str | None
) -> None:
    for name in ("train", "val"):
        for number in range(2):
            write_picture(tmp_path / "images" / name / f"{number}.png", _SIDES)
            label = tmp_path / "labels" / name / f"{number}.txt"
            label.parent.mkdir(parents=True, exist_ok=True)
            label.write_text("0 0.5 0.5 0.2 0.2\n")
        lines = [f"/content/set/images/{name}/{number}.png" for number in range(2)]
        (tmp_path / f"{name}.txt").write_text("\n".join(lines))
    content = {"train": train, "val": val, "test": "../test/images", "names": ["worker"]}
    (tmp_path / "data.yaml").write_text(yaml.safe_dump(content | ({"path": root} if root else {})))
    data = read_data(tmp_path)
    held: tuple[Split, ...] = ("train", "val")
    for split in held:
        assert [picture.path.parent.name for picture in data.splits[split]] == [split] * 2
        assert all(len(picture.xyxy_px) == 1 for picture in data.splits[split])
    assert data.splits["test"] == ()
    assert set(kinds(data)) == {"found elsewhere than its labels say", "split missing"}
    assert not any(problem.skipped_picture for problem in data.problems)


def test_what_names_a_split_is_never_left_away() -> None:
    assert "images" not in readings_of("../test/images")
    assert "images" not in readings_of("/content/train/images")
    assert list(readings_of("images/test")) == ["images/test"]
    assert list(readings_of(r"C:\Users\test\set\images\train"))[-1] == "train"


@pytest.mark.parametrize(
    "prefix",
    ["../../label-studio/data/media/upload/1/", "/data/local-files/?d=", "/data/local-files/?d=set/", "C:\\a\\"],
)
def test_pictures_of_label_studio_are_those_beside_the_labels(tmp_path: Path, prefix: str) -> None:
    images = [{"id": number, "file_name": f"{prefix}{number}.png"} for number in range(1, 5)]
    boxes = [box_in(number, [1, 2, 10, 20]) for number in range(1, 5)]
    data = read_data(write_coco(tmp_path, boxes, images=images))
    assert set(by_stem(data)) == {"1", "2", "3", "4"}
    assert kinds(data) == ["found elsewhere than its labels say"] * 4


def test_of_two_lost_paths_that_may_mean_one_picture_neither_is_taken(tmp_path: Path) -> None:
    names = ["1.png", "2.png", "3.png", "4.png", "/camera-a/1.png", "/camera-b/2.png", "/camera-c/2.png"]
    images = [{"id": number, "file_name": name} for number, name in enumerate(names, 1)]
    boxes = [box_in(number, [1, 2, 10, 20]) for number in range(1, 8)]
    data = read_data(write_coco(tmp_path, boxes, count=6, images=images[2:]))
    assert set(by_stem(data)) == {"3", "4", "1"}
    assert kinds(data).count("contradictory labels") == 1


def test_coco_files_among_the_pictures_of_each_split_are_read(tmp_path: Path) -> None:
    """As Roboflow exports them, with texts beside that are no labels."""
    (tmp_path / "README.roboflow.txt").write_text("exported", encoding="utf-8")
    for split in ("train", "valid"):
        write_picture(tmp_path / split / "a.png", _SIDES, seed=len(split))
        document = {
            "images": [{"id": 0, "file_name": "a.png", "width": _SIDES[0], "height": _SIDES[1]}],
            "annotations": [{"id": 1, "image_id": 0, "category_id": 1, "bbox": [10, 12, 20, 16], "area": 320}],
            "categories": [{"id": 1, "name": "worker"}],
        }
        (tmp_path / split / "_annotations.coco.json").write_text(json.dumps(document), encoding="utf-8")
    data = read_data(tmp_path)
    assert {split: [len(one.xyxy_px) for one in pictures] for split, pictures in data.splits.items()} == {
        "train": [1],
        "val": [1],
        "test": [],
    }
