from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from standoff.core.errors import DataError
from standoff_sim.composites.backgrounds import Background, find_backgrounds, split_backgrounds


def _photograph(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.full((60, 100, 3), 90, np.uint8))
    return path


def _flight(group: str, count: int) -> list[Background]:
    none = np.empty((0, 4))
    return [
        Background(Path(f"{group}-{k}.jpg"), group, 90.0, None, ("noon",), None, none, np.empty(0, np.int64), none)
        for k in range(count)
    ]


def test_a_folder_gives_its_photographs_by_name_and_says_how_they_were_taken(tmp_path: Path) -> None:
    for name in ("b-2.png", "a-1.jpg", "below/c-3.JPG", "notes.txt"):
        _photograph(tmp_path / name) if name != "notes.txt" else (tmp_path / name).write_text("no picture")
    nadir, oblique = (find_backgrounds([f"{tmp_path}{view}"]) for view in ("", ":oblique"))
    assert [b.path.name for b in nadir] == ["a-1.jpg", "b-2.png", "c-3.JPG"]
    assert {b.pitch_deg for b in nadir} == {90.0}
    assert all(b.pitch_deg < 60.0 for b in oblique)


def test_a_list_carries_labels_scale_and_ignored_places(tmp_path: Path) -> None:
    _photograph(tmp_path / "images" / "f-1.jpg")
    (tmp_path / "labels").mkdir()
    # a car of 46 x 20 px in the middle, a cyclist of 10 x 6 px at the left
    (tmp_path / "labels" / "f-1.txt").write_text("0 0.5 0.5 0.46 0.3333333\n4 0.05 0.5 0.1 0.1\n")
    entry = {"pictures": "images/*.jpg", "labels": {0: "vehicle", 4: "ignore"}, "ignore_px": [[0, 0, 5, 5]]}
    (tmp_path / "list.yaml").write_text(yaml.safe_dump([entry | {"light": ["overcast"], "shadow_deg": 30}]))
    (found,) = find_backgrounds([str(tmp_path / "list.yaml")])
    assert (found.group, found.conditions, found.shadow_deg, found.class_id.tolist()) == ("f", ("overcast",), 30, [5])
    assert found.px_per_m == pytest.approx(10.0)
    np.testing.assert_allclose(found.xyxy_px, [[26.5, 19.5, 72.5, 39.5]], atol=1e-4)
    np.testing.assert_allclose(found.ignored_px, [[0.0, 0.0, 5.0, 5.0], [-0.5, 26.5, 9.5, 32.5]], atol=1e-4)


def test_ignored_regions_can_be_given_by_picture_and_paths_have_variables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("f-1.jpg", "f-2.jpg"):
        _photograph(tmp_path / "far" / name)
    monkeypatch.setenv("PHOTOGRAPHS", str(tmp_path / "far"))
    (tmp_path / "unknown.yaml").write_text("f-2: [[1, 2, 3, 4], [5, 6, 7, 8]]")
    entry = {"pictures": "$PHOTOGRAPHS/*.jpg", "ignore_px": [[0, 0, 5, 5]], "ignore_regions": "unknown.yaml"}
    (tmp_path / "list.yaml").write_text(yaml.safe_dump([entry]))
    first, second = find_backgrounds([str(tmp_path / "list.yaml")])
    assert first.ignored_px.tolist() == [[0, 0, 5, 5]]
    assert second.ignored_px.tolist() == [[0, 0, 5, 5], [1, 2, 3, 4], [5, 6, 7, 8]]


@pytest.mark.parametrize(
    "content",
    ["{a: 1}", "- {view: nadir}", "- {pictures: '*.jpg', colour: red}", "- {pictures: '*.jpg', view: sideways}",
     "- {pictures: '*.jpg', light: [moon]}", "- {pictures: '*.jpg', labels: {0: vehicle}}", "- [",
     "- {pictures: '*.gif'}"],
)  # fmt: skip
def test_a_list_that_is_wrong_is_refused(tmp_path: Path, content: str) -> None:
    _photograph(tmp_path / "p.jpg")
    (tmp_path / "list.yaml").write_text(content)
    with pytest.raises(DataError):
        find_backgrounds([str(tmp_path / "list.yaml")])


def test_a_label_without_a_name_is_refused(tmp_path: Path) -> None:
    _photograph(tmp_path / "images" / "f-1.jpg")
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels" / "f-1.txt").write_text("3 0.5 0.5 0.4 0.3\n")
    (tmp_path / "list.yaml").write_text("- {pictures: 'images/*.jpg', labels: {0: vehicle}}")
    with pytest.raises(DataError, match="labels"):
        find_backgrounds([str(tmp_path / "list.yaml")])


def test_no_photographs_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="none"):
        find_backgrounds([str(tmp_path)])
    with pytest.raises(DataError, match="no folder"):
        find_backgrounds([str(tmp_path / "absent")])


@pytest.mark.parametrize("held_out", [0.1, 0.3])
def test_no_flight_is_in_two_splits_and_the_largest_is_for_training(held_out: float) -> None:
    backgrounds = [*_flight("big", 9), *_flight("mid", 5), *_flight("small", 2), *_flight("least", 1)]
    splits = split_backgrounds(backgrounds, held_out)
    groups = {split: {b.group for b in found} for split, found in splits.items()}
    assert sum(map(len, groups.values())) == 4 and all(groups.values())
    assert "big" in groups["train"]
    assert sum(map(len, splits.values())) == len(backgrounds)


@pytest.mark.parametrize(("flights", "held_out"), [(1, 0.3), (2, 0.3), (5, 0.0)])
def test_with_few_flights_or_none_held_out_all_are_for_training(flights: int, held_out: float) -> None:
    backgrounds = [b for k in range(flights) for b in _flight(f"f{k}", 3)]
    splits = split_backgrounds(backgrounds, held_out)
    assert len(splits["train"]) == len(backgrounds) and not splits["val"] and not splits["test"]


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("photos/*.jpg", "entry 1 of"),
        ({"pictures": "*.jpg", "pitch_deg": "steep"}, "pitch_deg"),
        ({"pictures": "*.jpg", "px_per_m": "abc"}, "px_per_m"),
        ({"pictures": "*.jpg", "ignore_px": [[0, 0, 1]]}, "ignore_px"),
        ({"pictures": "*.jpg", "labels": ["vehicle"]}, "labels"),
        ({"pictures": "*.jpg", "group": "site/a"}, "without /"),
        ({"pictures": "*.jpg", "colour": "green"}, "colour"),
    ],
)
def test_an_entry_that_is_wrong_is_refused_in_one_line(tmp_path: Path, entry: object, message: str) -> None:
    _photograph(tmp_path / "f-1.jpg")
    (tmp_path / "list.yaml").write_text(yaml.safe_dump([entry]))
    with pytest.raises(DataError, match=message):
        find_backgrounds([str(tmp_path / "list.yaml")])
