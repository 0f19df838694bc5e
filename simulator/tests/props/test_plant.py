"""The big props: stance, size, reproducibility, budgets; fences that follow the ground."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from standoff.core.homography import FloatArray
from standoff_sim.props.fences import FENCE_KINDS, make_fence
from standoff_sim.props.plant import PLANT
from standoff_sim.props.prop import Prop
from standoff_sim.scene.scene import Batch, moved
from standoff_sim.solids.bars import bars, corrugated, grid, lattice
from standoff_sim.solids.loose_material import heap
from standoff_sim.solids.mesh import Mesh, Surface, rotation, srgb, translation

_SEEDS = range(4)
_TRIANGLES = 16000
_LYING_M = 0.3
"""Below it lie cables and hoses, which run on under whatever stands there."""


def _points_m(batches: tuple[Batch, ...]) -> FloatArray:
    return np.concatenate(
        [batch.mesh.vertices_m @ pose[:3, :3].T + pose[:3, 3] for batch in batches for pose in batch.poses]
    ).astype(np.float64)


def _facing_share(mesh: Mesh) -> float:
    corners = mesh.vertices_m[mesh.triangles].astype(np.float64)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    agreement = np.einsum("ij,ikj->i", facing, mesh.normals[mesh.triangles])
    return float((agreement[np.linalg.norm(facing, axis=1) > 1e-8] > 0.0).mean())


@pytest.fixture(params=[(name, seed) for name in PLANT for seed in _SEEDS], ids=lambda param: f"{param[0]}-{param[1]}")
def built(request: pytest.FixtureRequest) -> tuple[Prop, tuple[Batch, ...]]:
    name, seed = request.param
    return PLANT[name], PLANT[name].make(np.random.default_rng(seed))


def test_it_stands_on_the_ground(built: tuple[Prop, tuple[Batch, ...]]) -> None:
    assert _points_m(built[1])[:, 2].min() == pytest.approx(0.0, abs=0.06)


def test_it_keeps_within_its_radius(built: tuple[Prop, tuple[Batch, ...]]) -> None:
    prop, batches = built
    points_m = _points_m(batches)
    standing = points_m[(points_m[:, 2] > _LYING_M) & (points_m[:, 2] < 3.0)]
    reach_m = np.hypot(*standing[:, :2].T).max()
    assert 0.3 * prop.radius_m < reach_m <= prop.radius_m


def test_it_has_few_triangles_and_no_impossible_paint(built: tuple[Prop, tuple[Batch, ...]]) -> None:
    batches = built[1]
    assert 50 < sum(len(batch.mesh.triangles) * len(batch.poses) for batch in batches) < _TRIANGLES
    for batch in batches:
        tinted = batch.mesh.albedo[None] * (1 + batch.mesh.tintable[None, :, None] * (batch.tint[:, None] - 1))
        assert tinted.min() >= 0.0
        assert tinted.max() <= 0.85
        assert ((batch.dust >= 0.0) & (batch.dust <= 1.0)).all()


def test_its_triangles_face_outwards(built: tuple[Prop, tuple[Batch, ...]]) -> None:
    for mesh in {batch.mesh for batch in built[1]}:
        assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-4)
        assert _facing_share(mesh) > 0.98


@pytest.mark.parametrize("name", PLANT)
def test_the_same_generator_state_gives_the_same_prop(name: str) -> None:
    first, second = (PLANT[name].make(np.random.default_rng(11)) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        assert one.mesh is other.mesh
        assert np.array_equal(one.poses, other.poses)
        assert np.array_equal(one.tint, other.tint)
        assert np.array_equal(one.dust, other.dust)


@pytest.mark.parametrize("name", PLANT)
def test_different_seeds_give_different_props_of_few_meshes(name: str) -> None:
    drawn = [PLANT[name].make(np.random.default_rng(seed)) for seed in range(20)]
    assert (
        len(
            {
                tuple(batch.dust.tobytes() + batch.tint.tobytes() + batch.poses.tobytes() for batch in batches)
                for batches in drawn
            }
        )
        > 15
    )
    assert len({id(batch.mesh) for batches in drawn for batch in batches}) <= 40


def test_a_crane_is_taller_than_everything_and_its_mast_is_full_of_gaps() -> None:
    batches = PLANT["crane"].make(np.random.default_rng(2))
    heights_m = _points_m(batches)[:, 2]
    assert 28.0 < heights_m.max() < 60.0
    mast = batches[1].mesh
    side_m2 = np.ptp(mast.vertices_m[:, 0]) * np.ptp(mast.vertices_m[:, 2])
    corners = mast.vertices_m[mast.triangles]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    doubled = np.cross(one, two)
    steel_m2 = np.linalg.norm(doubled, axis=1).sum() / 2
    assert steel_m2 < 4 * side_m2


def test_moving_a_prop_moves_all_its_points() -> None:
    pose = translation(12.0, -3.0, 0.7) @ rotation("z", 33.0)
    batches = PLANT["container"].make(np.random.default_rng(1))
    expected = _points_m(batches) @ pose[:3, :3].T + pose[:3, 3]
    assert _points_m(moved(batches, pose)) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("kind", FENCE_KINDS)
def test_a_fence_follows_its_path_and_the_ground(kind: str) -> None:
    path_m = np.array([[-20.0, 3.0], [0.0, 5.0], [4.0, 18.0]])

    def height_at(xy_m: FloatArray) -> FloatArray:
        slope: FloatArray = 10.0 + 0.05 * xy_m[:, 0] - 0.03 * xy_m[:, 1]
        return slope

    points_m = _points_m(make_fence(np.random.default_rng(5), path_m, height_at, kind))
    way = shapely.LineString(path_m)
    above_m = points_m[:, 2] - height_at(points_m[:, :2])
    assert above_m.min() == pytest.approx(0.0, abs=0.08)
    assert 0.7 < above_m.max() < 2.4
    assert shapely.distance(way, shapely.points(points_m[:, :2])).max() < 1.3
    along_m = shapely.line_locate_point(way, shapely.points(points_m[:, :2]))
    assert np.diff(np.sort(along_m)).max() < 8.0
    assert np.ptp(along_m) > 0.85 * way.length


def test_fences_of_all_kinds_appear() -> None:
    path_m = np.array([[0.0, 0.0], [30.0, 0.0]])
    drawn = [make_fence(np.random.default_rng(seed), path_m, lambda xy_m: np.zeros(len(xy_m))) for seed in range(60)]
    assert len({id(batches[0].mesh) for batches in drawn}) >= 4


def test_bars_run_between_their_ends() -> None:
    ends_m = np.random.default_rng(0).uniform(-3, 3, (50, 2, 3))
    mesh = bars(ends_m, 0.1, None)
    assert _facing_share(mesh) == 1.0
    corners_m = mesh.vertices_m.reshape(50, 16, 3)
    nearest = np.linalg.norm(corners_m[:, :, None] - ends_m[:, None], axis=3).min(axis=2)
    assert nearest == pytest.approx(0.05 * np.sqrt(2), abs=1e-5)


def test_a_lattice_joins_its_chords_with_bars_of_one_bay() -> None:
    chords, bracing = lattice(6.0, (1.9, 1.9), 1.5)
    assert len(chords) == 4
    lengths_m = np.linalg.norm(bracing[:, 1] - bracing[:, 0], axis=1)
    assert set(lengths_m.round(6)) == {1.9, round(float(np.hypot(1.9, 1.5)), 6)}


def test_corrugated_sheet_waves_by_its_depth() -> None:
    points_m = corrugated(6.0, 2.4, 0.3, 0.05, rows=3)
    assert np.ptp(points_m, axis=(0, 1)) == pytest.approx([6.0, 0.05, 2.4])
    assert grid(points_m, None, Surface.PAINT).normals[:, 1].max() < 0.0


@pytest.mark.parametrize("seed", _SEEDS)
def test_a_heap_rises_from_its_border(seed: int) -> None:
    mesh = heap(np.random.default_rng(seed), (4.0, 2.0, 1.0), [srgb("#8d7658")])
    border = (np.abs(mesh.vertices_m[:, 0]) > 1.99) | (np.abs(mesh.vertices_m[:, 1]) > 0.99)
    assert np.abs(mesh.vertices_m[border, 2]).max() < 0.05
    assert 0.7 < mesh.vertices_m[:, 2].max() < 1.8
