from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from standoff.core.errors import DataError
from standoff_sim.machines.digging import Link
from standoff_sim.machines.excavator import Excavator, build_excavator, reach
from standoff_sim.machines.excavator_sizes import SIZES
from standoff_sim.machines.mesh_file import BUDGET, PARTS, load_excavator

_SIZES_M = {
    "crawler": ((4.4, 2.8, 1.0), (0.2, 0.0, 0.5)),
    "body": ((4.0, 2.6, 1.8), (-0.5, 0.0, 0.9)),
    "boom": ((4.8, 0.5, 3.0), (2.4, 0.0, 1.5)),
    "arm": ((1.9, 0.4, 2.2), (0.9, 0.0, 1.1)),
}


def _write_parts(folder: Path, suffix: str = ".dae", *, detail: int = 0) -> Path:
    for part, (size_m, centre_m) in _SIZES_M.items():
        solid = trimesh.creation.box(extents=size_m)
        for _ in range(detail if part == "crawler" else 0):
            solid = solid.subdivide()
        solid.apply_translation(centre_m)
        solid.export(folder / f"zx200-{part}{suffix}")
    # The bucket's pivot is the origin, its tip a ridge at 1.5 m and 40 degrees.
    tip = 1.5 * np.array([np.cos(np.deg2rad(40)), np.sin(np.deg2rad(40))])
    corners = np.array([[x, y, z] for x, z in ((0.0, 0.0), (0.3, 0.8), tip) for y in (-0.6, 0.6)])
    trimesh.convex.convex_hull(corners).export(folder / f"zx200-bucket{suffix}")
    return folder


def _triangles(model: Excavator) -> int:
    return sum(len(batch.mesh.triangles) * len(batch.poses) for batch in model.parts({}))


@pytest.mark.parametrize("suffix", [".dae", ".glb"])
def test_parts_of_either_format_make_an_excavator(tmp_path: Path, suffix: str) -> None:
    model = load_excavator(_write_parts(tmp_path, suffix), np.random.default_rng(1))
    np.testing.assert_allclose(np.ptp(model.footprint_m, axis=0), [4.4, 2.8], atol=1e-5)
    assert model.linkage.bucket_m == pytest.approx(1.5, abs=1e-4)
    assert model.linkage.boom_m == pytest.approx(float(np.hypot(4.7878, 2.9959)))
    crawler = model.skins[Link.UNDERCARRIAGE][0].mesh
    np.testing.assert_allclose(crawler.vertices_m.min(axis=0), [-2.2, -1.4, 0.0], atol=1e-5)


def test_the_bucket_turns_with_its_tip_on_the_link(tmp_path: Path) -> None:
    model = load_excavator(_write_parts(tmp_path), np.random.default_rng(1))
    bucket = model.skins[Link.BUCKET][0].mesh.vertices_m
    tips = bucket[bucket[:, 0] > 1.49]
    np.testing.assert_allclose(tips.mean(axis=0), [1.5, 0.0, 0.0], atol=1e-3)


def test_it_has_the_joints_of_the_procedural_one_and_reaches_like_it(tmp_path: Path) -> None:
    model = load_excavator(_write_parts(tmp_path), np.random.default_rng(2))
    procedural = build_excavator(SIZES[3], np.random.default_rng(2))
    assert model.joints == procedural.joints
    assert model.class_id == procedural.class_id
    joints = reach(model, 6.5, 0.5, -100.0)
    tip = model.tool_tip_m(joints)
    assert tip[0] - model.linkage.swing_xy_m[0] == pytest.approx(6.5)
    assert tip[2] == pytest.approx(0.5)


def test_meshes_are_shared_and_colours_drawn(tmp_path: Path) -> None:
    folder = _write_parts(tmp_path)
    one, same, other = (load_excavator(folder, np.random.default_rng(seed)).parts({}) for seed in (1, 1, 2))
    for first, second, third in zip(one, same, other, strict=True):
        assert first.mesh is second.mesh is third.mesh
        np.testing.assert_array_equal(first.tint, second.tint)
    assert any(not np.array_equal(first.tint, third.tint) for first, third in zip(one, other, strict=True))


