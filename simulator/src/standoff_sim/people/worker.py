"""A worker: one body in one outfit that walks, bends, squats, works and carries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.people import carried, clothing
from standoff_sim.people.anthropometry import MEAN_STATURE_M, Body
from standoff_sim.people.dressing import worn
from standoff_sim.people.gait import ease, step_length_m
from standoff_sim.people.outfit import Outfit, choose_outfit
from standoff_sim.people.skeleton import Stance, hanging_wrists, reach, stand
from standoff_sim.scene.scene import CARRIED, Batch, place
from standoff_sim.solids.mesh import Colour

JOINTS: Mapping[str, tuple[float, float]] = {
    "stride_m": (-1e5, 1e5),
    "speed_mps": (0.0, 2.5),
    "bend_deg": (0.0, 95.0),
    "crouch": (0.0, 1.0),
    "arms": (0.0, 1.0),
    "turn_deg": (-60.0, 60.0),
    "act": (0.0, 1.0),
}
"""Allowed range of each joint of every worker."""
_TALLER_M = 0.20
"""Nobody is taller or shorter than the mean by more."""
_HOLDING = 0.5
_EIGHTHS_RAD = np.deg2rad(22.5 + 45.0 * np.arange(8))
_FOOTPRINT_M = np.column_stack([0.25 * np.cos(_EIGHTHS_RAD), 0.225 * np.sin(_EIGHTHS_RAD)]) / np.cos(np.pi / 8)
# Wrists of people who stand about, left side, in the chest's axes as shares of the stature.
_IDLE_WRISTS: Mapping[str, tuple[float, float, float]] = {
    "akimbo": (0.02, 0.135, -0.01),
    "folded": (0.135, -0.035, 0.085),
    "behind": (-0.11, 0.02, -0.03),
    "pockets": (0.05, 0.125, -0.055),
}


@dataclass(frozen=True, slots=True)
class Habits:
    """What sets people of one size and outfit apart.

    Attributes:
        pace_mps: Usual walking speed.
        phase: Of the gait where `stride_m` is 0.
        toes_out_deg: Of each foot.
        feet_apart_m: Half the distance between the ankles.
        ahead_m: How far the left foot is ahead when standing.
        slouch_deg: Of the upright upper body.
        kneeling: Whether crouching ends on a knee.
        look_deg: How far the head is turned to the left.
        idle: Where the arms are when standing about: "hang" or one of the idle poses.
    """

    pace_mps: float
    phase: float
    toes_out_deg: float
    feet_apart_m: float
    ahead_m: float
    slouch_deg: float
    kneeling: bool
    look_deg: float
    idle: str


class _Posture(NamedTuple):
    """Frames of the body's parts by name, and of the load, None while it is not shown."""

    frames: Mapping[str, FloatArray]
    load: FloatArray | None


