"""Marks in another place, or another way, than a layout has them: read where that is sure, else left out by name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from labelled_sets import by_stem, kinds, write_coco, write_picture, write_yolo
from pycocotools import mask as peer

from standoff.core.errors import DataError
from standoff.labels import read_data
from standoff.labels.regions import corners_of
from standoff.labels.run_lengths import box_of_runs

_SIDES = (64, 48)
_BNDBOX = "<bndbox><xmin>11</xmin><ymin>13</ymin><xmax>30</xmax><ymax>40</ymax></bndbox>"
_OBJECT = f"<object><name>worker</name>{_BNDBOX}</object>"
_AS_READ = [[9.5, 11.5, 29.5, 39.5]]


def write_voc(folder: Path, *inners: str, head: str = "<annotation>", tail: str = "</annotation>") -> Path:
    """Write a Pascal VOC folder: what is in each picture's file beside its name."""
    (folder / "Annotations").mkdir(parents=True)
    for number, inner in enumerate(inners):
        write_picture(folder / "JPEGImages" / f"{number}.png", _SIDES, seed=number)
        name = f"<filename>{number}.png</filename>"
        (folder / "Annotations" / f"{number}.xml").write_text(f"{head}{name}{inner}{tail}")
    return folder


# --- Pascal VOC ---


@pytest.mark.parametrize(
    "inner",
    [
        f"<objects>{_OBJECT}</objects>",
        _OBJECT.replace("object", "Object").replace("xmin", "XMin").replace("bndbox", "BndBox"),
        f'<x:object xmlns:x="http://x">{_OBJECT.removeprefix("<object>").removesuffix("</object>")}</x:object>',
        f"<source><database>mine</database></source><weather>4 5</weather>{_OBJECT}",
        _OBJECT.replace("</object>", f"<part><name>head</name>{_BNDBOX}</part></object>"),
    ],
)
def test_an_object_that_can_only_be_one_is_read_wherever_it_is(tmp_path: Path, inner: str) -> None:
    data = read_data(write_voc(tmp_path, inner, _OBJECT))
    assert data.problems == []
    assert [picture.xyxy_px.tolist() for picture in by_stem(data).values()] == [_AS_READ] * 2


def test_a_namespace_around_the_whole_changes_nothing(tmp_path: Path) -> None:
    data = read_data(write_voc(tmp_path, _OBJECT, head='<annotation xmlns="http://x">'))
    assert by_stem(data)["0"].xyxy_px.tolist() == _AS_READ
    wrapped = write_voc(tmp_path / "w", _OBJECT, head="<annotations><annotation>", tail="</annotation></annotations>")
    assert by_stem(read_data(wrapped))["0"].xyxy_px.tolist() == _AS_READ


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        (_OBJECT.replace("object", "item"), "'bndbox' in <item>"),
        (f"<deleted>{_OBJECT}</deleted>", "'object' in <deleted>"),
        ("<thing><label>worker</label><at><x1>1</x1><y1>2</y1><x2>20</x2><y2>30</y2></at></thing>", "in <thing>"),
        ('<worker left="1" top="2" right="20" bottom="30"/>', "'left' in <worker>"),
        ('<objects xmin="1" ymin="2" xmax="20" ymax="30"/>', "'xmin' in <objects>"),
        ("<worker>11, 13, 30, 40</worker>", "four numbers in <worker>"),
        ('<worker at="11 13 30 40"/>', "four numbers in <worker>"),
        (f"<bounding_box>{_BNDBOX}</bounding_box>", "<bounding_box>"),
        (f"<object><name>worker</name>{_BNDBOX}{_BNDBOX}</object>", "2 times <bndbox>"),
        (f"<object><name>worker</name><name>lorry</name>{_BNDBOX}</object>", "2 times <name>"),
        (f"<object><name>worker</name>{_BNDBOX}{_OBJECT}</object>", "an object within an object"),
        (_OBJECT.replace("<xmin>", "<xmin>3</xmin><xmin>"), "'3 and 11' for xmin"),
        ("<object><name>worker</name><robndbox><cx>9</cx></robndbox></object>", "with <robndbox>"),
        (_OBJECT.replace("<bndbox>", "<difficult>perhaps</difficult><bndbox>"), "'perhaps', neither yes nor no"),
    ],
)
def test_whatever_else_may_be_an_object_leaves_its_picture_out(tmp_path: Path, inner: str, said: str) -> None:
    data = read_data(write_voc(tmp_path, inner, _OBJECT + inner, _OBJECT, _OBJECT))
    assert set(by_stem(data)) == {"2", "3"}
    skipped = [problem for problem in data.problems if problem.skipped_picture]
    assert len(skipped) == 2
    assert all(said in problem.found for problem in skipped)


