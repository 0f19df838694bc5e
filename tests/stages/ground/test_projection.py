from __future__ import annotations

import numpy as np
import pytest
from drawn_solid import lens, looking_at
from tolerances import GEOMETRY_REL

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.stages.ground.projection import project, project_with_jacobians

LENSES = {
    "none": (0.0, 0.0, 0.0, 0.0, 0.0),
    "barrel": (-0.25, 0.06, 1e-3, -5e-4, 0.0),
    "k1 alone": (-0.3, 0.0, 0.0, 0.0, 0.0),
    "k3 too": (-0.2, 0.05, 2e-4, 1e-4, -0.01),
}


def _view(name: str) -> View:
    plain = lens()
    camera = Camera(plain.width_px, plain.height_px, plain.matrix, np.array(LENSES[name]))
    return looking_at(camera, (1.0, 2.0), away_m=12.0, heading_deg=30.0, pitch_deg=40.0)


def _points() -> FloatArray:
    """Return points in the picture, far outside it, and behind the camera."""
    return np.random.default_rng(0).uniform([-40.0, -40.0, -1.0], [40.0, 40.0, 12.0], (400, 3))


@pytest.mark.parametrize("name", LENSES)
def test_compiled_projection_is_the_view_s_own(name: str) -> None:
    view, points_m = _view(name), _points()
    expected_px = view.project(points_m)
    assert 0 < np.isfinite(expected_px[:, 0]).sum() < len(points_m)
    np.testing.assert_allclose(project(view, points_m), expected_px, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)


@pytest.mark.parametrize("name", LENSES)
def test_compiled_derivatives_are_the_view_s_own(name: str) -> None:
    view, points_m = _view(name), _points()
    for ours, expected in zip(
        project_with_jacobians(view, points_m), view.project_with_jacobians(points_m), strict=True
    ):
        scale = np.nanmax(np.abs(expected))
        np.testing.assert_allclose(ours, expected, rtol=GEOMETRY_REL, atol=GEOMETRY_REL * scale)


def test_no_points_have_no_picture() -> None:
    view = _view("barrel")
    assert project(view, np.zeros((0, 3))).shape == (0, 2)
    assert [len(one) for one in project_with_jacobians(view, np.zeros((0, 3)))] == [0, 0, 0]
