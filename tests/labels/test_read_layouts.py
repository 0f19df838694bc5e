from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import supervision as sv
import yaml
from labelled_sets import by_stem, kinds, write_mixture, write_picture, write_yolo
from tolerances import PEER_BOX_PX

from standoff.core.classes import CLASSES
from standoff.core.errors import DataError
from standoff.labels import LabelledData, load_picture, read_data
from standoff_sim.clip.picture_set import yolo_line

_SIZES = ((64, 48), (97, 31), (640, 360))


def _peer_set(folder: Path, seed: int) -> sv.DetectionDataset:
    """Pictures with random whole-pixel boxes (VOC knows no others), held by supervision."""
    rng = np.random.default_rng(seed)
    annotations = {}
    for number, size_px in enumerate(_SIZES):
        path = write_picture(folder / "images" / f"shot-{number}.png", size_px, seed=number)
        first = rng.integers(0, np.array(size_px) - 4, (number * 2, 2))
        last = rng.integers(first + 2, np.array(size_px) + 1)
        annotations[str(path)] = sv.Detections(
            np.hstack([first, last]).astype(np.float32), class_id=rng.integers(0, 3, len(first))
        )
    return sv.DetectionDataset(["worker", "digger", "car"], list(annotations), annotations)


def _assert_same(data: LabelledData, peer: sv.DetectionDataset) -> None:
    """Edges of supervision's boxes count from the edge of the first pixel, ours from its centre."""
    pictures = by_stem(data)
    assert set(pictures) == {Path(path).stem for path in peer.image_paths}
    for path, boxes in peer.annotations.items():
        picture = pictures[Path(path).stem]
        np.testing.assert_allclose(picture.xyxy_px, boxes.xyxy - 0.5, atol=PEER_BOX_PX)
        ours = [data.classes[number] for number in picture.class_id]
        assert ours == [peer.classes[number] for number in boxes.class_id]
        assert not picture.ignored.any()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("layout", ["yolo", "coco", "voc"])
def test_what_supervision_writes_and_reads_is_what_we_read(tmp_path: Path, layout: str, seed: int) -> None:
    original = _peer_set(tmp_path, seed)
    images = str(tmp_path / "images")
    if layout == "yolo":
        labels, names = str(tmp_path / "labels"), str(tmp_path / "data.yaml")
        original.as_yolo(annotations_directory_path=labels, data_yaml_path=names)
        peer = sv.DetectionDataset.from_yolo(images, labels, names)
        (tmp_path / "data.yaml").write_text(yaml.safe_dump({"train": "images", "names": peer.classes}))
        data = read_data(tmp_path)
        assert data.classes == tuple(peer.classes)
    elif layout == "coco":
        original.as_coco(annotations_path=str(tmp_path / "labels.json"))
        peer = sv.DetectionDataset.from_coco(images, str(tmp_path / "labels.json"))
        data = read_data(tmp_path / "labels.json")
    else:
        original.as_pascal_voc(annotations_directory_path=str(tmp_path / "Annotations"))
        peer = sv.DetectionDataset.from_pascal_voc(images, str(tmp_path / "Annotations"))
        data = read_data(tmp_path)
    assert data.problems == []
    _assert_same(data, peer)
    _assert_same(data, original)


@pytest.mark.parametrize("linked", [("images", "labels"), ("images",), ("labels",)])
def test_a_set_whose_folders_are_links_is_read_as_the_set_itself(tmp_path: Path, linked: tuple[str, ...]) -> None:
    there, here = tmp_path / "there", tmp_path / "here"
    write_yolo(there, {"a-01": "0 0.5 0.5 0.2 0.2", "b-01": "1 0.5 0.5 0.4 0.2"}, ["worker", "excavator"])
    here.mkdir()
    for one in there.iterdir():
        if one.name in linked:
            (here / one.name).symlink_to(one)
        else:
            one.rename(here / one.name)
    pictures = by_stem(read_data(here))
    assert {name: picture.class_id.tolist() for name, picture in pictures.items()} == {"a-01": [0], "b-01": [1]}


