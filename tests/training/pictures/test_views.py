from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tolerances import GEOMETRY_REL, RESIZED_CENTRE_PX, RESIZED_LEVELS, VISIBLE_BOX_PX
from training.drawn_pictures import SIZE_PX, draw_boxes, draw_ellipses, label, thing_share

from standoff.labels import LabelledPicture, load_picture
from standoff.training.pictures.augment_params import AugmentParams
from standoff.training.pictures.views import GREY, cut_boxes, draw_view

_TURNING = AugmentParams(any_rotation_sources=("drawn",), any_angle=0.7)
_VIEW_PX = (416, 256)


@pytest.mark.parametrize("seed", range(12))
def test_boxes_of_ellipses_are_carried_to_where_the_warped_ellipses_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    picture = label(draw_boxes(rng, 1))
    params = replace(_TURNING, zoom=(0.5, 1.5)) if seed % 2 else AugmentParams(tilted=1.0, tilt_deg=20)
    view = draw_view(rng, picture, _VIEW_PX, params)
    warped = np.empty((_VIEW_PX[1], _VIEW_PX[0], 3), np.uint8)
    view.warp(draw_ellipses(picture.xyxy_px), warped)
    rows, columns = np.nonzero(thing_share(warped) > 0.5)
    seen_px = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
    carried_px = np.clip(view.carry(picture.xyxy_px)[0], 0, [*_VIEW_PX, *_VIEW_PX])
    # An ellipse cut by the border does not reach the other sides of its cut box.
    inside = (carried_px > 0) & (carried_px < [*_VIEW_PX, *_VIEW_PX])
    if inside.all():
        np.testing.assert_allclose(seen_px, carried_px, atol=VISIBLE_BOX_PX)
    assert (seen_px[:2] > carried_px[:2] - VISIBLE_BOX_PX).all()
    assert (seen_px[2:] < carried_px[2:] + VISIBLE_BOX_PX).all()


@pytest.mark.parametrize("seed", range(8))
def test_a_soft_spot_is_carried_to_a_fraction_of_a_pixel(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centre_px = rng.uniform((250, 150), (390, 210))
    rows, columns = np.ogrid[: SIZE_PX[1], : SIZE_PX[0]]
    spot = 255.0 * np.exp(-((columns - centre_px[0]) ** 2 + (rows - centre_px[1]) ** 2) / (2 * 15.0**2))
    image = np.repeat(np.round(spot)[..., None], 3, axis=2).astype(np.uint8)
    picture = label(np.array([[*(centre_px - 60), *(centre_px + 60)]]))
    view = draw_view(rng, picture, (900, 900), replace(_TURNING, aim=1.0, zoom=(0.6, 1.4), whole=0.0, least_fill=0.1))
    warped, background = (np.empty((900, 900, 3), np.uint8) for _ in range(2))
    view.warp(image, warped)
    view.warp(np.zeros_like(image), background)
    bright = warped[..., 0].astype(np.float64) - background[..., 0]
    across, down = np.arange(900) + 0.5, np.arange(900) + 0.5
    seen_px = np.array([(bright.sum(axis=0) * across).sum(), (bright.sum(axis=1) * down).sum()]) / bright.sum()
    carried_px = view.carry(picture.xyxy_px)[0]
    np.testing.assert_allclose(seen_px, (carried_px[:2] + carried_px[2:]) / 2, atol=RESIZED_CENTRE_PX)


@given(st.integers(0, 10_000))
def test_mirrors_and_quarter_turns_keep_boxes_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    picture = label(draw_boxes(rng))
    params = replace(_TURNING, any_angle=0.0, tilted=0.0, stretch=1.0)
    view = draw_view(rng, picture, _VIEW_PX, params)
    carried_px = view.carry(picture.xyxy_px)
    sides_px = np.sort(carried_px[:, 2:] - carried_px[:, :2], axis=1)
    expected_px = view.zoom * np.sort(picture.xyxy_px[:, 2:] - picture.xyxy_px[:, :2], axis=1)
    np.testing.assert_allclose(sides_px, expected_px, rtol=GEOMETRY_REL)


@given(st.integers(0, 10_000), st.floats(12.0, 60.0))
def test_a_person_who_is_aimed_at_is_in_the_view_and_of_the_wanted_height(seed: int, height_px: float) -> None:
    params = AugmentParams(
        aim=1.0,
        whole=0.0,
        tilted=0.0,
        stretch=1.0,
        person_classes=(0,),
        person_height_px=(height_px, height_px),
        zoom=(0.01, 100.0),
    )
    params = replace(params, least_fill=0.01)
    picture = label(np.array([[300.0, 200.0, 310.0, 230.0]]))
    view = draw_view(np.random.default_rng(seed), picture, _VIEW_PX, params)
    left, top, right, bottom = view.carry(picture.xyxy_px)[0]
    assert bottom - top == pytest.approx(height_px, rel=GEOMETRY_REL)
    assert 0 < (left + right) / 2 < _VIEW_PX[0]
    assert 0 < (top + bottom) / 2 < _VIEW_PX[1]


@given(st.integers(0, 10_000))
def test_a_view_smaller_than_the_picture_shows_nothing_but_picture(seed: int) -> None:
    rng = np.random.default_rng(seed)
    picture = label(draw_boxes(rng))
    view = draw_view(rng, picture, (120, 90), replace(_TURNING, zoom=(1.0, 2.0), whole=0.0))
    warped = np.empty((90, 120, 3), np.uint8)
    view.warp(np.full((SIZE_PX[1], SIZE_PX[0], 3), 255, np.uint8), warped)
    # The picture's last half pixel fades into what is around it.
    assert (warped[2:-2, 2:-2] == 255).all()


def test_only_pictures_from_above_are_turned_far() -> None:
    rng = np.random.default_rng(0)
    picture = label(draw_boxes(rng))
    upright = [draw_view(rng, picture, _VIEW_PX, AugmentParams()).source_to_view for _ in range(200)]
    assert all(matrix[1, 1] > 0 and abs(matrix[1, 0]) < 0.2 * matrix[1, 1] for matrix in upright)
    from_above = [draw_view(rng, picture, _VIEW_PX, _TURNING).source_to_view for _ in range(200)]
    assert 0.3 < np.mean([matrix[1, 1] < 0 for matrix in from_above]) < 0.7


def test_what_surrounds_a_small_picture_is_the_letterbox_grey() -> None:
    view = draw_view(np.random.default_rng(0), label(np.zeros((0, 4))), (100, 400), AugmentParams(whole=1.0))
    warped = np.empty((400, 100, 3), np.uint8)
    view.warp(np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8), warped)
    assert (warped[[0, -1]] == GREY).any()


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("reduction", [2, 4])
def test_a_picture_that_was_read_smaller_lies_at_the_same_place(tmp_path: Path, suffix: str, reduction: int) -> None:
    rows, columns = np.mgrid[:361, :643]
    smooth = np.stack([columns * 0.3, rows * 0.6, 128 + 60 * np.sin(columns / 40) * np.cos(rows / 40)], axis=2)
    path = tmp_path / f"smooth{suffix}"
    cv2.imwrite(str(path), smooth.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 98])
    picture = label(np.zeros((0, 4)), path, (643, 361))
    view = draw_view(np.random.default_rng(3), picture, (160, 90), AugmentParams(whole=1.0, tilted=1.0, tilt_deg=30))
    warped = [np.empty((90, 160, 3), np.uint8) for _ in range(2)]
    view.warp(load_picture(picture), warped[0])
    view.warp(load_picture(picture, reduction), warped[1])
    # At the border with the grey the two are not smooth.
    picture_only = cv2.erode(np.uint8(1) * (warped[0] != GREY).any(axis=2), np.ones((7, 7), np.uint8)).astype(bool)
    assert picture_only.mean() > 0.3
    difference = np.abs(warped[0][picture_only].astype(float) - warped[1][picture_only])
    assert difference.mean() < RESIZED_LEVELS


