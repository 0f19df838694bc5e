"""A film whose parts were looked at by somebody else is the same run, and nobody looks twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from cli.conftest import write_site
from cli.test_cli import make_video
from cli.test_replay import SELECTIONS, TABLES, assert_same
from scale.noted_detectors import looks

from standoff.config import load_settings
from standoff.core.outputs import LOOKS_FOLDER
from standoff.scale import FilmPart, FilmPlan, parts_of, plan_films

PART_S = 0.5


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_video(tmp_path_factory.mktemp("films") / "site.mp4", 36)


def noted(words: Path, **more: Any) -> dict[str, Any]:
    return {"detect": {"factory": "scale.noted_detectors:Noted", "options": {"words": str(words), **more}}}


def plan(film: Path, folder: Path, out: str, detector: dict[str, Any], **more: Any) -> FilmPlan:
    site = write_site(folder, outputs=[*TABLES, "hazards"], replace=detector)
    (one,) = plan_films([film], folder / out, load_settings(site, more))
    return one


@pytest.mark.parametrize("selection", SELECTIONS.values(), ids=SELECTIONS.keys())
def test_a_film_looked_at_in_parts_is_the_run_in_one_piece_and_nobody_looks_twice(
    film: Path, tmp_path: Path, selection: dict[str, Any]
) -> None:
    words = tmp_path / "words"
    whole = plan(film, tmp_path, "whole", noted(words), **selection)
    assert whole.watch().message == ""
    wanted = sorted(looks(words))
    words.unlink()
    one = plan(film, tmp_path, "in parts", noted(words), **selection)
    parts = parts_of(one, PART_S)
    assert (
        len(parts)
        == {"all": 7, "every": 7, "detect_every": 7, "part": 5, "everything": 6}[
            next(name for name, other in SELECTIONS.items() if other is selection)
        ]
    )
    assert [part.look() for part in reversed(parts)] == [""] * len(parts)
    in_parts = looks(words)
    assert one.watch().message == ""
    # Where the rhythm depends on who is near, the parts hold what is looked at anyway.
    assert len(in_parts) == len(set(in_parts)) and set(in_parts) <= set(wanted)
    assert sorted(looks(words)) == wanted
    if selection.get("detect_every", 1) == 1:
        assert sorted(in_parts) == wanted
    assert_same(one.out, whole.out)
    assert not (one.out / LOOKS_FOLDER).exists()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_is_missing_or_broken_of_the_looks_is_looked_at_by_whoever_watches(
    film: Path, tmp_path: Path, seed: int
) -> None:
    words = tmp_path / "words"
    whole = plan(film, tmp_path, "whole", noted(words))
    whole.watch()
    words.unlink()
    one = plan(film, tmp_path, "in parts", noted(words))
    parts = parts_of(one, PART_S)
    del parts[2 + seed]
    for part in parts:
        part.look()
    kept = sorted((one.out / LOOKS_FOLDER).rglob("*.parquet"))
    kept[0].write_bytes(kept[0].read_bytes()[: 200 + 500 * seed])
    known = set(looks(words)) - set(range(5))
    words.unlink()
    assert one.watch().message == ""
    assert sorted({*looks(words), *known}) == [*range(36)]
    assert set(looks(words)) >= set(range(5))
    assert_same(one.out, whole.out)


def test_looks_of_other_settings_or_of_another_film_are_not_taken(film: Path, tmp_path: Path) -> None:
    words = tmp_path / "words"
    for part in parts_of(plan(film, tmp_path, "out", noted(words)), PART_S):
        part.look()
    words.unlink()
    other = plan(film, tmp_path, "out", noted(words), locate={"radius_m": {"worker": 2.0}})
    assert other.watch().message == ""
    assert sorted(looks(words)) == [*range(36)]
    words.unlink()
    for part in parts_of(plan(film, tmp_path, "twice", noted(words)), PART_S):
        part.look()
    words.unlink()
    longer = make_video(tmp_path / "site.mp4", 40)
    assert plan(longer, tmp_path, "twice", noted(words)).watch().message == ""
    assert sorted(looks(words)) == [*range(40)]


def test_a_detector_that_may_remember_is_never_asked_in_parts(film: Path, tmp_path: Path) -> None:
    one = plan(film, tmp_path, "out", {"detect": {"factory": "cli.test_replay:Unsure"}})
    assert "depends on those before it" in parts_of(one, PART_S)[0].look()
    assert one.watch().message == ""


def test_a_short_film_one_that_is_finished_and_one_that_cannot_be_read_have_no_parts(
    film: Path, tmp_path: Path
) -> None:
    one = plan(film, tmp_path, "out", noted(tmp_path / "words"))
    assert parts_of(one, 2.5) == []
    assert len(parts_of(one, 2.4)) == 2
    assert one.watch().message == ""
    assert parts_of(one, PART_S) == []
    (tmp_path / "broken.mp4").write_bytes(b"no film")
    assert parts_of(plan(tmp_path / "broken.mp4", tmp_path, "out", noted(tmp_path / "words")), PART_S) == []


def test_a_part_that_cannot_be_looked_at_says_why_in_one_line(film: Path, tmp_path: Path) -> None:
    part = parts_of(plan(film, tmp_path, "out", noted(tmp_path / "words")), PART_S)[0]
    gone = FilmPart(part.plan, 100.0, None, part.first, part.count)
    assert "Choose a start" in gone.look()
    assert "\n" not in gone.look()
