"""Who and what is put onto a photograph's ground: machines, people among them, clutter that is nobody."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import shapely

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import ImageArray
from standoff_sim import behaviour
from standoff_sim.composites.framing import Framed, roughness
from standoff_sim.composites.plane import Plane
from standoff_sim.machines.dozer import make_dozer
from standoff_sim.machines.dump_truck import make_dump_truck
from standoff_sim.machines.excavator import make_excavator
from standoff_sim.machines.mesh_file import load_excavator
from standoff_sim.machines.roller import make_roller
from standoff_sim.machines.vehicle import make_vehicle
from standoff_sim.machines.wheel_loader import make_wheel_loader
from standoff_sim.movement.motion import Place, sample
from standoff_sim.people.outfit import choose_outfit
from standoff_sim.people.worker import make_worker
from standoff_sim.props.clutter import CLUTTER
from standoff_sim.props.plant import PLANT
from standoff_sim.scene.reference import make_reference
from standoff_sim.scene.scene import Actor, Batch, Model, Motion, Reference, moved
from standoff_sim.solids.mesh import rotation, translation

MOMENT_S = 4.0
"""Of all motions that is shown."""
_LASTING_S = 8.0
_MACHINES: tuple[tuple[str, float], ...] = (
    ("excavator", 0.26), ("wheel_loader", 0.2), ("dump_truck", 0.2), ("roller", 0.11), ("dozer", 0.13), ("vehicle", 0.1)
)  # fmt: skip
_FAMILIES = (*CLUTTER, *(prop for name, prop in PLANT.items() if name != "crane"))
_SHAPES = ("square_footing", "quadrilateral_footing", "painted_square")
_REFERENCE_ID = 1000
_REFERENCE_SHARE = 0.12
_MACHINE_SHARE = 0.43
"""Of the most machines that are there, on average."""
_MOST_PEOPLE, _MOST_PROPS = 12, 25
_CROWD_SHARE = 0.3
_NEAR_SHARE = 0.55
_HIDING_SHARE = 0.3
"""Of clutter that stands between the camera and somebody."""
_CAMOUFLAGED_SHARE = 0.2
_CANDIDATES = 6
_TRIES = 8
_CHOICES = 5
_INSET = 0.02
_ROOM_M = 0.25
_TOOL_M = 0.7
_MESH_SHARE = 1 / 3


@dataclass(slots=True)
class Company:
    """Everybody and everything on one photograph's ground.

    Attributes:
        actors: Machines and people.
        props: Clutter.
        reference: Or None.
    """

    actors: list[Actor] = field(default_factory=list)
    props: list[Batch] = field(default_factory=list)
    reference: Reference | None = None


def gather(
    rng: np.random.Generator, framed: Framed, taken: Sequence[shapely.Polygon], ground: Plane, mesh: Path | None, *,
    most_machines: int, deserted: bool,
) -> Company:  # fmt: skip
    """Draw who and what is there.

    Args:
        rng: Decides.
        framed: Everybody stands in it.
        taken: Ground that is not free.
        ground: Its colour is what camouflaged people wear.
        mesh: Folder of excavator parts, or None.
        most_machines: That are there.
        deserted: Clutter only.
    """
    floor = _Floor(rng, framed.view, framed.image, list(taken))
    company = Company()
    if not deserted:
        _add_machines(rng, floor, company, mesh, most_machines)
        _add_people(rng, floor, company, ground)
        if rng.random() < _REFERENCE_SHARE:
            _add_reference(rng, floor, company, ground)
    _add_props(rng, floor, company)
    return company


class _Floor:
    """The ground in view and what of it is taken."""

    def __init__(self, rng: np.random.Generator, view: View, photo: ImageArray, taken: list[shapely.Polygon]) -> None:
        self._rng, self.view, self._taken = rng, view, taken
        self._size = np.array([view.camera.width_px, view.camera.height_px])
        self._roughness = roughness(photo) + 1.0

    def somewhere(self) -> Place:
        """Return a place in the picture, in any direction; rather on even ground than on trees and roofs' edges."""
        shares = self._rng.uniform(_INSET, 1.0 - _INSET, (_CHOICES, 2))
        column, row = (shares * self._roughness.shape[::-1]).astype(np.intp).T
        best = int(np.argmin(self._roughness[row, column] * self._rng.uniform(0.5, 2.0, _CHOICES)))
        x_m, y_m = self.view.to_plane((shares[best] * self._size)[None])[0].tolist()
        return Place(x_m, y_m, float(self._rng.uniform(0.0, 2 * np.pi)))

    def near(self, xy_m: FloatArray, least_m: float, most_m: float) -> Place:
        """Return a place at a distance from a point, which may be outside the picture."""
        rng = self._rng
        away_m, bearing_rad = rng.uniform(least_m, most_m), rng.uniform(0.0, 2 * np.pi)
        x_m, y_m = (xy_m + away_m * np.array([np.cos(bearing_rad), np.sin(bearing_rad)])).tolist()
        return Place(x_m, y_m, float(rng.uniform(0.0, 2 * np.pi)))

    def before(self, xy_m: FloatArray, away_m: float) -> Place:
        """Return a place on the line from a point to the camera's foot."""
        toward = self.view.position_m[:2] - xy_m
        x_m, y_m = (xy_m + away_m * toward / max(float(np.linalg.norm(toward)), 1e-6)).tolist()
        return Place(x_m, y_m, float(self._rng.uniform(0.0, 2 * np.pi)))

    def shows(self, place: Place) -> bool:
        """Return whether a place is in the picture."""
        at_px = self.view.project(np.array([[place.x_m, place.y_m, 0.0]]))[0]
        return bool(((at_px > 0.0) & (at_px < self._size)).all())

    def take(self, area: shapely.Geometry, room_m: float = _ROOM_M) -> bool:
        """Take an area if it is free; return whether it was."""
        if self._taken and shapely.dwithin(area, np.array(self._taken, dtype=object), room_m).any():
            return False
        self._taken.append(area)
        return True


