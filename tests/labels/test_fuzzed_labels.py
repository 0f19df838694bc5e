"""Label files as a bad copy leaves them: read, or refused in one line; and half a file is not a smaller one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from labelled_sets import by_stem, write_picture, write_yolo
from laws import examples
from mutations import mutated

from standoff.core.errors import DataError
from standoff.labels import LabelledData, read_data
from standoff.labels.ground_points import read_points
from standoff.labels.yolo_rows import read_rows

_COUNT = 2
_SIZE_PX = (64, 48)
_BOX = b"0 0.5 0.5 0.25 0.5\n1 0.25 0.25 0.125 0.25\n"
_POLYGON = b"1 0.1 0.1 0.4 0.1 0.4 0.4 0.1 0.4\n0 0.5 0.5 0.75 0.5 0.75 0.875\n"
_POSE = b"0 0.5 0.5 0.25 0.5 0.5 0.75 2 0.4 0.3 1\r\n"
_POINT = b"\xef\xbb\xbf0 0.5 0.5 0.25 0.5 0.5 0.75 2\n"
_DATA_YAML = b"path: .\ntrain: images\nval: [val.txt]\ntest: ../test/images\nnc: 2\nnames: {0: worker, 1: 'no'}\n"
_XML = (
    b'<?xml version="1.0" encoding="utf-8"?><annotation><folder>set</folder><filename>C:\\set\\1.png</filename>'
    b"<size><width>64</width><height>48</height><depth>3</depth></size><object><name>worker</name>"
    b"<difficult>0</difficult><bndbox><xmin>10</xmin><ymin>11.5</ymin><xmax>30</xmax><ymax>40</ymax></bndbox></object>"
    b"<object><name>lorry</name><bndbox><xmin>1</xmin><ymin>1</ymin><xmax>64</xmax><ymax>48</ymax></bndbox></object>"
    b"</annotation>\n"
)


def _coco() -> bytes:
    images = [
        {"id": number, "file_name": f"{number}.png", "width": 64, "height": 48, "scene": "a"}
        for number in range(_COUNT)
    ]
    boxes = [
        {
            "id": number,
            "image_id": number % _COUNT,
            "category_id": 1 + number % 2,
            "bbox": [10.5, 11, 20, 16 + number],
            "area": 320,
            "iscrowd": number // 7,
            "segmentation": [[10.5, 11, 30.5, 11, 30.5, 27]],
            "keypoints": [12, 13, 2],
        }
        for number in range(8)
    ]
    categories = [{"id": 1, "name": "worker", "keypoints": ["ground_point"]}, {"id": 2, "name": "lorry"}]
    return json.dumps({"images": images, "annotations": boxes, "categories": categories}).encode()


_COCO = _coco()


@pytest.fixture(scope="module")
def yolo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_yolo(tmp_path_factory.mktemp("yolo"), {str(number): _BOX for number in range(_COUNT)})
    (folder / "val.txt").write_text("images/1.png\n")
    return folder


@pytest.fixture(scope="module")
def voc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("voc")
    (folder / "Annotations").mkdir()
    for number in range(_COUNT):
        write_picture(folder / "JPEGImages" / f"{number}.png", _SIZE_PX, seed=number)
        (folder / "Annotations" / f"{number}.xml").write_bytes(_XML.replace(b"1.png", f"{number}.png".encode()))
    return folder


@pytest.fixture(scope="module")
def coco(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("coco")
    for number in range(_COUNT):
        write_picture(folder / f"{number}.png", _SIZE_PX, seed=number)
    return folder


def read_or_refuse(path: Path) -> LabelledData | None:
    """Read a set; None where it is refused in one line."""
    try:
        data = read_data(path)
    except DataError as error:
        assert "\n" not in str(error)
        return None
    for picture in by_stem(data).values():
        assert np.isfinite(picture.xyxy_px).all()
        assert (picture.class_id < len(data.classes)).all()
    return data


@given(mutated(st.sampled_from([_BOX, _POLYGON, _POSE, _POINT])))
@examples(200)
def test_lines_of_yolo_are_read_or_refused(content: bytes) -> None:
    try:
        rows = read_rows(content.decode("utf-8", errors="replace"))
    except ValueError:
        return
    assert rows.shape[1] == 7
    assert np.isfinite(rows[:, :5]).all()


@given(mutated(st.sampled_from([_BOX, _POLYGON, _POSE, _POINT])))
@examples(200)
def test_a_yolo_label_file_is_read_or_its_picture_left_out(yolo: Path, content: bytes) -> None:
    (yolo / "data.yaml").unlink(missing_ok=True)
    (yolo / "labels" / "1.txt").write_bytes(content)
    data = read_or_refuse(yolo)
    # What is left is a picture without things only where its file is empty.
    if data is not None and "1" in by_stem(data) and not len(by_stem(data)["1"].xyxy_px):
        assert not content.removeprefix(b"\xef\xbb\xbf").strip()


@given(mutated(st.just(_DATA_YAML)))
@examples(200)
def test_a_data_yaml_is_read_or_refused(yolo: Path, content: bytes) -> None:
    (yolo / "labels" / "1.txt").write_bytes(_BOX)
    (yolo / "data.yaml").write_bytes(content)
    read_or_refuse(yolo / "data.yaml")


@given(mutated(st.just(_XML)))
@examples(200)
def test_an_xml_file_is_read_or_its_picture_left_out(voc: Path, content: bytes) -> None:
    (voc / "Annotations" / "1.xml").write_bytes(content)
    read_or_refuse(voc)


@given(mutated(st.just(_COCO)))
@examples(200)
def test_a_coco_file_is_read_or_refused(coco: Path, content: bytes) -> None:
    (coco / "labels.json").write_bytes(content)
    read_or_refuse(coco / "labels.json")


_KEYS = (
    *("id", "image_id", "category_id", "bbox", "area", "segmentation", "keypoints", "iscrowd"),
    *("width", "height", "file_name", "name", "scene"),
)
_VALUE = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**400), 10**400),
    st.integers(-2, 9),
    st.floats(),
    st.text(max_size=4),
    st.just([]),
    st.just({}),
    st.just([[1, 2], None]),
)


@given(
    kind=st.sampled_from(["images", "annotations", "categories"]),
    place=st.integers(0, 7),
    key=st.sampled_from(_KEYS),
    value=_VALUE,
)
@examples(200)
def test_a_coco_file_with_any_value_of_another_kind_is_read_or_refused(
    coco: Path, kind: str, place: int, key: str, value: object
) -> None:
    content = json.loads(_COCO)
    entry = content[kind][place % len(content[kind])]
    inner = entry.get(key)
    if isinstance(inner, list) and place % 2:
        inner[0] = value
    else:
        entry[key] = value
    (coco / "labels.json").write_text(json.dumps(content, default=str))
    read_or_refuse(coco / "labels.json")


@given(mutated(st.just(b"0.5 0.5\nnan nan\n0.25 1.5\n")))
@examples(200)
def test_ground_points_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "points.txt"
    path.write_bytes(content)
    try:
        assert read_points(path, 3, _SIZE_PX).shape == (3, 2)
    except ValueError:
        return


# --- half a file ---


@pytest.mark.parametrize("whole", [_XML, _COCO], ids=["voc", "coco"])
def test_half_a_document_is_never_a_smaller_one(voc: Path, coco: Path, whole: bytes) -> None:
    is_voc = whole is _XML
    path = voc / "Annotations" / "1.xml" if is_voc else coco / "labels.json"
    read: Callable[[], LabelledData] = lambda: read_data(voc if is_voc else path)  # noqa: E731
    last = len(whole.rstrip())
    for end in {*range(0, last, max(1, last // 40)), *range(last - 12, last)}:
        path.write_bytes(whole[:end])
        if is_voc:
            assert "1" not in by_stem(read())
        else:
            with pytest.raises(DataError):
                read()
    path.write_bytes(whole[:last])
    assert len(by_stem(read())["1"].xyxy_px) == (2 if is_voc else 4)
