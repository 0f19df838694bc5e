"""How early breaches are foretold, and how often in vain: hours of simulated work, without a picture.

python examples/foretold.py [--hours 20] [--seed 0] [--error 1.0] [--json FILE]

The casts of `standoff simulate busy` and `mobile` work for two minutes each. What a camera would tell of them is drawn:
ground points with errors that change from frame to frame and errors that last, misses, and hidden stretches. The stages
locate, proximity and hazard with their defaults do the rest, once for each probability at which they could warn.

A breach is a gap that becomes negative, in truth, at a machine that is not parked and has nobody in its cab, by the
product's own definitions. It is foretold where a hazard of the pair was open two seconds before. A warning is false
where no breach follows until the horizon after it has ended.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from standoff.core.classes import CLASSES
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.roles import IS_EQUIPMENT
from standoff.core.types import GroundMap, Hazard, IntArray, Proximities, Tracks
from standoff.simulation.cast import Stage
from standoff.simulation.casting import CASTS
from standoff.simulation.motion import sample
from standoff.simulation.people.anthropometry import MEAN_STATURE_M
from standoff.stages.hazard import HazardMonitor, HazardParams
from standoff.stages.locate import Locator
from standoff.stages.proximity import ProximityMeter, ProximityParams
from standoff.stages.proximity.excuses import Excuses

CLIP_S, STEP_S = 120.0, 0.2
PX_PER_M, SIZE_PX, MIDDLE_M = 100.0, (40_000, 40_000), 200.0
LIMITS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9)
AHEAD_S, HORIZON_S = 2.0, 3.0
CHANGING_M = {"worker": 0.08, "excavator": 0.2}
LASTING_M = {"worker": 0.1, "excavator": 0.35}
OTHER_MACHINE_M = (0.12, 0.25)
LASTS_S = 4.0
MISSED, HIDDEN_PER_S, HIDDEN_S = 0.05, 1 / 60, (0.5, 3.0)

Pair = tuple[int, int]
Span = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Shift:
    """Two minutes of one site.

    Attributes:
        class_id: (E,) of everybody there.
        xy_m: (T, E, 2) where they truly are.
    """

    class_id: IntArray
    xy_m: FloatArray


@dataclass(slots=True)
class Score:
    """What one limit gives.

    Attributes:
        lead_s: Of each breach: how long before it a hazard was open; negative: after; NaN: never.
        warnings: How many hazards were opened.
        false: How many of them in vain.
    """

    lead_s: list[float] = field(default_factory=list)
    warnings: int = 0
    false: int = 0

    def row(self, hours: float, worker_hours: float) -> dict[str, float]:
        """Return the figures of one line of the table."""
        lead = np.array(self.lead_s)
        return {
            "breaches": len(lead),
            "recall_2_s": float(np.mean(lead >= AHEAD_S)),
            "recall_1_s": float(np.mean(lead >= 1.0)),
            "recall_0_s": float(np.mean(lead >= 0.0)),
            "never": float(np.mean(np.isnan(lead))),
            "median_lead_s": float(np.nanmedian(lead)),
            "false_per_hour": self.false / hours,
            "alarms_per_worker_hour": self.warnings / worker_hours,
        }


def work(seed: int) -> Shift:
    """Let a cast work."""
    rng = np.random.default_rng(seed)
    cast = CASTS[("busy", "mobile")[seed % 2]](rng, Stage(0.0, 1.0, CLIP_S, None, None, MEAN_STATURE_M))
    times_s = np.arange(0.0, CLIP_S, STEP_S)
    xy_m = np.array([[sample(actor.motion, time_s).xy_m for actor in cast.actors] for time_s in times_s])
    return Shift(np.array([actor.model.class_id for actor in cast.actors]), xy_m)


def seen(shift: Shift, rng: np.random.Generator, error: float) -> Iterator[Tracks]:
    """Give what a camera would tell of each frame."""
    names = [CLASSES[i].name for i in shift.class_id]
    changing_m = error * np.array([CHANGING_M.get(name, OTHER_MACHINE_M[0]) for name in names])
    lasting_m = error * np.array([LASTING_M.get(name, OTHER_MACHINE_M[1]) for name in names])
    count = len(names)
    kept = np.exp(-STEP_S / LASTS_S)
    bias_m = lasting_m[:, None] * rng.normal(size=(count, 2))
    hidden_s = np.zeros(count)
    variance_px2 = PX_PER_M**2 * (changing_m**2 + lasting_m**2)
    for xy_m in shift.xy_m:
        bias_m = kept * bias_m + np.sqrt(1.0 - kept**2) * lasting_m[:, None] * rng.normal(size=(count, 2))
        hides = (hidden_s <= 0.0) & (rng.random(count) < HIDDEN_PER_S * STEP_S)
        hidden_s = np.where(hides, rng.uniform(*HIDDEN_S, count), hidden_s - STEP_S)
        places_m = xy_m + bias_m + changing_m[:, None] * rng.normal(size=(count, 2))
        yield _tracks(shift, places_m, (hidden_s <= 0.0) & (rng.random(count) >= MISSED), variance_px2)


def _map() -> GroundMap:
    """Return the exact map of a picture that shows the site from straight above."""
    matrix = np.diag([1 / PX_PER_M, 1 / PX_PER_M, 1.0])
    matrix[:2, 2] = -MIDDLE_M
    return GroundMap(matrix, np.zeros((9, 9)), SIZE_PX, "exact", 1 / PX_PER_M)


def _tracks(shift: Shift, places_m: FloatArray, observed: BoolArray, variance_px2: FloatArray) -> Tracks:
    """Return everybody as the tracker would tell them in that picture."""
    count, foot_px = len(places_m), PX_PER_M * (places_m + MIDDLE_M)
    return Tracks(
        track_id=np.arange(1, count + 1),
        xyxy_px=np.concatenate([foot_px - 60.0, foot_px + 60.0], axis=1),
        score=np.full(count, 0.9),
        class_id=shift.class_id,
        observed=observed,
        age_s=np.full(count, CLIP_S),
        foot_px=foot_px,
        foot_covariance_px2=variance_px2[:, None, None] * np.eye(2),
    )


def run(shift: Shift, rng: np.random.Generator, error: float) -> dict[float, dict[Pair, list[Span]]]:
    """Return for each limit when hazards of each pair were open."""
    ground = _map()
    locator, meter = Locator(), ProximityMeter(ProximityParams(horizon_s=HORIZON_S))
    monitors = {limit: HazardMonitor(HazardParams(warning_probability=limit)) for limit in LIMITS}
    open_at: dict[float, dict[str, tuple[Pair, float]]] = {limit: {} for limit in LIMITS}
    spans: dict[float, dict[Pair, list[Span]]] = {limit: {} for limit in LIMITS}
    nobody_lost = np.zeros(0, dtype=bool)
    time_s = 0.0
    for k, tracks in enumerate(seen(shift, rng, error)):
        time_s = k * STEP_S
        positions = locator.update(time_s, tracks, ground)
        pairs: Proximities = meter.update(time_s, positions, ground)
        for limit, monitor in monitors.items():
            for event in monitor.update(time_s, positions, pairs, ground, nobody_lost):
                _follow(event, open_at[limit], spans[limit])
    for limit, monitor in monitors.items():
        for event in monitor.close(time_s):
            _follow(event, open_at[limit], spans[limit])
    return spans


def _follow(event: Hazard, open_at: dict[str, tuple[Pair, float]], spans: dict[Pair, list[Span]]) -> None:
    if event.rule != "proximity" or event.severity == "unknown":
        return
    if event.phase == "closed":
        if event.hazard_id in open_at:
            pair, since_s = open_at.pop(event.hazard_id)
            spans.setdefault(pair, []).append((since_s, event.time_s))
    else:
        open_at.setdefault(event.hazard_id, ((event.track_ids[0], event.track_ids[1]), event.time_s))


def true_breaches(shift: Shift) -> dict[Pair, list[Span]]:
    """Return when the gap of each pair was negative; breaches less than a second apart are one."""
    machines = IS_EQUIPMENT[shift.class_id]
    radii_m = np.array([CLASSES[i].action_radius_m for i in shift.class_id])
    excused = _truly_excused(shift)
    breaches: dict[Pair, list[Span]] = {}
    for a in np.flatnonzero(~machines):
        for b in np.flatnonzero(machines):
            first, second = sorted((int(a), int(b)))
            gap_m = np.linalg.norm(shift.xy_m[:, a] - shift.xy_m[:, b], axis=1) - radii_m[a] - radii_m[b]
            inside = (gap_m < 0.0) & ~excused[first, second]
            edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
            spans: list[Span] = []
            for start, stop in edges.reshape(-1, 2) * STEP_S:
                if spans and start - spans[-1][1] < 1.0:
                    spans[-1] = (spans[-1][0], float(stop))
                else:
                    spans.append((float(start), float(stop)))
            breaches[first + 1, second + 1] = spans
    return breaches


def _truly_excused(shift: Shift) -> dict[Pair, BoolArray]:
    """Return (T,) for each pair when the product's own rules, told the truth, call it no hazard."""
    exact = Locator()
    ground = _map()
    count = len(shift.class_id)
    a, b = np.triu_indices(count, k=1)
    rules, told = Excuses(ProximityParams()), []
    for k, xy_m in enumerate(shift.xy_m):
        tracks = _tracks(shift, xy_m, np.ones(count, dtype=bool), np.full(count, 0.01))
        positions = exact.update(k * STEP_S, tracks, ground)
        distance_m = np.linalg.norm(positions.xy_m[b] - positions.xy_m[a], axis=1)
        told.append(rules.update(positions, a, b, distance_m) != "")
    excused = np.array(told)
    return {(int(i), int(j)): excused[:, row] for row, (i, j) in enumerate(zip(a, b, strict=True))}