def _add_machines(rng: np.random.Generator, floor: _Floor, company: Company, mesh: Path | None, most: int) -> None:
    names, shares = zip(*_MACHINES, strict=True)
    for _ in range(int(rng.binomial(most, _MACHINE_SHARE))):
        kind = str(rng.choice(names, p=shares))
        model = _make_machine(rng, kind, mesh)
        for _ in range(_TRIES):
            motion = _machine_motion(rng, model, kind, floor.somewhere())
            if floor.take(_outline(model, motion)):
                company.actors.append(Actor(len(company.actors) + 1, model, motion))
                break


def _make_machine(rng: np.random.Generator, kind: str, mesh: Path | None) -> Model:
    if kind == "excavator" and mesh is not None and rng.random() < _MESH_SHARE:
        return load_excavator(mesh, rng)
    makers: dict[str, Callable[[np.random.Generator], Model]] = {
        "excavator": make_excavator, "wheel_loader": make_wheel_loader, "dump_truck": make_dump_truck,
        "roller": make_roller, "dozer": make_dozer, "vehicle": make_vehicle,
    }  # fmt: skip
    return makers[kind](rng)


def _machine_motion(rng: np.random.Generator, model: Model, kind: str, place: Place) -> Motion:
    """Return what a machine does, so that it is at the place at the moment that is shown."""
    works = rng.random() < 0.75
    if not works or kind == "vehicle":
        motion = behaviour.idle(rng, model, place, _LASTING_S)
    elif kind == "excavator":
        script = behaviour.digging if rng.random() < 0.7 else behaviour.grading
        motion = script(rng, model, place, _LASTING_S)
    elif kind == "roller":
        motion = behaviour.rolling(rng, model, place, 12.0, _LASTING_S)
    elif kind == "dozer":
        motion = behaviour.dozing(rng, model, place, 12.0, _LASTING_S)
    else:
        motion = behaviour.spreading(rng, model, place, 12.0, _LASTING_S)
    return replace(motion, xy_m=motion.xy_m + place.xy_m - sample(motion, MOMENT_S).xy_m)


def _outline(model: Model, motion: Motion) -> shapely.Geometry:
    """Return the ground under an entity and its tool."""
    placement = sample(motion, MOMENT_S)
    outline = shapely.Polygon(placement.to_site(model.footprint_m))
    tip_m = model.tool_tip_m(placement.joints)
    if tip_m is None or tip_m[2] > 1.5:
        return outline
    return shapely.union(outline, shapely.Point(placement.to_site(tip_m[:2])).buffer(_TOOL_M, quad_segs=2))


