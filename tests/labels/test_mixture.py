from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from labelled_sets import by_stem, kinds, write_mixture, write_picture, write_yolo

from standoff.core.classes import CLASSES
from standoff.core.errors import DataError
from standoff.labels import read_data
from standoff.labels.site_classes import to_site_classes
from standoff.labels.splits import hold_out, require_splits
from standoff.labels.summary import summarise
from standoff.labels.types import SPLITS, Split

_EACH = "0 0.25 0.5 0.5 1\n1 0.75 0.5 0.5 1\n"


def _flights(folder: Path, flights: int = 6, pictures: int = 3) -> Path:
    stems = [f"flight{chr(97 + flight)}-{number:03d}" for flight in range(flights) for number in range(pictures)]
    return write_yolo(folder, dict.fromkeys(stems, _EACH), ("person", "lorry"))


def test_labels_of_several_sets_become_one_list_of_classes(tmp_path: Path) -> None:
    write_yolo(tmp_path / "a", {"a1": _EACH}, ("person", "digger"))
    write_yolo(tmp_path / "b", {"b1": _EACH, "b2": _EACH + "2 0.5 0.5 0.1 0.1\n"}, ("car", "person", "sign"))
    first: dict[str, object] = {"path": "a", "class_map": {"person": "worker"}, "weight": 2}
    second: dict[str, object] = {"path": "b", "class_map": {"person": "ignore", "sign": "drop"}, "split": "test"}
    data = read_data(write_mixture(tmp_path / "mix.yaml", first, second))
    assert data.classes == ("worker", "digger", "car")
    pictures = by_stem(data)
    assert pictures["a1"].class_id.tolist() == [0, 1]
    assert (pictures["a1"].weight, pictures["a1"].source, pictures["a1"].group) == (2.0, "a", "a/a")
    assert pictures["b2"].class_id[0] == 2
    assert pictures["b2"].ignored.tolist() == [False, True]
    assert [picture.path.stem for picture in data.splits["test"]] == ["b1", "b2"]

    second["class_map"] = {"car": "digger", "*": "drop"}
    data = read_data(write_mixture(tmp_path / "mix.yaml", first, second, classes=["digger", "worker"]))
    assert data.classes == ("digger", "worker")
    assert by_stem(data)["a1"].class_id.tolist() == [1, 0]
    assert by_stem(data)["b2"].class_id.tolist() == [0]


def test_two_labels_of_one_class_on_one_box_do_not_contradict(tmp_path: Path) -> None:
    write_yolo(tmp_path / "a", {"a": "0 0.5 0.5 0.5 0.5\n1 0.5 0.5 0.5 0.5\n"}, ("car", "van"))
    data = read_data(write_mixture(tmp_path / "m.yaml", {"path": "a", "class_map": {"*": "vehicle"}}))
    assert (data.classes, kinds(data)) == (("vehicle",), ["box marked twice"])
    assert len(by_stem(data)["a"].xyxy_px) == 1


def test_paths_are_relative_to_the_file_and_may_hold_variables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _flights(tmp_path / "sets" / "f")
    monkeypatch.setenv("TEST_SETS", str(tmp_path / "sets"))
    monkeypatch.setenv("HOME", str(tmp_path))
    for path in ("sets/f", "$TEST_SETS/f", "${TEST_SETS}/f", "~/sets/f"):
        assert len(by_stem(read_data(write_mixture(tmp_path / "m.yaml", {"path": path})))) == 18


def test_negatives_and_ignored_regions(tmp_path: Path) -> None:
    for stem in ("park", "road"):
        write_picture(tmp_path / "bare" / f"{stem}.png")
    _flights(tmp_path / "f")
    regions = {"park": [[0, 0, 10, 10], [30, 20, 90, 90], [50, 50, 60, 60], [7, 7, 7, 9]]}
    (tmp_path / "regions.yaml").write_text(yaml.safe_dump(regions))
    bare: dict[str, object] = {"path": "bare", "negatives": True, "split": "train", "ignore_regions": "regions.yaml"}
    pictures = by_stem(read_data(write_mixture(tmp_path / "m.yaml", bare, {"path": "f"})))
    assert pictures["road"].xyxy_px.shape == (0, 4)
    assert pictures["park"].xyxy_px.tolist() == [[0, 0, 10, 10], [30, 20, 39.5, 29.5]]
    assert pictures["park"].ignored.all()

    # a set may bring its own, as simulated composites do
    (tmp_path / "f" / "ignore.yaml").write_text(yaml.safe_dump({"flighta-000": [[1, 2, 3, 4]], "typo": [[1, 2, 3, 4]]}))
    data = read_data(tmp_path / "f")
    assert kinds(data) == ["ignored region of no picture"]
    picture = by_stem(data)["flighta-000"]
    assert (picture.xyxy_px[2].tolist(), picture.ignored.tolist()) == ([1, 2, 3, 4], [False, False, True])


