"""Joint values with a meaning: which end of a joint's range is up, out or curled is read off the model itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff_sim.movement.driving import kind_of
from standoff_sim.movement.motion import Key, shortest_s
from standoff_sim.scene.scene import Model

Joints = dict[str, float]

_HINGES = ("boom_deg", "arm_deg", "bucket_deg")
_PROBE_SHARES = (
    (0.2, 0.2, 0.2), (0.8, 0.2, 0.5), (0.2, 0.8, 0.5), (0.5, 0.5, 0.8), (0.8, 0.8, 0.2), (0.5, 0.2, 0.8),
    (0.4, 0.6, 0.4),
)  # fmt: skip
_CHAIN_TOLERANCE_M = 0.02
_GRID_POINTS = 81


@dataclass(frozen=True, slots=True)
class TimedStance:
    """Joint values to reach, not sooner than some time after the stance before.

    Joints that are not named keep moving towards the next stance that names them, so that movements overlap.
    """

    joints: Mapping[str, float]
    after_s: float


def stance_keys(
    stances: Sequence[TimedStance], rates_ps: Mapping[str, float], start_s: float = 0.0
) -> tuple[dict[str, list[Key]], float]:
    """Give each stance the time at which it is reached, as soon as its own pace and all rates allow.

    Args:
        stances: In order; the first holds at `start_s`.
        rates_ps: Fastest change of joints, a second.
        start_s: When it begins.

    Returns:
        Keys of each joint, and when the last stance is reached.
    """
    now_s = start_s
    tracks: dict[str, list[Key]] = {name: [(start_s, value)] for name, value in stances[0].joints.items()}
    for stance in stances[1:]:
        now_s += stance.after_s
        for name, value in stance.joints.items():
            if name in rates_ps and name in tracks:
                since_s, before = tracks[name][-1]
                now_s = max(now_s, since_s + shortest_s(value - before, rates_ps[name]))
        for name, value in stance.joints.items():
            tracks.setdefault(name, []).append((now_s, value))
    return tracks, now_s


def middle(model: Model) -> Joints:
    """Return every joint in the middle of its range, or at 0 where that is allowed and the range has no end."""
    return {
        name: 0.5 * (low + high) if np.isfinite(high - low) and high - low < 1e4 else 0.0
        for name, (low, high) in model.joints.items()
    }


def raising(model: Model, joint: str) -> tuple[float, float]:
    """Return the ends of a joint's range, the one with the tool's edge lower first."""
    low, high = model.joints[joint]
    base = middle(model)
    return (low, high) if _tip(model, base | {joint: low})[1] <= _tip(model, base | {joint: high})[1] else (high, low)


def _tip(model: Model, joints: Mapping[str, float]) -> tuple[float, float]:
    """Return how far ahead and how high the tool's edge is; zeros without a tool."""
    tip_m = model.tool_tip_m(joints)
    return (0.0, 0.0) if tip_m is None else (float(tip_m[0]), float(tip_m[2]))


class ExcavatorArm:
    """Where an excavator's bucket gets to, read off its tool tip in a few positions.

    Boom, arm and bucket are hinges of a plane chain, each angle counted from the link before it.

    Args:
        model: With joints `boom_deg`, `arm_deg` and `bucket_deg`, and a tool tip.

    Raises:
        ValueError: The tip does not move as the end of such a chain.
    """

    def __init__(self, model: Model) -> None:
        limits_deg = np.array([model.joints[name] for name in _HINGES], dtype=np.float64)
        probes_deg = limits_deg[:, 0] + np.array(_PROBE_SHARES) * np.ptp(limits_deg, axis=1)
        rest = middle(model) | {"swing_deg": 0.0}
        tips = [_tip(model, rest | dict(zip(_HINGES, probe.tolist(), strict=True))) for probe in probes_deg]
        seen = np.array([complex(*tip) for tip in tips])
        links, *_ = np.linalg.lstsq(_turns(*probes_deg.T), seen, rcond=None)
        if np.abs(_turns(*probes_deg.T) @ links - seen).max() > _CHAIN_TOLERANCE_M:
            raise ValueError("boom, arm and bucket must be a plane chain of hinges with angles from link to link")
        boom_deg, arm_deg = (np.linspace(low, high, _GRID_POINTS) for low, high in limits_deg[:2].tolist())
        self._boom_deg, self._arm_deg = (part.ravel() for part in np.meshgrid(boom_deg, arm_deg))
        turns = _turns(self._boom_deg, self._arm_deg, np.zeros_like(self._boom_deg))
        self._wrists, self._buckets = turns[:, :3] @ links[:3], turns[:, 3] * links[3]
        self._curled_deg, self._open_deg = limits_deg[2].tolist()
        foot, some = links[0], len(self._boom_deg) // 2
        if abs(self._tips(0.0)[some] - foot) > abs(self._tips(1.0)[some] - foot):
            self._curled_deg, self._open_deg = self._open_deg, self._curled_deg
        tips_half_open = self._tips(0.5)
        self.ground_reach_m = float(tips_half_open.real[np.abs(tips_half_open.imag) < 0.5].max(initial=0.0))
        """How far from the swing's axis the half-open bucket's edge gets at ground level."""

    def bucket_deg(self, openness: float) -> float:
        """Return the bucket's angle: 0 curled, 1 open."""
        return float(self._curled_deg + openness * (self._open_deg - self._curled_deg))

    def at(self, reach_m: float, height_m: float, openness: float) -> Joints:
        """Return boom, arm and bucket so that the edge is at a place, to a tenth of a metre, or as near as it gets.

        Args:
            reach_m: Of the edge from the swing's axis.
            height_m: Of the edge above the ground.
            openness: Of the bucket, 0 curled .. 1 open.
        """
        nearest = int(np.argmin(np.abs(self._tips(openness) - complex(reach_m, height_m))))
        return {
            "boom_deg": float(self._boom_deg[nearest]),
            "arm_deg": float(self._arm_deg[nearest]),
            "bucket_deg": self.bucket_deg(openness),
        }

    def _tips(self, openness: float) -> npt.NDArray[np.complex128]:
        """Return reach and, as imaginary part, height of the edge for every boom and arm of the grid."""
        tips: npt.NDArray[np.complex128] = self._wrists + self._buckets * np.exp(
            1j * np.deg2rad(self.bucket_deg(openness))
        )
        return tips


