from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from stages.detect.conftest import CELL_PX, MakeModel
from typer.testing import CliRunner

from standoff.cli.app import app
from standoff.core.errors import ConfigError, DataError, ModelError, OutputError, StandoffError

SIDE_PX = 64
SCENES = 6
RED_GREEN, RED_BLUE = (0, 255, 255), (255, 0, 255)


def evaluate(*words: object) -> str:
    result = CliRunner().invoke(app, ["evaluate", "detection", *map(str, words)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures of coloured cells: a worker in each, an excavator in every second, and vehicles as black as the rest."""
    folder = tmp_path_factory.mktemp("cells")
    for scene in range(SCENES):
        image = np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8)
        things = [(0, scene, 1, RED_GREEN)] + [(1, scene, 4, RED_BLUE)] * (scene % 2) + [(2, 0, 6, (0, 0, 0))]
        lines = []
        for class_id, column, row, colour in things:
            left, top = column * CELL_PX, row * CELL_PX
            image[top : top + CELL_PX, left : left + CELL_PX] = colour
            share = CELL_PX / SIDE_PX
            lines.append(f"{class_id} {(column + 0.5) * share} {(row + 0.5) * share} {share} {share}")
        for kind, suffix in (("images", "png"), ("labels", "txt")):
            (folder / kind / "test").mkdir(parents=True, exist_ok=True)
            path = folder / kind / "test" / f"scene{scene}-0.{suffix}"
            if kind == "images":
                assert cv2.imwrite(str(path), image)
            else:
                path.write_text("\n".join(lines) + "\n")
    (folder / "classes.txt").write_text("worker\nexcavator\nvehicle\n")
    return folder


@pytest.fixture
def model(make_model: MakeModel) -> Path:
    return make_model(("person", "digger"), (SIDE_PX, SIDE_PX))


def classes_of(result: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {one["name"]: one for one in result["score"]["classes"]}


def test_cells_of_the_right_colour_are_found_and_what_the_model_does_not_know_scores_nought(
    cells: Path, model: Path
) -> None:
    result = json.loads(evaluate("--data", cells, "--model", model, "--json", "-"))
    (own,) = result["models"]
    by_class = classes_of(own)
    assert (result["pictures"], by_class["worker"]["truths"], by_class["excavator"]["truths"]) == (SCENES, SCENES, 3)
    assert by_class["worker"]["ap11"] == by_class["excavator"]["ap11"] == 1.0
    assert (by_class["vehicle"]["ap11"], by_class["reference"]["ap11"]) == (0.0, None)
    assert own["classes_unknown_to_the_model"] == ["vehicle"]
    assert own["score"]["mean_ap11"] == pytest.approx(2 / 3)
    assert own["score"]["average_iou"] > 0.9
    assert own["coco"]["ap50"] == pytest.approx(2 / 3)
    assert 0.0 < own["median_ms"] <= own["p95_ms"]


def test_models_stand_side_by_side_with_what_chance_may_do(cells: Path, model: Path, make_model: MakeModel) -> None:
    other = make_model(("worker",), (SIDE_PX, SIDE_PX))
    words = ("--data", cells, "--model", model, "--model", other, "--slices", "1x1", "--slices", "2x1")
    result = json.loads(evaluate(*words, "--at", 0.5, "--json", "-"))
    first, second = result["models"]
    assert first["label"] != second["label"]
    assert second["slices"] == [2, 1]
    assert classes_of(second)["excavator"]["ap11"] == 0.0
    assert result["difference_95_of_the_first_two"]["high"] < 0.0
    assert {row["class"] for row in first["at_thresholds"]} == {"worker", "excavator", "vehicle"}
    text = evaluate(*words)
    assert "does not know excavator, vehicle: AP 0" in " ".join(text.split())
    assert "more than chance" in " ".join(text.split())


def test_models_of_one_name_are_told_apart_by_their_folders(cells: Path, model: Path, tmp_path: Path) -> None:
    files = [tmp_path / name / "w" / "model.onnx" for name in ("x", "y")]
    for file in files:
        file.parent.mkdir(parents=True)
        shutil.copy(model, file)
    words = [word for file in (*files, model) for word in ("--model", file)]
    result = json.loads(evaluate("--data", cells, *words, "--json", "-"))
    assert [one["label"] for one in result["models"]] == ["x/w/model", "y/w/model", model.parent.name + "/model"]
    with pytest.raises(ConfigError, match="model 2 times"):
        evaluate("--data", cells, "--model", model, "--model", model)


def test_an_output_that_cannot_be_written_costs_no_table(cells: Path, model: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(
        app,
        [
            "evaluate",
            "detection",
            "--data",
            str(cells),
            "--model",
            str(model),
            "--json",
            str(tmp_path / "no" / "r.json"),
        ],
    )
    assert isinstance(result.exception, OutputError)
    assert "AP11" in result.stdout


def test_machines_can_be_scored_as_one_class_and_a_class_left_out(cells: Path, model: Path) -> None:
    words = ("--data", cells, "--model", model, "--merge-machines", "--json", "-")
    (merged,) = json.loads(evaluate(*words))["models"]
    assert [one["truths"] for one in merged["score"]["classes"]] == [SCENES, SCENES + 3]
    (without,) = json.loads(evaluate(*words, "--without", "vehicle"))["models"]
    assert [one["truths"] for one in without["score"]["classes"]] == [SCENES, 3]
    assert without["score"]["mean_ap11"] == 1.0


def test_a_picture_cut_short_is_named_and_left_out_for_all_models(cells: Path, model: Path, tmp_path: Path) -> None:
    data = tmp_path / "cells"
    shutil.copytree(cells, data)
    broken = data / "images" / "test" / "scene2-0.png"
    broken.write_bytes(broken.read_bytes()[:-30])
    (data / "labels" / "test" / "scene3-0.txt").write_text("9 0.5 0.5 0.1 0.1\n")
    result = CliRunner().invoke(
        app, ["evaluate", "detection", "--data", str(data), "--model", str(model), "--json", str(tmp_path / "r.json")]
    )
    assert result.exit_code == 0, result.output
    assert "1 times unreadable picture" in result.stderr and broken.name in result.stderr
    assert "class id 9" in result.stderr
    figures = json.loads((tmp_path / "r.json").read_text())
    assert (figures["pictures"], len(figures["problems"])) == (SCENES - 2, 2)
    assert classes_of(figures["models"][0])["worker"]["truths"] == SCENES - 2


def test_where_nothing_says_what_is_held_out_everything_is_scored(cells: Path, model: Path, tmp_path: Path) -> None:
    for kind in ("images", "labels"):
        shutil.copytree(cells / kind / "test", tmp_path / "plain" / kind)
    shutil.copy(cells / "classes.txt", tmp_path / "plain")
    words = ("--data", tmp_path / "plain", "--model", model, "--json", "-")
    whole = json.loads(evaluate(*words))
    assert (whole["pictures"], whole["data"]) == (SCENES, "plain, all")
    assert json.loads(evaluate(*words, "--split", "test"))["pictures"] < SCENES
    assert json.loads(evaluate("--data", cells, *words[2:]))["data"].endswith(", test")


def test_markdown_is_tables_and_figures_are_pictures(cells: Path, model: Path, tmp_path: Path) -> None:
    text = evaluate(
        "--data", cells, "--model", model, "--markdown", "--limit", 4, "--figure", tmp_path / "f",
        "--json", tmp_path / "result.json",
    )  # fmt: skip
    tables = [block for block in text.split("\n\n") if block.startswith("|")]
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1
    assert "| worker | 4 | 1.000" in text
    assert sorted(path.name for path in (tmp_path / "f").iterdir()) == ["accuracy_time.png", "precision_recall.png"]
    for path in (tmp_path / "f").iterdir():
        drawn = cv2.imread(str(path))
        assert drawn is not None and drawn.std() > 1.0
    assert json.loads((tmp_path / "result.json").read_text())["pictures"] == 4


@pytest.mark.parametrize(
    ("words", "error", "telling"),
    [
        (("--split", "val"), DataError, "--split"),
        (("--slices", "0x1"), ConfigError, "COLUMNSxROWS"),
        (("--slices", "1x1", "--slices", "2x2"), ConfigError, "once for each"),
        (("--without", "crane"), ConfigError, "crane"),
        (("--frames", "1-9"), ConfigError, "CSV"),
        (("--without", "worker", "--without", "excavator", "--without", "vehicle"), DataError, "something to find"),
        (("--model", "cells.txt"), ModelError, "cells.txt"),
    ],
)
def test_bad_input_is_one_line(
    cells: Path, model: Path, words: tuple[str, ...], error: type[StandoffError], telling: str
) -> None:
    with pytest.raises(error, match=telling) as caught:
        evaluate("--data", cells, "--model", model, *words)
    assert "\n" not in str(caught.value)
