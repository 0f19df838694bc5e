"""What machines stand on: two crawlers, or wheels on axles; they roll as far as the machine has travelled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.machines.machine_parts import Crawler
from standoff_sim.machines.paint import Painted
from standoff_sim.scene.scene import Batch
from standoff_sim.solids.mesh import rotation, translation


class RunningGear(Protocol):
    """Crawlers or wheels under a machine."""

    def batches(self, travel_m: float) -> tuple[Batch, ...]:
        """Return them in the undercarriage's frame when the machine has gone `travel_m` forwards."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Crawlers:
    """Two crawlers.

    Attributes:
        crawler: Shape of each.
        gauge_m: From middle to middle.
        shoe: One shoe of `crawler`.
        frame: The frame of `crawler`.
    """

    crawler: Crawler
    gauge_m: float
    shoe: Painted
    frame: Painted

    def batches(self, travel_m: float) -> tuple[Batch, ...]:
        """Return shoes and frames."""
        sides = np.stack([translation(0.0, side * self.gauge_m / 2, 0.0) for side in (-1.0, 1.0)])
        shoes = sides[:, None] @ self.crawler.shoe_poses(travel_m)
        return self.shoe.at(shoes), self.frame.at(sides)


@dataclass(frozen=True, slots=True, eq=False)
class Axles:
    """Wheels of one size.

    Attributes:
        wheel: Its mesh rolls about y.
        radius_m: Of the tread.
        places_m: (N, 3) centres of the wheels.
    """

    wheel: Painted
    radius_m: float
    places_m: FloatArray

    def batches(self, travel_m: float) -> tuple[Batch, ...]:
        """Return the wheels, turned."""
        turned = np.stack([translation(*place_m) for place_m in self.places_m])
        return (self.wheel.at(turned @ rotation("y", np.rad2deg(travel_m / self.radius_m))),)
