"""How early breaches are foretold, and how often in vain: hours of simulated work, without a picture.

python examples/foretold/foretold.py [--hours 20] [--seed 0] [--cast ordinary] [--error 1.0] [--json FILE] [--quiet]

A cast of `standoff simulate` works: an ordinary site for a quarter of an hour each; or `busy` and `mobile`, the hard
cases, in which everybody works within machines' circles, for two minutes each. What a camera would tell of them is
drawn: ground points with errors that change from frame to frame and errors that last, misses, and hidden stretches. The
stages locate, proximity and hazard with their defaults do the rest, the last of them once for each probability at which
it could warn. All times are those of the simulated site.

**Breach.** In truth, the circles of a worker and a machine touch. Breaches of a pair less than a second apart are one.
There is none in a cab, that is within 1.5 m of the machine's middle, where nobody on foot ever is; and none at a
machine other than an excavator that truly has not moved for a minute. A breach that begins because such a machine moves
off, with somebody in its circle already, is sudden: nothing could foretell it, and it is counted apart.

**Foretold.** A hazard of the pair was open two seconds (one second) before the breach and until it. **Lost**: none was
open at any time of it.

**Alarm.** A hazard of a pair that opened; what is unknown is none. It is a *right* one if there is a breach of that
pair from a second before it to the horizon after it, a *near miss* if there is none but the gap was less than a metre
in that time, which is the paper's buffer for the error of measuring; else it is a *false* warning, out of nothing.

Several sites are watched at once, a kilometre apart on one ground, and pairs that are so far apart that no probability
is left are not measured: that saves most of the time and changes nothing else.

The first minute of each shift of the ordinary cast, in which nobody can know what is parked, is not judged, nor the
first five seconds of the others.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any, Literal

import numpy as np

from standoff.cli.spoken_progress import SpokenProgress
from standoff.core.classes import CLASS_BY_NAME, CLASSES
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.roles import IS_EQUIPMENT
from standoff.core.types import GroundMap, GroundPositions, Hazard, IntArray, Proximities, Tracks
from standoff.stages.hazard import HazardMonitor, HazardParams
from standoff.stages.locate import Locator
from standoff.stages.proximity import ProximityMeter, ProximityParams
from standoff_sim.scene.cast import FilmedArea
from standoff_sim.scene.casting import CASTS

STEP_S = 0.2
LASTING_S = {"ordinary": 900.0, "busy": 120.0, "mobile": 120.0}
NOT_JUDGED_S = {"ordinary": 60.0, "busy": 5.0, "mobile": 5.0}
PX_PER_M, MIDDLE_M = 100.0, 200.0
SITES_AT_ONCE, SITES_APART_M, TRACKS_A_SITE = 8, 1000.0, 100
FAR_M = {"excavator": 6.0}
OTHERS_FAR_M = 16.0
"""Beyond its circle: nobody comes into it within the horizon, however fast both are."""
LIMITS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
CHANGING_M = {"worker": 0.08, "excavator": 0.2}
LASTING_M = {"worker": 0.1, "excavator": 0.35}
OTHER_MACHINE_M = (0.12, 0.25)
LASTS_S = 4.0
MISSED, HIDDEN_PER_S, HIDDEN_S = 0.05, 1 / 60, (0.5, 3.0)
ABOARD_M, PARKED_AFTER_S, STANDS_MPS = 1.5, 60.0, 0.02
ONE_BREACH_S, NEAR_MISS_M = 1.0, 1.0
CALM_S = 2.0
"""So long before and after anything stirs the hazard stage looks as well."""

Pair = tuple[int, int]
Span = tuple[float, float]
Kind = Literal["right", "near miss", "false"]
Measured = tuple[GroundPositions, Proximities]
_KEY = 1_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Shift:
    """Some minutes of one site.

    Attributes:
        class_id: (E,) of everybody there; tracks are numbered from 1.
        xy_m: (T, E, 2) where they truly are.
        judged_from_s: What is before is not judged.
    """

    class_id: IntArray
    xy_m: FloatArray
    judged_from_s: float

    @property
    def hours(self) -> float:
        """How much of it is judged."""
        return (len(self.xy_m) * STEP_S - self.judged_from_s) / 3600.0

    def gap_m(self, pair: Pair) -> FloatArray:
        """Return (T,) the true gap of two tracks."""
        a, b = pair[0] - 1, pair[1] - 1
        reach_m = sum(CLASSES[self.class_id[one]].action_radius_m for one in (a, b))
        gap_m: FloatArray = np.linalg.norm(self.xy_m[:, a] - self.xy_m[:, b], axis=1) - reach_m
        return gap_m


@dataclass(frozen=True, slots=True)
class Breach:
    """One true breach of a pair: when, and whether it came with a parked machine that moved off."""

    start_s: float
    end_s: float
    sudden: bool


@dataclass(slots=True)
class Score:
    """What one limit gives.

    Attributes:
        lead_s: Of each breach that could be foretold: how long before it a hazard was open; negative: after it began;
            NaN: never.
        sudden_lead_s: The same of the others.
        alarms: By kind.
    """

    lead_s: list[float] = field(default_factory=list)
    sudden_lead_s: list[float] = field(default_factory=list)
    alarms: dict[Kind, int] = field(default_factory=lambda: {"right": 0, "near miss": 0, "false": 0})

    def row(self, hours: float, worker_hours: float) -> dict[str, float]:
        """Return the figures of one line of the table."""
        lead, sudden = np.array(self.lead_s), np.array(self.sudden_lead_s)
        return {
            "recall_2_s": _share(lead >= 2.0),
            "recall_1_s": _share(lead >= 1.0),
            "recall_0_s": _share(lead >= 0.0),
            "lost": int(np.isnan(lead).sum() + np.isnan(sudden).sum()),
            "sudden_told_in_1_s": int(np.sum(sudden >= -1.0)),
            "median_lead_s": float(np.median(lead[~np.isnan(lead)])) if np.isfinite(lead).any() else np.nan,
            "false_per_hour": self.alarms["false"] / hours,
            "near_misses_per_hour": self.alarms["near miss"] / hours,
            "alarms_per_worker_hour": sum(self.alarms.values()) / worker_hours,
        }


def _share(those: BoolArray) -> float:
    return float(np.mean(those)) if len(those) else np.nan


def work(cast: str, seed: int) -> Shift:
    """Let a cast work."""
    stage = FilmedArea(0.0, 1.0, LASTING_S[cast], None, None)
    actors = CASTS[cast](np.random.default_rng(seed), stage).actors
    times_s = np.arange(0.0, LASTING_S[cast], STEP_S)
    columns = [[np.interp(times_s, a.motion.time_s, a.motion.xy_m[:, k]) for k in (0, 1)] for a in actors]
    class_id = np.array([actor.model.class_id for actor in actors])
    return Shift(class_id, np.array(columns).transpose(2, 0, 1), NOT_JUDGED_S[cast])


def seen(shift: Shift, rng: np.random.Generator, error: float) -> Iterator[tuple[FloatArray, BoolArray]]:
    """Give where a camera would take everybody to be in each frame, (E, 2), and whom it would find, (E,)."""
    changing_m, lasting_m = errors_m(shift, error)
    count = len(changing_m)
    kept = np.exp(-STEP_S / LASTS_S)
    bias_m = lasting_m[:, None] * rng.normal(size=(count, 2))
    hidden_s = np.zeros(count)
    for xy_m in shift.xy_m:
        bias_m = kept * bias_m + np.sqrt(1.0 - kept**2) * lasting_m[:, None] * rng.normal(size=(count, 2))
        hides = (hidden_s <= 0.0) & (rng.random(count) < HIDDEN_PER_S * STEP_S)
        hidden_s = np.where(hides, rng.uniform(*HIDDEN_S, count), hidden_s - STEP_S)
        places_m = xy_m + bias_m + changing_m[:, None] * rng.normal(size=(count, 2))
        yield places_m, (hidden_s <= 0.0) & (rng.random(count) >= MISSED)


def errors_m(shift: Shift, error: float) -> tuple[FloatArray, FloatArray]:
    """Return (E,) standard errors of everybody's ground point: that of each frame, and what lasts."""
    names = [CLASSES[i].name for i in shift.class_id]
    changing_m = np.array([CHANGING_M.get(name, OTHER_MACHINE_M[0]) for name in names])
    lasting_m = np.array([LASTING_M.get(name, OTHER_MACHINE_M[1]) for name in names])
    return error * changing_m, error * lasting_m


