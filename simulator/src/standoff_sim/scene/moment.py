"""A scene at one moment: where everything that moves stands, ready for the renderer and for the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.movement.motion import MotionState, place_on_ground, sample
from standoff_sim.scene.scene import CARRIED, NOTHING, Actor, Batch, Cover, GroundSurface, Reference, Scene, moved


@dataclass(frozen=True, slots=True, eq=False)
class EntityState:
    """One named entity at a moment.

    Attributes:
        entity_id: Of the truth.
        class_id: Of `standoff.core.classes`.
        batches: All its parts, site frame.
        carried: What goes with it but does not count to it: loads that people carry, what is under the ground.
        centre_m: (3,) middle of its footprint on the ground, site frame.
        heading_rad: Of its local x, counter-clockwise from east.
        velocity_mps: (2,) site frame.
        footprint_m: (K, 2) outline on the ground, site frame.
        tip_m: (3,) of the bucket's or blade's edge, site frame; NaN without one.
    """

    entity_id: int
    class_id: int
    batches: tuple[Batch, ...]
    carried: tuple[Batch, ...]
    centre_m: FloatArray
    heading_rad: float
    velocity_mps: FloatArray
    footprint_m: FloatArray
    tip_m: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What the camera may see at one time.

    Attributes:
        time_s: Since the scene's start.
        view: The camera.
        bodies: Actors and, last, the reference object.
        parked: Vehicles that stand still all the time, among the scene's props.
        loose: Batches that the truth does not name but that change with time (covers of the reference).
        reference_covered: Something lies on the reference object.
    """

    time_s: float
    view: View
    bodies: tuple[EntityState, ...]
    parked: tuple[EntityState, ...]
    loose: tuple[Batch, ...]
    reference_covered: bool

    @property
    def batches(self) -> tuple[Batch, ...]:
        """Return everything that moves or changes, for the renderer."""
        return tuple(batch for body in self.bodies for batch in body.batches + body.carried) + self.loose


def scene_at(scene: Scene, time_s: float) -> Moment:
    """Place everything at a time; the same time always gives the same moment."""
    bodies = [_actor_body(actor, time_s, scene.ground) for actor in scene.actors]
    loose: list[Batch] = []
    if scene.reference is not None:
        bodies.append(_reference_body(scene.reference))
        for cover in scene.reference.covers:
            loose += _risen(cover, time_s)
    parked = tuple(map(_parked_body, scene.parked))
    return Moment(time_s, scene.flight.view(time_s), tuple(bodies), parked, tuple(loose), bool(loose))


def _actor_body(actor: Actor, time_s: float, ground: GroundSurface) -> EntityState:
    model = actor.model
    placement: MotionState = sample(actor.motion, time_s)
    local_to_site = place_on_ground(placement, model.footprint_m, ground)
    tip_m = model.tool_tip_m(placement.joints)
    rotation, offset = local_to_site[:3, :3], local_to_site[:3, 3]
    outline = np.column_stack([model.footprint_m, np.zeros(len(model.footprint_m))]) @ rotation.T + offset
    parts = moved(model.parts(placement.joints), local_to_site)
    return EntityState(
        actor.entity_id,
        model.class_id,
        tuple(replace(part, entity_id=actor.entity_id) for part in parts if part.entity_id != CARRIED),
        tuple(replace(part, entity_id=NOTHING) for part in parts if part.entity_id == CARRIED),
        offset.copy(),
        placement.heading_rad,
        placement.velocity_mps,
        outline[:, :2],
        np.full(3, np.nan) if tip_m is None else rotation @ tip_m + offset,
    )


@lru_cache(maxsize=1024)
def _parked_body(batch: Batch) -> EntityState:
    local_to_site = batch.poses[0].astype(np.float64)
    low, high = batch.mesh.vertices_m[:, :2].min(axis=0), batch.mesh.vertices_m[:, :2].max(axis=0)
    outline = np.array([low, (high[0], low[1]), high, (low[0], high[1])], dtype=np.float64)
    return EntityState(
        batch.entity_id,
        CLASS_BY_NAME["vehicle"].id,
        (batch,),
        (),
        local_to_site[:3, 3],
        float(np.arctan2(local_to_site[1, 0], local_to_site[0, 0])),
        np.zeros(2),
        outline @ local_to_site[:2, :2].T + local_to_site[:2, 3],
        np.full(3, np.nan),
    )


def _reference_body(reference: Reference) -> EntityState:
    edge = reference.base_m[1] - reference.base_m[0]
    return EntityState(
        reference.entity_id,
        CLASS_BY_NAME["reference"].id,
        reference.batches,
        reference.roots,
        reference.base_m.mean(axis=0),
        float(np.arctan2(edge[1], edge[0])),
        np.zeros(2),
        reference.base_m[:, :2],
        np.full(3, np.nan),
    )


def _risen(cover: Cover, time_s: float) -> list[Batch]:
    """Return the cover as high as it has risen by now; nothing before and after."""
    share = min((time_s - cover.start_s) / cover.rise_s, (cover.stop_s - time_s) / cover.rise_s, 1.0)
    if share <= 0.0:
        return []
    poses = cover.batch.poses.copy()
    poses[:, :3, 2] *= max(share, 0.02)
    return [replace(cover.batch, poses=poses)]
