from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from evaluation.coverage.drawn_run import CLASSES, FRAMES, SIZE_PX, SQUARE_M, TRACK_OF, Drawn, draw

from standoff.core.errors import DataError
from standoff.evaluation.coverage import (
    ClipSamples,
    CoverageResult,
    PairRow,
    PairSamples,
    PositionSamples,
    evaluate_coverage,
    read_samples,
    score_samples,
)
from standoff.evaluation.resampling import LEAST_GROUPS
from standoff.evaluation.stated_errors import PROBABILITIES, score_coverage

PEOPLE, MACHINES = 2, 2
MANY = 4000
NAN = float("nan")


def samples(seed: int = 0, *, stated: float = 1.0, count: int = MANY, clip: str = "clip") -> ClipSamples:
    """Errors drawn from a normal distribution, of which the stated standard error is so many times the true one."""
    rng = np.random.default_rng(seed)
    sigma_m = rng.uniform(0.1, 0.9, count)
    true_m = rng.uniform(2.0, 40.0, count)
    turn = np.linalg.qr(rng.normal(size=(count, 2, 2)))[0]
    root_m = turn * rng.uniform(0.05, 1.0, (count, 1, 2))
    kinds = np.array(["worker-excavator", "worker-wheel_loader"], dtype=object)
    pairs = PairSamples(
        kind=kinds[rng.integers(0, 2, count)],
        true_m=true_m,
        measured_m=true_m + rng.normal(0.0, sigma_m),
        sigma_m=stated * sigma_m,
        sight=rng.integers(0, 3, count),
    )
    positions = PositionSamples(
        class_name=np.full(count, "worker", dtype=object),
        off_m=np.einsum("nij,nj->ni", root_m, rng.normal(size=(count, 2))),
        covariance_m2=stated**2 * root_m @ root_m.transpose(0, 2, 1),
    )
    return ClipSamples(Path("run"), Path(clip), 100, pairs, positions)


def row_of(result: CoverageResult, kind: str = "all", band: str = "") -> PairRow:
    return next(row for row in result.pairs if (row.kind, row.band) == (kind, band))


def within_chance(share: float, expected: float, count: int) -> bool:
    """Four standard errors of a binomial share."""
    return abs(share - expected) < 4.0 * math.sqrt(expected * (1.0 - expected) / count)


