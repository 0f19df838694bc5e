from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluation.standing_people import (
    HEADER,
    make_pairs,
    make_tracks,
    make_truth,
    write_run,
    write_truth,
)

from standoff.core.errors import DataError
from standoff.evaluation.positions import evaluate_positions, score_positions
from standoff.evaluation.positions_input import read_truth


def test_a_run_folder_and_a_truth_file_give_the_same_figures(tmp_path: Path) -> None:
    truth = make_truth()
    tracks = make_tracks(truth, np.random.default_rng(2).normal(0.0, 0.3, (len(truth["frame"]), 2)))
    pairs = make_pairs(tracks)
    write_run(tmp_path, tracks, pairs)
    truth_file = write_truth(tmp_path / "truth.csv", truth)
    found = evaluate_positions(tmp_path, truth_file, frames=(2, 4), pairs_up_to_m=4.5)
    assert found == score_positions(tracks, pairs, truth, frames=(2, 4), pairs_up_to_m=4.5)


def test_tracks_of_other_classes_are_left_out(tmp_path: Path) -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    tracks["class"] = np.where(truth["id"] == 4, "excavator", "worker").astype(object)
    write_run(tmp_path, tracks, make_pairs(tracks))
    result = evaluate_positions(tmp_path, write_truth(tmp_path / "truth.csv", truth))
    assert (result.entities.recall, result.entities.precision) == (0.75, 1.0)


def test_the_shared_truth_is_read(shared_data: Path) -> None:
    truth = read_truth(shared_data / "pets2009" / "gt.csv")
    assert len(truth["frame"]) == 2015
    assert (truth["conf"] == 0).sum() == 146


def truth_lines(*rows: str) -> str:
    return "\n".join([HEADER, *rows]) + "\n"


GOOD_ROW = "1,1,10,10,30,75,1,0.5,0.5,0"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "expected a CSV file of numbers with the columns frame,id,"),
        ("frame,id,x\n1,1,2\n", "without y,w,h,conf,X,Y"),
        (truth_lines("1,1,ten,10,30,75,1,0.5,0.5,0"), "expected a CSV file of numbers"),
        (truth_lines("1,1,10,10"), "expected a CSV file of numbers"),
        (truth_lines(GOOD_ROW, "0,2,10,10,30,75,1,0.5,0.5,0"), "whole numbers from 1, found otherwise in line 3"),
        (truth_lines("1.5,2,10,10,30,75,1,0.5,0.5,0"), "frames whole numbers from 1, found otherwise in line 2"),
        (truth_lines(GOOD_ROW, GOOD_ROW), "expected every id at most once in a frame, found otherwise in line 3"),
        (truth_lines(GOOD_ROW, "1,2,10,10,30,75,1,nan,0.5,0"), "expected X and Y in metres wherever conf is above 0"),
        (truth_lines(GOOD_ROW, "1,2,,,,,1,0.5,0.5,0"), "expected a box of positive width and height in every row"),
        (truth_lines("1,2,10,10,-30,75,1,0.5,0.5,0"), "expected a box of positive width and height in every row"),
        (truth_lines(), "expected truth with conf above 0, found none"),
        (truth_lines("1,1,10,10,30,75,0,0.5,0.5,0"), "expected truth with conf above 0, found none"),
    ],
)
def test_a_bad_truth_file_is_refused_in_one_line(tmp_path: Path, content: str, message: str) -> None:
    good = make_truth()
    tracks = make_tracks(good)
    write_run(tmp_path, tracks, make_pairs(tracks))
    (tmp_path / "truth.csv").write_text(content)
    assert_refused(tmp_path, tmp_path / "truth.csv", message)


def assert_refused(run_folder: Path, truth_file: Path, message: str, **options: Any) -> None:
    with pytest.raises(DataError) as refusal:
        evaluate_positions(run_folder, truth_file, **options)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_missing_truth_file_is_named(tmp_path: Path) -> None:
    tracks = make_tracks(make_truth())
    write_run(tmp_path, tracks, make_pairs(tracks))
    assert_refused(tmp_path, tmp_path / "nowhere.csv", "nowhere.csv")


@pytest.mark.parametrize("missing", ["tracks", "proximity"])
def test_a_run_without_a_table_is_refused(tmp_path: Path, missing: str) -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    write_run(tmp_path, tracks, make_pairs(tracks))
    (tmp_path / f"{missing}.parquet").unlink()
    truth_file = write_truth(tmp_path / "truth.csv", truth)
    assert_refused(tmp_path, truth_file, f"expected {missing}.parquet in the run folder, found no ")


def test_a_torn_table_is_refused(tmp_path: Path) -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    write_run(tmp_path, tracks, make_pairs(tracks))
    table = tmp_path / "tracks.parquet"
    table.write_bytes(table.read_bytes()[:200])
    assert_refused(tmp_path, write_truth(tmp_path / "truth.csv", truth), "expected a whole Parquet table in")


def test_a_table_without_its_columns_is_refused(tmp_path: Path) -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    pairs = make_pairs(tracks)
    del pairs["sigma_m"]
    write_run(tmp_path, tracks, pairs)
    assert_refused(tmp_path, write_truth(tmp_path / "truth.csv", truth), "without sigma_m")


def test_a_run_that_was_not_asked_for_such_pairs_is_refused(tmp_path: Path) -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    pairs = make_pairs(tracks)
    pairs["track_b"] = pairs["track_b"] + 100
    write_run(tmp_path, tracks, pairs)
    message = "expected distances between the tracks that the truth shows, found no such pair"
    assert_refused(tmp_path, write_truth(tmp_path / "truth.csv", truth), message)


def test_frames_without_labels_are_refused(tmp_path: Path) -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    write_run(tmp_path, tracks, make_pairs(tracks))
    truth_file = write_truth(tmp_path / "truth.csv", truth)
    assert_refused(tmp_path, truth_file, "found none in frames 100 to 200", frames=(100, 200))
