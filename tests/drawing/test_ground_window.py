from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from stages.sinks.fake_site import FakePicture, FakeSite

from standoff.core.camera import Camera
from standoff.drawing.ground_window import camera_up, rectify, seen_ground_m, window_around

LENS = Camera(640, 360, np.array([[450.0, 0, 320], [0, 450, 180], [0, 0, 1]]), np.array([-0.2, 0.05, 0, 0, 0]))
PANEL = (300, 400)


@pytest.mark.parametrize("camera", [None, LENS])
@pytest.mark.parametrize("half_size", [False, True])
def test_a_spot_on_the_ground_appears_where_it_lies(camera: Camera | None, half_size: bool) -> None:
    site = FakeSite((640, 360), camera=camera)
    ground = site.ground()
    window = window_around(np.array([[-12.0, -8.0], [12.0, 16.0]]), PANEL, np.array([0.2, 1.0]))
    for spot in ([0.0, 0.0], [6.0, 9.0], [-7.0, 3.0]):
        centre = ground.to_image(np.array([spot]))[0][0]
        x, y = np.meshgrid(np.arange(640), np.arange(360))
        picture = 255 * np.exp(-((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / (2 * 4.0**2))
        image = np.repeat(picture[:, :, None], 3, axis=2).astype(np.uint8)
        image = FakePicture(image).resized_bgr(320, 180) if half_size else image
        panel = np.zeros((PANEL[1], PANEL[0], 3), dtype=np.uint8)
        rectify(image, ground, window, panel)
        peak = np.array(np.unravel_index(cv2.GaussianBlur(panel[:, :, 0], (9, 9), 2).argmax(), panel.shape[:2]))[::-1]
        expected = window.to_window(np.array([spot]))[0]
        assert np.linalg.norm(peak - expected) * window.m_per_px < 0.35


def test_only_ground_in_front_of_the_camera_is_painted() -> None:
    site = FakeSite((640, 360))
    window = window_around(np.array([[-60.0, -90.0], [60.0, 60.0]]), PANEL, np.array([0.0, 1.0]))
    panel = np.zeros((PANEL[1], PANEL[0], 3), dtype=np.uint8)
    rectify(np.full((360, 640, 3), 255, dtype=np.uint8), site.ground(), window, panel)
    rows, columns = np.nonzero(panel[:, :, 0] == 255)
    centres_m = np.linalg.inv(window.ground_to_window) @ np.array([columns, rows, np.ones(len(rows))])
    seen, in_front = site.ground().to_image(centres_m[:2].T)
    assert len(rows) > 1000
    assert in_front.all()
    assert ((seen > -1) & (seen < [640, 360])).all()


def test_a_window_shows_a_metre_equally_long_everywhere_and_turns_up_upwards() -> None:
    points = np.array([[0.0, 0.0], [10.0, 4.0]])
    up = np.array([3.0, 4.0])
    window = window_around(points, PANEL, up)
    linear = window.ground_to_window[:2, :2]
    np.testing.assert_allclose(linear @ linear.T, np.eye(2) / window.m_per_px**2, atol=1e-9)
    moved = window.to_window(points[:1] + up / 5.0) - window.to_window(points[:1])
    np.testing.assert_allclose(moved, [[0.0, -1.0 / window.m_per_px]], atol=1e-9)
    assert window.covers(points).all()
    assert not window.covers(np.array([[500.0, 0.0], [np.nan, np.nan]])).any()


def test_the_window_shows_what_the_camera_sees() -> None:
    ground = FakeSite((640, 360)).ground()
    points = seen_ground_m(ground)
    pixels, valid = ground.to_image(points)
    assert valid.all()
    assert ((pixels > -1e-6) & (pixels < [640, 360])).all()
    assert len(points) > 100
    near, far = ground.to_image(np.vstack([points.mean(axis=0), points.mean(axis=0) + camera_up(ground)]))[0]
    assert far[1] < near[1]


def test_a_limited_map_shows_nothing_outside_its_limits() -> None:
    ground = replace(FakeSite((640, 360)).ground(), valid_px=np.array([[200, 100], [400, 100], [400, 300], [200, 300]]))
    pixels, _ = ground.to_image(seen_ground_m(ground))
    assert len(pixels) > 20
    assert ((pixels > [199, 99]) & (pixels < [401, 301])).all()
