"""What a scene is made of: batches of meshes, light, ground, actors, the reference object, the camera's flight.

Everything is a function of the scene's time: any frame can be rendered alone, and twice gives the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.solids.mesh import Colour, Float32Array, Mesh

PARKED = 0xFFFE
"""The entity id, among the props of a site that is not finished, of vehicles that the site will number."""

NOTHING = 0
"""The entity id of everything that the truth does not name."""


CARRIED = 0xFFFF
"""The entity id, in `Model.parts`, of what somebody carries: people who mark pictures do not count it to the person."""


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """One mesh in many places.

    Attributes:
        mesh: What is placed.
        poses: (N, 4, 4) local to site (or to the model's frame, in `Model.parts`).
        tint: (N, 3) linear, multiplies the albedo of tintable vertices.
        dust: (N,) 0 clean .. 1 caked with the ground's own dust, thicker towards the ground.
        entity_id: Of the truth, or NOTHING.
    """

    mesh: Mesh
    poses: Float32Array
    tint: Float32Array
    dust: Float32Array
    entity_id: int = NOTHING


def place(
    mesh: Mesh, poses: FloatArray, *, tint: Colour | FloatArray = (1.0, 1.0, 1.0), dust: float | FloatArray = 0.2,
    entity_id: int = NOTHING,
) -> Batch:  # fmt: skip
    """Build a batch from one (4, 4) or many (N, 4, 4) poses and one or many tints (3,) / (N, 3) and dusts."""
    many = np.asarray(poses, dtype=np.float32).reshape(-1, 4, 4)
    count = len(many)
    return Batch(
        mesh,
        many,
        np.ascontiguousarray(np.broadcast_to(np.asarray(tint, dtype=np.float32), (count, 3))),
        np.ascontiguousarray(np.broadcast_to(np.asarray(dust, dtype=np.float32), (count,))),
        entity_id,
    )


def moved(batches: Sequence[Batch], pose: FloatArray) -> tuple[Batch, ...]:
    """Return the batches through a (4, 4) pose: from the local frame of a prop or model to where it stands."""
    return tuple(replace(batch, poses=np.asarray(pose @ batch.poses, dtype=np.float32)) for batch in batches)


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """Sun, sky and haze. Radiances are linear and relative: a white card in full sun and sky shows about 1.

    Attributes:
        to_sun: (3,) unit vector from the site towards the sun.
        sun: Colour times strength of direct sunlight; zeros under a closed overcast.
        sky: Of skylight from above.
        bounce: Of light from below, reflected by the ground.
        sun_softness_m_per_m: Width of the penumbra per metre between caster and receiver (clear sky: 0.01).
        haze_per_m: Extinction; 0 is clear, 0.004 hides a hill at 1 km.
        haze: Colour that haze adds.
    """

    to_sun: FloatArray
    sun: Colour
    sky: Colour
    bounce: Colour
    sun_softness_m_per_m: float
    haze_per_m: float
    haze: Colour


class GroundSurface(Protocol):
    """The relief and its look; `standoff_sim.ground.terrain.Terrain`.

    Attributes:
        origin_xy_m: (2,) site coordinates of height sample [0, 0] (the south-west corner).
        cell_m: Distance of height samples.
        height_m: (ny, nx); row index grows with y (north), column with x (east). Each cell is two triangles, split
            from its south-west to its north-east corner: that is the surface, in the picture and in the truth.
        albedo: (h, w, 3) uint8 sRGB picture of the whole extent, row 0 at the southern edge.
        wetness: (h, w) uint8, 0 dry .. 255 standing water.
    """

    @property
    def origin_xy_m(self) -> FloatArray: ...  # noqa: D102
    @property
    def cell_m(self) -> float: ...  # noqa: D102
    @property
    def height_m(self) -> Float32Array: ...  # noqa: D102
    @property
    def albedo(self) -> npt.NDArray[np.uint8]: ...  # noqa: D102
    @property
    def wetness(self) -> npt.NDArray[np.uint8]: ...  # noqa: D102

    def height_at(self, xy_m: FloatArray) -> FloatArray:
        """Return (N,) heights of the rendered surface under (N, 2); the border's height outside."""
        ...


class Model(Protocol):
    """How an entity looks for given joint values.

    Attributes:
        class_id: Of `standoff.core.classes`.
        footprint_m: (K, 2) outline on the ground, local frame, counter-clockwise: the undercarriage of a machine.
        height_m: Highest point in rest position.
        joints: Allowed range of each joint.
    """

    @property
    def class_id(self) -> int: ...  # noqa: D102
    @property
    def footprint_m(self) -> FloatArray: ...  # noqa: D102
    @property
    def height_m(self) -> float: ...  # noqa: D102
    @property
    def joints(self) -> Mapping[str, tuple[float, float]]: ...  # noqa: D102

    def parts(self, joints: Mapping[str, float]) -> tuple[Batch, ...]:
        """Return all rigid parts, poses in the model's local frame, entity_id NOTHING or CARRIED."""
        ...

    def tool_tip_m(self, joints: Mapping[str, float]) -> FloatArray | None:
        """Return (3,) middle of the bucket's or blade's cutting edge, local frame; None without one."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Where an entity is and how its joints stand, sampled densely; linear in between, held before and after.

    Attributes:
        time_s: (T,) rising.
        xy_m: (T, 2) site frame.
        heading_rad: (T,) direction of local x, counter-clockwise from east, unwrapped.
        joints: (T,) of each joint by name.
    """

    time_s: FloatArray
    xy_m: FloatArray
    heading_rad: FloatArray
    joints: Mapping[str, FloatArray] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Actor:
    """A named entity of the truth: a model with a motion.

    Attributes:
        entity_id: From 1.
        model: Its look.
        motion: Its doings.
    """

    entity_id: int
    model: Model
    motion: Motion


@dataclass(frozen=True, slots=True, eq=False)
class Cover:
    """Something that lies on the reference object for part of the time.

    Attributes:
        batch: What it is.
        start_s: When it appears, rising from the ground within `rise_s`.
        stop_s: When it is gone.
        rise_s: Seconds of growing and of shrinking.
    """

    batch: Batch
    start_s: float = -np.inf
    stop_s: float = np.inf
    rise_s: float = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """The reference object of known shape.

    Attributes:
        top_m: (4, 3) upper corners, site frame, counter-clockwise from above.
        base_m: (4, 3) the same corners where the sides meet the ground; equal to `top_m` for a flat one.
        batches: Its look above the ground, entity id set.
        roots: What of it is below the ground.
        covers: Sand, plates, ... on it.
        entity_id: Of the truth.
    """

    top_m: FloatArray
    base_m: FloatArray
    batches: tuple[Batch, ...]
    roots: tuple[Batch, ...]
    covers: tuple[Cover, ...]
    entity_id: int

    @property
    def ground_m(self) -> float:
        """Return the mean height, in the site frame, of the ground that its corners stand on."""
        return float(self.base_m[:, 2].mean())

    @property
    def height_m(self) -> float:
        """Return how high its top is above that ground."""
        return float(self.top_m[:, 2].mean()) - self.ground_m


class Flight(Protocol):
    """The camera's way through the air."""

    def view(self, time_s: float) -> View:
        """Return where the camera is and looks at a moment, all shake included."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """All of it.

    Attributes:
        name: Preset.
        seed: Of everything random in it.
        ground: Relief and soils.
        props: Everything that stands still.
        actors: Workers and machines.
        parked: Vehicles among the props, each a batch of its own with its entity id.
        reference: Or None.
        light: Sun and sky.
        flight: Camera.
    """

    name: str
    seed: int
    ground: GroundSurface
    props: tuple[Batch, ...]
    actors: tuple[Actor, ...]
    parked: tuple[Batch, ...]
    reference: Reference | None
    light: Light
    flight: Flight
