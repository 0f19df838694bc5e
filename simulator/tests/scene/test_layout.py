from __future__ import annotations

import numpy as np
import pytest
import shapely
from laws import seeds

from standoff_sim.ground.terrain import Terrain
from standoff_sim.ground.terrain_plan import TerrainPlan
from standoff_sim.props.clutter import CLUTTER
from standoff_sim.props.prop import Prop
from standoff_sim.scene.layout import lay_out
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import Mesh, Surface, box

EXTENT_M = (-25.0, -20.0, 25.0, 20.0)
CLEAR = (shapely.LineString([(-25, -8), (0, 0), (25, 4)]).buffer(2.0), shapely.Point(8, 10).buffer(3.0))


def hillside(rise: float = 0.05, wave_m: float = 0.08) -> Terrain:
    """A wavy slope."""
    x, y = np.meshgrid(np.linspace(-60, 60, 241), np.linspace(-60, 60, 241))
    height_m = (rise * x + wave_m * np.sin(y / 3.0) + 2.0).astype(np.float32)
    dull = np.zeros((2, 2), dtype=np.uint8)
    return Terrain(TerrainPlan(), np.array([-60.0, -60.0]), 0.5, height_m, np.zeros((2, 2, 3), dtype=np.uint8), dull)


def brick(length_m: float, width_m: float, height_m: float) -> tuple[Prop, Mesh]:
    mesh = box((length_m, width_m, height_m), None, Surface.WOOD)

    def make(rng: np.random.Generator) -> tuple[Batch, ...]:
        return (place(mesh, np.eye(4), tint=rng.uniform(0.2, 0.8, (1, 3))),)

    return Prop(f"{length_m} x {width_m}", float(np.hypot(length_m, width_m)) / 2, make), mesh


BRICKS = [
    brick(*size) for size in ((4.0, 0.8, 0.5), (1.0, 1.0, 0.3), (0.4, 0.4, 2.0), (6.0, 2.4, 2.6), (2.0, 1.5, 0.1))
]


def outlines(batches: tuple[Batch, ...], bottom_only: bool = True) -> list[shapely.Polygon]:
    found = []
    for batch in batches:
        corners = batch.mesh.vertices_m[batch.mesh.vertices_m[:, 2] < 1e-6] if bottom_only else batch.mesh.vertices_m
        for pose in batch.poses:
            found.append(shapely.MultiPoint((corners @ pose[:3, :3].T + pose[:3, 3])[:, :2]).convex_hull)
    return found


@pytest.mark.parametrize("seed", seeds(5))
def test_nothing_overlaps_and_nothing_lies_where_it_must_not(seed: int) -> None:
    props = [prop for prop, _ in BRICKS]
    shapes = outlines(lay_out(np.random.default_rng(seed), props, 0.3, CLEAR, EXTENT_M, hillside()))
    assert len(shapes) > 30
    tree = shapely.STRtree(shapes)
    first, second = tree.query(shapes, predicate="intersects")
    assert np.array_equal(first, second)
    assert not any(shape.intersects(area) for shape in shapes for area in CLEAR)
    assert all(shapely.box(*EXTENT_M).buffer(0.05).contains(shape) for shape in shapes)


@pytest.mark.parametrize("seed", seeds(5))
def test_low_things_lean_with_the_ground_and_tall_ones_stand_upright_with_no_gap(seed: int) -> None:
    ground = hillside()
    batches = lay_out(np.random.default_rng(seed), [prop for prop, _ in BRICKS], 0.25, (), EXTENT_M, ground)
    for batch in batches:
        tall = batch.mesh.vertices_m[:, 2].max() > 1.2
        foot = batch.mesh.vertices_m[batch.mesh.vertices_m[:, 2] < 1e-6].astype(np.float64)
        for pose in batch.poses.astype(np.float64):
            points = foot @ pose[:3, :3].T + pose[:3, 3]
            gap_m = points[:, 2] - ground.height_at(points[:, :2])
            assert gap_m.max() < 0.06
            assert gap_m.min() > (-0.45 if tall else -0.25)
            assert (pose[2, 2] == pytest.approx(1.0, abs=1e-6)) == bool(tall)
            np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-5)


