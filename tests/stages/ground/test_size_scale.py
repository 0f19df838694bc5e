from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tolerances import CLEAN_CROWD_LOG, GEOMETRY_REL
from walking_crowd import random_crowd

from standoff.core import homography
from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import GroundMap
from standoff.stages.ground.size_scale import SizeScale, scale_from_sizes, unit_hint

_CROWD = random_crowd(11, clean=True, people=10)
_BOXES = _CROWD.pictures[0][1]
_WORKERS = np.zeros(len(_BOXES), dtype=np.int64)


def _stretched(factor: float) -> View:
    return View(_CROWD.view.camera, _CROWD.view.position_m * factor, _CROWD.view.site_to_camera)


def _scale(view: View | GroundMap, boxes: FloatArray = _BOXES, camera: CameraPrior | None = None) -> SizeScale:
    scale = scale_from_sizes(view, boxes, np.zeros(len(boxes), dtype=np.int64), camera=camera)
    assert scale is not None
    return scale


def _map(view: View, *, knows_lens: bool = True) -> GroundMap:
    camera = view.camera
    image_to_ground = homography.invert(view.plane_to_pinhole())
    size_px = (camera.width_px, camera.height_px)
    known = camera if knows_lens else None
    return GroundMap(image_to_ground, np.zeros((9, 9)), size_px, "test", 1.0, camera=known)


def test_people_seen_through_the_true_view_are_as_tall_as_people() -> None:
    scale = _scale(_CROWD.view)
    assert abs(np.log(scale.ratio)) < CLEAN_CROWD_LOG
    assert scale.verdict == "agrees"
    assert scale.entities == len(_BOXES)


@pytest.mark.parametrize("factor", [0.3048, 0.8, 1.7, 3.281, 100.0])
def test_a_map_wrong_by_a_factor_reads_that_factor(factor: float) -> None:
    wrong = _scale(_stretched(factor))
    assert wrong.ratio == pytest.approx(factor * _scale(_CROWD.view).ratio, rel=1e-3)
    assert wrong.sigma == pytest.approx(_scale(_CROWD.view).sigma)


def test_a_map_of_the_ground_says_the_same_as_the_pose_behind_it() -> None:
    assert _scale(_map(_CROWD.view)).ratio == pytest.approx(_scale(_CROWD.view).ratio, rel=1e-6)
    guessed = _scale(_map(_CROWD.view, knows_lens=False), camera=CameraPrior.unknown(1280, 720))
    assert guessed.ratio == pytest.approx(_scale(_CROWD.view).ratio, rel=1e-6)
    assert guessed.sigma > _scale(_CROWD.view).sigma


def test_the_order_of_boxes_does_not_matter() -> None:
    assert _scale(_CROWD.view, _BOXES[::-1]).ratio == pytest.approx(_scale(_CROWD.view).ratio, rel=GEOMETRY_REL)


def test_more_people_never_make_it_less_sure() -> None:
    sigma = [_scale(_CROWD.view, _BOXES[:count]).sigma for count in range(1, len(_BOXES) + 1)]
    assert (np.diff(sigma) <= 0.01 * sigma[0]).all()
    assert min(sigma) > 0.04  # what a crew shares does not average out


def test_some_who_stoop_hardly_change_the_scale() -> None:
    stooping = _BOXES.copy()
    stooping[:2, 1] += 0.4 * (stooping[:2, 3] - stooping[:2, 1])
    assert _scale(_CROWD.view, stooping).ratio == pytest.approx(_scale(_CROWD.view).ratio, rel=0.04)


def test_repeated_boxes_of_one_person_count_as_one() -> None:
    boxes = np.repeat(_BOXES[:1], 5, axis=0)
    workers = np.zeros(5, dtype=np.int64)
    scale = scale_from_sizes(_CROWD.view, boxes, workers, entity_id=workers)
    assert scale is not None
    assert scale.entities == 1
    assert scale.sigma == pytest.approx(_scale(_CROWD.view, boxes[:1]).sigma)


def test_boxes_cut_off_by_the_picture_s_edge_say_nothing() -> None:
    assert scale_from_sizes(_CROWD.view, np.array([[0.0, 300.0, 20.0, 350.0]]), np.array([0])) is None
    assert scale_from_sizes(_CROWD.view, np.zeros((0, 4)), np.zeros(0, dtype=np.int64)) is None


def test_a_reference_object_has_no_known_size() -> None:
    assert scale_from_sizes(_CROWD.view, _BOXES, np.full(len(_BOXES), 6)) is None


def test_machines_say_it_too_but_are_less_sure() -> None:
    size = np.array([[160.0, 110.0]]) * 20.0 / _CROWD.view.position_m[2]
    middle = np.array([[640.0, 400.0]])
    boxes = np.hstack([middle - size / 2.0, middle + size / 2.0])
    for class_id in (1, 2, 3, 4, 5):
        one = scale_from_sizes(_CROWD.view, boxes, np.array([class_id]))
        wrong = scale_from_sizes(_stretched(5.0), boxes, np.array([class_id]))
        assert one is not None
        assert wrong is not None
        assert wrong.ratio == pytest.approx(5.0 * one.ratio, rel=0.02)
        assert one.sigma > _scale(_CROWD.view).sigma


@pytest.mark.parametrize(
    ("ratio", "sigma", "verdict"),
    [
        (1.0, 0.1, "agrees"),
        (1.5, 0.1, "agrees"),
        (1.7, 0.1, "warning"),
        (0.5, 0.1, "warning"),
        (1.7, 0.4, "agrees"),
        (4.5, 0.1, "refusal"),
        (0.2, 0.1, "refusal"),
    ],
)
def test_a_verdict_needs_a_large_factor_and_to_be_sure_of_it(ratio: float, sigma: float, verdict: str) -> None:
    assert SizeScale(ratio, sigma, 3).verdict == verdict


@given(st.floats(-0.2, 0.2))
def test_a_wrong_unit_has_a_name(log_error: float) -> None:
    off = float(np.exp(log_error))
    assert unit_hint(100.0 * off) == "centimetres for metres"
    assert unit_hint(3.28 * off) == "feet for metres"
    assert unit_hint(0.3048 * off) == "metres for feet"
    assert unit_hint(off) is None
