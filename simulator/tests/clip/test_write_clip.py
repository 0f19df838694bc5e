from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from laws import seeds
from tolerances import GEOMETRY_REL

from standoff.clips import CLIP_FORMAT, CLIP_FRAMES_SCHEMA, PAIRS_SCHEMA, TRUTH_SCHEMA
from standoff.config import load_settings
from standoff.core.errors import OutputError
from standoff.stages.frames import open_source
from standoff.stages.ground import load_camera
from standoff_sim.clip.presets import Plan, plan_clip
from standoff_sim.clip.write_clip import frame_times_s, record_clip

_FRAMES = 3
_FILES = {
    "annotations.json", "camera.yaml", "frames.parquet", "pairs.parquet", "reference.yaml", "scene.json",
    "telemetry.srt", "truth.parquet", "video.mp4",
}  # fmt: skip


def _plan(name: str = "stationary-15", seed: int = 3) -> Plan:
    plan = plan_clip(name, seed=seed, frames=_FRAMES, width_px=320, height_px=180, masks=True)
    return replace(plan, preset=replace(plan.preset, clutter=0.05))  # most of a site's making is what lies about


@pytest.fixture(scope="session")  # of one worker, wherever its turn to run the tests of this file comes
def clip(opengl: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("clips") / "clip"
    record_clip(_plan(), out, processes=1)
    return out


def test_a_clip_has_every_file_and_its_tables_every_column(clip: Path) -> None:
    assert {path.name for path in clip.iterdir()} == _FILES
    for name, schema in (("truth", TRUTH_SCHEMA), ("pairs", PAIRS_SCHEMA), ("frames", CLIP_FRAMES_SCHEMA)):
        table = pq.read_table(clip / f"{name}.parquet")
        assert table.schema.equals(schema)
        assert sorted(set(table["frame"].to_pylist())) == list(range(_FRAMES))


def test_the_monitor_reads_its_video_camera_and_reference(clip: Path) -> None:
    source = open_source(clip / "video.mp4")
    times_s = [frame.time_s for frame in source]
    source.close()
    np.testing.assert_allclose(times_s, frame_times_s(_plan()), atol=1e-4)
    camera = load_camera(clip / "camera.yaml")
    assert (camera.width_px, camera.height_px) == (320, 180)
    settings = load_settings(clip / "reference.yaml")
    scene = json.loads((clip / "scene.json").read_text())
    assert scene["format"] == CLIP_FORMAT
    assert settings.ground.reference is not None
    top_m = np.array(scene["reference"]["top_m"])
    np.testing.assert_allclose(settings.ground.reference.shape().corners_m, top_m[:, :2], rtol=GEOMETRY_REL)


def test_the_stationary_clip_keeps_its_distance_exactly(clip: Path) -> None:
    pairs = pq.read_table(clip / "pairs.parquet")
    assert len(pairs) == _FRAMES
    np.testing.assert_allclose(pairs["centre_m"], 15.0, rtol=GEOMETRY_REL)


@pytest.mark.live
def test_the_same_seed_gives_the_same_truth_bit_for_bit_in_other_processes(clip: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    record_clip(_plan(), again, processes=2)
    for name in _FILES - {"video.mp4"}:
        assert (again / name).read_bytes() == (clip / name).read_bytes(), name


def test_another_seed_gives_another_truth(clip: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    record_clip(replace(_plan(seed=4), preset=replace(_plan().preset, frames=1)), other, processes=1)
    first, second = (pq.read_table(folder / "truth.parquet").slice(0, 1) for folder in (clip, other))
    assert not first.equals(second)


def test_an_interrupted_clip_leaves_nothing(opengl: None, tmp_path: Path) -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record_clip(_plan(), tmp_path / "clip", processes=1, on_frame=stop)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_files_is_not_overwritten_unless_asked(clip: Path) -> None:
    with pytest.raises(OutputError, match="overwrite"):
        record_clip(_plan(), clip, processes=1)


@pytest.mark.parametrize("seed", seeds(3))
def test_a_variable_rate_varies_and_always_rises(seed: int) -> None:
    steady = frame_times_s(plan_clip("busy", seed=seed))
    varied = frame_times_s(replace(plan_clip("busy", seed=seed), variable_rate=True))
    assert len(set(np.diff(steady).round(9))) == 1
    assert (np.diff(varied) > 0).all()
    assert np.std(np.diff(varied)) > 0.1 * np.mean(np.diff(steady))
    assert varied[0] == 0.0
