"""Put a site together: cast, reference object, ground, clutter, surroundings, light, camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff_sim.camera.flight import drone_camera, make_flight
from standoff_sim.camera.sensor import Sensor
from standoff_sim.clip.presets import Plan, Preset
from standoff_sim.ground.site_plans import SiteStyle, random_plan
from standoff_sim.ground.terrain import Terrain, make_terrain
from standoff_sim.ground.terrain_plan import FlatPatch, Soil
from standoff_sim.props.clutter import CLUTTER
from standoff_sim.props.fences import make_fence
from standoff_sim.props.heaps import scatter_litter
from standoff_sim.props.plant import PLANT
from standoff_sim.render import Look
from standoff_sim.scene.cast import Cast, FilmedArea
from standoff_sim.scene.casting import CASTS, bend_over
from standoff_sim.scene.covers import make_cover
from standoff_sim.scene.layout import lay_out
from standoff_sim.scene.light import level_luminance, random_light
from standoff_sim.scene.reference import board_corners_m, make_reference
from standoff_sim.scene.scene import PARKED, Batch, Flight, GroundSurface, Light, Reference, Scene, moved
from standoff_sim.solids.mesh import translation
from standoff_sim.surroundings.surroundings import make_surroundings

_EXTENT_M = 130.0
_REFERENCE_CLEAR_M = 3.2
_COVERED_SHARE = 0.2
"""Of the free ground under props at clutter 1."""
_FENCE_IN_M = 3.0
_PROPS_WITHIN_M = 45.0
_REFERENCE_ID = 1000
"""Of the reference object, far from the actors'."""
_FIRST_PARKED_ID = 2000
_BARE = 0.3
"""Clutter below which a site has no crane."""
_CRANE_SHARE = 0.5
_CRANE_TRIES = 12
_CRANE_FOOT_M = 4.2
_JIB_AWAY_M = 9.0
_OTHER_FLIGHTS = 15485863
"""With the seed and the camera's number: the stream of everything that sets further drones apart."""
_AROUND_DEG = (60.0, 120.0)
_METERED = (0.18, 0.29)
"""Linear picture value of level ground in the open; clutter and shadows are darker."""
_METER_ALBEDO = 0.23
"""Of ground that is exposed to the letter; darker soils stay a little darker, pale ones paler."""
_DEHAZED = 0.7
_DEEPEST_BLACK = 0.16
"""Linear picture value that an automatic black level goes up to."""
_DARKEST = 0.17
"""Level light below which the shutter cannot stay open longer."""


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
    names = (
        "cast",
        "ground",
        "reference",
        "props",
        "surroundings",
        "light",
        "camera",
        "flight",
        "look",
        "crane",
        "people",
    )
    streams = np.random.SeedSequence(plan.seed).spawn(len(names))
    rng = {name: np.random.default_rng(stream) for name, stream in zip(names, streams, strict=True)}

    camera = drone_camera(preset.width_px, preset.height_px, preset.field_deg, rng["camera"])
    heading_deg = float(rng["flight"].uniform(0.0, 360.0))
    duration_s = plan.duration_s * 1.3 + 1.0  # a variable rate takes longer than the nominal one
    scale = max(1.0, preset.altitude_m / 25.0)
    reference_m = None if preset.shape is None else preset.reference_offset_m
    area = FilmedArea(heading_deg, scale, duration_s, plan.excavator_mesh, reference_m, plan.stature_m)
    cast = CASTS[preset.cast](rng["cast"], area)
    bend_over(rng["people"], cast, plan.stooping)
    flight = make_flight(
        rng["flight"], preset.motion, camera, target_xy_m=np.zeros(2), altitude_m=preset.altitude_m,
        pitch_deg=preset.pitch_deg, heading_deg=heading_deg, duration_s=plan.duration_s,
    )  # fmt: skip
    reference_xy_m = area.place(*preset.reference_offset_m).xy_m
    filming = flight if plan.camera == 1 else _fly_elsewhere(plan, camera, heading_deg)
    ground = _shape_ground(rng["ground"], preset, cast, reference_xy_m)
    reference = _place_reference(rng["reference"], plan, reference_xy_m, heading_deg, ground)
    light = random_light(rng["light"], preset.condition)
    bed = shapely.Polygon() if reference is None else shapely.Polygon(reference.base_m[:, :2])
    clear = [*cast.ways, bed.buffer(_REFERENCE_CLEAR_M)]
    crane, foot = _raise_crane(rng["crane"], preset, clear, flight, ground, light)
    props = crane + _furnish(rng["props"], preset, [*clear, foot], bed, _furnished(plan, flight), ground)
    props += _fence_in(rng["props"], ground)
    shade = light.to_sun if rng["surroundings"].random() < 0.35 else None
    outside, parked = _number_parked(make_surroundings(rng["surroundings"], ground, shade_to_sun=shade))
    props += outside + parked
    return Site(
        Scene(plan.name, plan.seed, ground, props, tuple(cast.actors), parked, reference, light, filming),
        camera,
        _develop(rng["look"], light, ground, preset.altitude_m / np.sin(np.deg2rad(preset.pitch_deg))),
        Sensor.draw(rng["look"], preset.condition),
        1 / 60 if preset.condition == "dusk" else float(rng["look"].choice([1 / 240, 1 / 500, 1 / 1000])),
        duration_s,
        board_corners_m(reference) if reference is not None and preset.shape == "board" else None,
    )


