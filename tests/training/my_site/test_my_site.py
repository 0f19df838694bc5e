from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from standoff.core.boxes import overlaps
from standoff.core.classes import CLASSES
from standoff.core.errors import DataError, OutputError
from standoff.labels import read_data
from standoff.training.my_site import prepare_plan, read_preset
from standoff.training.my_site.mixture import replay_folder
from standoff.training.run.params import TrainParams
from standoff.training.run.plan import RunPlan
from standoff.training.run.training_folder import PREPARED_DATA

_FLIGHTS = "abcdef"


def labelled(folder: Path, stems: tuple[str, ...], names: tuple[str, ...]) -> Path:
    """Label the people alone in some of the replayed pictures, under other names."""
    for kind, suffix in (("images", "jpg"), ("labels", "txt")):
        (folder / kind).mkdir(parents=True)
        for number, stem in enumerate(stems):
            shutil.copy(pictures()[number], folder / "images" / f"{stem}.jpg")
            if suffix == "txt":
                lines = label_of(pictures()[number]).read_text(encoding="utf-8").splitlines()
                people = [line for line in lines if line.startswith("0 ")]
                (folder / "labels" / f"{stem}.txt").write_text("\n".join(people), encoding="utf-8")
    (folder / "classes.txt").write_text("\n".join(names) + "\n", encoding="utf-8")
    return folder


def pictures() -> list[Path]:
    return sorted((replay_folder() / "images" / "train").iterdir())


def label_of(picture: Path) -> Path:
    return replay_folder() / "labels" / picture.parent.name / f"{picture.stem}.txt"


def plan(data: Path) -> RunPlan:
    return RunPlan(data, "efficientnet-lite0", None, TrainParams(steps=40, warmup_steps=1, validate_every=10))


@pytest.mark.live
def test_what_the_detector_sees_of_classes_that_nobody_labelled_counts_neither_way(tmp_path: Path) -> None:
    said: list[str] = []
    given = plan(labelled(tmp_path / "labelled", tuple(f"{flight}_0" for flight in _FLIGHTS), ("person",)))
    prepared = prepare_plan(given, tmp_path / "run", said.append)
    data = read_data(prepared.data)
    assert data.classes == tuple(one.name for one in CLASSES)
    assert "excavator" in said[0] and "worker" not in said[0]
    truth = read_data(replay_folder() / "data.yaml")
    by_name = {picture.path.name: picture for picture in truth.splits["train"]}
    seen = machines = 0
    for picture in (one for split in data.splits.values() for one in split if one.source == "site"):
        assert set(picture.class_id[~picture.ignored].tolist()) <= {0}
        whole = by_name[pictures()[_FLIGHTS.index(picture.path.stem[0])].name]
        boxes = whole.xyxy_px[(whole.class_id > 0) & ~whole.ignored]
        found = overlaps(boxes, picture.xyxy_px[picture.ignored])
        seen, machines = seen + int((found > 0.3).any(axis=1).sum()), machines + len(boxes)
    assert 10 < machines < 3 * seen, (machines, seen)


def test_the_site_s_frames_and_what_was_learnt_before_are_drawn_seven_to_three(tmp_path: Path) -> None:
    given = plan(labelled(tmp_path / "labelled", ("a_0", "b_0", "c_0", "d_0"), tuple(one.name for one in CLASSES)))
    data = read_data(prepare_plan(given, tmp_path / "run", lambda _: None).data)
    weights = dict.fromkeys(("site", "replay"), 0.0)
    for picture in data.splits["train"]:
        weights[picture.source] += picture.weight
    assert weights["replay"] / sum(weights.values()) == pytest.approx(0.3, abs=0.01)
    assert {picture.source for picture in data.splits["val"]} == {"site", "replay"}


def test_frames_of_one_flight_are_all_trained_on_and_no_validation_chooses(tmp_path: Path) -> None:
    said: list[str] = []
    given = plan(labelled(tmp_path / "labelled", ("a_0", "a_1"), tuple(one.name for one in CLASSES)))
    prepared = prepare_plan(given, tmp_path / "run", said.append)
    assert prepared.params.validate_every == given.params.steps
    assert {picture.source for picture in read_data(prepared.data).splits["val"]} == {"replay"}
    assert len(said) == 1 and "one flight" in said[0]


def test_labels_that_are_no_class_of_the_site_are_refused(tmp_path: Path) -> None:
    given = plan(labelled(tmp_path / "labelled", ("a_0", "b_0"), ("kite",)))
    with pytest.raises(DataError, match="kite"):
        prepare_plan(given, tmp_path / "run", lambda _: None)
    assert not (tmp_path / "run").exists()


def test_a_folder_with_a_run_is_not_written_to(tmp_path: Path) -> None:
    given = plan(labelled(tmp_path / "labelled", ("a_0", "b_0"), tuple(one.name for one in CLASSES)))
    (tmp_path / "run" / PREPARED_DATA).mkdir(parents=True)
    prepare_plan(given, tmp_path / "run", lambda _: None)
    (tmp_path / "run" / "run.yaml").touch()
    with pytest.raises(OutputError, match="--resume"):
        prepare_plan(given, tmp_path / "run", lambda _: None)


def test_the_replayed_pictures_show_every_class_with_its_ground_points() -> None:
    data = read_data(replay_folder() / "data.yaml")
    assert not data.problems
    for split in ("train", "val"):
        every = data.splits[split]
        assert set(np.concatenate([one.class_id for one in every])) == {one.id for one in CLASSES}
        assert all(np.isfinite(one.foot_px).all() for one in every)
    assert sum(path.stat().st_size for path in replay_folder().rglob("*.jpg")) < 4e6


def test_the_preset_is_settings_that_training_knows() -> None:
    preset = read_preset()
    assert set(preset) == {"arch", "weights", "train"}
    assert yaml.safe_load(yaml.safe_dump(preset)) == preset
