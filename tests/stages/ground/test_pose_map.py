from __future__ import annotations

import numpy as np
import pytest
from drawn_solid import distance_and_sigma, lens, looking_at
from laws import few
from tolerances import DERIVATIVE_REL, GEOMETRY_REL, GROUND_THROUGH_LENS_M, MAP_SIGMA_REL

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import GroundMap
from standoff.stages.ground.pose_map import map_from_view

VIEW = looking_at(lens(k1=-0.05), (1.0, 2.0), away_m=14.0, heading_deg=70.0, pitch_deg=50.0)
SIGMA = np.array([1e-3] * 3 + [0.01] * 3 + [1e-3, 2e-3])
PAIR_PX = np.array([[110.0, 300.0], [520.0, 90.0]])


def _map(view: View, covariance: FloatArray | None = None, size_sigma: float = 0.0) -> GroundMap:
    return map_from_view(
        view,
        np.zeros((8, 8)) if covariance is None else covariance,
        method="test",
        scale_m_per_px=0.02,
        anchors_px=np.zeros((0, 2)),
        size_sigma=size_sigma,
        middle_m=np.array([1.0, 2.0]),
    )


def test_the_map_of_a_view_is_its_own_projection_back() -> None:
    ground, valid = _map(VIEW).to_ground(PAIR_PX)
    assert valid.all()
    np.testing.assert_allclose(ground, VIEW.to_plane(PAIR_PX), atol=GROUND_THROUGH_LENS_M)


def _distance(view: View) -> float:
    one, other = view.to_plane(PAIR_PX)
    return float(np.linalg.norm(other - one))


@pytest.mark.parametrize("k", few([None, 6, 7]), ids=["all", "focal length", "k1"])
def test_the_sigma_of_a_distance_is_the_scatter_of_disturbed_views(k: int | None) -> None:
    sigma = SIGMA if k is None else np.where(np.arange(8) == k, SIGMA, 0.0)
    rng = np.random.default_rng(0)
    lengths = [_distance(VIEW.changed(rng.normal(size=8) * sigma)) for _ in range(600)]
    length, expected = distance_and_sigma(_map(VIEW, np.diag(sigma**2)), PAIR_PX)
    assert length == pytest.approx(_distance(VIEW), rel=GEOMETRY_REL)
    assert np.std(lengths) == pytest.approx(expected, rel=MAP_SIGMA_REL)


def test_an_error_of_the_tape_measure_is_a_share_of_every_distance() -> None:
    ground = _map(VIEW, size_sigma=0.02)
    for pair in (PAIR_PX, np.array([[300.0, 200.0], [340.0, 200.0]])):
        length, sigma = distance_and_sigma(ground, pair)
        assert sigma == pytest.approx(0.02 * length, rel=1e-6)


def test_the_covariance_is_symmetrical_and_never_negative() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(8, 8)) * SIGMA[:, None]
    covariance = _map(VIEW, root @ root.T, size_sigma=0.01).covariance
    np.testing.assert_array_equal(covariance, covariance.T)
    spread = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(spread, spread)).min() > -1e-6


@pytest.mark.parametrize("k", range(8))
def test_the_entries_move_with_the_view_as_small_differences_do(k: int) -> None:
    step = np.eye(8)[k] * 1e-5
    ends = [np.append(_map(VIEW.changed(sign * step)).image_to_ground, sign * step[7]) for sign in (1.0, -1.0)]
    slope = (ends[0] - ends[1]) / 2e-5
    covariance = _map(VIEW, np.outer(np.eye(8)[k], np.eye(8)[k])).covariance
    np.testing.assert_allclose(covariance, np.outer(slope, slope), atol=DERIVATIVE_REL * (slope**2).max())