@dataclass(frozen=True, slots=True, eq=False)
class Worker:
    """A person on the site; implements `standoff_sim.scene.scene.Model`.

    The gait's phase is a function of `stride_m` alone, so that feet stand still on the ground while the speed changes;
    a worker's step is therefore as long as at the usual pace, and `speed_mps` says how much of a walk it is.

    Attributes:
        body: Size.
        outfit: Clothes.
        habits: Gait and posture.
        load: What is in the hands when `arms` is above 0.5.
        load_tint: Its colour.
        class_id: Of `standoff.core.classes`.
        footprint_m: (8, 2) octagon around the body's middle.
        joints: Allowed ranges.
        height_m: Sole to the top of the hat, standing upright.
    """

    body: Body
    outfit: Outfit
    habits: Habits
    load: carried.Load
    load_tint: Colour
    class_id: int = CLASS_BY_NAME["worker"].id
    footprint_m: FloatArray = field(default_factory=lambda: _FOOTPRINT_M.copy())
    joints: Mapping[str, tuple[float, float]] = field(default_factory=lambda: JOINTS)
    height_m: float = field(init=False)

    def __post_init__(self) -> None:
        tops_m = [batch.poses[:, 2, :3] @ batch.mesh.vertices_m.T + batch.poses[:, 2, 3:] for batch in self.person({})]
        object.__setattr__(self, "height_m", float(max(top_m.max() for top_m in tops_m)))

    @property
    def step_m(self) -> float:
        """Return the length of a full step."""
        return step_length_m(self.habits.pace_mps, self.body.stature_m)

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return the person's parts first, then what is carried; missing joints are 0."""
        posture = self._posture(joints)
        return self._dressed(posture) + self._burdened(posture)

    def person(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return body and clothes without what is carried."""
        return self._dressed(self._posture(joints))

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        """Return None: people have no bucket."""
        return None

    def _posture(self, joints: Mapping[str, float]) -> _Posture:
        values = {name: min(max(joints.get(name, 0.0), low), high) for name, (low, high) in self.joints.items()}
        stance, working = self._stance(values), ease(values["arms"] / _HOLDING)
        trunk = stand(self.body, stance, clothing.sole(self.body.scale))
        beat = 2.0 * np.pi * values["act"]
        beat_m = np.array([0.09 * np.sin(beat), 0.0, 0.11 * np.cos(beat) - 0.11])
        bearer = carried.Bearer(trunk.chest, trunk.heading, self.body.stature_m, trunk.shoulders_m, beat_m)
        free_m = hanging_wrists(self.body, stance, trunk)
        if self.habits.idle != "hang":
            x, y, z = _IDLE_WRISTS[self.habits.idle]
            idle_m = np.array([bearer.at_chest(x, y, z), bearer.at_chest(x, -y, z)])
            busy = stance.walk, ease(2.0 * values["crouch"]), ease(values["bend_deg"] / 30.0)
            free_m = free_m + np.prod(1.0 - np.array(busy)) * (idle_m - free_m)
        load_pose, wanted_m = self.load.hold(bearer)
        wanted_m = np.where(np.isnan(wanted_m), free_m, wanted_m)
        frames = {**trunk.frames, **reach(self.body, trunk, free_m + working * (wanted_m - free_m))}
        return _Posture(frames, load_pose if values["arms"] > _HOLDING else None)

    def _stance(self, values: Mapping[str, float]) -> Stance:
        habits = self.habits
        nod_deg = 4.0 * ease(values["arms"] / _HOLDING) * np.sin(2.0 * np.pi * values["act"])
        return Stance(
            phase=habits.phase + values["stride_m"] / (2.0 * self.step_m),
            step_m=self.step_m,
            speed_mps=values["speed_mps"],
            bend_deg=max(values["bend_deg"] + nod_deg, habits.slouch_deg),
            crouch=values["crouch"],
            turn_deg=values["turn_deg"],
            toes_out_deg=habits.toes_out_deg,
            feet_apart_m=habits.feet_apart_m,
            ahead_m=habits.ahead_m,
            kneeling=habits.kneeling,
            look_deg=habits.look_deg,
        )

    def _dressed(self, posture: _Posture) -> tuple[Batch, ...]:
        garments = worn(self.outfit, _build(self.body.girth))
        return tuple(
            place(garment.mesh, posture.frames[garment.frame] @ garment.fit, tint=garment.tint, dust=self.outfit.dust)
            for garment in garments
        )

    def _burdened(self, posture: _Posture) -> tuple[Batch, ...]:
        if posture.load is None or self.load.mesh is None:
            return ()
        return (place(self.load.mesh(), posture.load, tint=self.load_tint, dust=self.outfit.dust, entity_id=CARRIED),)


def _build(girth: float) -> str:
    return clothing.BUILDS[int(np.digitize(girth, [0.95, 1.08]))]


def make_worker(
    rng: np.random.Generator, *, outfit: Outfit | None = None, mean_stature_m: float = MEAN_STATURE_M
) -> Worker:
    """Return somebody who works here; the same generator state gives the same person.

    Args:
        rng: Source of everything random.
        outfit: Clothes to wear instead of random ones.
        mean_stature_m: Of all who could work here, barefoot; another mean changes sizes and nothing else.
    """
    chosen = choose_outfit(rng)
    low_m, high_m = mean_stature_m - _TALLER_M, mean_stature_m + _TALLER_M
    stature_m = float(np.clip(rng.normal(mean_stature_m, 0.075), low_m, high_m))
    body = Body(stature_m, float(np.clip(rng.normal(1.0, 0.09), 0.84, 1.22)), float(rng.uniform(0.985, 1.015)))
    habits = Habits(
        pace_mps=float(rng.uniform(0.95, 1.5)),
        phase=float(rng.random()),
        toes_out_deg=float(rng.uniform(2.0, 12.0)),
        feet_apart_m=float(rng.uniform(0.07, 0.13)),
        ahead_m=float(rng.uniform(-0.16, 0.16)),
        slouch_deg=float(rng.uniform(0.0, 7.0)),
        kneeling=bool(rng.random() < 0.35),
        look_deg=float(rng.normal(0.0, 14.0)),
        idle=str(rng.choice(["hang", *_IDLE_WRISTS], p=[0.55, 0.15, 0.12, 0.08, 0.10])),
    )
    load = carried.LOADS[int(rng.choice(len(carried.LOADS), p=[load.share for load in carried.LOADS]))]
    tint = load.tints[int(rng.integers(len(load.tints)))]
    return Worker(body, outfit or chosen, habits, load, tint)