def _fly_elsewhere(plan: Plan, camera: Camera, heading_deg: float) -> Flight:
    """Draw the flight of another drone, which sees the same middle of the site from 60 to 120 degrees around."""
    preset = plan.preset
    rng = np.random.default_rng([plan.seed, _OTHER_FLIGHTS, plan.camera])
    return make_flight(
        rng, preset.motion, camera, target_xy_m=rng.uniform(-1.5, 1.5, 2),
        altitude_m=preset.altitude_m * float(rng.uniform(0.9, 1.25)),
        pitch_deg=float(np.clip(preset.pitch_deg + rng.uniform(-4.0, 6.0), 20.0, 90.0)),
        heading_deg=heading_deg + float(rng.choice([-1.0, 1.0]) * rng.uniform(*_AROUND_DEG)),
        duration_s=plan.duration_s,
    )  # fmt: skip


def _shape_ground(rng: np.random.Generator, preset: Preset, cast: Cast, reference_xy_m: FloatArray) -> Terrain:
    patches = []
    if preset.shape is not None:
        radius_m = 20.0 if preset.shape == "board" else _REFERENCE_CLEAR_M
        patches.append(FlatPatch(_pair(reference_xy_m), radius_m))
    ways = (*cast.machines_way, *cast.peoples_way)
    for way in ways:
        centre_m = np.clip([way.centroid.x, way.centroid.y], -50.0, 50.0)
        radius_m = float(np.clip(shapely.minimum_bounding_radius(way), 1.5, 14.0))
        patches.append(FlatPatch(_pair(centre_m), radius_m, firmness=0.5))
    extent_m = (_EXTENT_M, _EXTENT_M)
    plan = random_plan(rng, SiteStyle(preset.style), patches=patches, ways=ways, extent_m=extent_m)
    if preset.soil is not None:
        plan = replace(plan, soil=Soil(preset.soil))
    return make_terrain(rng, plan)


def _pair(xy_m: FloatArray) -> tuple[float, float]:
    return float(xy_m[0]), float(xy_m[1])