def _judge(box_px: tuple[float, float, float, float], *, ignored: bool = False) -> tuple[list[float], bool, bool]:
    cut_px, present, unsure = cut_boxes(np.array([box_px]), np.array([ignored]), (100, 50), AugmentParams())
    return cut_px[0].tolist(), bool(present[0]), bool(unsure[0])


def test_half_a_box_counts_a_fifth_is_ignored_and_a_twentieth_is_gone() -> None:
    assert _judge((-20.0, 10.0, 20.0, 30.0)) == ([0.0, 10.0, 20.0, 30.0], True, False)
    assert _judge((-80.0, 10.0, 20.0, 30.0)) == ([0.0, 10.0, 20.0, 30.0], True, True)
    assert not _judge((-95.0, 10.0, 5.0, 30.0))[1]
    assert not _judge((-30.0, 10.0, -5.0, 30.0))[1]


def test_what_is_too_small_to_be_found_is_ignored_rather_than_ground() -> None:
    assert _judge((10.0, 10.0, 12.0, 18.0))[1:] == (True, True)
    assert _judge((10.0, 10.0, 14.0, 14.0))[1:] == (True, True)
    assert _judge((10.0, 10.0, 14.0, 16.0))[1:] == (True, False)


def test_a_corner_of_an_ignored_region_stays_ignored() -> None:
    assert _judge((-300.0, -300.0, 2.0, 2.0), ignored=True) == ([0.0, 0.0, 2.0, 2.0], True, True)


def test_a_rare_class_in_a_crowd_is_aimed_at_as_often_as_the_crowd() -> None:
    boxes_px = np.array([[20.0, 100.0, 30.0, 120.0]] * 30 + [[600.0, 100.0, 610.0, 120.0]])
    crowd = label(boxes_px)
    picture = LabelledPicture(
        crowd.path, crowd.size_px, boxes_px, np.array([0] * 30 + [1]), np.zeros(31, np.bool_), "", "drawn"
    )
    params = AugmentParams(aim=1.0, whole=0.0, person_classes=(0, 1), person_height_px=(20.0, 20.0), least_fill=0.01)
    shows_rare = []
    for seed in range(200):
        view = draw_view(np.random.default_rng(seed), picture, (100, 100), params)
        shows_rare.append(0 < view.carry(boxes_px[-1:])[0, [0, 2]].mean() < 100)
    assert np.mean(shows_rare) == pytest.approx(0.5, abs=0.11)


def test_people_are_known_by_what_their_class_is_called() -> None:
    assert AugmentParams().for_classes(("excavator", "Person", "worker", "tree")).person_classes == (1, 2)
    assert AugmentParams().for_classes(("tree", "kite")).person_classes == ()
    assert AugmentParams(person_classes=(0,)).for_classes(("car", "person")).person_classes == (0,)


@pytest.mark.parametrize("seed", range(12))
def test_points_go_where_the_middles_of_boxes_go_even_beyond_the_view(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes_px = draw_boxes(rng)
    view = draw_view(rng, label(boxes_px), _VIEW_PX, _TURNING if seed % 2 else AugmentParams())
    carried_px = view.carry(boxes_px)
    middle_px = view.carry_points((boxes_px[:, :2] + boxes_px[:, 2:]) / 2)
    np.testing.assert_allclose(middle_px, (carried_px[:, :2] + carried_px[:, 2:]) / 2, rtol=GEOMETRY_REL, atol=1e-9)
    assert np.isnan(view.carry_points(np.full((2, 2), np.nan))).all()
