"""Put a site together: cast, reference object, ground, clutter, surroundings, light, camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.simulation.casting import CASTS, Cast, Stage
from standoff.simulation.covers import make_cover
from standoff.simulation.flight import drone_camera, make_flight
from standoff.simulation.layout import lay_out
from standoff.simulation.light import level_luminance, random_light
from standoff.simulation.presets import Plan, Preset
from standoff.simulation.props.clutter import CLUTTER
from standoff.simulation.props.fences import make_fence
from standoff.simulation.props.heaps import scatter_litter
from standoff.simulation.props.plant import PLANT
from standoff.simulation.reference import board_corners_m, make_reference
from standoff.simulation.render import Look
from standoff.simulation.scene import PARKED, Batch, Flight, Ground, Light, Reference, Scene
from standoff.simulation.sensor import Sensor
from standoff.simulation.site_plans import SiteStyle, random_plan
from standoff.simulation.surroundings import make_surroundings
from standoff.simulation.terrain import Terrain, make_terrain
from standoff.simulation.terrain_plan import FlatPatch, Soil

_EXTENT_M = 130.0
_REFERENCE_CLEAR_M = 3.2
_COVERED_SHARE = 0.2
"""Of the free ground under props at clutter 1."""
_FENCE_IN_M = 3.0
_PROPS_WITHIN_M = 45.0
_REFERENCE_ID = 1000
"""Of the reference object, far from the actors'."""
_FIRST_PARKED_ID = 2000


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """A scene with the camera's habits.

    Attributes:
        scene: What there is.
        camera: Lens and picture size.
        look: Development of every picture.
        sensor: Noise, sharpening, exposure drift.
        shutter_s: Exposure time.
        duration_s: Of the motions.
        board_m: (49, 3) inner corners of the checkerboard, or None.
    """

    scene: Scene
    camera: Camera
    look: Look
    sensor: Sensor
    shutter_s: float
    duration_s: float
    board_m: FloatArray | None


def build_site(plan: Plan) -> Site:
    """Build everything that a plan says; the same plan gives the same site bit for bit.

    Raises:
        DataError: A mesh folder that cannot be used.
    """
    preset = plan.preset
    # a stream for each part: a change of one leaves the others as they were
    names = ("cast", "ground", "reference", "props", "surroundings", "light", "camera", "flight", "look")
    streams = np.random.SeedSequence(plan.seed).spawn(len(names))
    rng = {name: np.random.default_rng(stream) for name, stream in zip(names, streams, strict=True)}

    camera = drone_camera(preset.width_px, preset.height_px, preset.field_deg, rng["camera"])
    heading_deg = float(rng["flight"].uniform(0.0, 360.0))
    duration_s = plan.duration_s * 1.3 + 1.0  # a variable rate takes longer than the nominal one
    scale = max(1.0, preset.altitude_m / 25.0)
    reference_m = None if preset.shape is None else preset.reference_offset_m
    stage = Stage(heading_deg, scale, duration_s, plan.excavator_mesh, reference_m)
    cast = CASTS[preset.cast](rng["cast"], stage)
    flight = make_flight(
        rng["flight"], preset.motion, camera, target_xy_m=np.zeros(2), altitude_m=preset.altitude_m,
        pitch_deg=preset.pitch_deg, heading_deg=heading_deg, duration_s=plan.duration_s,
    )  # fmt: skip
    reference_xy_m = stage.place(*preset.reference_offset_m).xy_m
    ground = _shape_ground(rng["ground"], preset, cast, reference_xy_m)
    reference = _place_reference(rng["reference"], plan, reference_xy_m, heading_deg, ground)
    light = random_light(rng["light"], preset.condition)
    bed = shapely.Polygon() if reference is None else shapely.Polygon(reference.base_m[:, :2])
    props = _furnish(rng["props"], preset, cast, bed, _furnished(plan, flight), ground)
    props += _fence_in(rng["props"], ground)
    shade = light.to_sun if rng["surroundings"].random() < 0.35 else None
    outside, parked = _number_parked(make_surroundings(rng["surroundings"], ground, shade_to_sun=shade))
    props += outside + parked
    return Site(
        Scene(plan.name, plan.seed, ground, props, tuple(cast.actors), parked, reference, light, flight),
        camera,
        _develop(rng["look"], light),
        Sensor.draw(rng["look"], preset.condition),
        1 / 60 if preset.condition == "dusk" else float(rng["look"].choice([1 / 240, 1 / 500, 1 / 1000])),
        duration_s,
        board_corners_m(reference) if reference is not None and preset.shape == "board" else None,
    )