def _map() -> GroundMap:
    """Return the exact map of a picture that shows all sites from straight above."""
    matrix = np.diag([1 / PX_PER_M, 1 / PX_PER_M, 1.0])
    matrix[:2, 2] = -MIDDLE_M
    size_px = (round(PX_PER_M * SITES_APART_M * SITES_AT_ONCE), round(2.0 * PX_PER_M * MIDDLE_M))
    return GroundMap(matrix, np.zeros((9, 9)), size_px, "exact", 1 / PX_PER_M)


def measured(shifts: Sequence[Shift], rngs: Sequence[np.random.Generator], error: float) -> list[Measured]:
    """Return what the stages locate and proximity say of each frame, of the sites side by side."""
    ground, locator, meter = _map(), Locator(), ProximityMeter()
    class_id = np.concatenate([shift.class_id for shift in shifts])
    track_id = np.concatenate([TRACKS_A_SITE * k + np.arange(1, len(s.class_id) + 1) for k, s in enumerate(shifts)])
    middle_m = np.concatenate([np.tile([k * SITES_APART_M, 0.0], (len(s.class_id), 1)) for k, s in enumerate(shifts)])
    variance_px2 = PX_PER_M**2 * np.concatenate([np.square(errors_m(s, error)).sum(axis=0) for s in shifts])
    near = np.concatenate([_near_somebody(shift) for shift in shifts], axis=1)
    frames = []
    everybody = zip(*(seen(shift, rng, error) for shift, rng in zip(shifts, rngs, strict=True)), strict=True)
    for k, seen_now in enumerate(everybody):
        foot_px = PX_PER_M * (np.concatenate([places_m for places_m, _ in seen_now]) + middle_m + MIDDLE_M)
        tracks = Tracks(
            track_id=track_id,
            xyxy_px=np.concatenate([foot_px - 60.0, foot_px + 60.0], axis=1),
            score=np.full(len(track_id), 0.9),
            class_id=class_id,
            observed=np.concatenate([found for _, found in seen_now]),
            age_s=np.full(len(track_id), 1.0),
            foot_px=foot_px,
            foot_covariance_px2=variance_px2[:, None, None] * np.eye(2),
        )
        positions = locator.update(k * STEP_S, tracks, ground)[near[k]]
        pairs = meter.update(k * STEP_S, positions, ground)
        frames.append((positions, pairs[pairs.track_a // TRACKS_A_SITE == pairs.track_b // TRACKS_A_SITE]))
    return frames


def _near_somebody(shift: Shift) -> BoolArray:
    """Tell (T, E) who has anybody of the other kind so near that they could meet within the horizon."""
    machines = IS_EQUIPMENT[shift.class_id]
    near = np.zeros(shift.xy_m.shape[:2], dtype=bool)
    for a in np.flatnonzero(~machines).tolist():
        for b in np.flatnonzero(machines).tolist():
            far_m = FAR_M.get(CLASSES[shift.class_id[b]].name, OTHERS_FAR_M)
            meet = shift.gap_m((a + 1, b + 1)) < far_m
            near[meet, a] = near[meet, b] = True
    return near


def alarms(frames: Sequence[Measured], params: HazardParams) -> dict[Pair, list[Span]]:
    """Return when hazards of each pair of tracks were open, by the hazard stage.

    Pairs that are never half as likely as needed are left out, and so are frames in which nothing stirs: neither can
    begin, change or end a hazard.
    """
    least = 0.5 * params.warning_probability
    keys = [pairs.track_a * _KEY + pairs.track_b for _, pairs in frames]
    likely = [np.nan_to_num(pairs.breach_ahead) >= least for _, pairs in frames]
    may_warn = np.unique(np.concatenate([key[of] for key, of in zip(keys, likely, strict=True)]))
    kept = [np.isin(key, may_warn) for key in keys]
    stirs = [(of | np.isnan(pairs.breach_ahead))[which].any()
             for of, which, (_, pairs) in zip(likely, kept, frames, strict=True)]  # fmt: skip
    near = round(CALM_S / STEP_S)
    looks = np.convolve(stirs, np.ones(2 * near + 1), mode="same") > 0.0
    ground, monitor = _map(), HazardMonitor(params)
    followed = np.zeros(0, dtype=bool)
    open_at: dict[str, tuple[Pair, float]] = {}
    spans: dict[Pair, list[Span]] = {}
    for k in np.flatnonzero(looks).tolist():
        positions, pairs = frames[k]
        for event in monitor.update(k * STEP_S, positions, pairs[kept[k]], ground, followed):
            _follow(event, open_at, spans)
    for event in monitor.close(len(frames) * STEP_S):
        _follow(event, open_at, spans)
    return spans


def of_site(spans: dict[Pair, list[Span]], site: int) -> dict[Pair, list[Span]]:
    """Return what was said of one site, with its own numbers of tracks."""
    first = TRACKS_A_SITE * site
    return {(a - first, b - first): told for (a, b), told in spans.items() if a // TRACKS_A_SITE == site}


def _follow(event: Hazard, open_at: dict[str, tuple[Pair, float]], spans: dict[Pair, list[Span]]) -> None:
    if event.rule != "proximity" or event.severity == "unknown":
        return
    if event.phase == "closed":
        if event.hazard_id in open_at:
            pair, since_s = open_at.pop(event.hazard_id)
            spans.setdefault(pair, []).append((since_s, event.time_s))
    else:
        open_at.setdefault(event.hazard_id, ((event.track_ids[0], event.track_ids[1]), event.time_s))


def true_breaches(shift: Shift) -> dict[Pair, list[Breach]]:
    """Return all that happened, of each pair of a worker and a machine."""
    parked = truly_parked(shift)
    breaches: dict[Pair, list[Breach]] = {}
    for a in np.flatnonzero(~IS_EQUIPMENT[shift.class_id]).tolist():
        for b in np.flatnonzero(IS_EQUIPMENT[shift.class_id]).tolist():
            pair = min(a, b) + 1, max(a, b) + 1
            gap_m = shift.gap_m(pair)
            aboard = np.linalg.norm(shift.xy_m[:, a] - shift.xy_m[:, b], axis=1) < ABOARD_M
            inside = (gap_m < 0.0) & ~aboard & ~parked[:, b]
            edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int))).reshape(-1, 2)
            found: list[Breach] = []
            for start, stop in edges.tolist():
                if found and start * STEP_S - found[-1].end_s < ONE_BREACH_S:
                    found[-1] = Breach(found[-1].start_s, stop * STEP_S, found[-1].sudden)
                else:
                    sudden = start > 0 and bool(gap_m[start - 1] < 0.0 and parked[start - 1, b])
                    found.append(Breach(start * STEP_S, stop * STEP_S, sudden))
            breaches[pair] = found
    return breaches


def truly_parked(shift: Shift) -> BoolArray:
    """Return (T, E) who has truly not moved for a minute; never an excavator."""
    steps_m = np.linalg.norm(np.diff(shift.xy_m, axis=0, prepend=shift.xy_m[:1]), axis=2)
    frame = np.arange(len(steps_m))[:, None]
    moved = np.maximum.accumulate(np.where(steps_m > STANDS_MPS * STEP_S, frame, 0), axis=0)
    parked: BoolArray = (frame - moved) * STEP_S >= PARKED_AFTER_S - STEP_S / 2
    parked &= shift.class_id != CLASS_BY_NAME["excavator"].id
    return parked


def kind_of(shift: Shift, pair: Pair, span: Span, breaches: Sequence[Breach], horizon_s: float) -> Kind:
    """Tell a right alarm from a near miss and from a false one."""
    begins_s, ends_s = span
    if any(one.start_s <= ends_s + horizon_s and one.end_s >= begins_s - ONE_BREACH_S for one in breaches):
        return "right"
    first, last = round(begins_s / STEP_S), round((ends_s + horizon_s) / STEP_S)
    gap_m = shift.gap_m(pair)[first : last + 1]
    return "near miss" if 0.0 <= gap_m.min() < NEAR_MISS_M else "false"


def lead_of(one: Breach, spans: Sequence[Span]) -> float:
    """Return how long before a breach a hazard was open; negative: after its begin; NaN: never."""
    opened = [begins_s for begins_s, ends_s in spans if ends_s >= one.start_s and begins_s <= one.end_s]
    return one.start_s - min(opened) if opened else np.nan


def judge(shift: Shift, spans: dict[Pair, list[Span]], breaches: dict[Pair, list[Breach]], into: Score) -> None:
    """Compare what was said with what happened."""
    horizon_s = ProximityParams().horizon_s
    for pair, opened in spans.items():
        for span in opened:
            if span[0] >= shift.judged_from_s:
                into.alarms[kind_of(shift, pair, span, breaches[pair], horizon_s)] += 1
    for pair, happened in breaches.items():
        for one in happened:
            if one.start_s >= shift.judged_from_s:
                leads = into.sudden_lead_s if one.sudden else into.lead_s
                leads.append(lead_of(one, spans.get(pair, [])))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=0, help="of everything random")
    parser.add_argument("--cast", choices=("ordinary", "busy", "mobile"), default="ordinary")
    parser.add_argument("--error", type=float, default=1.0, help="factor on the errors of ground points")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quiet", action="store_true", help="without a progress bar")
    options = parser.parse_args()
    scores = {limit: Score() for limit in LIMITS}
    shifts = max(1, round(options.hours * 3600 / (LASTING_S[options.cast] - NOT_JUDGED_S[options.cast])))
    hours, worker_hours, began_s = 0.0, 0.0, monotonic()
    with SpokenProgress("shifts", quiet=options.quiet) as progress:
        task = progress.add_task(options.cast, total=shifts, rate=0.0)
        for first in range(0, shifts, SITES_AT_ONCE):
            numbers = range(first, min(first + SITES_AT_ONCE, shifts))
            sites = [work(options.cast, 10_000 * options.seed + k) for k in numbers]
            rngs = [np.random.default_rng([options.seed, k]) for k in numbers]
            frames = measured(sites, rngs, options.error)
            breaches = [true_breaches(shift) for shift in sites]
            hours += sum(shift.hours for shift in sites)
            worker_hours += sum(s.hours * int(np.count_nonzero(~IS_EQUIPMENT[s.class_id])) for s in sites)
            for limit in LIMITS:
                spans = alarms(frames, HazardParams(warning_probability=limit))
                for k, shift in enumerate(sites):
                    judge(shift, of_site(spans, k), breaches[k], scores[limit])
            told = summary(scores, hours, worker_hours)
            if options.json:
                # After each few sites, so that a run that is stopped has told something.
                options.json.write_text(json.dumps(told, indent=1))
            progress.update(task, completed=numbers[-1] + 1, rate=(numbers[-1] + 1) / (monotonic() - began_s))
    for line in table(told):
        print(line)


def summary(scores: dict[float, Score], hours: float, worker_hours: float) -> dict[str, Any]:
    """Return all figures so far."""
    first = scores[LIMITS[0]]
    return {
        "hours": hours,
        "worker_hours": worker_hours,
        "breaches": len(first.lead_s),
        "sudden": len(first.sudden_lead_s),
        "by_limit": {f"{limit:.2f}": score.row(hours, worker_hours) for limit, score in scores.items()},
    }


def table(told: dict[str, Any]) -> list[str]:
    """Return the lines of the table."""
    rows = told["by_limit"]
    names = next(iter(rows.values()))
    count = f"{told['breaches']} breaches and {told['sudden']} sudden ones"
    lines = [f"{told['hours']:.1f} hours, {told['worker_hours']:.1f} of workers, {count}"]
    lines.append("| warn at | " + " | ".join(name.replace("_", " ") for name in names) + " |")
    for limit, row in rows.items():
        lines.append(f"| {limit} | " + " | ".join(f"{value:.3g}" for value in row.values()) + " |")
    return lines


if __name__ == "__main__":
    main()
