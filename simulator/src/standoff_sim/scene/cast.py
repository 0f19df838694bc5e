"""Where actors act, who they are and the ground that they need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely

from standoff_sim.machines.excavator import make_excavator
from standoff_sim.machines.mesh_file import load_excavator
from standoff_sim.movement.motion import Place, sample
from standoff_sim.people.anthropometry import MEAN_STATURE_M
from standoff_sim.people.worker import make_worker
from standoff_sim.scene.scene import Actor, Model, Motion

_SWEEP_STEP_S = 0.5
_PROPS_AWAY_M = 0.8
_TOOL_RADIUS_M = 1.2
_REFERENCE_CLEAR_M = 3.0


@dataclass(frozen=True, slots=True)
class FilmedArea:
    """The ground that the camera looks at.

    Attributes:
        heading_deg: Of the camera, clockwise from north.
        scale: 1 for a camera at 25 m; things stand further apart when seen from higher up.
        duration_s: Of all motions.
        excavator_mesh: Folder of parts in place of the procedural excavators, or None.
        reference_m: (2,) where the reference object's middle is, in the area's directions; None without one.
        mean_stature_m: Of the workers, barefoot.
    """

    heading_deg: float
    scale: float
    duration_s: float
    excavator_mesh: Path | None
    reference_m: tuple[float, float] | None
    mean_stature_m: float = MEAN_STATURE_M

    def place(self, x_m: float, y_m: float, turn_deg: float = 0.0) -> Place:
        """Return a place in the area in site coordinates."""
        right_rad = -np.deg2rad(self.heading_deg)
        return Place(0.0, 0.0, float(right_rad)).moved(x_m, y_m, float(np.deg2rad(turn_deg)))

    def reserved(self) -> list[shapely.Polygon]:
        """Return the ground about the reference object, where nobody goes."""
        if self.reference_m is None:
            return []
        return [shapely.Point(self.place(*self.reference_m).xy_m).buffer(_REFERENCE_CLEAR_M)]

    def excavator(self, rng: np.random.Generator) -> Model:
        """Draw an excavator, from the mesh folder if there is one."""
        return make_excavator(rng) if self.excavator_mesh is None else load_excavator(self.excavator_mesh, rng)

    def worker(self, rng: np.random.Generator) -> Model:
        """Draw a worker of this site's stature."""
        return make_worker(rng, mean_stature_m=self.mean_stature_m)


@dataclass(slots=True)
class Cast:
    """The actors so far, and the ground that they need.

    Attributes:
        actors: Numbered from 1.
        reserved: Ground that nobody who is added may pass over.
    """

    actors: list[Actor] = field(default_factory=list)
    reserved: list[shapely.Geometry] = field(default_factory=list)
    _ways: dict[int, shapely.Geometry] = field(default_factory=dict, repr=False)

    def add(self, models: Sequence[Model], motions: Sequence[Motion], *, force: bool = False) -> bool:
        """Add entities that act together, if nobody else is in their way.

        Args:
            models: Who.
            motions: What each does; they may come as close to each other as they like.
            force: Add them in any case.

        Returns:
            Whether they were added.
        """
        ways: list[shapely.Geometry] = []
        if not force:
            ways = [swept(model, motion) for model, motion in zip(models, motions, strict=True)]
            taken = shapely.union_all([*self.reserved, *self.machines_way, *self.peoples_way])
            if shapely.union_all(ways).intersects(taken):
                return False
        for model, motion in zip(models, motions, strict=True):
            self.actors.append(Actor(len(self.actors) + 1, model, motion))
        # Hours of motion take long to sweep: who is added in any case is swept when somebody asks.
        self._ways |= {len(self.actors) - len(ways) + k + 1: way for k, way in enumerate(ways)}
        return True

    @property
    def machines_way(self) -> list[shapely.Geometry]:
        """Where machines go, in the site frame."""
        return [self._way(actor) for actor in self.actors if not is_person(actor.model)]

    @property
    def peoples_way(self) -> list[shapely.Geometry]:
        """Where people go."""
        return [self._way(actor) for actor in self.actors if is_person(actor.model)]

    @property
    def ways(self) -> list[shapely.Polygon]:
        """Return all ground that actors need, with room around."""
        rooms = [way.buffer(_PROPS_AWAY_M) for way in (*self.machines_way, *self.peoples_way)]
        return list(shapely.get_parts(rooms))

    def _way(self, actor: Actor) -> shapely.Geometry:
        if actor.entity_id not in self._ways:
            self._ways[actor.entity_id] = swept(actor.model, actor.motion)
        return self._ways[actor.entity_id]


def is_person(model: Model) -> bool:
    """Return whether a model is a worker."""
    return model.class_id == 0


def swept(model: Model, motion: Motion) -> shapely.Geometry:
    """Return all ground that an entity's footprint and tool pass over."""
    shapes: list[shapely.Geometry] = []
    before: shapely.Polygon | None = None
    for time_s in np.arange(0.0, motion.time_s[-1] + _SWEEP_STEP_S, _SWEEP_STEP_S):
        placement = sample(motion, float(time_s))
        outline = shapely.Polygon(placement.to_site(model.footprint_m))
        shapes.append(shapely.union(before or outline, outline).convex_hull)
        before = outline
        tip_m = model.tool_tip_m(placement.joints)
        if tip_m is not None:
            shapes.append(shapely.Point(placement.to_site(tip_m[:2])).buffer(_TOOL_RADIUS_M, quad_segs=3))
    return shapely.union_all(shapes).buffer(0.1).simplify(0.05)
