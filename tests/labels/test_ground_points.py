from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from labelled_sets import by_stem, kinds, write_mixture, write_picture, write_yolo
from tolerances import PEER_BOX_PX

from standoff.core.boxes import unknown_points
from standoff.core.camera import Camera
from standoff.core.errors import DataError
from standoff.core.pose import View
from standoff.labels import read_data
from standoff.labels.ground_points import points_line, read_points
from standoff.labels.site_classes import to_site_classes
from standoff.labels.types import LabelledPicture
from standoff.labels.views import GroundView, read_views, view_line

_SIZE_PX = (40, 30)
_LINES = "0 0.5 0.5 0.2 0.4\n1 0.25 0.5 0.3 0.4\n"


@pytest.mark.parametrize("seed", range(4))
def test_points_come_back_wherever_they_lie_and_stay_unknown_where_they_are(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    foot_px = rng.uniform(-60.0, 90.0, (9, 2))
    foot_px[rng.random(9) < 0.4] = np.nan
    path = tmp_path / "a.txt"
    path.write_text("".join(points_line(point, _SIZE_PX) for point in foot_px))
    np.testing.assert_allclose(read_points(path, 9, _SIZE_PX), foot_px, atol=PEER_BOX_PX)


def _yolo(folder: Path, points: str | None, lines: str = _LINES) -> Path:
    write_yolo(folder, {"a": lines})
    if points is not None:
        (folder / "points").mkdir()
        (folder / "points" / "a.txt").write_text(points)
    return folder


def test_the_points_of_a_yolo_set_lie_beside_its_labels(tmp_path: Path) -> None:
    picture = by_stem(read_data(_yolo(tmp_path, "0.5 1.25\nnan nan\n")))["a"]
    np.testing.assert_allclose(picture.foot_px, [[19.5, 37.0], [np.nan, np.nan]], atol=PEER_BOX_PX)


def test_labels_without_points_have_none(tmp_path: Path) -> None:
    picture = by_stem(read_data(_yolo(tmp_path, None)))["a"]
    assert picture.foot_px.shape == (2, 2) and np.isnan(picture.foot_px).all()


def test_labels_of_pose_estimation_are_read_and_may_lack_the_point(tmp_path: Path) -> None:
    lines = "0 0.5 0.5 0.2 0.4 0.5 1.0 2\n1 0.25 0.5 0.3 0.4 0 0 0\n"
    picture = by_stem(read_data(_yolo(tmp_path, None, lines)))["a"]
    np.testing.assert_allclose(picture.foot_px, [[19.5, 29.5], [np.nan, np.nan]], atol=PEER_BOX_PX)


@pytest.mark.parametrize("points", ["0.5 0.5\n", "0.5 0.5\n0.5\n", "0.5 0.5\nnever mind\n"])
def test_points_that_do_not_fit_the_labels_are_told(tmp_path: Path, points: str) -> None:
    _yolo(tmp_path, points)
    for name in ("b", "c"):
        write_picture(tmp_path / "images" / f"{name}.png", seed=5)
        (tmp_path / "labels" / f"{name}.txt").write_text(_LINES)
    assert kinds(read_data(tmp_path)) == ["unreadable labels"]


def test_points_stay_with_their_boxes_when_others_are_dropped_mapped_or_ignored(tmp_path: Path) -> None:
    lines = "0 0.2 0.5 0.2 0.4\n1 0.5 0.5 0.2 0.4\n2 0.8 0.5 0.2 0.4\n"
    folder = tmp_path / "set"
    write_yolo(folder, {"a": lines}, ("car", "tree", "person"))
    (folder / "points").mkdir()
    (folder / "points" / "a.txt").write_text("0.1 0.1\n0.2 0.2\n0.3 0.3\n")
    (folder / "ignore.yaml").write_text("a: [[1, 1, 5, 5]]\n")
    source = {"path": "set", "class_map": {"tree": "drop", "car": "rock"}}
    data = read_data(write_mixture(tmp_path / "m.yaml", source))
    (picture,) = by_stem(data).values()
    assert [data.classes[number] for number in picture.class_id[:2]] == ["rock", "person"]
    np.testing.assert_allclose(picture.foot_px[:2], [[3.5, 2.5], [11.5, 8.5]], atol=PEER_BOX_PX)
    assert picture.ignored.tolist() == [False, False, True] and np.isnan(picture.foot_px[2]).all()
    (site,) = by_stem(to_site_classes(data)).values()
    np.testing.assert_allclose(site.foot_px, picture.foot_px[1:])


def test_coco_keypoints_are_taken_by_their_name(tmp_path: Path) -> None:
    write_picture(tmp_path / "images" / "a.png")
    categories = [{"id": 1, "name": "worker", "keypoints": ["head", "ground_point"]}, {"id": 2, "name": "car"}]
    boxes = [
        {"bbox": [4, 4, 8, 8], "category_id": 1, "keypoints": [0, 0, 0, 8.5, 12.5, 2]},
        {"bbox": [14, 4, 8, 8], "category_id": 1, "keypoints": [0, 0, 0, 8.5, 12.5, 0]},
        {"bbox": [24, 4, 8, 8], "category_id": 2, "keypoints": [1, 1, 2]},
    ]
    content = {
        "images": [{"id": 1, "file_name": "a.png"}],
        "annotations": [{"id": number, "image_id": 1, **box} for number, box in enumerate(boxes)],
        "categories": categories,
    }
    (tmp_path / "labels.json").write_text(json.dumps(content))
    picture = by_stem(read_data(tmp_path / "labels.json"))["a"]
    assert picture.foot_px[0].tolist() == [8.0, 12.0] and np.isnan(picture.foot_px[1:]).all()


def test_another_number_of_points_than_boxes_is_a_mistake() -> None:
    boxes = np.array([[0.0, 0.0, 4.0, 4.0]])
    none = np.zeros(1, np.int64)
    with pytest.raises(ValueError, match="2 ground points of 1 boxes"):
        LabelledPicture(Path("a.png"), _SIZE_PX, boxes, none, none > 0, "g", "s", foot_px=unknown_points(2))


@pytest.mark.parametrize("seed", range(4))
def test_a_view_comes_back_and_finds_the_ground(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = Camera(640, 360, np.array([[500.0, 0, 320], [0, 500, 180], [0, 0, 1]]), np.array([-0.1, 0.02, 0, 0, 0]))
    view = View.aimed(
        camera, rng.uniform(10, 30, 3), heading_deg=rng.uniform(0, 360), pitch_deg=rng.uniform(30, 90), roll_deg=1.0
    )
    (tmp_path / "views.jsonl").write_text(view_line("a.jpg", GroundView(view, 1.5)))
    read = read_views(tmp_path / "views.jsonl")["a.jpg"]
    ground_m = np.column_stack([view.position_m[:2] + rng.uniform(-2, 2, (5, 2)), np.full(5, 1.5)])
    seen_m = ground_m + np.append(np.linalg.norm(view.position_m[2]) * view.site_to_camera[2, :2], 0.0)
    np.testing.assert_allclose(read.to_ground(view.project(seen_m)), seen_m[:, :2], atol=1e-6)


@pytest.mark.parametrize("line", ["{}", "no JSON", '{"picture": "a", "size_px": [4]}'])
def test_a_damaged_view_is_told_with_its_line(tmp_path: Path, line: str) -> None:
    (tmp_path / "views.jsonl").write_text(line + "\n")
    with pytest.raises(DataError, match="line 1 of"):
        read_views(tmp_path / "views.jsonl")
