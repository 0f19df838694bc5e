"""Wheels of trucks, cars and rollers: they roll as far as the machine has gone, and some of them steer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.machines.machine_parts import wheel
from standoff_sim.machines.paint import Painted
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import Mesh, rotation, translation


@dataclass(frozen=True, slots=True, eq=False)
class RoadWheels:
    """Wheels of one size.

    Attributes:
        wheel: Its mesh rolls about y.
        radius_m: Of the tread.
        places_m: (N, 3) centres.
        steered: (N,) share of the steering angle that each wheel turns by.
    """

    wheel: Painted
    radius_m: float
    places_m: FloatArray
    steered: FloatArray

    def batch(self, travel_m: float, steer_deg: float = 0.0, pose: FloatArray | None = None) -> Batch:
        """Return them, rolled and steered, in the frame that the (4, 4) `pose` leads to."""
        rolled = rotation("y", np.rad2deg(travel_m / self.radius_m))
        turned = [
            translation(*place_m) @ rotation("z", steer_deg * share) @ rolled
            for place_m, share in zip(self.places_m, self.steered, strict=True)
        ]
        return self.wheel.at((np.eye(4) if pose is None else pose) @ np.stack(turned))


def axle_places(axles_x_m: tuple[float, ...], track_m: float, radius_m: float) -> FloatArray:
    """Return (2 N, 3) wheel centres of axles, right wheel first.

    >>> axle_places((1.5,), 1.6, 0.3).tolist()
    [[1.5, -0.8, 0.3], [1.5, 0.8, 0.3]]
    """
    return np.array([[x_m, side * track_m / 2, radius_m] for x_m in axles_x_m for side in (-1.0, 1.0)])


@lru_cache(maxsize=32)
def road_wheel(radius_m: float, width_m: float, lugs: int = 0) -> Mesh:
    """Return a wheel with a rim in the tint's colour; fewer triangles than a wheel loader's."""
    return wheel(radius_m, width_m, None, lugs=lugs, sections=14, rim=0.55 if lugs else 0.62)