def test_other_programs_xml_is_no_picture_without_things(tmp_path: Path) -> None:
    cvat = '<image><box label="worker" xtl="1" ytl="2" xbr="20" ybr="30"/></image>'
    folder = write_voc(tmp_path, cvat, cvat, head="<annotations>", tail="</annotations>")
    with pytest.raises(DataError, match=r"2 not: unreadable labels .*0 times <annotation>"):
        read_data(folder)


def test_what_describes_the_picture_alone_leaves_it_without_things(tmp_path: Path) -> None:
    described = (
        "<folder>a</folder><path>/a/1 2 3 4</path><source><database>x</database></source>"
        "<size><width>64</width><height>48</height><depth>3</depth></size><segmented>0</segmented>"
        "<taken>2026-11-28 12:30:45</taken><place><lat>50.1</lat><lon>8.5</lon></place>"
    )
    data = read_data(write_voc(tmp_path, described, _OBJECT))
    assert data.problems == []
    assert by_stem(data)["0"].xyxy_px.shape == (0, 4)


@pytest.mark.parametrize(
    ("said", "is_ignored"),
    [("1", True), ("true", True), (" Yes ", True), ("0", False), ("False", False), ("Unspecified", False), ("", False)],
)
@pytest.mark.parametrize("mark", ["difficult", "Difficult", "ignore"])
def test_yes_and_no_may_be_words(tmp_path: Path, mark: str, said: str, *, is_ignored: bool) -> None:
    data = read_data(write_voc(tmp_path, _OBJECT.replace("<bndbox>", f"<{mark}>{said}</{mark}><bndbox>")))
    assert by_stem(data)["0"].ignored.tolist() == [is_ignored]


# --- where Pascal VOC counts from ---


def write_corners(folder: Path, *boxes: Sequence[float]) -> Path:
    tags = ("xmin", "ymin", "xmax", "ymax")
    inner = ["".join(f"<{tag}>{value:g}</{tag}>" for tag, value in zip(tags, box, strict=True)) for box in boxes]
    return write_voc(folder, *[f"<object><name>worker</name><bndbox>{one}</bndbox></object>" for one in inner])


@pytest.mark.parametrize(
    ("boxes", "expected"),
    [
        # from 0, both ends inside
        (((0, 0, 63, 47), (10, 5, 19, 14)), ([-0.5, -0.5, 63.5, 47.5], [9.5, 4.5, 19.5, 14.5])),
        # from 0, edges: one ends at the whole width
        (((0, 4, 10, 20), (44, 8, 64, 20)), ([-0.5, 3.5, 9.5, 19.5], [43.5, 7.5, 63.5, 19.5])),
        (((0, 4.25, 10, 20), (44, 8, 60, 20)), ([-0.5, 3.75, 9.5, 19.5], [43.5, 7.5, 59.5, 19.5])),
    ],
)
def test_a_set_in_which_zero_occurs_counts_from_zero(tmp_path: Path, boxes: Any, expected: Any) -> None:
    data = read_data(write_corners(tmp_path, *boxes))
    assert kinds(data) == ["pixels counted from 0"]
    assert [picture.xyxy_px[0].tolist() for picture in by_stem(data).values()] == list(expected)


