"""What a prop is: something that stands on the site and that the truth does not name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from standoff_sim.scene.scene import Batch


@dataclass(frozen=True, slots=True)
class Prop:
    """A family of things, each one a little different.

    Attributes:
        name: Of the family.
        radius_m: Nothing else may stand this close to its origin.
        make: Builds one around the local origin, standing on z = 0; the same generator state gives the same thing.
        weight: How often sites have it, relative to other families.
    """

    name: str
    radius_m: float
    make: Callable[[np.random.Generator], tuple[Batch, ...]]
    weight: float = 1.0
