from __future__ import annotations

import cv2
import numpy as np
import pytest
import tolerances
from hypothesis import given
from hypothesis import strategies as st

from standoff.stages.detect.letterbox import Letterbox

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
