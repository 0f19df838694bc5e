from __future__ import annotations

import cv2
import numpy as np
import pytest
from laws import seeds
from pycocotools import mask as coco_mask
from tolerances import HULL_BOX_PX

from standoff.clips import PAIRS_SCHEMA, TRUTH_SCHEMA
from standoff.core.camera import Camera
from standoff.core.pose import View
from standoff_sim.clip.coco import Annotations
from standoff_sim.clip.truth import (
    entity_rows,
    full_box_px,
    mask_counts,
    pair_rows,
    visible_boxes_px,
)
from standoff_sim.scene.moment import EntityState, Moment
from standoff_sim.scene.scene import place
from standoff_sim.solids.mesh import ball, box, rotation, srgb, translation

_CAMERA = Camera(
    640, 360, np.array([[480.0, 0.0, 319.5], [0.0, 480.0, 179.5], [0.0, 0.0, 1.0]]), np.array([-0.12, 0.03, 0, 0, 0])
)
_VIEW = View.aimed(_CAMERA, np.array([0.0, -20.0, 20.0]), heading_deg=0.0, pitch_deg=45.0)


def _body(
    entity_id: int, class_id: int, x_m: float, y_m: float, tip_m: tuple[float, float, float] | None = None
) -> EntityState:
    square = np.array([[-1.0, -0.5], [1.0, -0.5], [1.0, 0.5], [-1.0, 0.5]])
    return EntityState(
        entity_id,
        class_id,
        (place(box((2.0, 1.0, 1.0), srgb("#808080")), translation(x_m, y_m, 0.0), entity_id=entity_id),),
        (),
        np.array([x_m, y_m, 0.0]),
        0.0,
        np.array([1.0, 0.0]),
        square + np.array([x_m, y_m]),
        np.full(3, np.nan) if tip_m is None else np.array(tip_m),
    )


def _moment(*bodies: EntityState) -> Moment:
    return Moment(0.5, _VIEW, bodies, (), (), False)


@pytest.mark.parametrize("seed", seeds(4))
def test_the_full_box_is_that_of_every_vertex(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = ball((1.0, 0.5, 2.0), None, surface=box((1, 1, 1), None).surface[0])
    pose = (
        translation(float(rng.uniform(-5, 5)), float(rng.uniform(-5, 5)), 1.0)
        @ rotation("z", float(rng.uniform(0, 360)))
        @ rotation("x", 30.0)
    )
    every_px = _VIEW.project(shape.vertices_m @ pose[:3, :3].T + pose[:3, 3])
    expected = np.concatenate([every_px.min(axis=0), every_px.max(axis=0)])
    np.testing.assert_allclose(full_box_px([place(shape, pose)], _VIEW), expected, atol=HULL_BOX_PX)


def test_a_body_that_reaches_behind_the_camera_has_no_full_box() -> None:
    behind = place(box((90.0, 90.0, 30.0), None), np.eye(4))
    assert np.isnan(full_box_px([behind], _VIEW)).all()


@pytest.mark.parametrize("seed", seeds(4))
def test_visible_boxes_are_those_of_opencv(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ids = np.zeros((60, 80), np.uint16)
    for entity in (1, 2, 5):
        x, y = rng.integers(0, 60), rng.integers(0, 40)
        ids[y : y + rng.integers(1, 20), x : x + rng.integers(1, 20)] = entity
    boxes, sizes = visible_boxes_px(ids, 5)
    for entity in range(1, 6):
        mask = (ids == entity).astype(np.uint8)
        assert sizes[entity] == mask.sum()
        if mask.any():
            x, y, width, height = cv2.boundingRect(mask)
            assert boxes[entity].tolist() == [x - 0.5, y - 0.5, x + width - 0.5, y + height - 0.5]
        else:
            assert np.isnan(boxes[entity]).all()


# pycocotools' own array lacks numpy 2's `copy` keyword
@pytest.mark.filterwarnings("ignore:__array__ implementation doesn't accept a copy keyword:DeprecationWarning")
@pytest.mark.parametrize("seed", seeds(4))
def test_masks_decode_to_themselves_in_pycocotools(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ids = (rng.random((13, 17)) < 0.4).astype(np.uint16) * 3
    encoded = mask_counts(ids, 3)
    decoded = coco_mask.decode(coco_mask.frPyObjects(encoded, *ids.shape))
    np.testing.assert_array_equal(decoded, ids == 3)


def test_rows_fit_their_tables_and_what_is_hidden_stays_in_them() -> None:
    moment = _moment(_body(1, 0, 0.0, 0.0), _body(2, 1, 4.0, 0.0, (6.0, 0.0, 1.0)))
    ids = np.zeros((360, 640), np.uint16)
    ids[100:110, 200:205] = 1
    rows = entity_rows(3, moment, ids, lambda body: 100)
    assert all(set(row) == set(TRUTH_SCHEMA.names) for row in rows)
    seen, hidden = rows
    assert (seen["visible_px"], seen["visible_share"]) == (50, 0.5)
    assert (seen["x1_px"], seen["y1_px"], seen["x2_px"], seen["y2_px"]) == (199.5, 99.5, 204.5, 109.5)
    assert (hidden["visible_px"], hidden["visible_share"]) == (0, 0.0)
    assert np.isnan(hidden["x1_px"])
    assert np.isfinite(hidden["full_x1_px"])
    assert seen["heading_deg"] == 90.0  # local x points east
    foot_px = _VIEW.project(np.zeros((1, 3)))[0]
    assert (seen["foot_x_px"], seen["foot_y_px"]) == tuple(foot_px)


def test_distances_between_bodies_are_those_of_their_coordinates() -> None:
    moment = _moment(_body(2, 1, 6.0, 8.0, (3.0, 4.0, 2.0)), _body(1, 0, 0.0, 0.0), _body(3, 6, 1.0, 1.0))
    rows = pair_rows(0, moment)
    assert [(row["entity_a"], row["entity_b"]) for row in rows] == [(1, 2)]  # the reference object keeps no distance
    assert set(rows[0]) == set(PAIRS_SCHEMA.names)
    assert rows[0]["centre_m"] == 10.0
    assert rows[0]["tip_m"] == 5.0
    assert rows[0]["footprint_m"] == pytest.approx(np.hypot(6.0 - 2.0, 8.0 - 1.0))


def test_coco_boxes_count_from_the_pixels_corner() -> None:
    ids = np.zeros((360, 640), np.uint16)
    ids[0:10, 0:5] = 1
    rows = entity_rows(0, _moment(_body(1, 0, 0.0, 0.0), _body(2, 1, 4.0, 0.0)), ids, lambda body: 100)
    annotations = Annotations()
    annotations.add({"file_name": "a.jpg"}, rows, (640, 360), ids)
    content = annotations.to_dict("test")
    assert [image["file_name"] for image in content["images"]] == ["a.jpg"]
    (only,) = content["annotations"]  # what is hidden is not annotated
    assert (only["bbox"], only["area"], only["category_id"]) == ([0.0, 0.0, 5.0, 10.0], 50, 1)
    encoded = coco_mask.frPyObjects(only["segmentation"], 360, 640)
    assert coco_mask.toBbox(encoded).tolist() == only["bbox"]
