"""Watched ground against truth: what is counted is what was drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluation.coverage.drawn_run import CLASSES, SIZE_PX, TRACK_OF, Drawn, draw

from standoff.core.errors import DataError
from standoff.core.finding import WorkerFinding
from standoff.core.watched_ground import COLUMNS, REASONS, ROWS, TOO_SMALL, WATCHED
from standoff.evaluation.watched import WorkerSamples, evaluate_watched, read_worker_samples, score_watched
from standoff.evaluation.watched.finding import measure_finding

FRAMES = 30
WORKERS = [entity for entity, (class_id, _) in CLASSES.items() if class_id == 0]


def drawn_run(seed: int = 0) -> tuple[Drawn, np.ndarray[Any, np.dtype[np.int8]]]:
    """Return a run whose pictures are watched in their left half, and those cells."""
    drawn = draw(seed, frames=FRAMES)
    cells = np.full((ROWS, COLUMNS), TOO_SMALL, dtype=np.int8)
    cells[:, : COLUMNS // 2] = WATCHED
    rng = np.random.default_rng(seed)
    for row in drawn.frames:
        row.update(watched_cells=cells.ravel().tolist(), watched_share=0.5)
    for row in drawn.truth:
        row.update(foot_x_px=float(rng.uniform(0, SIZE_PX[0] - 1)), foot_y_px=float(rng.uniform(0, SIZE_PX[1] - 1)))
    return drawn, cells


def lose(drawn: Drawn, frame: int, entity: int) -> None:
    drawn.tracks[:] = [row for row in drawn.tracks if (row["frame"], row["track_id"]) != (frame, TRACK_OF[entity])]


@pytest.mark.parametrize("seed", range(3))
def test_every_worker_is_counted_on_the_ground_he_stands_on(seed: int, tmp_path: Path) -> None:
    drawn, _ = drawn_run(seed)
    rng, lost = np.random.default_rng(100 + seed), set()
    for row in drawn.truth:
        if row["entity_id"] in WORKERS and rng.random() < 0.3:
            lose(drawn, row["frame"], row["entity_id"])
            lost.add((row["frame"], row["entity_id"]))
    workers = [row for row in drawn.truth if row["entity_id"] in WORKERS]
    left = [(row["frame"], row["entity_id"]) for row in workers if row["foot_x_px"] + 0.5 < SIZE_PX[0] / 2]
    result = evaluate_watched([drawn.write(tmp_path)])
    assert (result.on_watched.workers, result.on_watched.missed) == (len(left), len(lost & set(left)))
    elsewhere = result.on_unwatched[REASONS[TOO_SMALL]]
    assert (elsewhere.workers, elsewhere.missed) == (len(workers) - len(left), len(lost - set(left)))
    assert result.watched_share == 0.5 and result.frames == FRAMES


def test_a_breach_that_nobody_sees_is_called_clear_on_watched_ground_only(tmp_path: Path) -> None:
    drawn, _ = drawn_run()
    for row in drawn.pairs:
        row["centre_m"] = 1.0
    for row in drawn.proximity:
        row["distance_m"] = 1.0
    for frame in range(0, FRAMES, 3):
        lose(drawn, frame, WORKERS[0])
    feet = {(row["frame"], row["entity_id"]): row["foot_x_px"] for row in drawn.truth}
    silent = [frame for frame in range(0, FRAMES, 3) if feet[frame, WORKERS[0]] + 0.5 < SIZE_PX[0] / 2]
    result = evaluate_watched([drawn.write(tmp_path)])
    assert result.breaches == FRAMES * len(WORKERS)
    assert result.breaches_called_clear == len(silent) > 0


def test_a_distance_far_beyond_the_true_one_calls_a_breach_clear(tmp_path: Path) -> None:
    drawn, _ = drawn_run()
    for row in drawn.pairs:
        row["centre_m"] = 1.0
    for row in drawn.proximity:
        row["distance_m"] = 60.0
    result = evaluate_watched([drawn.write(tmp_path)])
    feet = [row["foot_x_px"] for row in drawn.truth if row["entity_id"] in WORKERS]
    assert result.breaches_called_clear == sum(x_px + 0.5 < SIZE_PX[0] / 2 for x_px in feet)


def test_a_run_without_watched_ground_is_refused(tmp_path: Path) -> None:
    drawn, _ = drawn_run()
    for row in drawn.frames:
        row["watched_cells"] = [0, 1]
    with pytest.raises(DataError, match="nobody judged"):
        read_worker_samples(*drawn.write(tmp_path))


def workers(height_px: np.ndarray[Any, Any], found: np.ndarray[Any, Any], detector: WorkerFinding) -> WorkerSamples:
    """Return workers, every tenth of whom is only suspected where he is noticed."""
    count = len(height_px)
    suspected = found & (np.arange(count) % 10 == 0)
    return WorkerSamples(
        clip=Path("clip"),
        frames=1,
        watched_share=1.0,
        detector=detector,
        height_px=2.0 * height_px,
        input_height_px=height_px,
        whole=np.ones(count, dtype=bool),
        cell=np.full(count, WATCHED),
        found=found & ~suspected,
        suspected=suspected,
        in_breach=np.zeros(count, dtype=bool),
        called_clear=np.zeros(count, dtype=bool),
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_height_from_which_nine_of_ten_are_found_is_measured(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height_px = np.exp(rng.uniform(np.log(8), np.log(150), 20_000))
    share = 1.0 / (1.0 + (20.0 / height_px) ** 4)
    finding = measure_finding([workers(height_px, rng.random(20_000) < share, WorkerFinding())])
    assert finding.measured and list(finding.share) == sorted(finding.share)
    assert finding.least_height_px(0.9) == pytest.approx(20.0 * 9.0**0.25, rel=0.1)
    asked_px = np.array([10.0, 20.0, 40.0, 80.0])
    expected = 1.0 / (1.0 + (20.0 / asked_px) ** 4)
    np.testing.assert_allclose(finding.share_found(asked_px, (640, 360)), expected, atol=0.06)


def test_few_workers_tell_nothing() -> None:
    few = workers(np.full(19, 40.0), np.ones(19, dtype=bool), WorkerFinding())
    assert not measure_finding([few]).measured
    assert score_watched([few]).finding.to_dict() == {}


def test_whom_nobody_warns_counts_only_where_most_others_are_in_a_track() -> None:
    everybody = np.ones(300, dtype=bool)
    few, most = (workers(np.full(300, tall_px), everybody, WorkerFinding()) for tall_px in (16.0, 64.0))
    few = replace(few, found=np.arange(300) % 3 == 0, suspected=np.arange(300) % 3 != 0)
    finding = measure_finding([few, most])
    np.testing.assert_allclose(finding.share, (1 / 3, 1.0), atol=1e-3)
