from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from laws import seeds
from pycocotools.coco import COCO

from standoff.core.classes import CLASSES
from standoff.core.errors import ConfigError, OutputError
from standoff.labels import LabelledPicture, read_data
from standoff.labels.types import SPLITS
from standoff.labels.views import read_views
from standoff_sim.clip.dataset import DatasetPlan, record_dataset
from standoff_sim.clip.picture_set import is_marked

_SIZE_PX = (192, 108)
_PLAN = DatasetPlan(
    images=4, per_scene=2, width_px=_SIZE_PX[0], height_px=_SIZE_PX[1], layout="yolo", held_out=0.5, seed=24
)
"""Two sites with little on them: a full one takes ten times as long to build, and nothing here is about that."""
_ROUNDED_PX = 1e-3
"""Half a unit of YOLO's last decimal, in pixels of a picture under 1000 px wide, and some room."""


@pytest.fixture(scope="session")  # of one worker, wherever its turn to run the tests of this file comes
def sets(opengl: None, tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """Render some pictures with one process."""
    folder = tmp_path_factory.mktemp("sets") / "yolo"
    record_dataset(_PLAN, folder, processes=1)
    return SimpleNamespace(yolo=folder)


@pytest.fixture(scope="session")
def other(opengl: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Render the same pictures in the other layout, with two processes."""
    folder = tmp_path_factory.mktemp("sets") / "coco"
    record_dataset(replace(_PLAN, layout="coco"), folder, processes=2)
    return folder


def _yolo_boxes(folder: Path) -> dict[str, list[tuple[int, np.ndarray[Any, Any]]]]:
    """Return class and left, top, width, height in pixels by picture."""
    boxes = {}
    for path in sorted((folder / "labels").glob("*/*.txt")):
        rows = [line.split() for line in path.read_text().splitlines()]
        numbers = [(int(row[0]), np.array(row[1:], dtype=float)) for row in rows]
        boxes[path.stem] = [
            (kind, np.array([*(share[:2] - share[2:] / 2), *share[2:]]) * [*_SIZE_PX, *_SIZE_PX])
            for kind, share in numbers
        ]
    return boxes


def _pictures(folder: Path) -> dict[str, LabelledPicture]:
    splits = read_data(folder).splits.values()
    return {picture.path.stem: picture for pictures in splits for picture in pictures}


def _coco(folder: Path, capsys: pytest.CaptureFixture[str]) -> Iterator[tuple[str, COCO]]:
    for split in SPLITS:
        yield split, COCO(folder / "annotations" / f"{split}.json")
    capsys.readouterr()


def test_every_picture_has_its_label_file_and_its_size(sets: SimpleNamespace) -> None:
    images = sorted((sets.yolo / "images").glob("*/*.jpg"))
    assert len(images) == _PLAN.images
    for path in images:
        picture = cv2.imread(str(path))
        assert picture is not None and picture.shape == (_SIZE_PX[1], _SIZE_PX[0], 3)
        assert picture.std() > 3.0, "a picture shows something"
        assert (sets.yolo / "labels" / path.parent.name / f"{path.stem}.txt").is_file()


def test_yolo_boxes_are_inside_their_pictures(sets: SimpleNamespace) -> None:
    found = [entry for boxes in _yolo_boxes(sets.yolo).values() for entry in boxes]
    assert len(found) >= _PLAN.images
    for kind, (left, top, width, height) in found:
        assert 0 <= kind < len(CLASSES)
        assert width > 0 and height > 0 and left > -_ROUNDED_PX and top > -_ROUNDED_PX
        assert left + width < _SIZE_PX[0] + _ROUNDED_PX and top + height < _SIZE_PX[1] + _ROUNDED_PX


@pytest.mark.live
def test_both_layouts_and_any_number_of_processes_give_the_same_boxes(
    sets: SimpleNamespace, other: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    yolo = _yolo_boxes(sets.yolo)
    pictures = set()
    for _, coco in _coco(other, capsys):
        for image in coco.loadImgs(coco.getImgIds()):
            entries = coco.loadAnns(coco.getAnnIds(imgIds=image["id"]))
            mine = yolo[Path(image["file_name"]).stem]
            assert [kind + 1 for kind, _ in mine] == [entry["category_id"] for entry in entries]
            for (_, box), entry in zip(mine, entries, strict=True):
                np.testing.assert_allclose(box, entry["bbox"], atol=_ROUNDED_PX)
            first, second = (folder / image["file_name"] for folder in (sets.yolo, other))
            assert first.read_bytes() == second.read_bytes()
            pictures.add(first.stem)
    assert pictures == set(yolo)


@pytest.mark.live
def test_both_layouts_have_the_same_ground_points(sets: SimpleNamespace, other: Path) -> None:
    yolo, coco = _pictures(sets.yolo), _pictures(other)
    assert len(yolo) == len(coco)
    for stem, picture in yolo.items():
        np.testing.assert_allclose(picture.foot_px, coco[stem].foot_px, atol=_ROUNDED_PX)


def test_of_everybody_the_ground_point_is_known_and_of_every_picture_the_view(sets: SimpleNamespace) -> None:
    yolo = _pictures(sets.yolo)
    assert len(yolo) == _PLAN.images
    assert all(np.isfinite(picture.foot_px).all() for picture in yolo.values())
    views = read_views(sets.yolo / "views.jsonl")
    assert set(views) == {picture.path.name for picture in yolo.values()}
    assert all(np.isfinite(views[picture.path.name].to_ground(picture.foot_px)).all() for picture in yolo.values())


@pytest.mark.live
def test_pycocotools_knows_every_class_and_picture(other: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for split, coco in _coco(other, capsys):
        assert {c["name"] for c in coco.loadCats(coco.getCatIds())} == {c.name for c in CLASSES}
        files = {path.name for path in (other / "images" / split).iterdir()}
        assert {Path(image["file_name"]).name for image in coco.loadImgs(coco.getImgIds())} == files
        assert all((image["width"], image["height"]) == _SIZE_PX for image in coco.loadImgs(coco.getImgIds()))


def test_the_splits_share_no_scene(sets: SimpleNamespace) -> None:
    scenes = {
        split: {path.stem.split("-")[1] for path in (sets.yolo / "images" / split).glob("*.jpg")} for split in SPLITS
    }
    assert len(set.union(*scenes.values())) == sum(map(len, scenes.values())) == _PLAN.scenes
    assert len(scenes["val"]) == len(scenes["test"]) == 1


def test_trainers_find_the_splits_and_names(sets: SimpleNamespace) -> None:
    content = yaml.safe_load((sets.yolo / "data.yaml").read_text())
    assert content["names"] == {site_class.id: site_class.name for site_class in CLASSES}
    assert all((sets.yolo / content[split]).is_dir() for split in SPLITS)
    assert json.loads((sets.yolo / "dataset.json").read_text())["seed"] == _PLAN.seed


@pytest.mark.parametrize("held_out", [0.0, 0.1, 0.25, 0.5])
@pytest.mark.parametrize("seed", seeds(3))
def test_the_held_out_shares_are_kept(held_out: float, seed: int) -> None:
    plan = replace(_PLAN, images=200, held_out=held_out, seed=seed)
    splits = [plan.split_of(scene) for scene in range(plan.scenes)]
    assert splits.count("val") == splits.count("test") == round(held_out * 100)
    assert splits.count("train") == 100 - 2 * round(held_out * 100)
    assert splits == [plan.split_of(scene) for scene in range(plan.scenes)]


def test_one_scene_is_for_training() -> None:
    assert replace(_PLAN, images=3, per_scene=9).split_of(0) == "train"


def test_an_interrupted_run_leaves_nothing(opengl: None, tmp_path: Path) -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record_dataset(replace(_PLAN, images=1), tmp_path / "out", processes=1, on_picture=stop)
    assert list(tmp_path.iterdir()) == []


def test_files_of_others_are_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(OutputError, match=r"mine\.txt"):
        record_dataset(_PLAN, tmp_path, overwrite=True)
    assert (tmp_path / "mine.txt").read_text() == "keep"


@pytest.mark.parametrize("change", [{"seed": -1}, {"seed": 2**31}, {"width_px": 193}, {"height_px": 2}])
def test_a_plan_that_cannot_be_rendered_is_refused(change: dict[str, int]) -> None:
    with pytest.raises(ConfigError):
        replace(_PLAN, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("visible_px", "share", "side_px", "marked"),
    [
        (60, 0.9, 14, True),
        (4, 1.0, 4, False),
        (40, 0.05, 12, False),
        (9000, 0.05, 140, True),
        (20, 0.9, 5, False),
    ],
)
def test_only_what_can_be_seen_is_marked(visible_px: int, share: float, side_px: int, marked: bool) -> None:
    row = {"x1_px": 10.5, "y1_px": 4.5, "x2_px": 12.5, "y2_px": 4.5 + side_px}
    assert is_marked({**row, "visible_px": visible_px, "visible_share": share}) is marked


def test_what_is_not_in_the_picture_is_not_marked() -> None:
    nowhere = dict.fromkeys(("x1_px", "y1_px", "x2_px", "y2_px"), float("nan"))
    assert not is_marked({**nowhere, "visible_px": 0, "visible_share": 0.0})
