from __future__ import annotations

import numpy as np
from stages.locate.oblique_world import MATRIX, SIZE_PX, ground_map, seen_px
from tolerances import GEOMETRY_REL, NUMERICAL_DERIVATIVE_REL

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.map_error import factor, undistortion_jacobian
from standoff.stages.locate.uncertainty import own_covariance

LENS = np.array([-0.12, 0.03, 0.001, -0.0008, 0.0])
GROUND_M = np.array([[0.0, 35.0], [-8.0, 28.0], [12.0, 45.0]])


def central_differences(of: object, points: FloatArray, step: float = 1e-3) -> FloatArray:
    """Return (N, 2, 2) d of(point) / d point."""
    assert callable(of)
    columns = [(of(points + move) - of(points - move)) / (2.0 * step) for move in np.diag([step, step])]
    return np.stack(columns, axis=-1)


def test_a_factor_reproduces_a_covariance_of_lower_rank_and_mixed_sizes() -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        sizes = 10.0 ** rng.uniform(-7, 2, 9)
        spread = sizes[:, None] * rng.normal(size=(9, 8))
        covariance = spread @ spread.T
        root = factor(covariance)
        scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        np.testing.assert_allclose(root @ root.T / scale, covariance / scale, atol=GEOMETRY_REL)
    assert (factor(np.zeros((9, 9))) == 0).all()


def test_the_lens_jacobian_agrees_with_differences_of_the_undistortion() -> None:
    camera = Camera(*SIZE_PX, MATRIX, LENS)
    seen = seen_px(GROUND_M, LENS)
    found = undistortion_jacobian(camera, camera.undistort(seen))
    np.testing.assert_allclose(
        found, central_differences(camera.undistort, seen), rtol=0, atol=NUMERICAL_DERIVATIVE_REL
    )
    assert np.isnan(undistortion_jacobian(camera, np.full((1, 2), np.nan))).all()


def test_the_boxes_share_agrees_with_differences_of_the_whole_way_to_the_ground() -> None:
    ground = ground_map(distortion=LENS)
    seen = seen_px(GROUND_M, LENS)
    variance_px2 = np.array([[4.0, 9.0], [1.0, 1.0], [25.0, 2.0]])
    jacobian = central_differences(lambda points: ground.to_ground(points)[0], seen)
    expected = np.einsum("nij,nj,nkj->nik", jacobian, variance_px2, jacobian)
    found = own_covariance(ground, ground.undistorted(seen), variance_px2[:, :, None] * np.eye(2))
    np.testing.assert_allclose(found, expected, rtol=NUMERICAL_DERIVATIVE_REL, atol=NUMERICAL_DERIVATIVE_REL)