def test_whole_groups_are_held_out_and_the_same_ones_every_time(tmp_path: Path) -> None:
    _flights(tmp_path / "f", flights=10)
    source = {"path": "f", "held_out": {"val": 0.2, "test": 0.3}}
    chosen = []
    for seed in (0, 0, 1, 2):
        data = read_data(write_mixture(tmp_path / "m.yaml", source, seed=seed))
        groups = {split: {picture.group for picture in data.splits[split]} for split in SPLITS}
        assert [len(groups[split]) for split in SPLITS] == [5, 2, 3]
        assert len(set.union(*groups.values())) == 10
        chosen.append(groups["val"])
    assert chosen[0] == chosen[1]
    assert len({frozenset(groups) for groups in chosen}) > 1
    assert {split: len(pictures) for split, pictures in read_data(tmp_path / "f").splits.items()} == {
        "train": 24,
        "val": 3,
        "test": 3,
    }


_SHARES = st.fixed_dictionaries({}, optional={"val": st.floats(0, 0.49), "test": st.floats(0, 0.49)})


@given(st.lists(st.sampled_from("abcdefgh"), min_size=1, max_size=60), _SHARES, st.integers(0, 5))
def test_every_group_has_one_split_and_something_is_left_to_train(
    groups: list[str], held_out: Mapping[Split, float], seed: int
) -> None:
    split_of = hold_out(groups, held_out, seed)
    assert set(split_of) == set(groups)
    assert "train" in split_of.values()
    assert split_of == hold_out(sorted(groups), held_out, seed)
    for split, share in held_out.items():
        held = sum(split_of[group] == split for group in groups)
        smallest = min(groups.count(group) for group in groups)
        largest = max(groups.count(group) for group in groups)
        # the nearest group is half its own size away at the most; a forced one is no larger than the largest
        assert held <= max(share * len(groups) + largest / 2, largest if share else 0)
        if share and len(set(groups)) > len(held_out):
            assert held >= min(smallest, share * len(groups))


def test_groups_can_be_named_and_found_by_expression(tmp_path: Path) -> None:
    stems = [f"2024-0{day}_{shot}_{time}" for day in (1, 2, 3) for shot in ("x", "y") for time in (10, 20)]
    write_yolo(tmp_path / "f", dict.fromkeys(stems, _EACH), ("person", "lorry"))
    source: dict[str, object] = {"path": "f", "group": r"^(\d+-\d+)", "groups": {"val": ["2024-02"], "test": []}}
    data = read_data(write_mixture(tmp_path / "m.yaml", source))
    assert {picture.group for picture in data.splits["val"]} == {"f/2024-02"}
    assert len(data.splits["val"]) == 4
    assert len(data.splits["train"]) == 8


def test_a_group_that_the_sets_own_splits_cut_is_two_groups_and_said(tmp_path: Path) -> None:
    for split, number in (("train", 1), ("train", 2), ("val", 3)):
        write_picture(tmp_path / split / f"shot-{number}.png")
        (tmp_path / split / f"shot-{number}.txt").write_text("")
    (tmp_path / "classes.txt").write_text("car\n")
    data = read_data(tmp_path)
    assert kinds(data) == ["group in two splits"]
    name = tmp_path.name
    assert {picture.group for picture in data.splits["train"]} == {f"{name}/shot (train)"}
    assert {picture.group for picture in data.splits["val"]} == {f"{name}/shot (val)"}


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ({"weigth": 2}, "`weigth`"),
        ({"weight": 0}, "weight"),
        ({"weight": True}, "weight"),
        ({"names": "car"}, "names"),
        ({"split": "training"}, "training"),
        ({"split": "train", "held_out": {"val": 0.1}}, "held_out and split"),
        ({"held_out": {"val": 0.6, "test": 0.5}}, "held_out"),
        ({"held_out": {"train": 0.6}}, "held_out"),
        ({"groups": {"val": "flighta"}}, "groups"),
        ({"groups": {"val": ["flightz"]}}, "found flightz"),
        ({"groups": {"val": ["flighta"], "test": ["flighta"]}}, "two splits"),
        ({"group": "("}, "regular expression"),
        ({"group": "flight"}, "parentheses"),
        ({"group": "(boat)"}, "flighta-000"),
        ({"group": "(flight)", "held_out": {"val": 0.1}}, "enough groups"),
        ({"class_map": {"digger": "worker"}}, "found digger"),
        ({"class_map": {"person": "worker"}}, "found lorry"),
        ({"ignore_regions": "bad.yaml"}, "flighta-000"),
        ({"ignore_regions": "none.yaml"}, "none.yaml"),
        ({"path": "elsewhere"}, "elsewhere"),
        ({"path": "bad.yaml"}, "names"),
        ({"negatives": True, "path": "nothing"}, "found no picture"),
    ],
)
def test_a_mixture_that_makes_no_sense_is_refused_with_a_reason(
    tmp_path: Path, source: dict[str, object], said: str
) -> None:
    _flights(tmp_path / "f", flights=3, pictures=1)
    (tmp_path / "bad.yaml").write_text("flighta-000: [[3, 3, 1, 1]]\n")
    (tmp_path / "nothing").mkdir()
    path = write_mixture(
        tmp_path / "m.yaml", {"path": "f", "class_map": {"lorry": "drop"}, **source}, classes=["person", "worker"]
    )
    with pytest.raises(DataError) as refusal:
        read_data(path)
    assert said in str(refusal.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("sources: []\n", "none"),
        ("sources: [f]\n", "source 1"),
        ("sources: [{path: f}, {path: f}]\n", "f, f"),
        ("sources: [{path: f}]\nclasses: [a, a]\n", "a, a"),
        ("sources: [{path: f}]\nclass: [a]\n", "`class`"),
        ("sources: [{path: f, negatives: true}]\n", "classes"),
    ],
)
def test_a_mixture_file_is_checked_as_a_whole(tmp_path: Path, content: str, said: str) -> None:
    _flights(tmp_path / "f", flights=3, pictures=1)
    (tmp_path / "m.yaml").write_text(content)
    with pytest.raises(DataError, match=said):
        read_data(tmp_path / "m.yaml")


