"""What wearables of workers and machines report: positions by satellite, once a second, as cheap receivers err.

The error model, each device for itself:

- a slow drift of each axis (0.002 to 0.02 Hz), whose root mean square is drawn log-uniformly from 0.5 to 3 m,
- white noise of 0.15 to 0.4 m on each axis,
- near a structure (within 6 m of something 2.5 m tall) both are 1.8 times as large,
- no report during outages: one begins every 240 s on average, near a structure every 20 s, and lasts 2 s at least and
  6 s on average,
- reports come 1 s apart, each up to 0.15 s early or late; `time_s` is when the position held, on the scene's clock.

`accuracy_m` is what the receiver takes for its horizontal error (68 %): right to a factor of about 1.25.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from standoff.core.homography import FloatArray
from standoff_sim.camera.telemetry import DRIFT_BAND_HZ, Origin
from standoff_sim.clip.truth import Row
from standoff_sim.movement.band_noise import BandNoise
from standoff_sim.movement.motion import sample
from standoff_sim.scene.scene import NOTHING, Actor, Batch, GroundSurface, Scene

DRIFT_M = (0.5, 3.0)
NOISE_M = (0.15, 0.4)
NEAR_FACTOR = 1.8
INTERVAL_S, JITTER_S = 1.0, 0.15
OUTAGE_EVERY_S, OUTAGE_EVERY_NEAR_S = 240.0, 20.0
OUTAGE_S, SHORTEST_OUTAGE_S = 6.0, 2.0
_TALL_M, _NEAR_M = 2.5, 6.0
_DOUBT = 0.22
"""Standard deviation of the logarithm of what a receiver takes for its error."""


@dataclass(frozen=True, slots=True, eq=False)
class Receiver:
    """One device's habits.

    Attributes:
        device_id: Its name.
        drift: Of x and y.
        drift_m: Root mean square of the drift of one axis.
        noise_m: Standard deviation of one axis.
        first_s: Time of its first report.
    """

    device_id: str
    drift: tuple[BandNoise, BandNoise]
    drift_m: float
    noise_m: float
    first_s: float

    @classmethod
    def draw(cls, rng: np.random.Generator, device_id: str) -> Receiver:
        """Draw a receiver."""
        drift_m = float(np.exp(rng.uniform(*np.log(DRIFT_M))))
        east, north = (BandNoise.draw(rng, DRIFT_BAND_HZ, drift_m) for _ in range(2))
        return cls(device_id, (east, north), drift_m, float(rng.uniform(*NOISE_M)), float(rng.uniform(0, INTERVAL_S)))

    def sigma_m(self, near: bool) -> float:
        """Return the standard error of one axis."""
        return float(np.hypot(self.drift_m, self.noise_m)) * (NEAR_FACTOR if near else 1.0)


def report_positions(scene: Scene, duration_s: float, origin: Origin, rng: np.random.Generator) -> list[Row]:
    """Return the rows of `DEVICES_SCHEMA` of everybody who moves on the site.

    Args:
        scene: Whose actors carry a device each.
        duration_s: Reports end then.
        origin: Of the site frame on the Earth.
        rng: Decides everything.
    """
    structures = tall_outlines(scene.props, scene.ground)
    numbers = rng.permutation(len(scene.actors)) + 1
    rows: list[Row] = []
    for actor, number in zip(scene.actors, numbers.tolist(), strict=True):
        own = np.random.default_rng(rng.integers(2**63))
        receiver = Receiver.draw(own, f"wearable-{number:02d}")
        rows += _reports(actor, receiver, duration_s, structures, origin, own)
    return sorted(rows, key=lambda row: (row["time_s"], row["device_id"]))


def tall_outlines(props: tuple[Batch, ...], ground: GroundSurface) -> shapely.STRtree:
    """Return the outlines on the ground of everything that hides a part of the sky."""
    outlines = []
    for batch in props:
        low, high = batch.mesh.vertices_m.min(axis=0), batch.mesh.vertices_m.max(axis=0)
        corners_m = np.array(
            [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        )
        for pose in batch.poses if batch.entity_id == NOTHING else ():
            points_m = corners_m @ pose[:3, :3].T + pose[:3, 3]
            if points_m[:, 2].max() - ground.height_at(points_m[:, :2].mean(axis=0)[None])[0] > _TALL_M:
                outlines.append(shapely.MultiPoint(points_m[:, :2]).convex_hull)
    return shapely.STRtree(outlines)


def _reports(
    actor: Actor, receiver: Receiver, duration_s: float, structures: shapely.STRtree, origin: Origin,
    rng: np.random.Generator,
) -> list[Row]:  # fmt: skip
    rows: list[Row] = []
    due_s, back_s = receiver.first_s, 0.0
    while due_s < duration_s:
        time_s = due_s + float(rng.uniform(-JITTER_S, JITTER_S))
        true_m = sample(actor.motion, time_s).xy_m
        near = len(structures.query(shapely.Point(true_m), predicate="dwithin", distance=_NEAR_M)) > 0
        every_s = OUTAGE_EVERY_NEAR_S if near else OUTAGE_EVERY_S
        if due_s >= back_s and rng.random() < 1.0 - np.exp(-INTERVAL_S / every_s):
            back_s = due_s + SHORTEST_OUTAGE_S + float(rng.exponential(OUTAGE_S - SHORTEST_OUTAGE_S))
        if due_s >= back_s and 0.0 <= time_s < duration_s:
            rows.append(_report(actor, receiver, time_s, true_m, near, origin, rng))
        due_s += INTERVAL_S
    return rows


def _report(
    actor: Actor, receiver: Receiver, time_s: float, true_m: FloatArray, near: bool, origin: Origin,
    rng: np.random.Generator,
) -> Row:  # fmt: skip
    drift_m = np.array([noise.at(time_s) for noise in receiver.drift])
    error_m = (drift_m + rng.normal(0.0, receiver.noise_m, 2)) * (NEAR_FACTOR if near else 1.0)
    x_m, y_m = (true_m + error_m).tolist()
    latitude_deg, longitude_deg = origin.degrees(np.array([x_m, y_m]))
    return {
        "time_s": time_s,
        "device_id": receiver.device_id,
        "entity_id": actor.entity_id,
        "latitude_deg": latitude_deg,
        "longitude_deg": longitude_deg,
        "x_m": x_m,
        "y_m": y_m,
        "hdop": float(rng.uniform(0.7, 1.1)) * (NEAR_FACTOR if near else 1.0),
        # 68 % of two equal axes' errors together lie within 1.51 of one axis' standard error
        "accuracy_m": 1.51 * receiver.sigma_m(near) * float(np.exp(rng.normal(0.0, _DOUBT))),
    }