def test_too_fine_a_mesh_is_thinned_out(tmp_path: Path) -> None:
    model = load_excavator(_write_parts(tmp_path, detail=5), np.random.default_rng(1))
    assert _triangles(model) < BUDGET + 1000
    crawler = model.skins[Link.UNDERCARRIAGE][0].mesh
    assert 100 < len(crawler.triangles) < 12288
    np.testing.assert_allclose(np.ptp(crawler.vertices_m, axis=0), [4.4, 2.8, 1.0], atol=0.1)


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    folder = _write_parts(tmp_path)
    load_excavator(folder, np.random.default_rng(1))
    solid = trimesh.creation.box(extents=(5.0, 3.0, 1.0))
    solid.export(folder / "zx200-crawler.dae")
    np.testing.assert_allclose(
        np.ptp(load_excavator(folder, np.random.default_rng(1)).footprint_m, axis=0), [5.0, 3.0], atol=1e-5
    )


def test_the_texture_decides_what_takes_the_paint(tmp_path: Path) -> None:
    folder = _write_parts(tmp_path)
    texture = np.zeros((8, 8, 3), np.uint8)
    texture[:, :4], texture[:, 4:] = (20, 120, 230), (40, 40, 40)  # BGR: orange, dark grey
    cv2.imwrite(str(folder / "bake.png"), texture)
    solid = trimesh.creation.box(extents=(4.0, 2.6, 1.8))
    solid.unmerge_vertices()
    across = solid.vertices[:, 0] > 0
    solid.visual = trimesh.visual.TextureVisuals(uv=np.column_stack([np.where(across, 0.9, 0.1), np.full(36, 0.5)]))
    solid.export(folder / "zx200-body.glb")
    (folder / "zx200-body.dae").unlink()
    body = load_excavator(folder, np.random.default_rng(1)).skins[Link.UPPER][0].mesh
    facing_back = body.normals[:, 0] < -0.9
    facing_ahead = body.normals[:, 0] > 0.9
    assert (body.tintable[facing_back] == 1.0).all()
    assert (body.tintable[facing_ahead] == 0.0).all()
    assert body.albedo[facing_ahead].max() < 0.05


@pytest.mark.parametrize("part", PARTS)
def test_a_missing_part_is_named(tmp_path: Path, part: str) -> None:
    _write_parts(tmp_path)
    (tmp_path / f"zx200-{part}.dae").unlink()
    with pytest.raises(DataError, match=f"'{part}'"):
        load_excavator(tmp_path, np.random.default_rng(1))


@pytest.mark.parametrize("suffix", [".dae", ".glb", ".gltf"])
@pytest.mark.parametrize("content", [b"", b"not a mesh", b"<COLLADA/>", b"{}", b"glTF\x02\x00\x00\x00\x40\x00\x00\x00"])
def test_an_unreadable_part_is_named(tmp_path: Path, suffix: str, content: bytes) -> None:
    _write_parts(tmp_path)
    (tmp_path / "zx200-boom.dae").unlink()
    (tmp_path / f"zx200-boom{suffix}").write_bytes(content)
    with pytest.raises(DataError, match="zx200-boom"):
        load_excavator(tmp_path, np.random.default_rng(1))


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_a_truncated_part_is_named(tmp_path: Path, share: float) -> None:
    _write_parts(tmp_path)
    path = tmp_path / "zx200-arm.dae"
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(DataError, match="zx200-arm"):
        load_excavator(tmp_path, np.random.default_rng(1))


@pytest.mark.shared
def test_the_real_meshes_make_a_20_t_excavator(shared_data: Path, tmp_path: Path) -> None:
    folder = shared_data / "meshes" / "zx200"
    if not folder.is_dir():
        pytest.skip(f"no meshes in {folder}")
    model = load_excavator(folder, np.random.default_rng(3))
    assert _triangles(model) < BUDGET + 1000
    np.testing.assert_allclose(np.ptp(model.footprint_m, axis=0), [4.35, 3.58], atol=0.1)
    points_m = np.concatenate(
        [b.mesh.vertices_m @ pose[:3, :3].T + pose[:3, 3] for b in model.parts({}) for pose in b.poses]
    )
    assert points_m[:, 2].min() == pytest.approx(0.0, abs=0.06)
    assert model.linkage.bucket_m == pytest.approx(1.5, abs=0.02)
    body = model.skins[Link.UPPER][0].mesh
    assert 0.02 < body.tintable.mean() < 0.9
    shutil.copytree(folder, tmp_path / "copy")
    (tmp_path / "copy" / "zx200-arm.dae").unlink()
    with pytest.raises(DataError, match="'arm'"):
        load_excavator(tmp_path / "copy", np.random.default_rng(3))
