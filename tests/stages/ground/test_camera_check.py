from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from tolerances import ITERATED_INVERSE_PX

from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import GroundError
from standoff.stages.ground.camera_check import lens_warnings
from standoff.stages.ground.camera_file import load_camera


def camera_file(folder: Path, **stated: float | str) -> Path:
    usual = {"width_px": 1280, "height_px": 720, "fx": 914.0, "fy": 914.0, "cx": 653.3, "cy": 359.9}
    path = folder / "camera.yaml"
    path.write_text(yaml.safe_dump(usual | stated))
    return path


def refusal(path: Path) -> str:
    with pytest.raises(GroundError) as caught:
        load_camera(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("size_px", "camera_px"), [((1280, 720), (1920, 1080)), ((1920, 1080), (1280, 720)), ((720, 1280), (1280, 720))]
)
def test_a_camera_of_another_resolution_is_refused_with_the_likely_size(
    tmp_path: Path, size_px: tuple[int, int], camera_px: tuple[int, int]
) -> None:
    focal_px = 0.714 * max(camera_px)
    path = camera_file(
        tmp_path,
        **dict(zip(("width_px", "height_px"), size_px, strict=True)),
        **dict(zip(("cx", "cy"), ((side - 1) / 2 for side in camera_px), strict=True)),
        fx=focal_px,
        fy=focal_px,
    )
    assert f"the middle of one of {camera_px[0]}x{camera_px[1]}" in refusal(path)


def test_a_picture_that_was_cut_is_read_with_a_warning(tmp_path: Path) -> None:
    # A fifth was cut off on the left.
    camera = load_camera(camera_file(tmp_path, cx=480.0))
    (warning,) = lens_warnings(CameraPrior.calibrated(camera))
    assert "480, 360 of 1280x720" in warning and "camera file" in warning and "cut" in warning
    assert not lens_warnings(CameraPrior.calibrated(load_camera(camera_file(tmp_path, cx=700.0))))
    assert not lens_warnings(CameraPrior.unknown(1280, 720)) and not lens_warnings(None)


@pytest.mark.parametrize(("focal_px", "read"), [(0.29, False), (0.31, True), (19.0, True), (21.0, False)])
def test_focal_lengths_are_those_of_lenses(tmp_path: Path, focal_px: float, read: bool) -> None:
    path = camera_file(tmp_path, fx=1280 * focal_px, fy=1280 * focal_px)
    if read:
        load_camera(path)
    else:
        assert "fx in pixels" in refusal(path)


@pytest.mark.parametrize(
    ("lens", "names"),
    [
        ({"k1": 5.0}, "k1 5 in"),
        ({"k1": -120.0}, "by which the picture folds"),
        ({"k1": -0.5}, "by which the picture folds"),
        ({"k1": -0.266, "k2": -0.039, "k3": -3.0}, "by which the picture folds"),
        ({"k1": 0.1, "k2": 3.0}, "k1 0.1, k2 3 in"),
        ({"k1": -0.27, "k2": 0.08, "p1": 0.4}, "p1 0.4"),
        ({"k1": -1.0, "lens": "fisheye"}, "by which the picture folds"),
    ],
)
def test_distortion_that_no_lens_has_is_refused_by_name(
    tmp_path: Path, lens: dict[str, float | str], names: str
) -> None:
    assert names in refusal(camera_file(tmp_path, **lens))


@pytest.mark.parametrize(
    "lens",
    [
        # Of calibrations that people publish: an action camera's wide lens, a webcam's, a security camera's, a drone's.
        {"fx": 580.0, "fy": 580.0, "k1": -0.27, "k2": 0.1, "k3": -0.017},
        {"k1": -0.42, "k2": 0.22, "k3": -0.05},
        {"k1": -0.38, "k2": 0.17},
        {"k1": 0.13, "k2": -0.3, "k3": 0.2},
        {"k1": -0.013, "k2": 0.03, "p1": 0.0016, "p2": -0.0005, "k3": -0.02},
        {"fx": 600.0, "fy": 600.0, "lens": "fisheye", "k1": 0.05, "k2": -0.01},
    ],
)
def test_lenses_that_people_have_are_read_and_straighten_the_edge_of_the_picture_as_opencv_does(
    tmp_path: Path, lens: dict[str, float | str]
) -> None:
    camera: Camera = load_camera(camera_file(tmp_path, **lens))
    edge_px = np.array([[0.0, 0.0], [1279.0, 719.0], [0.0, 359.5], [639.5, 719.0]])
    straight = camera.undistort(edge_px)
    described = np.isfinite(straight[:, 0])
    assert described[2:].any()
    # Where a polynomial turns back before the corners, that is said.
    assert bool(lens_warnings(CameraPrior.calibrated(camera))) == (not described.all())
    rays = np.column_stack([(straight - camera.matrix[:2, 2]) / np.diag(camera.matrix)[:2], np.ones(4)])[described]
    project = cv2.fisheye.projectPoints if camera.lens == "fisheye" else cv2.projectPoints
    back_px = project(rays.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), camera.matrix, camera.distortion)[0]
    np.testing.assert_allclose(back_px.reshape(-1, 2), edge_px[described], atol=ITERATED_INVERSE_PX)
