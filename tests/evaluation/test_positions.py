from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from evaluation.standing_people import (
    FRAMES,
    make_pairs,
    make_tracks,
    make_truth,
)
from hypothesis import given
from hypothesis import strategies as st
from laws import examples

from standoff.clips import Columns, chosen_rows
from standoff.core.errors import DataError
from standoff.evaluation.positions import PositionsResult, score_positions


def score(truth: Columns, tracks: Columns, **options: Any) -> PositionsResult:
    return score_positions(tracks, make_pairs(tracks), truth, **({"min_overlap": 0.5} | options))


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


@examples(20)
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


@examples(20)
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