def test_the_simulators_lines_come_back_as_its_boxes(tmp_path: Path) -> None:
    row = {"class_id": 2, "x1_px": -0.5, "y1_px": 3.5, "x2_px": 11.5, "y2_px": 29.5}
    write_yolo(tmp_path, {"9-00004-05": yolo_line(row, (40, 30))}, [site_class.name for site_class in CLASSES])
    picture = by_stem(read_data(tmp_path))["9-00004-05"]
    np.testing.assert_allclose(picture.xyxy_px, [[-0.5, 3.5, 11.5, 29.5]], atol=PEER_BOX_PX)
    assert picture.group == f"{tmp_path.name}/9-00004"


@pytest.mark.parametrize("names", [["a", "b"], {0: "a", 1: "b"}, {"1": "b", "0": "a"}])
def test_a_data_yaml_names_labels_and_splits(tmp_path: Path, names: object) -> None:
    for split in ("train", "val", "test"):
        write_picture(tmp_path / "images" / split / f"{split}-1.jpg")
        (tmp_path / "labels" / split).mkdir(parents=True)
        (tmp_path / "labels" / split / f"{split}-1.txt").write_text("1 0.5 0.5 1 1\n")
    listed = tmp_path / "held_out.txt"
    listed.write_text("images/test/test-1.jpg\n\n")
    content = {"train": "images/train", "val": ["images/val"], "test": "held_out.txt", "names": names}
    (tmp_path / "data.yaml").write_text(yaml.safe_dump(content))
    for path in (tmp_path, tmp_path / "data.yaml"):
        data = read_data(path)
        assert data.classes == ("a", "b")
        stems = {split: [picture.path.stem for picture in pictures] for split, pictures in data.splits.items()}
        assert stems == {"train": ["train-1"], "val": ["val-1"], "test": ["test-1"]}
        assert by_stem(data)["val-1"].xyxy_px.tolist() == [[-0.5, -0.5, 39.5, 29.5]]


def test_a_yolo_folder_may_have_its_labels_beside_the_pictures_and_splits_as_folders(tmp_path: Path) -> None:
    for split in ("train", "valid"):
        write_picture(tmp_path / split / "images" / f"{split}.png")
        (tmp_path / split / "images" / f"{split}.txt").write_text("")
    (tmp_path / "obj.names").write_text("car\n")
    data = read_data(tmp_path)
    assert [len(data.splits[split]) for split in ("train", "val", "test")] == [1, 1, 0]
    assert data.classes == ("car",)
    assert by_stem(data)["valid"].xyxy_px.shape == (0, 4)


