from __future__ import annotations

import cv2
import numpy as np
import pytest
import tolerances
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.types import ImageArray
from standoff.stages.detect.letterbox import Letterbox, Preprocessing

sides = st.integers(1, 4000)
input_sides = st.integers(1, 40).map(lambda count: 32 * count)


@given(st.tuples(sides, sides), st.tuples(input_sides, input_sides))
def test_the_picture_lies_inside_the_input_and_touches_two_of_its_sides(
    source: tuple[int, int], target: tuple[int, int]
) -> None:
    box = Letterbox.fit(source, target)
    assert all(box.offset_px[axis] >= 0 for axis in (0, 1))
    assert all(box.offset_px[axis] + box.inner_size_px[axis] <= target[axis] for axis in (0, 1))
    assert box.inner_size_px[0] == target[0] or box.inner_size_px[1] == target[1]


@given(st.tuples(sides, sides), st.tuples(input_sides, input_sides))
def test_the_edges_of_the_picture_come_back_exactly(source: tuple[int, int], target: tuple[int, int]) -> None:
    box = Letterbox.fit(source, target)
    edges = np.array([*box.offset_px, *np.add(box.offset_px, box.inner_size_px)], dtype=np.float64)
    expected = [[-0.5, -0.5, source[0] - 0.5, source[1] - 0.5]]
    np.testing.assert_allclose(box.to_source(edges), expected, rtol=tolerances.GEOMETRY_REL)


@pytest.mark.parametrize("source", [(1920, 1080), (768, 576), (333, 517), (100, 60)])
@pytest.mark.parametrize("target", [(416, 416), (416, 256), (320, 608)])
def test_a_spot_comes_back_to_where_it_is_in_the_picture(source: tuple[int, int], target: tuple[int, int]) -> None:
    # OpenCV resizes, we carry back: the centre of gravity of a spot stays where it was.
    centre_px = np.array([0.4, 0.6]) * source + 0.3
    box = Letterbox.fit(source, target)
    shrinks = box.inner_size_px[0] < source[0]
    spread_px = 2.0 * max(1.0, source[0] / box.inner_size_px[0])
    x, y = np.arange(source[0]) - centre_px[0], np.arange(source[1])[:, None] - centre_px[1]
    spot = np.rint(255.0 * np.exp(-(x**2 + y**2) / (2.0 * spread_px**2))).astype(np.uint8)
    picture = np.repeat(spot[:, :, None], 3, axis=2)
    resized = cv2.resize(picture, box.inner_size_px, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    seen = box.network_input(np.asarray(resized, np.uint8))[0, 0].astype(np.float64)
    seen[seen == 0.5] = 0.0  # the grey around the picture
    centre_x = seen.sum(axis=0) @ (np.arange(target[0]) + 0.5) / seen.sum()
    centre_y = seen.sum(axis=1) @ (np.arange(target[1]) + 0.5) / seen.sum()
    back = box.to_source(np.array([[centre_x, centre_y, centre_x, centre_y]]))[0, :2]
    np.testing.assert_allclose(back, centre_px, atol=tolerances.RESIZED_CENTRE_PX)


def test_boxes_are_cut_at_the_edges_of_the_picture() -> None:
    box = Letterbox.fit((200, 100), (64, 64))
    cut = box.to_source(np.array([[-np.inf, -5.0, np.inf, 70.0], [10.0, 0.0, 20.0, 10.0]]))
    np.testing.assert_allclose(cut[0], [-0.5, -0.5, 199.5, 99.5])
    assert cut[1, 1] == cut[1, 3] == -0.5, "a box in the grey bar has no height"


def test_colours_are_red_first_between_0_and_1_and_the_rest_is_grey() -> None:
    box = Letterbox.fit((4, 2), (32, 32))
    resized = np.zeros((16, 32, 3), np.uint8)
    resized[..., 2] = 255
    seen = box.network_input(resized)
    assert seen.shape == (1, 3, 32, 32)
    assert seen.dtype == np.float32
    assert (seen[0, 0, 8:24] == 1).all()
    assert (seen[0, 1:, 8:24] == 0).all()
    assert (seen[0, :, :8] == 0.5).all()
    assert (seen[0, :, 24:] == 0.5).all()


def _random_picture(seed: int, size_px: tuple[int, int]) -> ImageArray:
    return np.random.default_rng(seed).integers(0, 256, (size_px[1], size_px[0], 3), dtype=np.uint8)


@pytest.mark.parametrize("source", [(64, 32), (40, 80), (96, 96)])
def test_a_picture_at_the_top_left_is_what_yolox_wants(source: tuple[int, int]) -> None:
    box = Letterbox.fit(source, (96, 96), "top-left")
    picture = _random_picture(0, box.inner_size_px)
    expected = np.full((96, 96, 3), 114, np.float32)
    expected[: picture.shape[0], : picture.shape[1]] = picture
    seen = box.network_input(picture, Preprocessing("bgr", 255.0, placement="top-left", pad=114.0))
    np.testing.assert_array_equal(seen[0], expected.transpose(2, 0, 1))
    inner = box.to_source(np.array([[0.0, 0.0, *box.inner_size_px]], np.float64))
    np.testing.assert_allclose(inner, [[-0.5, -0.5, source[0] - 0.5, source[1] - 0.5]])


def test_a_stretched_picture_fills_the_input_and_its_boxes_come_back() -> None:
    box = Letterbox.fit((300, 90), (64, 96), "stretch")
    assert box.inner_size_px == (64, 96)
    np.testing.assert_allclose(box.to_source(np.array([[32.0, 24.0, 64.0, 48.0]])), [[149.5, 22.0, 299.5, 44.5]])


def test_mean_and_standard_deviation_are_those_of_each_channel() -> None:
    mean, std = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
    picture = _random_picture(1, (64, 32))
    seen = Letterbox.fit((64, 32), (64, 64), "centre").network_input(
        picture, Preprocessing(mean=mean, std=std, pad=0.0)
    )
    expected = (picture[:, :, ::-1] / 255.0 - mean) / std
    np.testing.assert_allclose(seen[0, :, 16:48].transpose(1, 2, 0), expected, atol=1e-6)
    np.testing.assert_allclose(seen[0, :, 0, 0], -np.array(mean) / std, rtol=1e-6)
