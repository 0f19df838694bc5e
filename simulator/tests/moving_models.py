"""Simple models with the joints of real ones, for tests of motions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff_sim.scene.scene import Batch

_FAR = (-1e5, 1e5)
_JOINTS: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "worker": {
        "stride_m": _FAR, "speed_mps": (0.0, 2.5), "bend_deg": (0.0, 95.0), "crouch": (0.0, 1.0), "arms": (0.0, 1.0),
        "turn_deg": (-60.0, 60.0), "act": (0.0, 1.0),
    },
    "excavator": {
        "swing_deg": (-36000.0, 36000.0), "boom_deg": (-48.0, 62.0), "arm_deg": (-152.0, -28.0),
        "bucket_deg": (-138.0, 25.0), "load": (0.0, 1.0), "track_m": _FAR,
    },
    "wheel_loader": {
        "steer_deg": (-38.0, 38.0), "lift_deg": (-44.0, 44.0), "bucket_deg": (-48.0, 48.0), "load": (0.0, 1.0),
        "travel_m": _FAR,
    },
    "dump_truck": {"steer_deg": (-40.0, 40.0), "bed_deg": (0.0, 50.0), "load": (0.0, 1.0), "travel_m": _FAR},
    "roller": {"steer_deg": (-35.0, 35.0), "travel_m": _FAR},
    "dozer": {"blade_m": (-0.4, 1.1), "travel_m": _FAR},
    "vehicle": {"steer_deg": (-38.0, 38.0), "travel_m": _FAR},
}  # fmt: skip
_SIZES_M = {
    "worker": (0.5, 0.45), "excavator": (4.4, 2.9), "wheel_loader": (7.5, 2.7), "dump_truck": (8.5, 2.6),
    "roller": (5.5, 2.2), "dozer": (4.5, 3.0), "vehicle": (4.8, 1.9),
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class MovingModel:
    """A model without a look; the excavator's and the loader's tools are plane chains."""

    kind: str

    @property
    def class_id(self) -> int:
        name = "roller_or_dozer" if self.kind in ("roller", "dozer") else self.kind
        return CLASS_BY_NAME[name].id

    @property
    def footprint_m(self) -> FloatArray:
        length_m, width_m = _SIZES_M[self.kind]
        return np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [length_m / 2, width_m / 2]

    @property
    def height_m(self) -> float:
        return 1.75 if self.kind == "worker" else 3.0

    @property
    def joints(self) -> Mapping[str, tuple[float, float]]:
        return _JOINTS[self.kind]

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        return ()

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        if self.kind == "excavator":
            angles = np.cumsum([joints["boom_deg"], joints["arm_deg"], joints["bucket_deg"]])
            tip = complex(0.2, 1.8) + np.array([5.7, 2.9, 1.4]) @ np.exp(1j * np.deg2rad(angles))
            swing = np.deg2rad(joints.get("swing_deg", 0.0))
            return np.array([tip.real * np.cos(swing), tip.real * np.sin(swing), tip.imag])
        if self.kind == "wheel_loader":
            angles = np.cumsum([joints["lift_deg"], joints["bucket_deg"]])
            tip = complex(1.5, 2.0) + np.array([2.6, 1.2]) @ np.exp(1j * np.deg2rad(angles))
            return np.array([tip.real, 0.0, tip.imag])
        return None
