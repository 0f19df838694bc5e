from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import drawn_clip
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from standoff.clips import (
    CLIP_FRAMES_SCHEMA,
    DEVICES_SCHEMA,
    NOISY_DETECTIONS_SCHEMA,
    PAIRS_SCHEMA,
    TRUTH_SCHEMA,
    load_clip,
)
from standoff.core.errors import DataError


def test_a_clip_is_read_as_it_was_written(clip_folder: Path) -> None:
    clip = load_clip(clip_folder)
    assert clip.frame_count == drawn_clip.FRAMES
    assert clip.names() == ["worker", "wheel_loader", "excavator"]
    assert clip.pairs.tolist() == [[0, 1], [0, 2]]
    worker, loader, excavator = drawn_clip.ENTITIES
    for frame in (0, 17):
        expected = [drawn_clip.true_distance_m(frame, worker, other) for other in (loader, excavator)]
        assert clip.distance_m[frame].tolist() == pytest.approx(expected)
        np.testing.assert_allclose(clip.xy_m[frame, 1], loader.xy_m(drawn_clip.time_s(frame)))
    assert np.flatnonzero(np.isnan(clip.box_px[:, 2, 0])).tolist() == list(drawn_clip.UNSEEN)


def _without(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def _scene(**changes: object) -> Callable[[Path], None]:
    return lambda folder: drawn_clip.change_scene(folder, **changes)


def _no_camera_column(folder: Path) -> None:
    table = pq.read_table(folder / "frames.parquet")
    pq.write_table(table.drop_columns(["reference_covered"]), folder / "frames.parquet")


def _broken_table(folder: Path) -> None:
    (folder / "truth.parquet").write_bytes(b"PAR1")


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_without("scene.json"), "no .*scene.json"),
        (_without("video.mp4"), "no .*video.mp4"),
        (_without("truth.parquet"), "no .*truth.parquet"),
        (_without("camera.yaml"), "no .*camera.yaml"),
        (_scene(format=2), "format 2"),
        (_scene(reference=None), "neither"),
        (_scene(board={"corners_m": [[0.0, 0.0, 0.0]] * 12, "square_m": 1.0}), "12 in"),
        (_no_camera_column, "without reference_covered"),
        (_broken_table, "whole Parquet table"),
    ],
)
def test_a_folder_that_is_no_clip_is_refused_in_one_line(
    copy_of: Path, spoil: Callable[[Path], None], said: str
) -> None:
    spoil(copy_of)
    with pytest.raises(DataError, match=said) as refused:
        load_clip(copy_of)
    assert "\n" not in str(refused.value)


def test_a_clip_without_a_film_is_read_where_none_is_asked_for(copy_of: Path) -> None:
    with_film = load_clip(copy_of)
    (copy_of / "video.mp4").unlink()
    with pytest.raises(DataError, match=r"video\.mp4"):
        load_clip(copy_of)
    np.testing.assert_array_equal(load_clip(copy_of, with_film=False).distance_m, with_film.distance_m)


def test_pairs_without_a_true_distance_are_left_out(copy_of: Path) -> None:
    table = pq.read_table(copy_of / "pairs.parquet")
    rows = np.arange(len(table))
    pq.write_table(table.take(rows[table["entity_b"].to_numpy() != 3]), copy_of / "pairs.parquet")
    assert load_clip(copy_of).pairs.tolist() == [[0, 1]]


@pytest.mark.parametrize(
    "schema",
    [CLIP_FRAMES_SCHEMA, DEVICES_SCHEMA, NOISY_DETECTIONS_SCHEMA, PAIRS_SCHEMA, TRUTH_SCHEMA],
    ids=["frames", "devices", "detections", "pairs", "truth"],
)
def test_every_column_says_what_it_means_and_its_unit_is_that_of_its_name(schema: pa.Schema) -> None:
    # Numbers of pixels are areas, too.
    units = {"m": ("m",), "px": ("px",), "px^2": ("px", "px2"), "s": ("s",), "deg": ("deg",), "m/s": ("mps",)}
    for field in schema:
        unit = field.metadata[b"unit"].decode()
        assert field.metadata[b"description"]
        assert (field.name.rpartition("_")[2] in units[unit]) if unit else not field.name.endswith(("_m", "_px", "_s"))