def test_a_slip_among_many_first_pixels_moves_no_box(tmp_path: Path) -> None:
    data = read_data(write_corners(tmp_path, (0, 5, 10, 20), (1, 5, 10, 20), (1, 1, 64, 48), (7, 1, 20, 20)))
    assert "pixels counted from 0" in kinds(data)
    pictures = by_stem(data)
    assert pictures["1"].xyxy_px.tolist() == [[-0.5, 3.5, 9.5, 19.5]]
    assert pictures["2"].xyxy_px.tolist() == [[-0.5, -0.5, 63.5, 47.5]]


# --- COCO ---


def boxes_of_each(count: int, *boxes: dict[str, Any]) -> list[dict[str, Any]]:
    return [{"image_id": number, "category_id": 1, **box} for number in range(1, count + 1) for box in boxes]


@pytest.mark.parametrize("mark", ["iscrowd", "ignore"])
@pytest.mark.parametrize(
    ("said", "is_ignored"),
    [("0", False), ("false", False), (False, False), (None, False), (0.0, False), ("1", True), (True, True), (1, True)],
)
def test_a_crowd_is_one_where_it_says_so(tmp_path: Path, mark: str, said: object, *, is_ignored: bool) -> None:
    data = read_data(write_coco(tmp_path, boxes_of_each(2, {"bbox": [1, 2, 10, 20], mark: said}), 2))
    assert [picture.ignored.tolist() for picture in by_stem(data).values()] == [[is_ignored]] * 2


@pytest.mark.parametrize(
    "box",
    [
        {"bbox": [[1, 2], [11, 22]]},
        {"bbox": [[1, 2, 10, 20]]},
        {"bbox": [True, 2, 10, 20]},
        {"bbox": [1, 2, 10, 20, 30]},
        {"bbox": {"x": 1, "y": 2, "width": 10, "height": 20}},
        {"bbox": None, "segmentation": [[[1, 2], [11, 2], [11, 22]]]},
        {"bbox": [], "segmentation": [[1, 11, 11], [2, 2, 22]]},
        {"bbox": [1, 2, 10, 20], "iscrowd": "some"},
        {"bbox": [1, 2, 10, 20], "keypoints": [[5, 6, 2]]},
        {"bbox": [1, 2, 10, 20], "keypoints": [5, True, 2]},
    ],
    ids=str,
)
def test_numbers_in_other_lists_than_expected_leave_the_picture_out(tmp_path: Path, box: dict[str, Any]) -> None:
    good = boxes_of_each(4, {"bbox": [1, 2, 10, 20], "keypoints": [5, 6, 2]})
    categories = [{"id": 1, "name": "worker", "keypoints": ["ground_point"]}]
    path = write_coco(tmp_path, [*good[1:], {"image_id": 1, "category_id": 1, **box}], categories=categories)
    data = read_data(path)
    assert set(by_stem(data)) == {"2", "3", "4"}
    assert kinds(data) == ["unreadable labels"]


def test_ids_are_whole_numbers_and_true_is_none(tmp_path: Path) -> None:
    boxes = [{"image_id": 1.0, "category_id": 1.0, "bbox": [1, 2, 10, 20]}]
    boxes.append({"image_id": 2, "category_id": True, "bbox": [1, 2, 10, 20]})
    data = read_data(write_coco(tmp_path, boxes, 2))
    assert set(by_stem(data)) == {"1"}
    assert kinds(data) == ["unknown class id"]


