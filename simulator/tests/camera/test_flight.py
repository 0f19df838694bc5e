from __future__ import annotations

from itertools import pairwise
from typing import get_args

import cv2
import numpy as np
import pytest
from laws import seeds
from tolerances import GEOMETRY_REL

from standoff.core.homography import apply
from standoff_sim.camera.flight import (
    ShakenFlight,
    Still,
    blur_homography,
    drone_camera,
    look_at,
    make_flight,
)
from standoff_sim.clip.presets import FlightStyle
from standoff_sim.movement.band_noise import BandNoise

STYLES: tuple[FlightStyle, ...] = get_args(FlightStyle)
TARGET_M = np.array([4.0, -3.0])


def _flight(style: FlightStyle, seed: int, duration_s: float = 12.0) -> ShakenFlight:
    rng = np.random.default_rng(seed)
    camera = drone_camera(1920, 1080, 72.0, rng)
    return make_flight(
        rng, style, camera, target_xy_m=TARGET_M, altitude_m=24.0, pitch_deg=52.0, heading_deg=130.0,
        duration_s=duration_s,
    )  # fmt: skip


@pytest.mark.parametrize("style", STYLES)
def test_a_view_is_the_same_whenever_it_is_asked_for(style: FlightStyle) -> None:
    first, second = _flight(style, 3), _flight(style, 3)
    for time_s in (0.0, 3.7, 11.0):
        second.view(time_s + 1.0)
        np.testing.assert_array_equal(first.view(time_s).position_m, second.view(time_s).position_m)
        np.testing.assert_array_equal(first.view(time_s).site_to_camera, second.view(time_s).site_to_camera)
    assert (first.view(1.0).position_m != _flight(style, 4).view(1.0).position_m).any()


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("seed", seeds(3))
def test_a_flight_is_smooth(style: FlightStyle, seed: int) -> None:
    flight, step_s = _flight(style, seed), 1e-3
    times_s = np.arange(0.0, 0.5, step_s) + 5.0
    views = [flight.view(time_s) for time_s in times_s.tolist()]
    position_m = np.array([view.position_m for view in views])
    velocity = np.diff(position_m, axis=0) / step_s
    assert np.linalg.norm(velocity, axis=1).max() < 20.0
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() / step_s < 12.0
    turn = [np.rad2deg(np.linalg.norm(cv2.Rodrigues(b.site_to_camera @ a.site_to_camera.T)[0]))
            for a, b in pairwise(views)]  # fmt: skip
    assert max(turn) / step_s < 30.0
    assert max(turn) > 0.0


@pytest.mark.parametrize("seed", seeds(4))
def test_a_hovering_drone_wanders_by_decimetres_and_keeps_its_target_in_the_picture(seed: int) -> None:
    flight = _flight("hover", seed)
    views = [flight.view(time_s) for time_s in np.arange(0.0, 60.0, 0.25).tolist()]
    away_m = np.linalg.norm([v.position_m - look_at(np.array([*TARGET_M, 0.0]), 24.0, 52.0, 130.0).position_m
                             for v in views], axis=1)  # fmt: skip
    assert 0.05 < away_m.max() < 0.6
    target_px = np.array([view.project(np.array([[*TARGET_M, 0.0]]))[0] for view in views])
    assert np.abs(target_px - [960.0, 540.0]).max() < 60.0


def test_an_orbit_keeps_its_distance_and_looks_at_the_target() -> None:
    flight = _flight("orbit", 1)
    for time_s in (0.0, 5.0, 12.0):
        view = flight.view(time_s)
        assert np.linalg.norm(view.position_m[:2] - TARGET_M) == pytest.approx(24.0 / np.tan(np.deg2rad(52.0)), abs=0.5)
        assert np.abs(view.project(np.array([[*TARGET_M, 0.0]]))[0] - [960.0, 540.0]).max() < 60.0
    moved_m = np.linalg.norm(flight.view(10.0).position_m - flight.view(0.0).position_m)
    assert moved_m > 8.0


def test_a_pass_has_its_target_in_the_middle_half_way() -> None:
    flight = _flight("pass", 2)
    assert np.abs(flight.view(6.0).project(np.array([[*TARGET_M, 0.0]]))[0] - [960.0, 540.0]).max() < 60.0
    speed_mps = np.linalg.norm(flight.view(12.0).position_m - flight.view(0.0).position_m) / 12.0
    assert 1.5 < speed_mps < 5.5


@pytest.mark.parametrize("seed", seeds(4))
def test_an_excursion_loses_its_target_and_comes_back(seed: int) -> None:
    flight = _flight("away", seed)
    x_px = [flight.view(time_s).project(np.array([[*TARGET_M, 0.0]]))[0][0] for time_s in (0.0, 6.0, 12.0)]
    assert not 0 <= x_px[1] <= 1919
    assert all(860 < x < 1060 for x in (x_px[0], x_px[2]))


def test_a_still_camera_looks_at_its_target() -> None:
    camera = drone_camera(1280, 720, 60.0, np.random.default_rng(5))
    still = Still.over(camera, TARGET_M, altitude_m=30.0, pitch_deg=90.0, heading_deg=45.0, roll_deg=2.0)
    expected = camera.distort(camera.matrix[None, :2, 2])
    np.testing.assert_allclose(still.view(7.0).project(np.array([[*TARGET_M, 0.0]])), expected, atol=1e-6)
    assert still.view(0.0) is still.view(9.0)


@pytest.mark.parametrize("style", STYLES)
def test_the_blur_takes_points_of_the_plane_where_they_are_one_exposure_later(style: FlightStyle) -> None:
    flight, plane_z_m = _flight(style, 7), 0.4
    points_m = np.column_stack([TARGET_M + np.random.default_rng(0).uniform(-9, 9, (20, 2)), np.full(20, plane_z_m)])
    moved, valid = apply(blur_homography(flight, 2.0, 0.01, plane_z_m), flight.view(2.0).project_pinhole(points_m))
    np.testing.assert_allclose(moved, flight.view(2.01).project_pinhole(points_m), rtol=GEOMETRY_REL)
    assert valid.all()


@pytest.mark.parametrize("seed", seeds(30))
def test_a_drones_lens_can_be_undone_all_over_the_picture(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = drone_camera(3840, 2140, rng.uniform(60.0, 84.0), rng)
    x, y = np.meshgrid(np.linspace(-0.5, 3839.5, 25), np.linspace(-0.5, 2139.5, 15))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    ideal = camera.undistort(pixels)
    assert np.isfinite(ideal).all()
    np.testing.assert_allclose(camera.distort(ideal), pixels, atol=1e-5)
    assert np.abs(camera.distortion).max() > 0.0


def test_band_noise_has_its_strength_its_band_and_its_bound() -> None:
    noise = BandNoise.draw(np.random.default_rng(1), (0.1, 0.5), 0.08)
    values = np.array([noise.at(time_s) for time_s in np.arange(0.0, 800.0, 0.25).tolist()])
    assert values.std() == pytest.approx(0.08, rel=0.1)
    assert np.abs(values).max() <= noise.bound
    power = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
    frequency_hz = np.fft.rfftfreq(len(values), 0.25)
    assert power[(frequency_hz > 0.09) & (frequency_hz < 0.51)].sum() / power.sum() > 0.999
