from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import yaml

from standoff.core.classes import CLASSES
from standoff.core.errors import ConfigError
from standoff_sim.composites.composite_set import CompositePlan, record_composites

_SIZE_PX = (320, 180)
_FLIGHTS = ("field", "park", "yard")


@pytest.fixture(scope="session")  # of one worker, wherever its turn to run the tests of this file comes
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Noise of three colours, so that a picture shows which flight it is from; a marked car in each of `yard`."""
    folder = tmp_path_factory.mktemp("photographs")
    (folder / "images").mkdir()
    (folder / "labels").mkdir()
    for flight, code in zip(_FLIGHTS, ((60, 140, 70), (90, 110, 160), (150, 150, 150)), strict=True):
        for number in range(3 if flight == "field" else 1):
            rng = np.random.default_rng(number)
            image = np.clip(rng.normal(0.0, 6.0, (405, 720, 1)) + np.array(code), 0, 255).astype(np.uint8)
            cv2.imwrite(str(folder / "images" / f"{flight}-{number}.png"), image)
            (folder / "labels" / f"{flight}-{number}.txt").write_text("0 0.5 0.5 0.1 0.06\n4 0.2 0.2 0.01 0.02\n")
    entry = {"pictures": "images/*.png", "labels": {0: "vehicle", 4: "ignore"}, "ignore_px": [[0, 0, 400, 400]]}
    (folder / "list.yaml").write_text(yaml.safe_dump([entry]))
    return folder


@pytest.fixture(scope="session")  # of one worker, wherever its turn to run the tests of this file comes
def sets(opengl: None, photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """Make a few pictures."""
    root = tmp_path_factory.mktemp("composites")
    plan = CompositePlan((str(photographs / "list.yaml"),), 6, *_SIZE_PX, held_out=0.25, seed=4)
    record_composites(plan, root / "one", processes=1)
    return SimpleNamespace(one=root / "one", plan=plan)


def _content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.live
def test_the_result_does_not_depend_on_the_number_of_processes(sets: SimpleNamespace, tmp_path: Path) -> None:
    record_composites(sets.plan, tmp_path / "two", processes=2)
    assert _content(sets.one) == _content(tmp_path / "two")


def test_every_picture_has_its_labels_and_they_lie_in_it(sets: SimpleNamespace) -> None:
    images = sorted((sets.one / "images").glob("*/*.jpg"))
    assert len(images) == sets.plan.images
    marked = 0
    for path in images:
        picture = cv2.imread(str(path))
        assert picture is not None and picture.shape == (_SIZE_PX[1], _SIZE_PX[0], 3)
        for line in (sets.one / "labels" / path.parent.name / f"{path.stem}.txt").read_text().splitlines():
            kind, x, y, width, height = (float(word) for word in line.split())
            assert 0 <= kind < len(CLASSES) and 0.0 < width <= 1.0 and 0.0 < height <= 1.0
            assert abs(x - 0.5) + width / 2 <= 0.5 + 1e-5 and abs(y - 0.5) + height / 2 <= 0.5 + 1e-5
            marked += 1
    assert marked > len(images)


def test_no_flight_is_in_two_splits(sets: SimpleNamespace) -> None:
    flights = {
        split: {path.stem.split("-")[1] for path in (sets.one / "images" / split).glob("*.jpg")}
        for split in ("train", "val", "test")
    }
    assert flights["train"] == {"field"}
    assert len(flights["val"]) == len(flights["test"]) == 1
    assert flights["val"] != flights["test"]
    counts = [len(list((sets.one / "images" / split).iterdir())) for split in ("train", "val", "test")]
    assert counts == [2, 2, 2]


def test_places_of_which_nothing_is_known_are_listed(sets: SimpleNamespace) -> None:
    content = yaml.safe_load((sets.one / "ignore.yaml").read_text())
    stems = {path.stem for path in (sets.one / "images").glob("*/*.jpg")}
    assert content and set(content) <= stems
    boxes = np.array([box for found in content.values() for box in found])
    assert (boxes[:, 2:] > boxes[:, :2]).all()
    assert boxes.min() >= -0.5 and (boxes.max(axis=0)[2:] <= np.array(_SIZE_PX) - 0.5).all()


def test_trainers_find_the_splits_and_names(sets: SimpleNamespace) -> None:
    content = yaml.safe_load((sets.one / "data.yaml").read_text())
    assert content["names"] == {site_class.id: site_class.name for site_class in CLASSES}
    assert all((sets.one / content[split]).is_dir() for split in ("train", "val", "test"))
    assert json.loads((sets.one / "dataset.json").read_text())["seed"] == 4


def test_another_seed_gives_other_pictures(sets: SimpleNamespace, tmp_path: Path) -> None:
    record_composites(replace(sets.plan, seed=5, images=1), tmp_path / "out", processes=1)
    (other,) = (tmp_path / "out" / "images").glob("*/*.jpg")
    assert other.read_bytes() not in set(_content(sets.one).values())


@pytest.mark.live
def test_as_many_machines_as_are_asked_for(sets: SimpleNamespace, tmp_path: Path) -> None:
    """None where none may be, and more where more may be."""
    found = {}
    for most in (0, 20):
        record_composites(replace(sets.plan, most_machines=most, seed=6), tmp_path / str(most), processes=1)
        labels = (tmp_path / str(most) / "labels").glob("*/*.txt")
        kinds = [int(line.split()[0]) for path in labels for line in path.read_text().splitlines()]
        found[most] = sum(kind in range(1, 5) for kind in kinds)
    assert found[0] == 0
    assert found[20] > sets.plan.images


@pytest.mark.parametrize("change", [{"seed": -1}, {"width_px": 193}, {"most_machines": 31}])
def test_a_plan_that_cannot_be_made_is_refused(change: dict[str, int]) -> None:
    plan = CompositePlan(("photographs",), 4, *_SIZE_PX, held_out=0.1, seed=0)
    with pytest.raises(ConfigError):
        replace(plan, **change)  # type: ignore[arg-type]