def _place_reference(
    rng: np.random.Generator, plan: Plan, xy_m: FloatArray, heading_deg: float, ground: GroundSurface
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


def _raise_crane(
    rng: np.random.Generator, preset: Preset, clear: Sequence[shapely.Polygon], flight: Flight, ground: GroundSurface,
    light: Light,
) -> tuple[tuple[Batch, ...], shapely.Polygon]:  # fmt: skip
    """Put up a tower crane on some sites, so that its shadow falls across the work; return it and the ground it takes.

    Its mast never stands between the camera and the middle of the site, and the jib keeps away from the camera.
    """
    nothing = (), shapely.Polygon()
    if preset.clutter < _BARE or preset.shape == "board" or rng.random() > _CRANE_SHARE:
        return nothing
    camera = shapely.Point(flight.view(0.0).position_m[:2])
    sight = shapely.LineString([camera, (0.0, 0.0)]).buffer(_CRANE_FOOT_M)
    sunward = light.to_sun[:2] / max(float(np.linalg.norm(light.to_sun[:2])), 1e-6)
    for _ in range(_CRANE_TRIES):
        xy_m = rng.uniform(-8.0, 8.0, 2) + sunward * rng.uniform(8.0, 38.0)
        foot = shapely.Point(xy_m).buffer(_CRANE_FOOT_M)
        if foot.intersects(shapely.union_all([sight, *clear])):
            continue
        pose = translation(float(xy_m[0]), float(xy_m[1]), float(ground.height_at(xy_m[None]).min()))
        crane = moved(PLANT["crane"].make(rng), pose)
        jib = shapely.LineString([(crane[2].poses[0] @ (x_m, 0.0, 0.0, 1.0))[:2] for x_m in (-14.0, 49.0)])
        if jib.distance(camera) > _JIB_AWAY_M:
            return crane, foot
    return nothing


def _furnish(
    rng: np.random.Generator, preset: Preset, clear: Sequence[shapely.Polygon], bed: shapely.Polygon,
    extent_m: tuple[float, float, float, float], ground: GroundSurface,
) -> tuple[Batch, ...]:  # fmt: skip
    """Lay out clutter, away from everybody's ways and from the reference object's bed."""
    families = [*CLUTTER, *(prop for prop in PLANT.values() if prop.name != "crane")]
    laid = lay_out(rng, families, _COVERED_SHARE * preset.clutter, clear, extent_m, ground)
    region = shapely.box(*extent_m) - bed.buffer(0.1)
    return laid + scatter_litter(rng, int(0.5 * preset.clutter * region.area), region, ground.height_at)


def _fence_in(rng: np.random.Generator, ground: GroundSurface) -> tuple[Batch, ...]:
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


def _develop(rng: np.random.Generator, light: Light, ground: Terrain, away_m: float) -> Look:
    """Draw a way of exposing and developing, as drones do by themselves: the meter holds the ground near middle grey.

    What haze adds over the distance to the ground is mostly taken off again, as by cameras' automatic black level.
    """
    level = level_luminance(light)
    clear = float(np.exp(-light.haze_per_m * away_m))
    veil = (1.0 - _DEHAZED) * (1.0 - clear)
    albedo = _METER_ALBEDO + 0.6 * (_ground_luminance(ground) - _METER_ALBEDO)
    exposure = float(np.clip(rng.uniform(*_METERED) / (clear * albedo + veil), 0.6, 1.9)) * min(level / _DARKEST, 1.0)
    warmth, tint = rng.normal(0.0, 0.03), rng.normal(0.0, 0.01)
    return Look(
        exposure=exposure / level,
        contrast=float(rng.uniform(0.95, 1.25)),
        lift=float(min(rng.exponential(0.004), 0.02)) - min(_DEHAZED * (1.0 - clear) * exposure, _DEEPEST_BLACK),
        saturation=float(rng.uniform(0.75, 1.15)),
        white_balance=(float(1.0 + warmth), float(1.0 + tint), float(1.0 - warmth)),
        vignette=float(rng.uniform(0.0, 0.2)),
    )


def _ground_luminance(ground: Terrain) -> float:
    """Return the mean albedo of what the camera sees most of, dark where it is wet."""
    rows, columns = ground.wetness.shape
    middle = np.s_[rows // 4 : 3 * rows // 4 : 8, columns // 4 : 3 * columns // 4 : 8]
    linear = (ground.albedo[middle] / 255.0) ** 2.2 @ np.array([0.2126, 0.7152, 0.0722])
    return float(np.mean(linear * (1.0 - 0.58 * (ground.wetness[middle] / 255.0))))
