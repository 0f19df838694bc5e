"""How well an excavator's boom is told from its box, and what the sector that it sweeps would excuse: against truth.

python examples/boom_sweep/measure.py [--machines 20] [--seed 0]

Each machine of the simulator digs or grades for half a minute, seen five times a second by a camera 14 to 50 m up that
looks down 28 to 75 degrees. Its boxes have the errors of the shipped detector (`standoff_sim.clip.detection_noise`),
its ground points are 0.67 m off in each coordinate, three tenths of the variance for half a second and the rest for
good. Eight workers stand about it, beyond the counterweight and inside both action radii (14.1 m). The stage locate
places them; `boom.py` tells the direction, `sweep.py` who is excused, for each look-ahead: by that direction, and by
the true direction and rate of swing.

Struck within three seconds: the worker's circle of 2 m is touched by the bucket, by where it will truly be. Lost:
struck, and excused all the same.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import product

import numpy as np
from boom import Booms
from sweep import out_of_sweep

from standoff.core.camera import Camera
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import Tracks
from standoff.stages.ground import map_from_view
from standoff.stages.locate import Locator
from standoff_sim.behaviour.digging import digging, grading
from standoff_sim.clip.detection_noise import MEMORY_S, NOISE
from standoff_sim.clip.truth import full_box_px
from standoff_sim.machines.excavator import make_excavator
from standoff_sim.movement.motion import Place, sample
from standoff_sim.scene.scene import moved

SIZE_PX = (1920, 1080)
STEP_S, LASTS_S, STRUCK_WITHIN_S = 0.2, 30.0, 3.0
FOOT_SIGMA_M, CHANGING_SHARE = 0.67, 0.3
WORKERS, FROM_M, TO_M, WORKER_M, BUCKET_M = 8, 5.2, 14.1, 2.0, 0.8
LOOK_AHEADS_S = (1.0, 2.0, 3.0)
TOLD_BY = ("box", "truth")
EXCAVATOR, WORKER = CLASS_BY_NAME["excavator"].id, CLASS_BY_NAME["worker"].id


@dataclass(frozen=True, slots=True, eq=False)
class Work:
    """One machine at work before one camera.

    Attributes:
        view: The camera; the centre of swing is the origin.
        boxes_px: (T, 4) exact.
        swing_rad: (T,) direction of the boom.
        reach_m: (T,) of the bucket.
    """

    view: View
    boxes_px: FloatArray
    swing_rad: FloatArray
    reach_m: FloatArray


def draw_view(rng: np.random.Generator) -> View:
    """Draw a camera that sees the origin well inside its picture."""
    while True:
        focal_px = SIZE_PX[0] / 2.0 / np.tan(np.deg2rad(rng.uniform(50.0, 80.0)) / 2.0)
        matrix = np.array([[focal_px, 0.0, SIZE_PX[0] / 2.0], [0.0, focal_px, SIZE_PX[1] / 2.0], [0.0, 0.0, 1.0]])
        angles = {"heading_deg": rng.uniform(0.0, 360.0), "pitch_deg": rng.uniform(28.0, 75.0)}
        above_m = np.array([0.0, 0.0, rng.uniform(14.0, 50.0)])
        camera = Camera(*SIZE_PX, matrix, np.zeros(5))
        at_px = np.array([[rng.uniform(0.15, 0.85), rng.uniform(0.2, 0.85)]]) * SIZE_PX
        middle_m = View.aimed(camera, above_m, **angles).to_plane(at_px)[0]
        if np.isfinite(middle_m).all() and np.hypot(*middle_m[:2]) < 90.0:
            return View.aimed(camera, above_m - [*middle_m[:2], 0.0], **angles)


def draw_work(rng: np.random.Generator) -> Work:
    """Draw a machine, what it does and who looks."""
    model, view = make_excavator(rng), draw_view(rng)
    doing = (digging, grading)[rng.integers(2)]
    motion = doing(rng, model, Place(0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)), LASTS_S + 2.0)
    rows = []
    for time_s in np.arange(0.0, LASTS_S, STEP_S):
        now = sample(motion, time_s)
        cos, sin = np.cos(now.heading_rad), np.sin(now.heading_rad)
        pose = np.array([[cos, -sin, 0.0, 0.0], [sin, cos, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
        tip_m = model.tool_tip_m(now.joints)
        box_px = full_box_px(moved(model.parts(now.joints), pose), view)
        rows.append([*box_px, now.heading_rad + np.deg2rad(now.joints["swing_deg"]), np.hypot(tip_m[0], tip_m[1])])
    table = np.array(rows)
    return Work(view, table[:, :4], table[:, 4], table[:, 5])


def lasting(rng: np.random.Generator, count: int, columns: int) -> FloatArray:
    """Return (T, columns) standard normal numbers that change slowly."""
    kept = np.exp(-STEP_S / MEMORY_S)
    rows = [rng.normal(size=columns)]
    for _ in range(count - 1):
        rows.append(kept * rows[-1] + np.sqrt(1.0 - kept**2) * rng.normal(size=columns))
    return np.array(rows)


def follow(work: Work, rng: np.random.Generator) -> tuple[FloatArray, dict[tuple[str, float], FloatArray]]:
    """Return (N, 2) the direction's errors and their stated standard errors; counts of worker-frames by rule.

    The counts are (4,): all, excused, struck soon, lost.
    """
    noise, count = NOISE["machine"], len(work.boxes_px)
    sides_px = np.tile(work.boxes_px[:, 2:] - work.boxes_px[:, :2], 2)
    spread_px = np.hypot(np.array(noise.edge_share) * sides_px, noise.edge_px)
    outwards_px = np.array(noise.edge_bias) * sides_px + lasting(rng, count, 4) * spread_px
    boxes_px = work.boxes_px + outwards_px * [-1.0, -1.0, 1.0, 1.0]
    feet_m = np.sqrt(1.0 - CHANGING_SHARE) * rng.normal(size=2) + np.sqrt(CHANGING_SHARE) * lasting(rng, count, 2)
    angle, away_m = rng.uniform(0.0, 2.0 * np.pi, WORKERS), np.sqrt(rng.uniform(FROM_M**2, TO_M**2, WORKERS))
    workers_m = np.column_stack([away_m * np.cos(angle), away_m * np.sin(angle)])
    ground = map_from_view(work.view, np.zeros((8, 8)), method="exact", scale_m_per_px=1.0, anchors_px=np.zeros((0, 2)))
    beside_m = ground.to_ground(np.array([[0.0, 0.0], [1.0, 0.0]]) + work.view.project(np.zeros((1, 3))))[0]
    m_per_px = float(np.linalg.norm(beside_m[1] - beside_m[0]))
    locator, booms = Locator(), Booms()
    errors, counts = [], {rule: np.zeros(4) for rule in product(TOLD_BY, LOOK_AHEADS_S)}
    machine, people = np.zeros(WORKERS, dtype=np.int64), np.arange(1, WORKERS + 1)
    soon = round(STRUCK_WITHIN_S / STEP_S)
    for k in range(count):
        places_m = np.vstack([FOOT_SIGMA_M * feet_m[k], workers_m])
        feet_px = work.view.project(np.column_stack([places_m, np.zeros(len(places_m))]))
        boxes = np.concatenate([feet_px - [8.0, 30.0], feet_px - [-8.0, -2.0]], axis=1)
        boxes[0] = boxes_px[k]
        sigma_px = np.array([FOOT_SIGMA_M / m_per_px, *[2.0] * WORKERS])
        tracks = Tracks(
            track_id=np.arange(WORKERS + 1),
            xyxy_px=boxes,
            score=np.full(WORKERS + 1, 0.9),
            class_id=np.array([EXCAVATOR, *[WORKER] * WORKERS]),
            observed=np.ones(WORKERS + 1, dtype=np.bool_),
            age_s=np.full(WORKERS + 1, k * STEP_S),
            foot_px=feet_px,
            foot_covariance_px2=sigma_px[:, None, None] ** 2 * np.eye(2),
        )
        positions = locator.update(k * STEP_S, tracks, ground)
        covariance_m2 = positions.state_covariance[:, :2, :2]
        boom = booms.update(k * STEP_S, tracks, ground, positions.xy_m, covariance_m2)
        direction_rad, sigma_rad = boom[0, :2]
        if np.isfinite(direction_rad):
            errors.append((np.angle(np.exp(1j * (direction_rad - work.swing_rad[k]))), sigma_rad))
        if k >= count - soon or k * STEP_S < 5.0:
            continue
        struck = np.zeros(WORKERS, dtype=np.bool_)
        for later in range(k, k + soon + 1):
            apart = np.abs(np.angle(np.exp(1j * (angle - work.swing_rad[later]))))
            struck |= (apart < np.arcsin((WORKER_M + BUCKET_M) / away_m)) & (away_m < work.reach_m[later] + WORKER_M)
        true_boom = np.full_like(boom, np.nan)
        true_boom[0] = work.swing_rad[k], 0.0, (work.swing_rad[k + 1] - work.swing_rad[k - 1]) / (2.0 * STEP_S), 0.0
        booms_by = {"box": boom, "truth": true_boom}
        for (told_by, ahead_s), tally in counts.items():
            excused = out_of_sweep(positions, booms_by[told_by], machine, people, ahead_s)
            tally += [WORKERS, excused.sum(), struck.sum(), (struck & excused).sum()]
    return np.array(errors).reshape(-1, 2), counts


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    errors, totals = [], {rule: np.zeros(4) for rule in product(TOLD_BY, LOOK_AHEADS_S)}
    for number in range(options.machines):
        rng = np.random.default_rng([options.seed, number])
        try:
            work = draw_work(rng)
        except ValueError:
            continue
        found, counts = follow(work, rng)
        errors.append(found)
        totals = {rule: tally + counts[rule] for rule, tally in totals.items()}
    off_deg, sigma_deg = np.abs(np.rad2deg(np.concatenate(errors))).T
    inside = [100.0 * float(np.mean(off_deg < z * sigma_deg)) for z in (1.0, 1.96)]
    print(
        f"{len(errors)} machines, {len(off_deg)} looks: direction off by {np.median(off_deg):.1f} degrees (median), "
        f"p95 {np.percentile(off_deg, 95):.1f}, more than 60 in {100.0 * np.mean(off_deg > 60.0):.1f} %; stated "
        f"{np.median(sigma_deg):.1f}; inside 68 % {inside[0]:.0f}, 95 % {inside[1]:.0f}"
    )
    for (told_by, ahead_s), (every, excused, struck, lost) in totals.items():
        print(
            f"direction by {told_by}, look-ahead {ahead_s:g} s: {100.0 * excused / every:.1f} % of {every:.0f} "
            f"worker-frames excused; {struck:.0f} struck within {STRUCK_WITHIN_S:g} s, {lost:.0f} of them excused"
        )


if __name__ == "__main__":
    main()
