"""A ground map that was written into a run's frames places points as it did, and states the same errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from stages.sinks.fake_site import FakeSite

from standoff.clips import MAP_COLUMNS, RunFolder, map_of
from standoff.core.camera import Camera
from standoff.core.errors import DataError
from standoff.core.map_error import map_jacobian
from standoff.core.types import GroundMap, NoGroundMap, Outcome
from standoff.stages.sinks import FRAMES, TableSink

SIZE_PX = (640, 360)
LENSES = {
    "none": None,
    "brown": ((-0.11, 0.02, 0.001, -0.002, 0.003), "brown"),
    "fisheye": ((0.05, -0.01, 0.002, 0.0), "fisheye"),
}


def some_map(lens: str, seed: int) -> GroundMap:
    rng = np.random.default_rng(seed)
    told = LENSES[lens]
    matrix = np.array([[500.0 + seed, 0.0, 321.5], [0.0, 505.0, 178.25], [0.0, 0.0, 1.0]])
    image_to_ground = np.array([[0.05, 0.0, -15.0], [0.0, -0.08, 20.0], [0.0, 0.001, 1.0]])
    image_to_ground = image_to_ground * rng.uniform(0.9, 1.1, (3, 3))
    size = 9 if told is None else 10
    root = rng.normal(0.0, 1.0, (size, size)) * 10.0 ** rng.uniform(-8.0, -2.0, (size, 1))
    return GroundMap(
        image_to_ground,
        root @ root.T,
        SIZE_PX,
        "fused",
        0.07,
        anchors_px=rng.uniform(0.0, 300.0, (4, 2)),
        camera=None if told is None else Camera(*SIZE_PX, matrix, np.array(told[0]), told[1]),  # type: ignore[arg-type]
        age_s=0.4,
    )


def through_a_table(ground: GroundMap | NoGroundMap, folder: Path) -> GroundMap | NoGroundMap:
    """Write the map into a table, as a run does, and read it again."""
    result = FakeSite(SIZE_PX).result(0)
    sink = TableSink(folder / "frames.parquet", FRAMES)
    sink.write(replace(result, ground=ground))
    sink.close(Outcome("complete"))
    names = [name for name, *_ in MAP_COLUMNS]
    columns = RunFolder(folder).table("frames", names)
    return map_of({name: columns[name][0] for name in names}, SIZE_PX)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("lens", LENSES)
def test_points_lie_where_they_lay_with_the_errors_that_they_had(lens: str, seed: int, tmp_path: Path) -> None:
    before = some_map(lens, seed)
    after = through_a_table(before, tmp_path)
    assert isinstance(after, GroundMap)
    points_px = np.random.default_rng(seed).uniform(20.0, 340.0, (30, 2))
    np.testing.assert_array_equal(after.to_ground(points_px)[0], before.to_ground(points_px)[0])
    jacobian = [map_jacobian(ground, ground.undistorted(points_px)) for ground in (before, after)]
    np.testing.assert_array_equal(jacobian[1], jacobian[0])
    np.testing.assert_array_equal(after.covariance, np.tril(before.covariance) + np.tril(before.covariance, -1).T)
    np.testing.assert_array_equal(after.anchors_px, before.anchors_px)
    assert (after.method, after.age_s, after.scale_m_per_px) == (before.method, before.age_s, before.scale_m_per_px)


def test_no_map_stays_none_and_keeps_its_reason(tmp_path: Path) -> None:
    after = through_a_table(NoGroundMap("the reference is hidden"), tmp_path)
    assert isinstance(after, NoGroundMap) and after.reason == "the reference is hidden"


def test_a_run_from_before_maps_were_written_whole_says_what_is_missing(tmp_path: Path) -> None:
    through_a_table(some_map("brown", 0), tmp_path)
    path = tmp_path / "frames.parquet"
    pq.write_table(pq.read_table(path).drop_columns(["map_covariance", "lens", "anchors_px"]), path)
    with pytest.raises(DataError, match="without map_covariance,lens,anchors_px"):
        RunFolder(tmp_path).table("frames", [name for name, *_ in MAP_COLUMNS])
