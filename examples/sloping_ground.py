"""What surveyed heights are worth on ground that slopes: distances with them and without, against exact truth.

python examples/sloping_ground.py [--sites 40] [--seed 0] [--relief 0.1]

Each site is a terrain of the simulator, tilted, under a camera 15 to 30 m up whose lens is known. Eight points within
12 m of the middle of the picture are surveyed, heights to 2 cm and picture points to a pixel. Workers stand on the
terrain up to 25 m from there; their foot points are read to a pixel, and their pairs up to 15 m are measured by the
stages ground, locate and proximity with their defaults: by a camera that stands where it was surveyed, and by one that
may move, in the survey's picture. True distances are horizontal.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, NoCameraMotion, Tracks
from standoff.stages.frames.pictures import ArrayPicture
from standoff.stages.ground import FusedGround, FusedParams, SurveyedGround
from standoff.stages.locate import Locator
from standoff.stages.proximity import ProximityMeter, ProximityParams
from standoff_sim.ground.terrain import Terrain, make_terrain
from standoff_sim.ground.terrain_plan import TerrainPlan

SIZE_PX = (1280, 720)
SLOPES_DEG = (0.0, 4.0, 8.0, 12.0)
SURVEYED, SURVEYED_WITHIN_M, HEIGHT_SIGMA_M, POINT_SIGMA_PX = 8, 12.0, 0.02, 1.0
WORKERS, WORKERS_WITHIN_M, LONGEST_M = 14, 25.0, 15.0
STILL: CameraMotion | NoCameraMotion = NoCameraMotion("one picture")


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """A tilted terrain and the camera above it."""

    terrain: Terrain
    rise: FloatArray
    view: View

    def heights_m(self, xy_m: FloatArray) -> FloatArray:
        """Return (N,) heights of the ground."""
        heights: FloatArray = self.terrain.height_at(xy_m) + xy_m @ self.rise
        return heights

    def seen_px(self, xy_m: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return (N, 2) where the ground is read in the picture."""
        exact_px = self.view.project(np.column_stack([xy_m, self.heights_m(xy_m)]))
        return exact_px + rng.normal(0.0, POINT_SIGMA_PX, exact_px.shape)


def draw_site(rng: np.random.Generator, slope_deg: float, relief_m: float) -> Site:
    """Tilt a terrain, and aim a camera at its middle."""
    terrain = make_terrain(rng, TerrainPlan(cell_m=0.5, relief_m=relief_m))
    falls_to = rng.uniform(0.0, 2.0 * np.pi)
    rise = np.tan(np.deg2rad(slope_deg)) * np.array([np.cos(falls_to), np.sin(falls_to)])
    focal_px = rng.uniform(850.0, 1100.0)
    matrix = np.array([[focal_px, 0.0, 639.5], [0.0, focal_px, 359.5], [0.0, 0.0, 1.0]])
    camera = Camera(*SIZE_PX, matrix, np.array([-0.05, 0.0, 0.0, 0.0, 0.0]))
    above_m, pitch_deg = rng.uniform(15.0, 30.0), rng.uniform(35.0, 60.0)
    position_m = np.array([0.0, -above_m / np.tan(np.deg2rad(pitch_deg)), above_m])
    return Site(terrain, rise, View.aimed(camera, position_m, heading_deg=0.0, pitch_deg=pitch_deg))


def in_picture(site: Site, rng: np.random.Generator, count: int, within_m: float) -> FloatArray:
    """Return (N, 2) places that the picture shows."""
    xy_m = rng.uniform(-within_m, within_m, (40 * count, 2))
    px = site.view.project(np.column_stack([xy_m, site.heights_m(xy_m)]))
    shown = ((px > 30.0) & (px < np.array(SIZE_PX) - 30.0)).all(axis=1) & (np.hypot(*xy_m.T) < within_m)
    chosen_m: FloatArray = xy_m[shown][:count]
    return chosen_m