def test_held_out_does_not_override_a_sets_own_splits(tmp_path: Path) -> None:
    for split in ("train", "val"):
        write_picture(tmp_path / "f" / split / f"{split}-1.png")
        (tmp_path / "f" / split / f"{split}-1.txt").write_text("")
    (tmp_path / "f" / "classes.txt").write_text("car\n")
    with pytest.raises(DataError, match="found train, val"):
        read_data(write_mixture(tmp_path / "m.yaml", {"path": "f", "held_out": {"val": 0.5}}))


def test_site_classes_rename_what_they_know_and_drop_the_rest(tmp_path: Path) -> None:
    lines = _EACH + "2 0.5 0.5 0.2 0.2\n"
    write_yolo(tmp_path / "f", {"a": lines}, ("Person", "kite", "Dump Truck"))
    (tmp_path / "f" / "ignore.yaml").write_text("a: [[1, 1, 5, 5]]\n")
    data = to_site_classes(read_data(tmp_path / "f"))
    assert data.classes == tuple(site_class.name for site_class in CLASSES)
    picture = by_stem(data)["a"]
    assert [data.classes[number] for number in picture.class_id[:2]] == ["worker", "dump_truck"]
    assert picture.ignored.tolist() == [False, False, True]
    write_yolo(tmp_path / "g", {"a": lines}, ("kite", "tree", "cloud"))
    with pytest.raises(DataError, match="kite, tree, cloud"):
        to_site_classes(read_data(tmp_path / "g"))


def test_the_summary_counts_everything_once(tmp_path: Path) -> None:
    folder = _flights(tmp_path / "f", flights=5, pictures=2)
    (folder / "labels" / "flighta-000.txt").write_text("")
    (folder / "labels" / "flightb-000.txt").write_text("no labels")
    (folder / "ignore.yaml").write_text("flightc-000: [[1, 1, 5, 5]]\n")
    data = read_data(folder)
    summary = summarise(data)
    splits = summary.splits.values()
    assert (sum(one.pictures for one in splits), summary.skipped) == (9, 1)
    assert [sum(one.boxes[name] for one in splits) for name in data.classes] == [8, 8]
    assert (sum(one.empty for one in splits), sum(one.ignored for one in splits)) == (1, 1)
    assert all(one.sources == {"f": one.pictures} and sum(one.groups.values()) == one.pictures for one in splits)
    assert summary.problems == {"unreadable labels": 1}


def test_pictures_of_one_scene_alone_are_told_so_when_there_is_nothing_to_hold_out(tmp_path: Path) -> None:
    alone = read_data(_flights(tmp_path / "alone", flights=1))
    with pytest.raises(
        DataError, match=r"all pictures are of one scene \(flighta\)\. Add another video, or give `group`"
    ):
        require_splits(alone, ("train", "val"))
    require_splits(alone, ("train",))
    require_splits(read_data(_flights(tmp_path / "many")), ("train", "val"))
    path = write_mixture(tmp_path / "mix.yaml", {"path": "many", "split": "train"})
    with pytest.raises(DataError, match="found none in val"):
        require_splits(read_data(path), ("train", "val"))
