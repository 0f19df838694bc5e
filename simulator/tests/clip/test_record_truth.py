"""Clips without pictures, and clips of two drones; nothing here needs OpenGL but one comparison."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pyarrow.parquet as pq
import pytest
from tolerances import GEOMETRY_REL

from standoff.clips import CLIP_FRAMES_SCHEMA, DEVICES_SCHEMA, NOISY_DETECTIONS_SCHEMA, PAIRS_SCHEMA, TRUTH_SCHEMA
from standoff.config import load_settings
from standoff.core.homography import FloatArray
from standoff_sim.clip.presets import Plan, plan_clip
from standoff_sim.clip.write_clip import record_cameras, record_clip, record_truth

_FRAMES = 3
_SCHEMAS = {
    "truth": TRUTH_SCHEMA, "pairs": PAIRS_SCHEMA, "frames": CLIP_FRAMES_SCHEMA, "detections": NOISY_DETECTIONS_SCHEMA,
    "devices": DEVICES_SCHEMA,
}  # fmt: skip
_FILES = {*(f"{name}.parquet" for name in _SCHEMAS), "scene.json", "camera.yaml", "reference.yaml", "telemetry.srt"}
_APPROXIMATE = ("1_px", "2_px", "visible_px", "visible_share", "foot_x_px", "foot_y_px")


def _plan() -> Plan:
    plan = plan_clip("stationary-15", seed=3, frames=_FRAMES, fps=2.0, width_px=320, height_px=180, devices=True)
    return replace(plan, preset=replace(plan.preset, clutter=0.1))


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("pairs") / "pair"
    with pytest.MonkeyPatch.context() as patch:
        # a machine without OpenGL
        patch.delattr(moderngl, "create_context")
        patch.delattr(moderngl, "create_standalone_context")
        record_cameras(record_truth, _plan(), out, cameras=2, processes=1)
    return out


def _looks_deg(clip: Path) -> FloatArray:
    """Return where the camera looks in each frame, clockwise from north."""
    site_to_camera = pq.read_table(clip / "frames.parquet")["site_to_camera"].to_pylist()
    forward: FloatArray = np.array(site_to_camera)[:, 6:8]
    east, north = forward.T
    return np.asarray(np.rad2deg(np.arctan2(east, north)))


def test_a_clip_without_pictures_has_every_table_and_no_film(pair: Path) -> None:
    for clip in (pair / "camera-1", pair / "camera-2"):
        assert {path.name for path in clip.iterdir()} == _FILES
        for name, schema in _SCHEMAS.items():
            assert pq.read_table(clip / f"{name}.parquet").schema.equals(schema)
    assert {path.name for path in pair.iterdir()} == {"camera-1", "camera-2"}


def test_two_drones_see_the_same_site_at_the_same_times_from_different_sides(pair: Path) -> None:
    one, other = (pq.read_table(pair / name / "truth.parquet").to_pylist() for name in ("camera-1", "camera-2"))
    places = {(row["frame"], row["entity_id"]): (row["time_s"], row["x_m"], row["y_m"], row["z_m"]) for row in one}
    shared = [row for row in other if (row["frame"], row["entity_id"]) in places]
    assert len(shared) >= 3 * _FRAMES
    for row in shared:
        found = (row["time_s"], row["x_m"], row["y_m"], row["z_m"])
        assert found == places[row["frame"], row["entity_id"]]
    assert pq.read_table(pair / "camera-1" / "pairs.parquet").equals(pq.read_table(pair / "camera-2" / "pairs.parquet"))
    around_deg = np.abs((_looks_deg(pair / "camera-1") - _looks_deg(pair / "camera-2") + 180.0) % 360.0 - 180.0)
    assert (around_deg > 55.0).all() and (around_deg < 125.0).all()
    scenes = [json.loads((pair / name / "scene.json").read_text()) for name in ("camera-1", "camera-2")]
    assert [scene.pop("camera") for scene in scenes] == [1, 2]
    assert scenes[0] == scenes[1]


def test_two_drones_have_one_place_on_earth_and_each_its_own_errors(pair: Path) -> None:
    first, second = ((pair / name / "telemetry.srt").read_text() for name in ("camera-1", "camera-2"))
    dates = [[line for line in text.splitlines() if line.startswith("20")] for text in (first, second)]
    assert dates[0] == dates[1]
    assert first != second
    devices = [(pair / name / "devices.parquet").read_bytes() for name in ("camera-1", "camera-2")]
    assert devices[0] == devices[1]


def test_the_reference_object_says_how_high_it_stands_above_the_ground(pair: Path) -> None:
    reference = json.loads((pair / "camera-1" / "scene.json").read_text())["reference"]
    top_m, base_m = np.array(reference["top_m"]), np.array(reference["base_m"])
    assert reference["ground_m"] == pytest.approx(base_m[:, 2].mean(), rel=GEOMETRY_REL)
    settings = load_settings(pair / "camera-1" / "reference.yaml").ground.reference
    assert settings is not None and settings.height_m is not None
    assert settings.height_m == pytest.approx(top_m[:, 2].mean() - base_m[:, 2].mean())
    assert 0.2 < settings.height_m < 0.4


def test_the_same_seed_writes_the_same(pair: Path, tmp_path: Path) -> None:
    record_truth(_plan(), tmp_path / "again", processes=1)
    for name in _FILES:
        assert (tmp_path / "again" / name).read_bytes() == (pair / "camera-1" / name).read_bytes(), name


def test_positions_are_those_of_the_rendered_clip_bit_for_bit(opengl: None, pair: Path, tmp_path: Path) -> None:
    plan = _plan()
    record_clip(plan, tmp_path / "clip", processes=1)
    for name in ("pairs.parquet", "devices.parquet", "telemetry.srt", "camera.yaml", "reference.yaml", "scene.json"):
        assert (tmp_path / "clip" / name).read_bytes() == (pair / "camera-1" / name).read_bytes(), name
    rendered, surveyed = (
        {(row["frame"], row["entity_id"]): row for row in pq.read_table(folder / "truth.parquet").to_pylist()}
        for folder in (tmp_path / "clip", pair / "camera-1")
    )
    assert len(rendered.keys() & surveyed.keys()) >= 3 * _FRAMES
    for key in rendered.keys() & surveyed.keys():
        exact = [name for name in rendered[key] if not name.endswith(_APPROXIMATE)]
        np.testing.assert_equal([rendered[key][name] for name in exact], [surveyed[key][name] for name in exact])