@pytest.mark.parametrize("stated", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_coverage_is_what_the_normal_distribution_says(seed: int, stated: float) -> None:
    """True errors hold 68.3 and 95 %; stated half as large, 38.3 and 67.3 %."""
    result = score_samples([samples(seed, stated=stated)])
    row = row_of(result)
    assert within_chance(row.coverage.inside_68, math.erf(stated / math.sqrt(2.0)), MANY)
    assert within_chance(row.coverage.inside_95, math.erf(1.959964 * stated / math.sqrt(2.0)), MANY)
    for probability, share in zip(PROBABILITIES, row.coverage.observed, strict=True):
        if stated == 1.0:
            assert within_chance(share, probability, MANY)
    (position,) = result.positions
    # Rayleigh's distribution: the share beyond r standard errors of a point of a plane is exp(-r^2 / 2).
    assert within_chance(position.inside_68, 1.0 - 0.317311 ** (stated**2), MANY)
    assert within_chance(position.inside_95, 1.0 - 0.05 ** (stated**2), MANY)


def test_a_hand_made_example() -> None:
    true_m = np.array([4.0, 8.0, 20.0, 30.0])
    measured_m = np.array([5.0, 7.5, NAN, 33.0])
    sigma_m = np.array([0.4, 0.5, NAN, 2.0])
    pairs = PairSamples(
        np.array(["worker-excavator"] * 4, dtype=object), true_m, measured_m, sigma_m, np.array([0, 1, 2, 0])
    )
    result = score_samples([replace(samples(count=1), pairs=pairs)])
    assert [(row.by, row.band, row.score.measured, row.score.frames) for row in result.pairs] == [
        ("all", "", 3, 4),
        ("distance", "0-5 m", 1, 1),
        ("distance", "5-10 m", 1, 1),
        ("distance", "10-25 m", 0, 1),
        ("distance", "25+ m", 1, 1),
        ("visibility", "whole", 2, 2),
        ("visibility", "hidden", 1, 1),
        ("visibility", "cut off", 0, 1),
    ]
    whole = result.pairs[0]
    assert whole.score.made_m == pytest.approx((1.0 + 0.5 + 3.0) / 3.0)
    assert whole.score.mape_percent == pytest.approx(100.0 * (0.25 + 0.0625 + 0.1) / 3.0)
    assert whole.score.median_m == pytest.approx(1.0)
    # One is exactly one stated error off, one 1.5 of them, one 2.5.
    assert whole.coverage.inside_68 == pytest.approx(1 / 3)
    assert whole.coverage.inside_95 == pytest.approx(2 / 3)
    assert whole.coverage.sigma_m == pytest.approx(0.5)
    assert math.isnan(row_of(result, "worker-excavator", "10-25 m").coverage.inside_95)


def test_a_distance_without_a_stated_error_is_never_inside() -> None:
    found = score_coverage(np.array([3.0, 5.0]), np.array([3.0, 5.0]), np.array([0.1, NAN]))
    assert (found.inside_68, found.inside_95, found.sigma_m) == (0.5, 0.5, 0.1)


def test_pooled_runs_score_like_one_long_run() -> None:
    parts = [samples(seed, count=300 + seed, clip=f"clip-{seed}") for seed in range(3)]
    fields = {name: [getattr(one.pairs, name) for one in parts] for name in PairSamples.__dataclass_fields__}
    whole = replace(parts[0], pairs=PairSamples(**{name: np.concatenate(of) for name, of in fields.items()}))
    pooled, together = score_samples(parts), score_samples([whole])
    assert [replace(row, intervals={}) for row in pooled.pairs] == [
        replace(row, intervals={}) for row in together.pairs
    ]
    assert (pooled.clips, pooled.frames) == (3, 300)


def test_clips_are_drawn_and_not_frames() -> None:
    """Clips that are alike leave nothing to chance; those that differ do, however many frames they have."""
    count = LEAST_GROUPS
    alike = [replace(samples(1), clip=Path(f"clip-{k}")) for k in range(count)]
    row = row_of(score_samples(alike))
    for name, value in (("inside_95", row.coverage.inside_95), ("made_m", row.score.made_m), ("measured_share", 1.0)):
        assert row.intervals[name] == pytest.approx((value, value))
    differing = [samples(k, stated=0.2 if k % 2 else 3.0, clip=f"clip-{k}") for k in range(count)]
    low, high = row_of(score_samples(differing)).intervals["inside_95"]
    assert low < 0.55 and high > 0.85
    (position,) = score_samples(differing).positions
    assert position.intervals["inside_95"][0] < position.inside_95 < position.intervals["inside_95"][1]


def test_runs_of_one_clip_are_no_further_clips() -> None:
    again = score_samples([samples(k) for k in range(LEAST_GROUPS + 2)])
    assert again.clips == 1 and row_of(again).intervals == {}
    few = score_samples([samples(k, clip=f"clip-{k}") for k in range(LEAST_GROUPS - 1)])
    assert row_of(few).intervals == {}


@pytest.fixture
def drawn() -> Drawn:
    return draw()


def test_tables_give_the_errors_that_were_put_in(drawn: Drawn, tmp_path: Path) -> None:
    run, clip = drawn.write(tmp_path)
    found = read_samples(run, clip)
    assert found.frames == FRAMES
    assert len(found.pairs.kind) == FRAMES * PEOPLE * MACHINES
    assert set(found.pairs.kind) == {"worker-excavator", "worker-wheel_loader"}
    true = {(row["frame"], row["entity_a"], row["entity_b"]): row["centre_m"] for row in drawn.pairs}
    entity_of = {track: entity for entity, track in TRACK_OF.items()}
    off_m = [
        row["distance_m"] - true[row["frame"], entity_of[row["track_a"]], entity_of[row["track_b"]]]
        for row in drawn.proximity
    ]
    assert sorted(found.pairs.measured_m - found.pairs.true_m) == pytest.approx(sorted(off_m))
    assert (found.pairs.sight == 0).all() and (found.pairs.sigma_m == 0.3).all()
    assert found.positions is not None
    assert len(found.positions.class_name) == FRAMES * len(CLASSES)
    assert np.linalg.norm(found.positions.off_m, axis=1).max() < 2.0


def test_the_order_of_rows_does_not_matter(drawn: Drawn, tmp_path: Path) -> None:
    before = evaluate_coverage([drawn.write(tmp_path / "before")])
    mixer = random.Random(3)
    for rows in (drawn.truth, drawn.pairs, drawn.tracks, drawn.proximity, drawn.frames):
        mixer.shuffle(rows)
    after = evaluate_coverage([drawn.write(tmp_path / "after")])
    for one, other in zip(before.pairs, after.pairs, strict=True):
        assert (one.kind, one.band, one.score.frames) == (other.kind, other.band, other.score.frames)
        assert one.score.made_m == pytest.approx(other.score.made_m)
        assert one.coverage == other.coverage


def _without_a_row(drawn: Drawn) -> None:
    drawn.proximity.remove(next(row for row in drawn.proximity if row["track_b"] == TRACK_OF[3]))


def _not_measured(drawn: Drawn) -> None:
    row = next(row for row in drawn.proximity if row["track_b"] == TRACK_OF[3])
    row.update(distance_m=None, sigma_m=None, measured=False)


def _not_found(drawn: Drawn) -> None:
    drawn.tracks.remove(next(row for row in drawn.tracks if row["track_id"] == TRACK_OF[3]))


def _somewhere_else(drawn: Drawn) -> None:
    row = next(row for row in drawn.tracks if row["track_id"] == TRACK_OF[3])
    row.update(y1_px=500.0, y2_px=600.0)


def _taken_for_a_person(drawn: Drawn) -> None:
    next(row for row in drawn.tracks if row["track_id"] == TRACK_OF[3])["class"] = "worker"


@pytest.mark.parametrize(
    ("spoil", "missing"),
    [(_without_a_row, 1), (_not_measured, 1), (_not_found, PEOPLE), (_somewhere_else, PEOPLE),
     (_taken_for_a_person, PEOPLE)],
)  # fmt: skip
def test_what_a_run_does_not_say_is_unmeasured_and_still_counts(
    drawn: Drawn, tmp_path: Path, spoil: Callable[[Drawn], None], missing: int
) -> None:
    spoil(drawn)
    score = row_of(evaluate_coverage([drawn.write(tmp_path)]), "worker-excavator").score
    assert (score.frames, score.measured) == (FRAMES * PEOPLE, FRAMES * PEOPLE - missing)


def test_a_machine_taken_for_another_one_is_the_same_machine(drawn: Drawn, tmp_path: Path) -> None:
    for row in drawn.tracks:
        if row["track_id"] == TRACK_OF[3]:
            row["class"] = "wheel_loader"
    score = row_of(evaluate_coverage([drawn.write(tmp_path)]), "worker-excavator").score
    assert score.measured == FRAMES * PEOPLE


def test_who_cannot_be_seen_makes_no_pair(drawn: Drawn, tmp_path: Path) -> None:
    for row in drawn.truth:
        if row["entity_id"] == 3 and row["frame"] < 10:
            row.update(x1_px=NAN, y1_px=NAN, x2_px=NAN, y2_px=NAN)
    result = evaluate_coverage([drawn.write(tmp_path)])
    assert row_of(result, "worker-excavator").score.frames == (FRAMES - 10) * PEOPLE
    (excavator,) = [row for row in result.positions if row.class_name == "excavator"]
    assert excavator.visible == FRAMES - 10


@pytest.mark.parametrize(
    ("change", "band"),
    [
        ({"visible_share": 0.5}, "hidden"),
        ({"visible_share": 0.95}, "whole"),
        ({"full_x1_px": -40.0, "visible_share": 0.7}, "cut off"),
        ({"full_y2_px": SIZE_PX[1] + 5.0}, "cut off"),
        ({"full_x2_px": SIZE_PX[0] - 0.2}, "whole"),
        ({"full_x1_px": NAN}, "cut off"),
    ],
)
def test_a_pair_shows_as_the_worse_of_the_two(
    drawn: Drawn, tmp_path: Path, change: dict[str, float], band: str
) -> None:
    for row in drawn.truth:
        if row["entity_id"] == 3:
            row.update(change)
    result = evaluate_coverage([drawn.write(tmp_path)])
    assert row_of(result, "worker-excavator", band).score.frames == FRAMES * PEOPLE
    assert row_of(result, "worker-wheel_loader", "whole").score.frames == FRAMES * PEOPLE


def test_a_run_that_found_nobody_measured_nothing(drawn: Drawn, tmp_path: Path) -> None:
    run, clip = drawn.write(tmp_path)
    for name in ("tracks", "proximity"):
        table = pq.read_table(run / f"{name}.parquet")
        pq.write_table(table.slice(0, 0), run / f"{name}.parquet")
    result = evaluate_coverage([(run, clip)])
    score = row_of(result).score
    assert (score.measured, score.frames) == (0, FRAMES * PEOPLE * MACHINES)
    assert math.isnan(score.made_m) and {row.located for row in result.positions} == {0}


def test_a_clip_without_a_pair_has_nothing_to_score(drawn: Drawn, tmp_path: Path) -> None:
    drawn.truth = [row for row in drawn.truth if row["class_id"] != 0]
    with pytest.raises(DataError, match="a worker and a machine"):
        evaluate_coverage([drawn.write(tmp_path)])


def test_only_frames_that_the_run_read_count(drawn: Drawn, tmp_path: Path) -> None:
    drawn.frames = drawn.frames[::2]
    drawn.tracks = [row for row in drawn.tracks if row["frame"] % 2 == 0]
    result = evaluate_coverage([drawn.write(tmp_path)])
    assert (result.frames, row_of(result).score.frames) == (FRAMES // 2, FRAMES // 2 * PEOPLE * MACHINES)


def test_a_square_that_was_taken_the_other_way_round_costs_nothing(drawn: Drawn, tmp_path: Path) -> None:
    before = evaluate_coverage([drawn.write(tmp_path / "before")])
    middle = SQUARE_M.mean(axis=0)
    for row in drawn.tracks:
        x_m, y_m = np.array([row["x_m"], row["y_m"]]) - middle
        row.update(x_m=middle[0] - y_m, y_m=middle[1] + x_m)
    after = evaluate_coverage([drawn.write(tmp_path / "after")])
    for one, other in zip(before.positions, after.positions, strict=True):
        assert other.median_m == pytest.approx(one.median_m)
        assert other.inside_95 == one.inside_95


def test_places_counted_from_elsewhere_are_not_compared(drawn: Drawn, tmp_path: Path) -> None:
    for row in drawn.frames[:10]:
        row["map_method"] = "telemetry"
    result = evaluate_coverage([drawn.write(tmp_path / "some")])
    assert {row.located / row.visible for row in result.positions} == {1.0 - 10 / FRAMES}
    moved_m = (SQUARE_M + 1.0).tolist()
    for k, reference in enumerate(({"square_m": 3.0}, {"corners_m": moved_m}, {"corners_m": "all"}, None)):
        drawn.record = {"source": {}, "settings": {"ground": {"reference": reference}}}
        result = evaluate_coverage([drawn.write(tmp_path / f"{k}")])
        assert (result.positions, result.runs_without_positions) == ((), 1)
        assert row_of(result).score.measured == FRAMES * PEOPLE * MACHINES


def _later(drawn: Drawn) -> None:
    for row in drawn.frames:
        row["time_s"] += 0.02


def _longer(drawn: Drawn) -> None:
    drawn.frames.append({"frame": FRAMES, "time_s": FRAMES / 10.0, "map_method": "fused"})


def _of_another_class(drawn: Drawn) -> None:
    drawn.tracks[0]["class"] = "crane"


def _truth_of_another_class(drawn: Drawn) -> None:
    drawn.truth[0]["class_id"] = 70


def _odd_record(drawn: Drawn) -> None:
    drawn.record = {"source": [], "settings": "default"}


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_later, "at those times"),
        (_longer, "at those times"),
        (_of_another_class, "crane"),
        (_truth_of_another_class, "known classes"),
        (_odd_record, "a run's record"),
    ],
)
def test_what_is_no_run_of_the_clip_is_refused(
    drawn: Drawn, tmp_path: Path, spoil: Callable[[Drawn], None], said: str
) -> None:
    spoil(drawn)
    with pytest.raises(DataError, match=said) as refused:
        read_samples(*drawn.write(tmp_path))
    assert "\n" not in str(refused.value)


def test_a_film_with_other_content_is_refused(drawn: Drawn, tmp_path: Path) -> None:
    drawn.record["source"] = {"fingerprint": "of another film"}
    run, clip = drawn.write(tmp_path)
    assert read_samples(run, clip).frames == FRAMES  # a clip without a film
    (clip / "video.mp4").write_bytes(b"film")
    with pytest.raises(DataError, match="other content"):
        read_samples(run, clip)


@pytest.mark.parametrize("name", ["run/tracks", "run/proximity", "run/frames", "clip/truth", "clip/pairs"])
def test_a_missing_table_is_one_line(drawn: Drawn, tmp_path: Path, name: str) -> None:
    folders = drawn.write(tmp_path)
    (tmp_path / f"{name}.parquet").unlink()
    with pytest.raises(DataError, match=name.partition("/")[2]):
        read_samples(*folders)
