from __future__ import annotations

import numpy as np
import pytest
from drawn_solid import lens, looking_at
from tolerances import GEOMETRY_REL

from standoff.core.camera import COEFFICIENTS, Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.stages.ground.projection import eye_of, on_ground, project, project_with_jacobians, turned_by

LENSES = {
    "none": (0.0, 0.0, 0.0, 0.0, 0.0),
    "barrel": (-0.25, 0.06, 1e-3, -5e-4, 0.0),
    "k1 alone": (-0.3, 0.0, 0.0, 0.0, 0.0),
    "k3 too": (-0.2, 0.05, 2e-4, 1e-4, -0.01),
    "fisheye": (-0.02, 0.01, -0.004, 0.001),
    "fisheye that folds": (-0.3, 0.01, 0.0, 0.0),
}


def _view(name: str) -> View:
    plain = lens()
    model = next(model for model, count in COEFFICIENTS.items() if count == len(LENSES[name]))
    camera = Camera(plain.width_px, plain.height_px, plain.matrix, np.array(LENSES[name]), model)
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


@pytest.mark.parametrize("name", LENSES)
def test_compiled_rays_meet_the_ground_where_the_view_s_do(name: str) -> None:
    view = _view(name)
    size_px = np.array([view.camera.width_px, view.camera.height_px])
    points_px = np.random.default_rng(1).uniform(-3.0, 4.0, (400, 2)) * size_px
    expected_m = view.to_plane(points_px)
    assert 0 < np.isfinite(expected_m[:, 0]).sum() < len(points_px)
    np.testing.assert_allclose(on_ground(points_px, *eye_of(view)), expected_m, rtol=1e-6)


@pytest.mark.parametrize("angle_rad", [0.0, 1e-9, 0.02, 2.5])
def test_a_compiled_turn_is_the_view_s_own(angle_rad: float) -> None:
    view, axis = _view("none"), np.array([0.6, -0.48, 0.64])
    expected = view.changed(np.append(angle_rad * axis, np.zeros(5))).site_to_camera
    np.testing.assert_allclose(turned_by(angle_rad * axis, view.site_to_camera), expected, atol=GEOMETRY_REL)