def _turns(boom_deg: FloatArray, arm_deg: FloatArray, bucket_deg: FloatArray) -> npt.NDArray[np.complex128]:
    """Return (N, 4) directions of foot, boom, arm and bucket as complex numbers."""
    angles_rad = np.deg2rad(np.cumsum([np.zeros_like(boom_deg), boom_deg, arm_deg, bucket_deg], axis=0))
    turns: npt.NDArray[np.complex128] = np.exp(1j * angles_rad).T
    return turns


@dataclass(frozen=True, slots=True)
class LoaderArms:
    """Values of a wheel loader's lift and bucket.

    Attributes:
        low_deg: Lift with the bucket at the ground.
        high_deg: Lift to the top.
        level_deg: Bucket with its edge at the ground when low.
        curled_deg: Bucket that carries.
        dumped_deg: Bucket that empties.
    """

    low_deg: float
    high_deg: float
    level_deg: float
    curled_deg: float
    dumped_deg: float

    @classmethod
    def of(cls, model: Model) -> LoaderArms:
        """Read them off a model with joints `lift_deg` and `bucket_deg`."""
        low_deg, high_deg = raising(model, "lift_deg")
        dumped_deg, curled_deg = raising(model, "bucket_deg")
        angles = np.linspace(*model.joints["bucket_deg"], 61)
        heights = [_tip(model, middle(model) | {"lift_deg": low_deg, "bucket_deg": float(a)})[1] for a in angles]
        level_deg = float(angles[int(np.argmin(np.abs(np.array(heights) - 0.05)))])
        return cls(low_deg, high_deg, level_deg, curled_deg, dumped_deg)

    def lift_deg(self, share: float) -> float:
        """Return the lift's angle: 0 at the ground, 1 at the top."""
        return self.low_deg + share * (self.high_deg - self.low_deg)


def random_stance(rng: np.random.Generator, model: Model) -> Joints:
    """Draw joint values in which an entity may be found at any moment of its work.

    Args:
        rng: Decides.
        model: Any.

    Returns:
        A value within its range for every joint of the model.
    """
    kind = kind_of(model)
    if kind == "excavator":
        drawn = _excavator_stance(rng, model)
    elif kind == "wheel_loader":
        drawn = _loader_stance(rng, model)
    elif kind == "worker":
        drawn = _worker_stance(rng)
    else:
        drawn = {
            "steer_deg": rng.normal(0.0, 8.0),
            "bed_deg": rng.uniform(15.0, 50.0) * (rng.random() < 0.15),
            "blade_m": rng.uniform(0.0, 0.5) * (rng.random() < 0.5),
            "load": rng.uniform(0.2, 1.0) * (rng.random() < 0.6),
        }
    return {
        name: float(np.clip(drawn.get(name, rng.uniform(0.0, 2.0) if name.endswith("_m") else 0.0), low, high))
        for name, (low, high) in model.joints.items()
    }


def _excavator_stance(rng: np.random.Generator, model: Model) -> Joints:
    arm = ExcavatorArm(model)
    reach_m, height_m = rng.uniform(0.4, 1.0) * arm.ground_reach_m, rng.choice([0.0, 0.3, 2.0, 3.5])
    swing_deg = rng.normal(0.0, 25.0) if rng.random() < 0.5 else rng.uniform(-170.0, 170.0)
    load = float(rng.random() < 0.4)
    return {**arm.at(reach_m, height_m, rng.uniform(0.0, 0.9)), "swing_deg": swing_deg, "load": load}


def _loader_stance(rng: np.random.Generator, model: Model) -> Joints:
    arms = LoaderArms.of(model)
    share = float(rng.choice([0.0, 0.1, 0.4, 0.9], p=[0.3, 0.4, 0.15, 0.15]))
    bucket_deg = float(rng.choice([arms.level_deg, arms.curled_deg]))
    return {
        "lift_deg": arms.lift_deg(share),
        "bucket_deg": bucket_deg,
        "load": float(rng.random() < 0.5),
        "steer_deg": rng.normal(0.0, 12.0),
    }


def _worker_stance(rng: np.random.Generator) -> Joints:
    manner = rng.choice(["walks", "stands", "bends", "crouches", "works"], p=[0.35, 0.25, 0.15, 0.1, 0.15])
    walks = manner == "walks"
    return {
        "stride_m": rng.uniform(0.0, 10.0),
        "speed_mps": rng.uniform(0.7, 1.5) if walks else 0.0,
        "bend_deg": {"bends": rng.uniform(30.0, 90.0), "works": rng.uniform(5.0, 35.0)}.get(manner, rng.uniform(0, 8)),
        "crouch": rng.uniform(0.6, 1.0) if manner == "crouches" else 0.0,
        "arms": rng.uniform(0.6, 1.0) if manner in ("bends", "crouches", "works") else float(rng.random() < 0.2),
        "turn_deg": rng.normal(0.0, 12.0),
        "act": rng.uniform(0.0, 1.0),
    }