def _add_people(rng: np.random.Generator, floor: _Floor, company: Company, ground: Plane) -> None:
    count = int(np.clip(round(float(rng.exponential(4.5))) + 1, 1, _MOST_PEOPLE))
    crowd = floor.somewhere().xy_m if rng.random() < _CROWD_SHARE else None
    machines = [sample(actor.motion, MOMENT_S).xy_m for actor in company.actors]
    for _ in range(count):
        worker = _dress(rng, ground)
        for _ in range(_TRIES):
            if crowd is not None and rng.random() < 0.8:
                place = floor.near(crowd, 0.0, 5.0)
            elif machines and rng.random() < _NEAR_SHARE:
                place = floor.near(machines[int(rng.integers(len(machines)))], 1.5, 8.0)
            else:
                place = floor.somewhere()
            if not floor.shows(place):
                continue
            motion = _person_motion(rng, worker, place)
            if floor.take(_outline(worker, motion), 0.0):
                company.actors.append(Actor(len(company.actors) + 1, worker, motion))
                break


def _dress(rng: np.random.Generator, ground: Plane) -> Model:
    """Make a worker; now and then one in clothes of the ground's own colour."""
    if rng.random() > _CAMOUFLAGED_SHARE:
        return make_worker(rng)
    outfits = [choose_outfit(rng) for _ in range(_CANDIDATES)]
    unlike = [np.abs(np.log(np.array([o.top, o.trousers]) / ground.linear)).sum() + 3.0 * (o.hi_vis != "none")
              for o in outfits]  # fmt: skip
    return make_worker(rng, outfit=outfits[int(np.argmin(unlike))])


def _person_motion(rng: np.random.Generator, worker: Model, place: Place) -> Motion:
    kind = str(rng.choice(["work", "walk", "carry", "talk"], p=[0.45, 0.3, 0.15, 0.1]))
    end = place.moved(8.0)
    if kind == "work":
        motion = behaviour.standing_working(rng, worker, place, _LASTING_S)
    elif kind == "walk":
        motion = behaviour.walking_past(rng, worker, np.array([place.xy_m, end.xy_m]), _LASTING_S)
    elif kind == "carry":
        motion = behaviour.carrying_between(rng, worker, place, end, _LASTING_S)
    else:
        motion = behaviour.pair_talking(rng, (worker, worker), place, _LASTING_S)[0]
    return replace(motion, xy_m=motion.xy_m + place.xy_m - sample(motion, MOMENT_S).xy_m)


def _add_reference(rng: np.random.Generator, floor: _Floor, company: Company, ground: Plane) -> None:
    place = floor.somewhere()
    if not floor.take(shapely.Point(place.xy_m).buffer(2.6)):
        return
    shape, turn_deg = str(rng.choice(_SHAPES)), float(rng.uniform(0.0, 360.0))
    company.reference = make_reference(rng, shape, (place.x_m, place.y_m), turn_deg, ground, _REFERENCE_ID)


def _add_props(rng: np.random.Generator, floor: _Floor, company: Company) -> None:
    """Strew clutter, every family as often as any other; some of it in front of people and machines."""
    actors = [(sample(actor.motion, MOMENT_S).xy_m, actor.model) for actor in company.actors]
    for _ in range(int(rng.integers(_MOST_PROPS + 1))):
        prop = _FAMILIES[int(rng.integers(len(_FAMILIES)))]
        if actors and rng.random() < _HIDING_SHARE:
            xy_m, model = actors[int(rng.integers(len(actors)))]
            half_m = 0.5 * float(np.ptp(model.footprint_m, axis=0).max())
            place = floor.before(xy_m, half_m + prop.radius_m * float(rng.uniform(0.3, 0.9)))
        else:
            place = floor.somewhere()
        batches = prop.make(rng)
        if floor.take(_ground_under(batches, place)):
            pose = translation(place.x_m, place.y_m, 0.0) @ rotation("z", float(np.rad2deg(place.heading_rad)))
            company.props += moved(batches, pose)


def _ground_under(batches: Sequence[Batch], place: Place) -> shapely.Polygon:
    """Return the rectangle that a thing covers."""
    corners = []
    for batch in batches:
        low, high = batch.mesh.vertices_m.min(axis=0), batch.mesh.vertices_m.max(axis=0)
        box_m = np.array(
            [[x, y, z, 1.0] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        )
        corners.append((box_m @ batch.poses[:, :2].transpose(0, 2, 1)).reshape(-1, 2))
    points = np.concatenate(corners)
    (west, south), (east, north) = points.min(axis=0), points.max(axis=0)
    spots = [
        place.moved(float(x), float(y)).xy_m for x, y in ((west, south), (east, south), (east, north), (west, north))
    ]
    return shapely.Polygon(spots)