def test_annotations_elsewhere_in_the_file_are_not_passed_over(tmp_path: Path) -> None:
    inner = [{"label": "worker", "bbox": [1, 2, 10, 20]}]
    more = {"images": [{"id": 1, "file_name": "1.png", "objects": inner}, {"id": 2, "file_name": "2.png"}]}
    data = read_data(write_coco(tmp_path / "inner", boxes_of_each(1, {"bbox": [1, 2, 10, 20]})[:0], 2, **more))
    assert set(by_stem(data)) == {"2"}
    assert kinds(data) == ["labels cannot be placed"]
    with pytest.raises(DataError, match="`bbox` in `objects`"):
        read_data(write_coco(tmp_path / "other", [], 2, objects=[{"image_id": 1, "bbox": [1, 2, 10, 20]}]))


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.02, 0.9), is_text=st.booleans())
def test_the_box_of_a_mask_is_the_one_that_pycocotools_finds(seed: int, share: float, is_text: bool) -> None:
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, 40, 2)
    pixels = rng.random((height, width)) < share
    coded = peer.encode(np.asfortranarray(pixels.astype(np.uint8)))
    flat = pixels.flatten(order="F")
    changes = np.flatnonzero(np.diff(np.concatenate([[False], flat]))).tolist()
    runs = np.diff([0, *changes, len(flat)]).tolist()
    found = box_of_runs({"size": [int(height), int(width)], "counts": coded["counts"].decode() if is_text else runs})
    if not pixels.any():
        assert found is None
        return
    left, top, wide, high = peer.toBbox(coded).tolist()
    assert found is not None
    assert found.tolist() == [left, top, left + wide, top + high]


@pytest.mark.parametrize("counts", ["", "4", [5, 2], [5, 2, -7], [5, True, 6], "P", "~~", None, [[12]]])
def test_a_damaged_mask_has_no_box(counts: object) -> None:
    assert box_of_runs({"size": [4, 3], "counts": counts}) is None


# --- which layout the numbers have ---

_PLACED = [(2, 0, 12, 20), (40, 28, 64, 48), (0, 6, 20, 40), (24, 0, 60, 30)]
"""Left, top, right, bottom edges of things, several of which touch the picture's edges."""
_SHARES = np.array(_SIDES * 2)


def numbers_as(layout: str, box: tuple[float, ...]) -> list[float]:
    x1, y1, x2, y2 = box
    first = [(x1 + x2) / 2, (y1 + y2) / 2] if layout == "centre" else [x1, y1]
    return [*first, *([x2, y2] if layout == "corners" else [x2 - x1, y2 - y1])]


_FOUND = {"centre": "cxcywh", "corner": "the left and the upper edge, a width and a height, xywh", "corners": "xyxy"}


@pytest.mark.parametrize("layout", ["centre", "corner", "corners"])
def test_a_layout_that_only_can_be_is_named_or_read(tmp_path: Path, layout: str) -> None:
    numbers = [numbers_as(layout, box) for box in _PLACED]
    coco = write_coco(
        tmp_path / "coco", [box | {"bbox": n} for box, n in zip(boxes_of_each(4, {}), numbers, strict=True)]
    )
    lines = {
        str(row): "0 " + " ".join(map(str, (n / _SHARES).tolist())) for row, n in enumerate(map(np.array, numbers))
    }
    yolo = write_yolo(tmp_path / "yolo", lines)
    for row in range(len(lines)):
        write_picture(yolo / "images" / f"{row}.png", _SIDES, seed=row)
    for path, right in ((coco, "corner"), (yolo, "centre")):
        if layout == right:
            boxes = [picture.xyxy_px[0] + 0.5 for picture in by_stem(read_data(path)).values()]
            np.testing.assert_allclose(boxes, _PLACED, atol=1e-9)
        else:
            with pytest.raises(DataError, match=f"only if those are .*{_FOUND[layout]}"):
                read_data(path)
    if layout != "corners":
        with pytest.raises(DataError, match=f"only if those are .*{_FOUND[layout]}"):
            read_data(write_corners(tmp_path / "voc", *numbers))


def test_a_centre_in_the_place_of_a_corner_is_told_by_the_outline(tmp_path: Path) -> None:
    outline = {"segmentation": [[10, 12, 30, 12, 30, 28]]}
    with pytest.raises(DataError, match="only if their numbers are the centre"):
        read_data(write_coco(tmp_path, boxes_of_each(4, {"bbox": [20, 20, 20, 16], **outline})))
    pixels = np.zeros(_SIDES[::-1], np.uint8)
    pixels[12:28, 10:30] = 1
    coded = peer.encode(np.asfortranarray(pixels))
    mask = {"size": coded["size"], "counts": coded["counts"].decode()}
    with pytest.raises(DataError, match=r"only if their numbers are .* xyxy"):
        read_data(write_coco(tmp_path / "mask", boxes_of_each(4, {"bbox": [10, 12, 30, 28], "segmentation": mask})))


