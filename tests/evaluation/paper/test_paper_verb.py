from __future__ import annotations

import json
import re
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import drawn_clip
import numpy as np
import pytest
import tolerances
from evaluation.paper import drawn_board
from pages import without_pictures
from typer.testing import CliRunner

from standoff.cli.app import app
from standoff.core.errors import ConfigError, SimulationError
from standoff.evaluation.paper.published import PUBLISHED
from standoff_sim.clip.presets import PRESETS, Plan


def evaluate(*words: object) -> str:
    result = CliRunner().invoke(app, ["evaluate", "paper", *map(str, words)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


@cache
def first_clip(*words: object) -> dict[str, Any]:
    """Return what is measured on the first clip; nobody changes it, and the same words are run once."""
    return dict(json.loads(evaluate(*words, "--json", "-"))["clips"][0])


def figures_of(clip: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {figure["name"]: figure for figure in clip["paper"]}


@pytest.fixture(scope="module", params=["paper", pytest.param("paper+tls", marks=pytest.mark.live), "oriented"])
def measured(request: pytest.FixtureRequest, clip_folder: Path) -> dict[str, Any]:
    return first_clip(clip_folder, "--method", request.param)


def test_flat_entities_under_true_boxes_are_where_they_are(measured: dict[str, Any]) -> None:
    limit_m = tolerances.DRAWN_SITE_M[measured["trial"]["method"]]
    assert {score["class_name"] for score in measured["localisation"]} == {"worker", "wheel_loader", "excavator"}
    for score in measured["localisation"]:
        assert score["ale_m"] == 0.0
        assert score["position_mean_m"] < limit_m
    for group in measured["pairs"]:
        assert 0.0 < group["scores"]["after the filter"]["made_m"] < limit_m


def test_the_map_alone_is_measured(measured: dict[str, Any]) -> None:
    score = measured["map_only"]
    assert score["without_map"] == score["without_map_since_seen"] == len(drawn_clip.HIDDEN)
    for kind in ("level", "uneven"):
        assert 0.0 < score[kind]["median_m"] < tolerances.DRAWN_SITE_M[measured["trial"]["method"]]


def test_failed_frames_are_counted_as_failed_whatever_fills_them(measured: dict[str, Any]) -> None:
    hidden, frames = len(drawn_clip.HIDDEN), drawn_clip.FRAMES
    rectification = measured["rectification"]
    assert rectification["failed"] == rectification["failed_covered"] == hidden
    assert sum(rectification["failed_by_reason"].values()) == hidden
    assert rectification["within_share"] == pytest.approx((frames - hidden) / frames)
    assert rectification["corner_rmse_px"] < 1.5
    by_pair = {group["class_pair"]: group for group in measured["pairs"]}
    unseen = {"worker-wheel_loader": 0, "worker-excavator": len(drawn_clip.UNSEEN)}
    for name, group in by_pair.items():
        scores = group["scores"]
        assert scores["after the filter"]["frames"] == frames
        assert scores["after the filter"]["measured"] == frames - hidden - unseen[name]
        assert scores["after, failures filled"]["measured"] == frames - unseen[name]
        assert sum(group["missing_by_reason"].values()) == hidden + unseen[name]


def test_the_stated_errors_of_distances_are_checked(measured: dict[str, Any]) -> None:
    for group in measured["pairs"]:
        coverage = group["coverage"]
        assert 0.0 <= coverage["inside_68"] <= coverage["inside_95"] <= 1.0
        assert 0.0 < coverage["sigma_m"] < 3.0
        assert coverage["observed"] == sorted(coverage["observed"])


def test_answers_are_scored_in_every_frame_in_which_a_pair_can_be_seen(measured: dict[str, Any]) -> None:
    frames, hidden, unseen = drawn_clip.FRAMES, len(drawn_clip.HIDDEN), len(drawn_clip.UNSEEN)
    for answers in (measured["frame_by_frame"]["measured"], measured["frame_by_frame"]["said"]):
        assert sum(map(sum, answers["counts"])) == 2 * frames - unseen
        assert answers["answers"][3]["said"] == 2 * hidden
        assert answers["unknown_share"] == pytest.approx(2 * hidden / (2 * frames - unseen))
    # An excavator's and a worker's radii add up to 14.1 m, a loader's to 7.8 m: the excavator is in breach throughout.
    assert [one["from_start"] for one in measured["breaches"]].count(True) >= 1
    assert measured["frame_by_frame"]["measured"]["answers"][0]["recall"] > 0.8


def test_the_papers_benchmark_is_scored_against_truth_as_well(measured: dict[str, Any]) -> None:
    for group in measured["pairs"]:
        benchmark = group["scores"]["benchmark itself"]
        assert benchmark["measured"] >= drawn_clip.FRAMES - 4
        assert 0.0 < benchmark["made_m"] < tolerances.DRAWN_SITE_M[measured["trial"]["method"]]


def test_every_figure_of_the_mobile_test_stands_beside_the_papers(measured: dict[str, Any]) -> None:
    figures = figures_of(measured)
    wanted = {name for name in PUBLISHED if name.startswith(("mobile", "ale"))}
    assert wanted | {"rectification time"} == set(figures)
    made = figures["mobile made worker-wheel_loader"]
    assert made["paper"] == 0.33
    assert made["count"] == drawn_clip.FRAMES - len(drawn_clip.HIDDEN)
    assert made["of"] == drawn_clip.FRAMES


@pytest.mark.live
def test_box_errors_make_ale(clip_folder: Path) -> None:
    words = (clip_folder, "--method", "oriented", "--detector", "noisy", "--box-error", "3")
    one, other = (first_clip(*words, "--seed", seed) for seed in (0, 6))
    again = first_clip(*words)  # the default seed
    assert one["localisation"][0]["ale_m"] == again["localisation"][0]["ale_m"] != other["localisation"][0]["ale_m"]
    made_m = [clip["pairs"][0]["scores"]["after the filter"]["made_m"] for clip in (one, again)]
    assert made_m[0] == pytest.approx(made_m[1])
    ale = figures_of(one)["ale worker"]["measured"]
    # A centre of two edges, each 3 px off: 2.1 px a coordinate, 2.7 px on the average, of 3 cm or so.
    assert 0.03 < ale < 0.15


def test_larger_box_errors_make_larger_errors(clip_folder: Path) -> None:
    words = (clip_folder, "--method", "oriented")
    noise: tuple[tuple[str, ...], ...] = ((), *(("--detector", "noisy", "--box-error", size) for size in ("3", "8")))
    clips = [first_clip(*words, *more) for more in noise]
    for series in (
        [clip["localisation"][0]["ale_m"] for clip in clips],
        [clip["localisation"][0]["position_mean_m"] for clip in clips],
        [clip["pairs"][0]["scores"]["before the filter"]["made_m"] for clip in clips],
    ):
        assert series[0] < series[1] < series[2]


def test_on_flat_ground_a_flat_entity_is_off_by_the_map_alone(measured: dict[str, Any]) -> None:
    for score in measured["localisation"]:
        # Flat entities: whichever point of the box stands for them, it is near the foot.
        assert score["map_mean_m"] == pytest.approx(score["position_mean_m"], abs=tolerances.FLAT_BOX_POINT_M)


def test_a_clip_that_fails_does_not_lose_the_others(clip_folder: Path, board_folder: Path, tmp_path: Path) -> None:
    broken = Path(shutil.copytree(board_folder, tmp_path / "broken"))
    (broken / "video.mp4").write_bytes(b"no video")
    out, page = tmp_path / "r.json", tmp_path / "r.html"
    words = [clip_folder, broken, board_folder, "--json", out, "--report", page]
    result = CliRunner().invoke(app, ["evaluate", "paper", *map(str, words)])
    assert result.exit_code == 2
    assert "broken" in result.stderr and "93.51 %" in result.stdout
    written = json.loads(out.read_text())
    assert [clip["clip"] for clip in written["clips"]] == ["drawn", "board"]
    assert [entry["clip"] for entry in written["failed"]] == ["broken"]
    assert "broken is missing: expected" in without_pictures(page.read_text(encoding="utf-8"))


def test_every_preset_is_looked_for_and_none_that_is_there_is_rendered(
    clip_folder: Path, board_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rendered = []

    def refuse(plan: Plan, out: Path, on_frame: object) -> None:
        rendered.append((plan.name, plan.preset.frames, plan.preset.width_px))
        raise SimulationError(expected="a graphics card", found="none", fix="buy one")

    monkeypatch.setattr("standoff_sim.clip.write_clip.record_clip", refuse)
    few = {name: PRESETS[name] for name in ("virtual", "board", "busy", "far")}
    monkeypatch.setattr("standoff_sim.clip.presets.PRESETS", few)
    shutil.copytree(clip_folder, tmp_path / "virtual")
    shutil.copytree(board_folder, tmp_path / "board")
    words = ["--all", "--clips", tmp_path, "--size", "640x360", "--frames", "6", "--json", tmp_path / "all.json"]
    result = CliRunner().invoke(app, ["evaluate", "paper", *map(str, words)])
    assert result.exit_code == 2 and result.stderr.count("Buy one") == 2
    assert rendered == [("busy", 6, 640), ("far", 6, 640)]
    assert len(json.loads((tmp_path / "all.json").read_text())["clips"]) == 2


def test_one_page_shows_it_all(clip_folder: Path, board_folder: Path, tmp_path: Path) -> None:
    out = evaluate(clip_folder, board_folder, "--report", tmp_path / "sub" / "r.html")
    assert "beside the paper" in out and "0.33 m" in out and "93.51 %" in out
    page = (tmp_path / "sub" / "r.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 4
    assert "data:image/jpeg;base64," in page
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)
    said = without_pictures(page)
    assert "frame by frame" in said and "inside 95 %" in said and "had begun with the clip" in said
    assert "93.51 %" in said and "37 frames" in said and "too few edges" in said
    assert "nan" not in said.lower()


def test_the_lab_test_on_a_drawn_board(board_folder: Path) -> None:
    (clip,) = json.loads(evaluate(board_folder, "--json", "-"))["clips"]
    board, figures = clip["board"], figures_of(clip)
    assert board["frames"] == drawn_board.FRAMES and board["measured"] == drawn_board.FRAMES - 1
    assert board["before"][drawn_board.EMPTY] is None
    assert board["corner_rmse_px"] < 0.3 and board["misplaced"] == 0
    assert board["exact_after_percent"] == pytest.approx(100.0)
    assert 95.0 < board["after_percent"] < 100.0
    assert board["after_percent"] < board["after_pose_percent"] <= 100.0
    assert board["before_percent"] < board["after_percent"]
    assert board["worst_frame"] == drawn_board.FRAMES - 1
    assert np.nanmean(np.array(board["before"], float)) == pytest.approx(board["before_percent"])
    assert {name for name in PUBLISHED if name.startswith("board")} == set(figures)
    assert figures["board before"]["count"] == drawn_board.FRAMES - 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "neither"),
        (("clip", "--all"), "both"),
        (("clip", "--detector", "noisy"), "--box-error"),
        (("clip", "--box-error", "3"), "--detector noisy"),
        (("clip", "--detector", "noisy", "--box-error", "wide"), "wide"),
        (("clip", "--detector", "noisy", "--box-error", "-3"), "-3"),
        (("clip", "--detector", "no-such.onnx"), "no-such.onnx"),
        (("--all",), "--clips"),
    ],
)
def test_words_that_make_no_sense_are_refused(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(said)):
        evaluate(*words)
