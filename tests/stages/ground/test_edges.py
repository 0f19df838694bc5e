from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree
from skimage.feature import canny as skimage_canny
from tolerances import EDGE_PX

from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray
from standoff.evaluation.drawn_quadrilaterals import draw_quadrilateral
from standoff.stages.ground.edges import between_pixels, canny, sobel_gradients

WHOLE = np.array([0.0, 0.0, 319.0, 319.0])


def shared(
    first: FloatArray,
    second: FloatArray,
    within_px: float,
) -> float:
    """Return the smaller share of points of one set that have a neighbour in the other."""
    one, two = cKDTree(first), cKDTree(second)
    return min(
        float(np.mean(two.query(first)[0] <= within_px)),
        float(np.mean(one.query(second)[0] <= within_px)),
    )


def points_of(
    mask: BoolArray,
) -> FloatArray:
    rows, columns = np.nonzero(mask)
    return np.column_stack([columns, rows]).astype(np.float64)


@pytest.mark.parametrize("seed", range(6))
def test_edges_agree_with_opencvs_canny_on_the_smoothed_picture(seed: int) -> None:
    gray = draw_quadrilateral("sand", seed).gray
    gradients = sobel_gradients(gray, WHOLE)
    assert gradients is not None
    edges = canny(gradients, 0.6, 0.24)
    largest = float(np.hypot(gradients.dx, gradients.dy)[1:-1, 1:-1].max())
    smooth = cv2.GaussianBlur(gray, (7, 7), 1.0)
    theirs = cv2.Canny(smooth, 0.24 * largest, 0.6 * largest, L2gradient=True) > 0
    # OpenCV rounds the smoothed picture to whole grey levels, which moves some maxima to the next pixel.
    assert shared(edges.points_px, points_of(theirs), 0.0) > 0.85
    assert shared(edges.points_px, points_of(theirs), 1.5) > 0.99


@pytest.mark.parametrize("seed", range(6))
def test_edges_agree_with_scikit_images_canny(seed: int) -> None:
    gray = draw_quadrilateral("clean", seed).gray
    gradients = sobel_gradients(gray, WHOLE)
    assert gradients is not None
    edges = canny(gradients, 0.6, 0.24)
    largest = float(np.hypot(gradients.dx, gradients.dy).max())
    # scikit-image's Sobel is OpenCV's over four.
    low, high = 0.24 * largest / 4.0, 0.6 * largest / 4.0
    theirs = skimage_canny(gray.astype(float), sigma=1.0, low_threshold=low, high_threshold=high)
    assert shared(edges.points_px, points_of(theirs), 1.0) > 0.95


def test_edges_lie_inside_the_box_only_and_its_border_makes_none() -> None:
    scene = draw_quadrilateral("clean", 3)
    centre = scene.corners_px.mean(axis=0)
    inner = np.concatenate([centre - 20.0, centre + 20.0])
    box = np.concatenate([scene.corners_px[0] - 30.0, scene.corners_px[0] + 30.0])
    gradients, flat = sobel_gradients(scene.gray, box), sobel_gradients(np.full((320, 320), 80, np.uint8), inner)
    assert gradients is not None
    assert flat is not None
    points = canny(gradients, 0.6, 0.24).points_px
    assert len(points) > 20
    assert ((points >= box[:2]) & (points <= box[2:])).all()
    assert len(canny(flat, 0.6, 0.24)) == 0


def test_edges_of_a_box_are_those_of_the_whole_picture_in_it() -> None:
    gray = draw_quadrilateral("clean", 4).gray
    box = np.array([60.2, 50.7, 250.9, 240.1])
    part, whole = sobel_gradients(gray, box), sobel_gradients(gray, WHOLE)
    assert part is not None
    assert whole is not None
    cut = whole.dx[part.top_px - whole.top_px :, part.left_px - whole.left_px :][: part.dx.shape[0], : part.dx.shape[1]]
    np.testing.assert_array_equal(part.dx, cut)


@pytest.mark.parametrize(
    "box", [[-90.0, 0.0, -10.0, 50.0], [10.0, 400.0, 90.0, 500.0], [50.0, 50.0, 51.5, 90.0], [318.5, 0.0, 400.0, 319.0]]
)
def test_a_box_without_pixels_has_no_gradients(box: list[float]) -> None:
    assert sobel_gradients(np.zeros((320, 320), np.uint8), np.array(box)) is None


@pytest.mark.parametrize("angle_deg", [0.0, 12.0, 33.0, 45.0, 77.0, 90.0])
def test_points_between_pixels_lie_on_the_true_edge(angle_deg: float) -> None:
    normal = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    gray, offset = half_plane(normal, -60.25 * normal.sum())
    gradients = sobel_gradients(gray, np.array([20.0, 20.0, 100.0, 100.0]))
    assert gradients is not None
    coarse = canny(gradients, 0.6, 0.24)
    fine = between_pixels(coarse, gradients)
    before, after = (edges.points_px @ normal + offset for edges in (coarse, fine))
    # Single points keep the error of linear interpolation; along an edge it cancels.
    assert abs(after.mean()) < EDGE_PX
    assert np.sqrt((after**2).mean()) < 0.5 * max(np.sqrt((before**2).mean()), 0.25)
    assert (fine.direction @ normal > 0.99).all()


def half_plane(normal: FloatArray, offset: float) -> tuple[ImageArray, float]:
    steps = (np.arange(8) + 0.5) / 8 - 0.5
    fine = (np.arange(120)[:, None] + steps).ravel()
    bright = fine[None, :] * normal[0] + fine[:, None] * normal[1] + offset > 0
    share = bright.reshape(120, 8, 120, 8).mean(axis=(1, 3))
    return np.rint(80 + 100 * share).astype(np.uint8), offset
