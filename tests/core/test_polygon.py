from __future__ import annotations

import cv2
import numpy as np

from standoff.core.polygon import inside


def test_inside_agrees_with_opencv_on_convex_and_concave_outlines() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        bearing = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9))
        radius = rng.uniform(0.2, 1.0, 9)
        star = np.column_stack([np.cos(bearing), np.sin(bearing)]) * radius[:, None] * 100.0
        points = rng.uniform(-100.0, 100.0, (200, 2))
        outline = star.astype(np.float32)
        expected = [cv2.pointPolygonTest(outline, (float(x), float(y)), False) > 0 for x, y in points]
        np.testing.assert_array_equal(inside(outline.astype(np.float64), points), expected)
        np.testing.assert_array_equal(inside(outline[::-1].astype(np.float64), points), expected)


def test_points_that_are_not_finite_are_outside() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert inside(square, np.array([[0.5, 0.5], [np.nan, 0.5], [0.5, np.inf]])).tolist() == [True, False, False]