def score(spans: dict[Pair, list[Span]], breaches: dict[Pair, list[Span]], into: Score) -> None:
    """Compare what was said with what happened."""
    for pair, hazards in spans.items():
        into.warnings += len(hazards)
        true = breaches.get(pair, [])
        into.false += sum(
            not any(start <= end_s + HORIZON_S and stop >= begin_s - 1.0 for start, stop in true)
            for begin_s, end_s in hazards
        )
    for pair, true in breaches.items():
        for start, stop in true:
            # What is there from the beginning could not be foretold.
            if start < AHEAD_S + HORIZON_S:
                continue
            opened = [begin_s for begin_s, end_s in spans.get(pair, []) if end_s >= start and begin_s <= stop]
            into.lead_s.append(start - min(opened) if opened else np.nan)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--error", type=float, default=1.0, help="factor on the errors of ground points")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    scores = {limit: Score() for limit in LIMITS}
    clips, worker_hours = round(options.hours * 3600 / CLIP_S), 0.0
    for k in range(clips):
        shift = work(1000 * options.seed + k)
        spans = run(shift, np.random.default_rng([options.seed, k]), options.error)
        breaches = true_breaches(shift)
        worker_hours += np.count_nonzero(shift.class_id == 0) * CLIP_S / 3600.0
        for limit in LIMITS:
            score(spans[limit], breaches, scores[limit])
    hours = clips * CLIP_S / 3600.0
    rows = {limit: scores[limit].row(hours, worker_hours) for limit in LIMITS}
    print(f"{hours:.1f} hours, {worker_hours:.1f} of workers")
    print("| warn at | breaches | 2 s ahead | 1 s | 0 s | never | median s | false an hour | alarms a worker-hour |")
    for limit, row in rows.items():
        print(f"| {limit:.2f} | " + " | ".join(f"{value:.3g}" for value in row.values()) + " |")
    if options.json:
        options.json.write_text(json.dumps({"hours": hours, "worker_hours": worker_hours, "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
