from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.evaluation.positions import PositionsResult, evaluate_positions, score_positions
from standoff.evaluation.positions_input import Columns, chosen_rows, read_truth

FRAMES = 6
STANDING_M = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0], [40.0, 0.0]])
HEADER = "frame,id,x,y,w,h,conf,X,Y,Z"


def make_truth(standing_m: FloatArray = STANDING_M, frames: int = FRAMES) -> Columns:
    """Truth of people who stand still, 100 px apart in the picture."""
    people = len(standing_m)
    person = np.tile(np.arange(people), frames)
    return {
        "frame": np.repeat(np.arange(1.0, frames + 1), people),
        "id": person + 1.0,
        "x": 100.0 * person,
        "y": np.full(len(person), 50.0),
        "w": np.full(len(person), 30.0),
        "h": np.full(len(person), 75.0),
        "conf": np.ones(len(person)),
        "X": standing_m[person, 0],
        "Y": standing_m[person, 1],
    }


def make_tracks(truth: Columns, error_m: FloatArray | None = None) -> dict[str, Any]:
    """Tracks exactly where the truth is, or off by (N, 2) metres; ids are the truth's plus 10."""
    error_m = np.zeros((len(truth["frame"]), 2)) if error_m is None else error_m
    return {
        "frame": truth["frame"].astype(np.int64) - 1,
        "track_id": truth["id"].astype(np.int64) + 10,
        "class": np.full(len(truth["frame"]), "worker", dtype=object),
        "x1_px": truth["x"],
        "y1_px": truth["y"],
        "x2_px": truth["x"] + truth["w"],
        "y2_px": truth["y"] + truth["h"],
        "observed": np.ones(len(truth["frame"]), dtype=np.bool_),
        "x_m": truth["X"] + error_m[:, 0],
        "y_m": truth["Y"] + error_m[:, 1],
    }


def make_pairs(tracks: Columns, sigma_m: float = 0.1) -> dict[str, Any]:
    """Measure all pairs of tracks from their positions."""
    rows: list[tuple[int, int, int, float]] = []
    for frame in np.unique(tracks["frame"]):
        here = np.flatnonzero(tracks["frame"] == frame)
        distance_m = pdist(np.column_stack([tracks["x_m"], tracks["y_m"]])[here])
        first, second = np.triu_indices(len(here), k=1)
        ids = tracks["track_id"][here]
        rows += zip([int(frame)] * len(first), ids[first], ids[second], distance_m, strict=True)
    frames, first_id, second_id, distances = np.array(rows).T
    return {
        "frame": frames.astype(np.int64),
        "track_a": first_id.astype(np.int64),
        "track_b": second_id.astype(np.int64),
        "distance_m": distances,
        "sigma_m": np.full(len(rows), sigma_m),
        "measured": np.ones(len(rows), dtype=np.bool_),
    }


def score(truth: Columns, tracks: Columns, **options: Any) -> PositionsResult:
    return score_positions(tracks, make_pairs(tracks), truth, **({"min_overlap": 0.5} | options))


def write_run(folder: Path, tracks: dict[str, Any], pairs: dict[str, Any]) -> None:
    names = pa.array(tracks["class"]).dictionary_encode()
    pa.parquet.write_table(pa.table({**tracks, "class": names}), folder / "tracks.parquet")
    pa.parquet.write_table(pa.table(pairs), folder / "proximity.parquet")


def write_truth(path: Path, truth: Columns) -> Path:
    names = HEADER.split(",")[:-1]
    rows = zip(*(truth[name].tolist() for name in names), strict=True)
    path.write_text("\n".join([HEADER, *(",".join(map(str, row)) + ",0" for row in rows)]) + "\n")
    return path


def test_perfect_tracks_score_perfectly() -> None:
    truth = make_truth()
    result = score(truth, make_tracks(truth))
    assert (result.entities.recall, result.entities.precision) == (1.0, 1.0)
    assert result.entities.position_p95_m == 0.0
    assert (result.pairs.made_m, result.pairs.mape_percent, result.pairs.within_2_sigma) == (0.0, 0.0, 1.0)
    assert result.observed_entities == result.entities
    assert (result.first_frame, result.last_frame, result.frames) == (1, FRAMES, FRAMES)