def maps(site: Site, rng: np.random.Generator) -> dict[tuple[str, str], GroundMap]:
    """Return the maps of both cameras, without heights and with them."""
    xy_m = in_picture(site, rng, SURVEYED, SURVEYED_WITHIN_M)
    points_px = site.seen_px(xy_m, rng)
    told_m = site.heights_m(xy_m) + rng.normal(0.0, HEIGHT_SIGMA_M, len(xy_m))
    frame = Frame("site", 0, 0.0, ArrayPicture(np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)))
    found = {}
    for name, heights_m in (("without", np.full(len(xy_m), np.nan)), ("with", told_m)):
        survey = SurveyedGround(points_px, xy_m, SIZE_PX, heights_m=heights_m, camera=site.view.camera)
        prior = CameraPrior.calibrated(site.view.camera)
        moving = FusedGround(survey=survey, camera=prior, params=FusedParams(telemetry=False, sizes=False))
        for kind, ground in (("fixed", survey), ("moving", moving)):
            result = ground.update(frame, Detections.empty(), STILL)
            if isinstance(result, GroundMap):
                found[kind, name] = result
    return found


def errors(ground: GroundMap, feet_px: FloatArray, xy_m: FloatArray) -> FloatArray:
    """Return (K, 2) of the pairs of workers: how far the distance is off, and the stated standard error."""
    count = len(xy_m)
    tracks = Tracks(
        track_id=np.arange(count),
        xyxy_px=np.concatenate([feet_px - [10.0, 40.0], feet_px - [-10.0, -2.0]], axis=1),
        score=np.full(count, 0.9),
        class_id=np.zeros(count, dtype=np.int64),
        observed=np.ones(count, dtype=np.bool_),
        age_s=np.zeros(count),
        foot_px=feet_px,
        foot_covariance_px2=np.broadcast_to(POINT_SIGMA_PX**2 * np.eye(2), (count, 2, 2)),
    )
    positions = Locator().update(0.0, tracks, ground)
    pairs = ProximityMeter(ProximityParams(pairs=(("worker", "worker"),))).update(0.0, positions, ground)
    truth_m = np.linalg.norm(xy_m[pairs.track_a] - xy_m[pairs.track_b], axis=1)
    rows: FloatArray = np.column_stack([pairs.distance_m - truth_m, pairs.sigma_m])
    return np.asarray(rows[(truth_m < LONGEST_M) & np.isfinite(rows).all(axis=1)], dtype=np.float64)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=40, help="of each slope")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--relief", type=float, default=0.1, help="standard deviation of the ground about the slope; m")
    options = parser.parse_args()
    for slope_deg in SLOPES_DEG:
        rows: dict[tuple[str, str], list[FloatArray]] = {}
        measured: dict[tuple[str, str], int] = {}
        for number in range(options.sites):
            rng = np.random.default_rng([options.seed, number, round(slope_deg)])
            site = draw_site(rng, slope_deg, options.relief)
            xy_m = in_picture(site, rng, WORKERS, WORKERS_WITHIN_M)
            feet_px = site.seen_px(xy_m, rng)
            try:
                found = maps(site, rng)
            except GroundError as error:
                print(f"{slope_deg:g} degrees, site {number}: {error}")
                continue
            for which, ground in found.items():
                rows.setdefault(which, []).append(errors(ground, feet_px, xy_m))
                measured[which] = measured.get(which, 0) + 1
        for which, parts in sorted(rows.items()):
            off_m, sigma_m = np.concatenate(parts).T
            inside = [100.0 * float(np.mean(np.abs(off_m) < z * sigma_m)) for z in (1.0, 1.96)]
            print(
                f"{slope_deg:4g} degrees, {which[0]:6} camera, {which[1]:7} heights: {measured[which]:3d} sites, "
                f"{len(off_m):5d} pairs, MADE {np.abs(off_m).mean():.3f} m, "
                f"p95 {np.percentile(np.abs(off_m), 95):.2f} m, inside 68 % {inside[0]:.0f}, 95 % {inside[1]:.0f}"
            )


if __name__ == "__main__":
    main()
