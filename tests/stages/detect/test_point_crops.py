from __future__ import annotations

import numpy as np
import pytest

from standoff.stages.detect.point_crops import POINT_CROP_AROUND, POINT_CROP_PX, point_crop, point_squares_px

SIZE_PX = (320, 200)


def test_a_square_holds_the_box_and_some_of_what_is_around() -> None:
    rng = np.random.default_rng(0)
    corners_px = rng.uniform(-20, 300, (200, 2))
    sides_px = rng.uniform(3, 150, (200, 2))
    squares = point_squares_px(np.hstack([corners_px, corners_px + sides_px]))
    np.testing.assert_allclose(squares[:, 2], POINT_CROP_AROUND * sides_px.max(axis=1), atol=0.51)
    middle_px = squares[:, :2] + squares[:, 2:] / 2.0 - 0.5
    assert np.abs(middle_px - (corners_px + sides_px / 2.0)).max() <= 0.75


@pytest.mark.parametrize("seed", range(5))
def test_what_is_in_the_square_is_where_it_is_said_to_be_in_the_crop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(20):
        image = np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
        middle_px, side_px = rng.uniform((0, 0), SIZE_PX), float(rng.uniform(30, 200))
        (square,) = point_squares_px(np.array([[*(middle_px - side_px / 2), *(middle_px + side_px / 2)]]))
        low_px, high_px = np.maximum(square[:2], 0) + 5.0, np.minimum(square[:2] + square[2], SIZE_PX) - 6.0
        if (low_px >= high_px).any():
            continue
        dot_px = rng.uniform(low_px, high_px).round()
        x, y = dot_px.astype(int)
        image[y - 3 : y + 4, x - 3 : x + 4] = 255
        seen = point_crop(image, square)[:, :, 0].astype(np.float64)
        rows, columns = np.mgrid[:POINT_CROP_PX, :POINT_CROP_PX] + 0.5
        found = np.array([(columns * seen).sum(), (rows * seen).sum()]) / seen.sum() / POINT_CROP_PX
        np.testing.assert_allclose(found * square[2] + square[:2] - 0.5, dot_px, atol=0.5)


def test_beyond_the_picture_its_edge_goes_on() -> None:
    image = np.full((50, 60, 3), 90, np.uint8)
    for square in ([-30, -30, 40], [40, 30, 100], [-10, -10, 300], [200, 200, 20], [-80, 10, 20]):
        assert (point_crop(image, np.array(square)) == 90).all()
