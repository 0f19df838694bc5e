from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from stages.detect.onnx_models import Array, save_graph

from standoff.core.errors import ModelError
from standoff.core.types import Detections
from standoff.stages.detect import DetectParams, OnnxDetector
from standoff.stages.detect.model_card import ModelCard
from standoff.stages.detect.suppression import join_cut, suppress
from standoff.stages.frames import frame_from_array

_SIZE_PX = (64, 32)


def _save(path: Path, rows: Array, points: Array) -> Path:
    save_graph(
        path,
        [onnx.helper.make_node("Identity", [name], [out]) for name, out in (("rows", "boxes"), ("feet", "points"))],
        {"picture": (np.float32, (1, 3, _SIZE_PX[1], _SIZE_PX[0]))},
        {"boxes": (rows.dtype, rows.shape), "points": (points.dtype, points.shape)},
        {"rows": rows, "feet": points},
    )
    model = onnx.load(str(path))
    onnx.helper.set_model_props(model, ModelCard(("worker", "excavator"), (), _SIZE_PX, {}).to_metadata())
    onnx.save(model, str(path))
    return path


def _rows(rng: np.random.Generator, count: int) -> Array:
    centre = np.column_stack([np.linspace(8.0, 56.0, count), rng.uniform(14.0, 18.0, count)])
    size = rng.uniform(4.0, 6.0, (count, 2))
    certain = np.tile([1.0, 0.9, 0.05], (count, 1))
    return np.concatenate([centre, size, certain], axis=1)[None].astype(np.float32)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size_px", [(64, 32), (1280, 720), (300, 400)])
def test_points_go_through_the_letterbox_as_their_boxes_do_and_may_leave_the_picture(
    tmp_path: Path, seed: int, size_px: tuple[int, int]
) -> None:
    rng = np.random.default_rng(seed)
    rows = _rows(rng, 5)
    # The corners of each box as points: what becomes of them is known from the boxes.
    points = np.concatenate([rows[..., :2] + rows[..., 2:4] / 2, rng.uniform(0.5, 2.0, (1, 5, 2))], axis=2)
    detector = OnnxDetector(_save(tmp_path / "a.onnx", rows, points.astype(np.float32)))
    found = detector.detect(frame_from_array(np.zeros((size_px[1], size_px[0], 3), np.uint8)))
    inside = (found.xyxy_px[:, 2:] < np.array(size_px) - 0.6).all(axis=1)
    assert len(found) and np.isfinite(found.foot_px).all()
    np.testing.assert_allclose(found.foot_px[inside], found.xyxy_px[inside, 2:], atol=1e-3)
    scale = max(size_px[0] / _SIZE_PX[0], size_px[1] / _SIZE_PX[1])
    sigma_px = np.sqrt(np.diagonal(found.foot_covariance_px2, axis1=1, axis2=2))
    assert ((sigma_px > 0.45 * scale) & (sigma_px < 2.1 * scale)).all()


def test_slices_place_points_in_the_frame(tmp_path: Path) -> None:
    rows = _rows(np.random.default_rng(0), 3)
    points = np.concatenate([rows[..., :2], np.ones((1, 3, 2))], axis=2).astype(np.float32)
    detector = OnnxDetector(_save(tmp_path / "a.onnx", rows, points), DetectParams(slices=(2, 1)))
    found = detector.detect(frame_from_array(np.zeros((320, 1280, 3), np.uint8)))
    np.testing.assert_allclose(found.foot_px, (found.xyxy_px[:, :2] + found.xyxy_px[:, 2:]) / 2, atol=1e-3)


def test_a_network_that_gives_no_point_for_a_box_leaves_it_unknown(tmp_path: Path) -> None:
    rows = _rows(np.random.default_rng(0), 3)
    points = np.full((1, 3, 4), np.nan, np.float32)
    points[0, 1] = 3.0, 4.0, 1.0, 1.0
    found = OnnxDetector(_save(tmp_path / "a.onnx", rows, points), DetectParams(ground_points="none")).detect(
        frame_from_array(np.zeros((32, 64, 3), np.uint8))
    )
    assert np.isfinite(found.foot_px).all(axis=1).sum() == 1
    with pytest.raises(ModelError, match="the tensors"):
        OnnxDetector(_save(tmp_path / "b.onnx", rows, points[..., :3]))


def _with_feet(boxes: list[list[float]], sigma_px: list[float]) -> Detections:
    array = np.array(boxes)
    covariance_px2 = np.array(sigma_px)[:, None, None] ** 2 * np.eye(2)
    plain = Detections(array, np.linspace(0.9, 0.5, len(array)), np.zeros(len(array), np.int64))
    return replace(plain, foot_px=array[:, 2:] + 1.0, foot_covariance_px2=covariance_px2)


def test_the_surest_of_duplicates_keeps_its_own_point() -> None:
    both = _with_feet([[0, 0, 10, 10], [0, 0, 10, 11]], [3.0, 1.0])
    kept = suppress(both, 0.5, 10)
    assert kept.foot_px.tolist() == [[11.0, 11.0]]


def test_what_slices_cut_takes_the_surest_point_of_its_pieces() -> None:
    pieces = _with_feet([[0, 0, 40, 30], [25, 0, 50, 28], [200, 0, 220, 20]], [9.0, 2.0, 4.0])
    joined = join_cut(pieces, np.array([True, True, False]), 0.3)
    assert joined.xyxy_px.tolist() == [[0, 0, 50, 30], [200, 0, 220, 20]]
    assert joined.foot_px.tolist() == [[51.0, 29.0], [221.0, 21.0]]