def _coco(path: Path, images: list[dict[str, Any]], annotations: list[dict[str, Any]]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    categories = [{"id": 7, "name": "person"}, {"id": 3, "name": "truck"}]
    path.write_text(json.dumps({"images": images, "annotations": annotations, "categories": categories}))
    return path


def test_a_coco_folder_has_crowds_scenes_and_a_file_for_each_split(tmp_path: Path) -> None:
    for number, split in enumerate(("train", "val", "test")):
        write_picture(tmp_path / "images" / split / f"{split}.png", (40, 30))
        image = {"id": 5, "file_name": f"images/{split}/{split}.png", "width": 40, "height": 30, "scene": number}
        boxes = [
            {"id": 1, "image_id": 5, "category_id": 7, "bbox": [0, 0, 10, 5], "iscrowd": 0},
            {"id": 2, "image_id": 5, "category_id": 3, "bbox": [20, 10, 20, 20], "iscrowd": 1},
        ]
        _coco(tmp_path / "annotations" / f"{split}.json", [image], boxes)
    # as `simulate dataset --layout coco` leaves it
    (tmp_path / "data.yaml").write_text(yaml.safe_dump({"train": "images/train", "names": ["person"]}))
    data = read_data(tmp_path)
    assert data.classes == ("truck", "person")
    assert [len(pictures) for pictures in data.splits.values()] == [1, 1, 1]
    picture = data.splits["val"][0]
    assert picture.xyxy_px.tolist() == [[-0.5, -0.5, 9.5, 4.5], [19.5, 9.5, 39.5, 29.5]]
    assert (picture.class_id.tolist(), picture.ignored.tolist()) == ([1, 0], [False, True])
    assert picture.group == f"{tmp_path.name}/1"


@pytest.mark.parametrize(
    ("file", "folder"),
    [
        ("instances_train2017.json", "train2017"),
        ("instances_train2017.json", "images/train2017"),
        ("instances_default.json", "images/default"),
        ("instances_default.json", "images"),
    ],
)
def test_pictures_of_a_coco_file_are_found_where_coco_and_cvat_put_them(tmp_path: Path, file: str, folder: str) -> None:
    write_picture(tmp_path / folder / "1.png")
    boxes = [{"image_id": 1, "category_id": 7, "bbox": [1, 1, 5, 5]}]
    _coco(tmp_path / "annotations" / file, [{"id": 1, "file_name": "1.png"}], boxes)
    assert by_stem(read_data(tmp_path))["1"].path == tmp_path / folder / "1.png"


def test_damaged_entries_of_a_coco_file_cost_their_own_picture_only(tmp_path: Path) -> None:
    for number in [*range(12), 20, 21, 22]:
        write_picture(tmp_path / f"{number}.png")
    images: list[dict[str, Any]] = [
        {"id": number, "file_name": f"{number}.png", "width": 40, "height": 30} for number in [*range(10), 20, 21, 22]
    ]
    images += [
        {"id": 10, "file_name": "10.png", "width": 30, "height": 40},
        {"id": 11, "file_name": "11.png"},
        {"id": 11, "file_name": "0.png"},
        {"id": 13},
        {"id": [], "file_name": "no such picture.png"},
    ]
    boxes: list[dict[str, Any]] = [
        {"image_id": 1, "category_id": 99, "bbox": [1, 1, 5, 5]},
        {"image_id": 2, "category_id": 7, "bbox": [1, 1, "wide", 5]},
        {"image_id": 3, "category_id": 7},
        {"image_id": 77, "category_id": 7, "bbox": [1, 1, 5, 5]},
        {"image_id": 4, "category_id": 7, "bbox": [1, 1, 5, 5]},
    ]
    data = read_data(_coco(tmp_path / "x.json", images, boxes))
    assert sorted(by_stem(data), key=int) == ["0", "4", "5", "6", "7", "8", "9", "20", "21", "22"]
    assert sorted(set(kinds(data))) == [
        "annotation without picture",
        "contradictory labels",
        "picture missing",
        "picture without name",
        "size differs from labels",
        "unknown class id",
        "unreadable labels",
    ]


def _voc_xml(name: str, boxes: str, size: str = "<size><width>40</width><height>30</height></size>") -> str:
    return f"<annotation><filename>{name}</filename>{size}{boxes}</annotation>"


def _voc_object(label: str, corners: tuple[object, object, object, object], difficult: int = 0) -> str:
    tags = zip(("xmin", "ymin", "xmax", "ymax"), corners, strict=True)
    inner = "".join(f"<{tag}>{value}</{tag}>" for tag, value in tags)
    return f"<object><name>{label}</name><difficult>{difficult}</difficult><bndbox>{inner}</bndbox></object>"


def test_voc_counts_pixels_from_one_and_difficult_objects_are_ignored(tmp_path: Path) -> None:
    for stem in ("a", "b", "c"):
        write_picture(tmp_path / "JPEGImages" / f"{stem}.jpg")
    (tmp_path / "Annotations").mkdir()
    boxes = _voc_object("person", (1, 1, 1, 1)) + _voc_object("car", (1, 2, 40, 30), difficult=1)
    (tmp_path / "Annotations" / "a.xml").write_text(_voc_xml("a.jpg", boxes))
    (tmp_path / "Annotations" / "b.xml").write_text(_voc_xml("", "", size=""))
    (tmp_path / "Annotations" / "c.xml").write_text(_voc_xml("c.jpg", ""))
    sets = tmp_path / "ImageSets" / "Main"
    sets.mkdir(parents=True)
    (sets / "train.txt").write_text("a\n")
    (sets / "val.txt").write_text("b -1\n")
    data = read_data(tmp_path)
    assert data.classes == ("car", "person")
    (picture,) = data.splits["train"]
    assert picture.xyxy_px.tolist() == [[-0.5, -0.5, 0.5, 0.5], [-0.5, 0.5, 39.5, 29.5]]
    assert (picture.class_id.tolist(), picture.ignored.tolist()) == ([1, 0], [False, True])
    assert [other.path.stem for other in data.splits["val"]] == ["b"]
    assert kinds(data) == ["picture in no split"]


@pytest.mark.parametrize(
    "xml",
    [
        '<!DOCTYPE a [<!ENTITY b "bbbb">]><annotation><filename>&b;</filename></annotation>',
        '<?xml version="1.0" encoding="nonsense"?><annotation></annotation>',
        "<annotation><object>",
        "",
        _voc_xml("2.png", _voc_object("car", (1, 1, "many", 5))),
        _voc_xml("2.png", _voc_object("car", (1, 1, "nan", 5))),
        _voc_xml("2.png", _voc_object("", (1, 1, 5, 5))),
        _voc_xml("2.png", "<object><name>car</name></object>"),
    ],
)
def test_a_bad_xml_file_costs_its_own_picture_only(tmp_path: Path, xml: str) -> None:
    (tmp_path / "Annotations").mkdir()
    for stem in ("1", "2", "3"):
        write_picture(tmp_path / "JPEGImages" / f"{stem}.png")
        text = xml if stem == "2" else _voc_xml(f"{stem}.png", _voc_object("car", (1, 1, 5, 5)))
        (tmp_path / "Annotations" / f"{stem}.xml").write_text(text)
    data = read_data(tmp_path)
    assert sorted(by_stem(data)) == ["1", "3"]
    assert kinds(data) == ["unreadable labels"]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({}, "nothing"),
        ({"set/notes.md": ""}, "no data.yaml"),
        ({"set/data.yaml": "names: [a]\n"}, "no pictures"),
        ({"set/data.yaml": "names: {0: a, 2: b}\ntrain: x\n"}, "0: 'a', 2: 'b'"),
        ({"set/data.yaml": "names: [a]\ntrain: elsewhere\n"}, "elsewhere"),
        ({"set/data.yaml": "names: [a\n"}, "names and values as YAML"),
        ({"set/annotations/train.json": "[]"}, "list"),
        ({"set/annotations/train.json": "{"}, "names and values as JSON"),
        ({"set/annotations/train.json": '{"images": [1]}'}, "images"),
        ({"set/a.txt": "0 0.5 0.5 1 1"}, "classes.txt"),
        ({"set/images/a.png": "", "set/classes.txt": "car\n\nbus\n"}, "an empty line for class id 1"),
    ],
)
def test_what_is_no_data_set_is_refused_with_a_reason(tmp_path: Path, files: dict[str, str], said: str) -> None:
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    with pytest.raises(DataError, match=said):
        read_data(tmp_path / "set")


@pytest.mark.shared
def test_the_aerial_vehicles_are_split_by_flight_and_all_their_pictures_load(shared_data: Path, tmp_path: Path) -> None:
    labels = ["car", "truck", "bus", "minibus", "cyclist"]
    source = {"path": str(shared_data / "aerial_vehicles"), "names": labels}
    data = read_data(write_mixture(tmp_path / "mix.yaml", source))
    pictures = by_stem(data)
    assert (len(pictures), list(data.problems), data.classes) == (81, [], tuple(labels))
    assert sum(len(picture.xyxy_px) for picture in pictures.values()) == 1958
    groups = [{picture.group for picture in chosen} for chosen in data.splits.values()]
    assert all(groups)
    assert sum(map(len, groups)) == len(set.union(*groups)) == 7
    for picture in list(pictures.values())[::8]:
        np.testing.assert_array_equal(load_picture(picture), cv2.imread(str(picture.path)))