def test_only_pairs_up_to_the_limit_are_scored() -> None:
    truth = make_truth()
    assert score(truth, make_tracks(truth)).pairs.true_pairs == 3 * FRAMES
    assert score(truth, make_tracks(truth), pairs_up_to_m=4.5).pairs.true_pairs == 2 * FRAMES
    assert score(truth, make_tracks(truth), pairs_up_to_m=50.0).pairs.true_pairs == 6 * FRAMES


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_figures_are_those_of_the_errors_put_in(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = make_truth(rng.uniform(-5.0, 5.0, (5, 2)))
    error_m = rng.normal(0.0, 0.3, (len(truth["frame"]), 2))
    tracks = make_tracks(truth, error_m)
    result = score(truth, tracks, pairs_up_to_m=100.0)
    shifted_m = np.linalg.norm(error_m, axis=1)
    assert result.entities.position_median_m == pytest.approx(np.median(shifted_m))
    assert result.entities.position_mean_m == pytest.approx(shifted_m.mean())
    assert result.entities.position_p95_m == pytest.approx(np.percentile(shifted_m, 95))
    true_m = make_pairs(make_tracks(truth))["distance_m"]
    wrong_m = make_pairs(tracks)["distance_m"] - true_m
    assert result.pairs.made_m == pytest.approx(np.abs(wrong_m).mean())
    assert result.pairs.mape_percent == pytest.approx(100 * (np.abs(wrong_m) / true_m).mean())
    assert result.pairs.median_signed_error_m == pytest.approx(np.median(wrong_m))
    assert result.pairs.p95_error_m == pytest.approx(np.percentile(np.abs(wrong_m), 95))
    assert result.pairs.within_2_sigma == pytest.approx((np.abs(wrong_m) <= 0.2).mean())


@settings(max_examples=20, deadline=None)
@given(st.floats(-np.pi, np.pi), st.floats(-100.0, 100.0))
def test_turning_and_shifting_the_site_changes_no_distance_error(angle: float, shift_m: float) -> None:
    rng = np.random.default_rng(5)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    truth = make_truth()
    tracks = make_tracks(truth, rng.normal(0.0, 0.3, (len(truth["frame"]), 2)))
    turned = {}
    for name, (x, y), rows in (("truth", ("X", "Y"), truth), ("tracks", ("x_m", "y_m"), tracks)):
        moved_m = np.column_stack([rows[x], rows[y]]) @ turn.T + shift_m
        turned[name] = {**rows, x: moved_m[:, 0], y: moved_m[:, 1]}
    before, after = score(truth, tracks), score(turned["truth"], turned["tracks"])
    assert after.pairs.made_m == pytest.approx(before.pairs.made_m)
    assert after.entities.position_mean_m == pytest.approx(before.entities.position_mean_m)


def test_a_missed_person_costs_recall_and_measured_pairs() -> None:
    truth = make_truth()
    tracks = chosen_rows(make_tracks(truth), truth["id"] != 2)
    result = score(truth, tracks)
    assert result.entities.recall == 0.75
    assert result.entities.precision == 1.0
    assert result.pairs.true_pairs == 3 * FRAMES
    assert result.pairs.pairs_share == pytest.approx(1 / 3)


def test_a_track_on_nobody_costs_precision() -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    tracks["x1_px"], tracks["x2_px"] = (
        np.where(truth["id"] == 4, tracks[x] + 20.0, tracks[x]) for x in ("x1_px", "x2_px")
    )
    result = score(truth, tracks)
    assert result.entities.precision == 0.75
    assert result.entities.recall == 0.75


def test_the_overlap_asked_of_a_match_can_be_chosen() -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    tracks["x1_px"], tracks["x2_px"] = tracks["x1_px"] + 15.0, tracks["x2_px"] + 15.0  # IoU 1 / 3
    assert score(truth, tracks, min_overlap=0.3).entities.recall == 1.0
    assert score(truth, tracks, min_overlap=0.4).entities.recall == 0.0


def test_truth_that_is_not_scored_counts_neither_way() -> None:
    truth = dict(make_truth())
    truth["conf"] = np.where(truth["id"] == 1, 0.0, 1.0)
    with_track, without_track = make_tracks(truth), chosen_rows(make_tracks(truth), truth["id"] != 1)
    for tracks in (with_track, without_track):
        result = score(truth, tracks)
        assert (result.entities.recall, result.entities.precision) == (1.0, 1.0)
        assert result.entities.truths == 3 * FRAMES
        assert result.pairs.true_pairs == FRAMES


def test_coasting_tracks_count_and_are_told_apart() -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    tracks["observed"] = truth["id"] != 3
    result = score(truth, tracks)
    assert result.entities.recall == 1.0
    assert result.observed_entities.recall == 0.75
    assert result.pairs.pairs_share == 1.0
    assert result.observed_pairs.pairs_share == pytest.approx(1 / 3)
    figures = result.to_dict()
    assert (figures["recall"], figures["observed_recall"]) == (1.0, 0.75)


def test_a_pair_that_was_not_measured_is_missing_not_zero() -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    pairs = make_pairs(tracks)
    pairs["measured"] = pairs["frame"] != 0
    pairs["distance_m"] = np.where(pairs["measured"], pairs["distance_m"], np.nan)
    result = score_positions(tracks, pairs, truth, min_overlap=0.5)
    assert result.pairs.pairs == 3 * (FRAMES - 1)
    assert result.pairs.pairs_share == pytest.approx((FRAMES - 1) / FRAMES)
    assert result.pairs.made_m == 0.0


def test_a_run_without_a_map_measures_nothing_and_says_so() -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    pairs = make_pairs(tracks)
    pairs["measured"] = np.zeros_like(pairs["measured"])
    tracks["x_m"] = tracks["y_m"] = np.full(len(truth["frame"]), np.nan)
    result = score_positions(tracks, pairs, truth, min_overlap=0.5)
    assert result.entities.recall == 1.0
    assert (result.entities.located, result.pairs.pairs, result.pairs.pairs_share) == (0, 0, 0.0)
    assert result.to_dict()["made_m"] is None
    assert result.to_dict()["position_median_m"] is None


def test_distances_come_from_the_proximity_table_not_from_positions() -> None:
    truth = make_truth()
    tracks = make_tracks(truth)
    pairs = make_pairs(tracks)
    pairs["distance_m"] = pairs["distance_m"] + 0.25
    result = score_positions(tracks, pairs, truth, min_overlap=0.5)
    assert result.pairs.made_m == pytest.approx(0.25)
    assert result.pairs.median_signed_error_m == pytest.approx(0.25)
    assert result.pairs.within_2_sigma == 0.0


def test_frames_the_run_never_reported_are_missed_and_counted() -> None:
    truth = make_truth()
    tracks = chosen_rows(make_tracks(truth), truth["frame"] % 2 == 0)
    result = score(truth, tracks)
    assert result.entities.recall == 0.5
    assert result.frames_without_tracks == FRAMES / 2


def test_only_the_chosen_frames_are_scored() -> None:
    truth = make_truth()
    tracks = chosen_rows(make_tracks(truth), truth["frame"] != 5)
    assert score(truth, tracks, frames=(1, 4)).entities.recall == 1.0
    assert score(truth, tracks, frames=(5, 6)).entities.recall == 0.5


def test_tracks_in_a_chosen_frame_without_labels_are_wrong() -> None:
    labelled = make_truth()
    tracks = make_tracks(labelled)
    truth = chosen_rows(labelled, labelled["frame"] != 3)
    assert score(truth, tracks, frames=(1, FRAMES)).entities.precision == pytest.approx((FRAMES - 1) / FRAMES)
    assert score(truth, tracks).entities.precision == 1.0


def test_without_an_overlap_tracks_are_matched_where_they_stand() -> None:
    truth = dict(make_truth())
    near = make_tracks(truth, np.full((len(truth["frame"]), 2), 1.0))
    for name in ("x", "y", "w", "h"):
        truth[name] = np.full(len(truth["frame"]), np.nan)
    assert score(truth, near, min_overlap=None).entities.recall == 1.0
    far = {**near, "x_m": near["x_m"] + 1000.0}
    assert score(truth, far, min_overlap=None).entities.recall == 0.0
    nowhere = {**near, "x_m": np.full(len(near["frame"]), np.nan)}
    entities = score_positions(nowhere, make_pairs(near), truth).entities
    assert (entities.recall, entities.tracks) == (0.0, 0)


def test_boxes_cannot_be_matched_with_truth_that_has_none() -> None:
    truth = dict(make_truth())
    tracks = make_tracks(truth)
    for name in ("x", "y", "w", "h"):
        truth[name] = np.full(len(truth["frame"]), np.nan)
    with pytest.raises(DataError, match="expected truth with boxes"):
        score(truth, tracks)


def test_nobody_tracked_is_a_result() -> None:
    truth = make_truth()
    pairs = make_pairs(make_tracks(truth))
    none = np.zeros(len(truth["frame"]), dtype=np.bool_)
    result = score_positions(chosen_rows(make_tracks(truth), none), pairs, truth)
    assert result.entities.recall == 0.0
    assert result.to_dict()["precision"] is None
    assert result.frames_without_tracks == FRAMES


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
