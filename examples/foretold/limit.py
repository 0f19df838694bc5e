"""How early breaches could be foretold if nothing were measured wrong: places and velocities are the true ones.

python examples/foretold/limit.py [--hours 20] [--seed 1]

The sites, the breaches and the kinds of alarm are those of `foretold.py`. Here a pair is warned of while its paths from
now on, as straight and as fast as in the last fifth of a second, bring the circles together within so many seconds; or,
in the second table, as they bend and speed up or brake in the last two fifths, until they stand. What is left of wrong
warnings is what people and machines do next: no measurement, however good, takes it away.
"""

from __future__ import annotations

import argparse

import numpy as np
from foretold import (
    ABOARD_M,
    LASTING_S,
    NOT_JUDGED_S,
    ONE_BREACH_S,
    STEP_S,
    Breach,
    Pair,
    Score,
    Shift,
    Span,
    judge,
    true_breaches,
    truly_parked,
    work,
)

from standoff.cli.spoken_progress import SpokenProgress
from standoff.core.classes import CLASSES
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.roles import IS_EQUIPMENT

AHEAD_S = (2.0, 2.2, 2.5, 3.0, 4.0)
LOOK_S = 0.1
FAR_M = 16.0
STANDS_MPS, BRAKES_MPS2 = 1e-9, 0.05


def least_gaps_m(shift: Shift, pair: Pair, *, bends: bool) -> FloatArray:
    """Return (T, A) the least gap within each of `AHEAD_S`, if both went on as they do.

    Args:
        shift: Of the pair.
        pair: Numbers of its tracks.
        bends: Also as they speed up, brake and turn.
    """
    a, b = pair[0] - 1, pair[1] - 1
    reach_m = sum(CLASSES[shift.class_id[one]].action_radius_m for one in (a, b))
    apart_m = shift.xy_m[:, a] - shift.xy_m[:, b]
    velocity_mps = np.diff(apart_m, axis=0, prepend=apart_m[:1]) / STEP_S
    change_mps2 = np.diff(velocity_mps, axis=0, prepend=velocity_mps[:1]) / STEP_S * float(bends)
    speed_mps = np.linalg.norm(velocity_mps, axis=1)
    braking_mps2 = -(velocity_mps * change_mps2).sum(axis=1) / np.maximum(speed_mps, STANDS_MPS)
    # Who brakes stands in the end, and does not go back.
    stands_s = np.where(braking_mps2 > BRAKES_MPS2, speed_mps / np.maximum(braking_mps2, BRAKES_MPS2), np.inf)
    times_s = np.arange(0.0, AHEAD_S[-1] + LOOK_S, LOOK_S)
    gaps_m = np.empty((len(apart_m), len(times_s)))
    for k, time_s in enumerate(times_s):
        until_s = np.minimum(time_s, stands_s)[:, None]
        there_m = apart_m + velocity_mps * until_s + 0.5 * change_mps2 * until_s**2
        gaps_m[:, k] = np.linalg.norm(there_m, axis=1) - reach_m
    least_m = np.minimum.accumulate(gaps_m, axis=1)
    chosen: FloatArray = least_m[:, [round(ahead_s / LOOK_S) for ahead_s in AHEAD_S]]
    return chosen


def spans_of(warned: BoolArray) -> list[Span]:
    """Return when something is said, (T,) frame by frame; pauses of less than a second are none."""
    frames = np.flatnonzero(warned)
    if not len(frames):
        return []
    cuts = np.flatnonzero(np.diff(frames) * STEP_S > ONE_BREACH_S)
    begins, ends = np.r_[frames[0], frames[cuts + 1]], np.r_[frames[cuts], frames[-1]] + 1
    return [(begin * STEP_S, end * STEP_S) for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)]


def try_site(shift: Shift, breaches: dict[Pair, list[Breach]], scores: dict[tuple[bool, float], Score]) -> None:
    """Say of one site what each rule would have said."""
    parked = truly_parked(shift)
    told: dict[tuple[bool, float], dict[Pair, list[Span]]] = {key: {} for key in scores}
    for pair in breaches:
        if shift.gap_m(pair).min() > FAR_M:
            continue
        machine = next(one - 1 for one in pair if IS_EQUIPMENT[shift.class_id[one - 1]])
        a, b = pair[0] - 1, pair[1] - 1
        aboard = np.linalg.norm(shift.xy_m[:, a] - shift.xy_m[:, b], axis=1) < ABOARD_M
        for bends in (False, True):
            gaps_m = least_gaps_m(shift, pair, bends=bends)
            for column, ahead_s in enumerate(AHEAD_S):
                warned = (gaps_m[:, column] < 0.0) & ~aboard & ~parked[:, machine]
                told[bends, ahead_s][pair] = spans_of(warned)
    for key, score in scores.items():
        judge(shift, told[key], breaches, score)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1, help="of everything random")
    options = parser.parse_args()
    sites = max(1, round(options.hours * 3600 / (LASTING_S["ordinary"] - NOT_JUDGED_S["ordinary"])))
    scores = {(bends, ahead_s): Score() for bends in (False, True) for ahead_s in AHEAD_S}
    hours, worker_hours = 0.0, 0.0
    with SpokenProgress("shifts", quiet=False) as progress:
        task = progress.add_task("ordinary", total=sites, rate=0.0)
        for k in range(sites):
            shift = work("ordinary", 10_000 * options.seed + k)
            try_site(shift, true_breaches(shift), scores)
            hours += shift.hours
            worker_hours += shift.hours * int(np.count_nonzero(~IS_EQUIPMENT[shift.class_id]))
            progress.update(task, completed=k + 1)
    print(f"{hours:.1f} hours, {len(scores[False, AHEAD_S[0]].lead_s)} breaches that could be foretold")
    for (bends, ahead_s), score in scores.items():
        row = score.row(hours, worker_hours)
        how = "as they speed up, brake and turn" if bends else "straight on"
        figures = (f"{name.replace('_', ' ')} {value:.3g}" for name, value in row.items())
        print(f"{how}, {ahead_s} s: {', '.join(figures)}")


if __name__ == "__main__":
    main()