def test_one_box_beyond_an_edge_does_not_make_another_layout(tmp_path: Path) -> None:
    lines = {"a": "0 0.05 0.4 0.2 0.2\n", "b": "0 0.3 0.3 0.1 0.1\n", "c": "1 0.5 0.4 0.2 0.2\n"}
    assert len(by_stem(read_data(write_yolo(tmp_path, lines)))) == 3


# --- YOLO ---


def yolo_with(folder: Path, **content: object) -> Path:
    write_yolo(folder, {"a": "0 0.5 0.5 0.2 0.2\n", "b": "1 0.5 0.5 0.2 0.2\n"})
    (folder / "data.yaml").write_text(yaml.safe_dump({"train": "images", "names": ["worker", "lorry"], **content}))
    return folder


@pytest.mark.parametrize("count", [1, 3, "many", True, 2.5])
def test_another_number_of_classes_than_of_names_is_refused(tmp_path: Path, count: object) -> None:
    with pytest.raises(DataError, match=r"`nc` says .*found nc .* and 2 names \(worker, lorry\)"):
        read_data(yolo_with(tmp_path, nc=count))


@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("vla", "val"),
        ("Val", "val"),
        ("vall", "val"),
        ("trian", "train"),
        ("tset", "test"),
        ("vaild", "valid"),
        ("training", "train"),
        ("val_images", "val"),
        ("validaton", "validation"),
        ("NC", "nc"),
        ("Names", "names"),
        ("kpt-shape", "kpt_shape"),
    ],
)
def test_a_misspelt_key_is_refused_with_the_one_that_is_meant(tmp_path: Path, key: str, meant: str) -> None:
    with pytest.raises(DataError, match=f"`{key}`, which is not read.*Write `{meant}`"):
        read_data(yolo_with(tmp_path, **{key: "images2"}))


def test_keys_of_other_programs_are_none_of_ours(tmp_path: Path) -> None:
    others = {
        **{"nc": "2", "download": "https://x", "roboflow": {"workspace": "a"}, "flip_idx": [0], "license": "MIT"},
        **{"minival": "minival.txt", "task": "detect", "version": "1.0", "val_split": 0.1, "description": "of a site"},
    }
    data = read_data(yolo_with(tmp_path, **others))
    assert data.problems == []
    with pytest.raises(DataError, match="images2"):
        read_data(yolo_with(tmp_path / "validation", validation="images2"))


def test_two_label_files_of_one_picture_must_agree(tmp_path: Path) -> None:
    folder = write_yolo(tmp_path, {"a": "", "b": "1 0.5 0.5 0.2 0.2\n", "c": "1 0.5 0.5 0.2 0.2\n"})
    (folder / "images" / "a.txt").write_text("0 0.5 0.5 0.2 0.2\n")
    (folder / "images" / "b.txt").write_text("1 0.5 0.5 0.2 0.2")
    data = read_data(folder)
    assert set(by_stem(data)) == {"b", "c"}
    assert kinds(data) == ["contradictory labels"]


@given(st.lists(st.lists(st.integers(-9, 9), min_size=4, max_size=4), max_size=4))
def test_regions_are_four_numbers_each(boxes: list[list[int]]) -> None:
    boxes = [[*sorted((x1, x2)), *sorted((y1, y2))] for x1, x2, y1, y2 in boxes]
    ordered = [[x1, y1, x2, y2] for x1, x2, y1, y2 in boxes]
    found = corners_of(ordered)
    assert found is not None
    assert found.tolist() == ordered
    if ordered:
        assert corners_of([ordered]) is None
        assert corners_of([value for box in ordered for value in box]) is None
        assert corners_of([[[x1, y1], [x2, y2]] for x1, y1, x2, y2 in ordered]) is None
        assert corners_of([[False, y1, x2, y2] for _, y1, x2, y2 in ordered]) is None