def _shape_ground(rng: np.random.Generator, preset: Preset, cast: Cast, reference_xy_m: FloatArray) -> Terrain:
    patches = []
    if preset.shape is not None:
        radius_m = 20.0 if preset.shape == "board" else _REFERENCE_CLEAR_M
        patches.append(FlatPatch(_pair(reference_xy_m), radius_m))
    for way in (*cast.machines_way, *cast.peoples_way):
        centre_m = np.clip([way.centroid.x, way.centroid.y], -50.0, 50.0)
        radius_m = float(np.clip(shapely.minimum_bounding_radius(way), 1.5, 14.0))
        patches.append(FlatPatch(_pair(centre_m), radius_m, firmness=0.5))
    extent_m = (_EXTENT_M, _EXTENT_M)
    plan = random_plan(rng, SiteStyle(preset.style), patches=patches, extent_m=extent_m)
    if preset.soil is not None:
        plan = replace(plan, soil=Soil(preset.soil))
    return make_terrain(rng, plan)


def _pair(xy_m: FloatArray) -> tuple[float, float]:
    return float(xy_m[0]), float(xy_m[1])


def _place_reference(
    rng: np.random.Generator, plan: Plan, xy_m: FloatArray, heading_deg: float, ground: Ground
) -> Reference | None:
    preset = plan.preset
    if preset.shape is None:
        return None
    turn_deg = float(rng.uniform(8.0, 40.0)) - heading_deg
    reference = make_reference(
        rng, preset.shape, _pair(xy_m), turn_deg, ground, _REFERENCE_ID, worn=plan.name != "virtual"
    )
    covers = tuple(
        make_cover(rng, cover.kind, reference, ground, cover.start * plan.duration_s, cover.stop * plan.duration_s)
        for cover in preset.covers
    )
    return replace(reference, covers=covers)


def _furnished(plan: Plan, flight: Flight) -> tuple[float, float, float, float]:
    """Return west, south, east, north of the ground for props: what the camera ever sees, as far as it is worth it."""
    if (reach_m := plan.preset.furnished_m) is not None:
        return -reach_m, -reach_m, reach_m, reach_m
    corners = []
    for time_s in np.linspace(0.0, plan.duration_s, 5):
        view = flight.view(float(time_s))
        width_px, height_px = view.camera.width_px, view.camera.height_px
        edge_px = np.array([[0, 0], [width_px, 0], [width_px, height_px], [0, height_px]], dtype=np.float64)
        corners.append(view.to_plane(edge_px))
    points = np.concatenate(corners)
    points = np.where(np.isfinite(points), points, np.sign(points) * _PROPS_WITHIN_M)
    low = np.clip(np.nanmin(points, axis=0) - 3.0, -_PROPS_WITHIN_M, 0.0)
    high = np.clip(np.nanmax(points, axis=0) + 3.0, 0.0, _PROPS_WITHIN_M)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _furnish(
    rng: np.random.Generator, preset: Preset, cast: Cast, bed: shapely.Polygon,
    extent_m: tuple[float, float, float, float], ground: Ground,
) -> tuple[Batch, ...]:  # fmt: skip
    """Lay out clutter, away from everybody's ways and from the reference object's bed."""
    families = [*CLUTTER, *PLANT.values()]
    clear = [*cast.ways, bed.buffer(_REFERENCE_CLEAR_M)]
    laid = lay_out(rng, families, _COVERED_SHARE * preset.clutter, clear, extent_m, ground)
    region = shapely.box(*extent_m) - bed.buffer(0.1)
    return laid + scatter_litter(rng, int(0.5 * preset.clutter * region.area), region, ground.height_at)


def _fence_in(rng: np.random.Generator, ground: Ground) -> tuple[Batch, ...]:
    """Put a fence around the site."""
    half_m = _EXTENT_M / 2 - _FENCE_IN_M
    corners = np.array([[-half_m, -half_m], [half_m, -half_m], [half_m, half_m], [-half_m, half_m], [-half_m, -half_m]])
    return make_fence(rng, corners, ground.height_at)


def _number_parked(batches: tuple[Batch, ...]) -> tuple[tuple[Batch, ...], tuple[Batch, ...]]:
    """Divide into what the truth does not name, and parked vehicles, one by one with their entity ids."""
    cars = [
        replace(batch, poses=batch.poses[k : k + 1], tint=batch.tint[k : k + 1], dust=batch.dust[k : k + 1])
        for batch in batches
        if batch.entity_id == PARKED
        for k in range(len(batch.poses))
    ]
    numbered = tuple(replace(car, entity_id=_FIRST_PARKED_ID + k) for k, car in enumerate(cars))
    return tuple(batch for batch in batches if batch.entity_id != PARKED), numbered


def _develop(rng: np.random.Generator, light: Light) -> Look:
    """Draw a way of exposing and developing: from washed out to hard, warm to cold."""
    return Look(
        exposure=float(0.9 / max(level_luminance(light), 0.25) * rng.uniform(0.85, 1.25)),
        contrast=float(rng.uniform(0.82, 1.15)),
        lift=float(rng.uniform(0.0, 0.03)),
        saturation=float(rng.uniform(0.6, 1.1)),
        white_balance=(float(rng.normal(1.0, 0.03)), 1.0, float(rng.normal(1.0, 0.04))),
        vignette=float(rng.uniform(0.0, 0.2)),
    )