def test_cliffs_stay_empty() -> None:
    assert lay_out(np.random.default_rng(0), [BRICKS[0][0]], 0.2, (), EXTENT_M, hillside(rise=0.6)) == ()


def test_the_same_seed_lays_out_the_same_site_and_another_seed_another() -> None:
    first, again, other = (
        lay_out(np.random.default_rng(seed), CLUTTER, 0.15, CLEAR, EXTENT_M, hillside()) for seed in (4, 4, 5)
    )
    assert len(first) == len(again)
    for one, two in zip(first, again, strict=True):
        assert one.mesh is two.mesh
        np.testing.assert_array_equal(one.poses, two.poses)
        np.testing.assert_array_equal(one.tint, two.tint)
        np.testing.assert_array_equal(one.dust, two.dust)
    assert [len(batch.poses) for batch in first] != [len(batch.poses) for batch in other]


@pytest.mark.parametrize("seed", seeds(3))
def test_every_mesh_has_one_batch_with_a_tint_and_dust_for_each_place(seed: int) -> None:
    batches = lay_out(np.random.default_rng(seed), CLUTTER, 0.2, CLEAR, EXTENT_M, hillside())
    assert len({id(batch.mesh) for batch in batches}) == len(batches)
    for batch in batches:
        assert batch.poses.shape == (len(batch.dust), 4, 4) and batch.tint.shape == (len(batch.dust), 3)
        assert batch.poses.dtype == batch.tint.dtype == batch.dust.dtype == np.float32
    assert sum(len(batch.poses) * len(batch.mesh.triangles) for batch in batches) < 150_000


def area_m2(batches: tuple[Batch, ...]) -> float:
    return float(sum(shape.area for shape in outlines(batches)))


@pytest.mark.parametrize("density", [0.05, 0.15, 0.25])
def test_things_cover_the_share_of_the_ground_that_was_asked_for(density: float) -> None:
    free_m2 = (EXTENT_M[2] - EXTENT_M[0]) * (EXTENT_M[3] - EXTENT_M[1])
    props = [prop for prop, _ in BRICKS]
    covered = [
        area_m2(lay_out(np.random.default_rng(seed), props, density, (), EXTENT_M, hillside())) / free_m2
        for seed in range(4)
    ]
    assert np.mean(covered) == pytest.approx(density, rel=0.2)


def test_heavier_weights_come_more_often() -> None:
    rare, _ = brick(1.0, 1.0, 0.3)
    common, mesh = brick(1.0, 1.1, 0.3)
    props = [rare, Prop(common.name, common.radius_m, common.make, weight=6.0)]
    batches = lay_out(np.random.default_rng(1), props, 0.1, (), EXTENT_M, hillside())
    counts = {id(batch.mesh): len(batch.poses) for batch in batches}
    assert counts[id(mesh)] > 2 * (sum(counts.values()) - counts[id(mesh)])


def test_an_area_without_free_ground_stays_empty() -> None:
    everywhere = shapely.box(*EXTENT_M).buffer(1.0)
    assert lay_out(np.random.default_rng(0), CLUTTER, 0.3, (everywhere,), EXTENT_M, hillside()) == ()


def test_an_empty_area_keeps_nothing_clear() -> None:
    with_it, without = (
        lay_out(np.random.default_rng(0), CLUTTER, 0.1, areas, EXTENT_M, hillside())
        for areas in ((shapely.Polygon(),), ())
    )
    assert sum(len(batch.poses) for batch in with_it) == sum(len(batch.poses) for batch in without) > 0


def test_most_things_are_square_to_the_building_and_some_are_not() -> None:
    batches = lay_out(np.random.default_rng(2), [BRICKS[0][0]], 0.2, (), EXTENT_M, hillside(rise=0.0, wave_m=0.0))
    turns_deg = np.rad2deg(np.arctan2(batches[0].poses[:, 1, 0], batches[0].poses[:, 0, 0])) % 90.0
    off_deg = (turns_deg - np.arange(0.0, 90.0, 2.0)[:, None] + 45.0) % 90.0 - 45.0
    best = float(np.mean(np.abs(off_deg) < 10.0, axis=1).max())
    assert 0.4 < best < 1.0
