"""Cars, vans and lorries that nobody moves."""

from __future__ import annotations

import numpy as np

from standoff.simulation.machines.vehicle import make_car, make_truck
from standoff.simulation.mesh import rotation, translation
from standoff.simulation.props.prop import moved
from standoff.simulation.scene import Batch

_SPACE_M = 2.75


def make_parked_car(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build one parked car, van or pickup."""
    return make_car(rng).parts({"steer_deg": rng.uniform(-20.0, 20.0)})


def make_parked_row(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build a row of parked cars side by side, some spaces free, some cars the other way round."""
    count = int(rng.integers(3, 7))
    batches: list[Batch] = []
    for space in range(count):
        if rng.random() < 0.15:
            continue
        turn_deg = rng.normal(0.0, 2.5) + (180.0 if rng.random() < 0.3 else 0.0)
        pose = translation(rng.normal(0.0, 0.25), (space - (count - 1) / 2) * _SPACE_M, 0.0) @ rotation("z", turn_deg)
        batches += moved(make_parked_car(rng), pose)
    return tuple(batches)


def make_parked_truck(rng: np.random.Generator) -> tuple[Batch, ...]:
    """Build one parked flatbed lorry or concrete mixer."""
    return make_truck(rng).parts({})
