from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated
from tolerances import ITERATED_INVERSE_PX

from standoff.core.camera import Camera
from standoff.core.errors import GroundError, OutputError
from standoff.stages.ground.camera_file import load_camera, save_camera

_PLAIN = """
width_px: 640
height_px: 480
fx: 535.9
fy: 536.1
cx: 342.3
cy: 235.6
k1: -0.266
k2: -0.039
p1: 0.0018
p2: -0.0003
k3: 0.238
"""


_OPENCV = """%YAML:1.0
---
calibration_time: "Sat 28 Nov 2026"
image_width: 1280
image_height: 720
fisheye_model: 1
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 620., 0., 640., 0., 620., 360., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ -0.02, 0.01, -0.004, 0.001 ]
"""
_OPENCV_XML = """<?xml version="1.0"?>
<opencv_storage>
<image_width>640</image_width>
<image_height>480</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
  <data>500. 0. 320. 0. 501. 240. 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>d</dt>
  <data>-0.2 0.1 0. 0. 0.</data></distortion_coefficients>
</opencv_storage>
"""
_OPENDRONEMAP = """{"v2 dji fc220 4000 3000 brown 0.72": {"projection_type": "perspective", "width": 4000,
"height": 3000, "focal": 0.75, "k1": 0.01, "k2": -0.02}}"""


def opencv_file(
    path: Path, matrix: np.ndarray, distortion: np.ndarray, size_px: tuple[int, int] | None, fisheye: int | None = 0
) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    if size_px is not None:
        storage.write("image_width", size_px[0])
        storage.write("image_height", size_px[1])
    if fisheye is not None:
        storage.write("fisheye_model", fisheye)
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", distortion)
    storage.release()
    return path


def plain_file(folder: Path, text: str) -> Path:
    path = folder / "camera.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def one_line_error(path: Path) -> str:
    with pytest.raises(GroundError) as caught:
        load_camera(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("expected ")
    return str(caught.value)


def test_the_shared_opencv_file_is_read_as_opencv_reads_it(shared_data: Path) -> None:
    camera = load_camera(shared_data / "checkerboards" / "left_intrinsics.yml")
    assert (camera.width_px, camera.height_px) == (640, 480)
    assert camera.matrix[0, 0] == 535.91573396163199
    assert camera.distortion.tolist() == [
        -0.26637260909660682,
        -0.038588898922304653,
        0.0017831947042852964,
        -0.00028122100441115472,
        0.23839153080878486,
    ]


@pytest.mark.parametrize("suffix", [".yml", ".xml", ".json"])
@pytest.mark.parametrize("count", [4, 5, 8])
def test_every_format_of_opencv_is_read(tmp_path: Path, suffix: str, count: int) -> None:
    matrix = np.array([[500.0, 0.0, 320.0], [0.0, 501.0, 240.0], [0.0, 0.0, 1.0]])
    distortion = np.zeros((count, 1))
    distortion[:4, 0] = [-0.2, 0.1, 0.001, 0.002]
    camera = load_camera(opencv_file(tmp_path / f"camera{suffix}", matrix, distortion, (640, 480)))
    np.testing.assert_array_equal(camera.matrix, matrix)
    assert camera.distortion.tolist() == [-0.2, 0.1, 0.001, 0.002, 0.0]


@pytest.mark.parametrize("suffix", [".yml", ".xml", ".json"])
def test_a_fisheye_of_opencv_is_one_here_and_four_coefficients_of_nobody_knows_what_are_none(
    tmp_path: Path, suffix: str
) -> None:
    matrix = np.array([[620.0, 0.0, 640.0], [0.0, 620.0, 360.0], [0.0, 0.0, 1.0]])
    distortion = np.array([[-0.02], [0.01], [-0.004], [0.001]])
    camera = load_camera(opencv_file(tmp_path / f"fisheye{suffix}", matrix, distortion, (1280, 720), 1))
    point_px = np.array([[[1200.0, 650.0]]])
    by_opencv = cv2.fisheye.undistortPoints(point_px, matrix, distortion, P=matrix)[0]
    np.testing.assert_allclose(camera.undistort(point_px[0]), by_opencv, atol=ITERATED_INVERSE_PX)
    np.testing.assert_allclose(by_opencv, [[1559.0, 836.0]], atol=0.5)
    unnamed = opencv_file(tmp_path / f"unnamed{suffix}", matrix, distortion, (1280, 720), None)
    assert "fisheye_model: 0" in one_line_error(unnamed)


_ROS = """
image_width: 1280
image_height: 720
camera_name: head_camera
camera_matrix: {rows: 3, cols: 3, data: [914.0, 0, 653.3, 0, 914.0, 359.9, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1213, 0.04898, 0.00099, 0.0001, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [914.0, 0, 653.3, 0, 0, 914.0, 359.9, 0, 0, 0, 1, 0]}
"""
_KALIBR = """
cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.12, 0.05, 0.001, 0.0001]
  distortion_model: radtan
  intrinsics: [914.0, 915.0, 653.3, 359.9]
  resolution: [1280, 720]
  rostopic: /cam0/image_raw
"""


def test_cameras_of_ros_are_read_and_models_that_are_not_known_refused_by_name(tmp_path: Path) -> None:
    camera = load_camera(plain_file(tmp_path, _ROS))
    assert (camera.lens, camera.width_px, camera.matrix[0, 2]) == ("brown", 1280, 653.3)
    assert camera.distortion.tolist() == [-0.1213, 0.04898, 0.00099, 0.0001, 0.0]
    four = _ROS.replace("cols: 5", "cols: 4").replace(", 0]}\nrect", "]}\nrect")
    fisheye = load_camera(plain_file(tmp_path, four.replace("plumb_bob", "equidistant")))
    assert (fisheye.lens, fisheye.distortion.tolist()) == ("fisheye", [-0.1213, 0.04898, 0.00099, 0.0001])
    eight = _ROS.replace("plumb_bob", "rational_polynomial").replace("cols: 5", "cols: 8")
    assert not load_camera(plain_file(tmp_path, eight.replace(", 0]}\nrect", ", 0, 0, 0, 0]}\nrect"))).distortion[4]
    rational = eight.replace(", 0]}\nrect", ", 0, 0.1, 0, 0]}\nrect")
    assert "rational" in one_line_error(plain_file(tmp_path, rational))
    assert "'thin_prism'" in one_line_error(plain_file(tmp_path, _ROS.replace("plumb_bob", "thin_prism")))
    assert "'xi'" in one_line_error(plain_file(tmp_path, _ROS + "xi: 1.2\n"))
    assert "contradict" in one_line_error(plain_file(tmp_path, _ROS + "fisheye_model: 1\n"))
    assert "3 x 3" in one_line_error(plain_file(tmp_path, _ROS.replace(", 0, 0, 1]}\ndist", ", 0, 1]}\ndist")))


def test_cameras_of_kalibr_are_read_and_models_that_are_not_known_refused_by_name(tmp_path: Path) -> None:
    camera = load_camera(plain_file(tmp_path, _KALIBR))
    assert camera.matrix.tolist() == [[914.0, 0.0, 653.3], [0.0, 915.0, 359.9], [0.0, 0.0, 1.0]]
    assert (camera.lens, camera.distortion.tolist()) == ("brown", [-0.12, 0.05, 0.001, 0.0001, 0.0])
    assert load_camera(plain_file(tmp_path, _KALIBR.replace("radtan", "equidistant"))).lens == "fisheye"
    none = _KALIBR.replace("radtan", "none").replace("[-0.12, 0.05, 0.001, 0.0001]", "[]")
    assert not load_camera(plain_file(tmp_path, none)).bends
    assert "'fov'" in one_line_error(plain_file(tmp_path, _KALIBR.replace("radtan", "fov")))
    assert "'omni'" in one_line_error(plain_file(tmp_path, _KALIBR.replace("pinhole", "omni")))
    assert "one camera" in one_line_error(plain_file(tmp_path, _KALIBR + _KALIBR.replace("cam0", "cam1")))


def odm_file(folder: Path, **entry: object) -> Path:
    path = folder / "cameras.json"
    path.write_text(json.dumps({"v2 dji fc220 4000 3000 brown 0.72": {"width": 4000, "height": 3000, **entry}}))
    return path


def test_cameras_of_opendronemap_are_read_in_shares_of_the_longer_side_from_the_middle(tmp_path: Path) -> None:
    k: dict[str, object] = {"k1": 0.01, "k2": -0.02, "p1": 0.001, "p2": 0.002, "k3": 0.03}
    place: dict[str, object] = {"focal_x": 0.75, "focal_y": 0.76, "c_x": 0.01, "c_y": -0.02}
    camera = load_camera(odm_file(tmp_path, projection_type="brown", **place, **k, k1_prior=0.0))
    # The middle of 4000 pixels lies between the centres of number 1999 and number 2000.
    np.testing.assert_allclose(camera.matrix, [[3000.0, 0.0, 2039.5], [0.0, 3040.0, 1419.5], [0.0, 0.0, 1.0]])
    assert camera.distortion.tolist() == [0.01, -0.02, 0.001, 0.002, 0.03]
    plain = load_camera(odm_file(tmp_path, projection_type="perspective", focal=0.75, k1=0.01, k2=-0.02))
    assert plain.distortion.tolist() == [0.01, -0.02, 0.0, 0.0, 0.0]
    fisheye = load_camera(odm_file(tmp_path, projection_type="fisheye", focal=0.4, k1=0.01, k2=-0.02))
    assert (fisheye.lens, fisheye.distortion.tolist()) == ("fisheye", [0.01, -0.02, 0.0, 0.0])
    opencv: dict[str, object] = {"k1": 0.01, "k2": -0.02, "k3": 0.03, "k4": 0.04}
    fisheye = load_camera(odm_file(tmp_path, projection_type="fisheye_opencv", **place, **opencv))
    assert fisheye.distortion.tolist() == [0.01, -0.02, 0.03, 0.04]
    assert "'dual'" in one_line_error(odm_file(tmp_path, projection_type="dual", focal=0.4))
    path = odm_file(tmp_path, projection_type="perspective", focal=0.75, k1=0.01, k2=-0.02)
    path.write_text(path.read_text().replace('"k1"', '"focal": 0.9, "k1"'))
    assert "the key `focal` twice" in one_line_error(path)


def test_the_plain_file_takes_a_fisheye_with_its_own_coefficients(tmp_path: Path) -> None:
    text = _PLAIN.split("k1")[0].replace("535.9", "300").replace("536.1", "300") + "lens: fisheye\nk1: -0.02\nk4: 0.1\n"
    camera = load_camera(plain_file(tmp_path, text))
    assert (camera.lens, camera.distortion.tolist()) == ("fisheye", [-0.02, 0.0, 0.0, 0.1])
    save_camera(camera, tmp_path / "again.yaml")
    again = load_camera(tmp_path / "again.yaml")
    assert (again.lens, again.distortion.tolist()) == (camera.lens, camera.distortion.tolist())
    assert "'p1'" in one_line_error(plain_file(tmp_path, text + "p1: 0.1\n"))
    assert "'mei'" in one_line_error(plain_file(tmp_path, text.replace("fisheye", "mei")))


@pytest.mark.parametrize(
    ("focal", "unit"),
    [
        ("4.5", "millimetres"),
        ("24", "millimetres"),
        ("0.0045", "metres"),
        ("0.75", "a share of the picture's width"),
        ("90000", "a far larger picture"),
    ],
)
def test_focal_lengths_in_another_unit_are_refused_by_its_name(tmp_path: Path, focal: str, unit: str) -> None:
    text = _PLAIN.replace("535.9", focal).replace("536.1", focal)
    assert f"found {focal} in" in one_line_error(plain_file(tmp_path, text))
    assert (
        f"likely {'' if unit.startswith('a share') else 'of ' if 'picture' in unit else 'in '}{unit}"
        in one_line_error(plain_file(tmp_path, text))
    )
    assert "fx in pixels" in one_line_error(plain_file(tmp_path, _PLAIN.replace("535.9", focal)))
    assert "fy in pixels" in one_line_error(plain_file(tmp_path, _PLAIN.replace("536.1", focal)))


def test_pixels_are_about_square_and_the_axis_about_in_the_middle(tmp_path: Path) -> None:
    assert "square" in one_line_error(plain_file(tmp_path, _PLAIN.replace("535.9", "1200")))
    assert "in the middle" in one_line_error(plain_file(tmp_path, _PLAIN.replace("342.3", "2.3")))


_FILES = (_PLAIN, _ROS, _KALIBR, _OPENCV, _OPENCV_XML, _OPENDRONEMAP)


@examples(200)
@given(st.sampled_from([".yaml", ".xml", ".json"]), mutated(st.sampled_from([text.encode() for text in _FILES])))
def test_a_damaged_file_is_a_camera_or_one_line(suffix: str, content: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"camera{suffix}"
        path.write_bytes(content)
        try:
            camera = load_camera(path)
        except GroundError as error:
            assert "\n" not in str(error)
        else:
            corner_px = np.array([[0.0, 0.0]])
            assert camera.undistort(corner_px).shape == (1, 2)


def test_the_plain_file_means_the_same_with_numbers_and_with_lists(tmp_path: Path) -> None:
    numbers = load_camera(plain_file(tmp_path, _PLAIN))
    lists = load_camera(
        plain_file(
            tmp_path,
            "{width_px: 640, height_px: 480, matrix: [[535.9, 0, 342.3], [0, 536.1, 235.6], [0, 0, 1]],"
            " distortion: [-0.266, -0.039, 0.0018, -0.0003, 0.238]}",
        )
    )
    np.testing.assert_array_equal(numbers.matrix, lists.matrix)
    np.testing.assert_array_equal(numbers.distortion, lists.distortion)
    assert numbers.distortion.tolist() == [-0.266, -0.039, 0.0018, -0.0003, 0.238]


def test_a_camera_without_distortion_needs_no_coefficients(tmp_path: Path) -> None:
    text = "{width_px: 640, height_px: 480, fx: 500, fy: 500, cx: 320, cy: 240}"
    assert not load_camera(plain_file(tmp_path, text)).distortion.any()


def test_a_saved_camera_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    camera = Camera(
        1920, 1080, np.array([[1.0 / 3 * 4000, 0, 960.1], [0, 1333.0, 540], [0, 0, 1]]), np.full(5, 0.1 / 3)
    )
    path = tmp_path / "new folder" / "camera.yaml"
    save_camera(camera, path, calibration={"rms_px": 0.2, "views": 13})
    back = load_camera(path)
    np.testing.assert_array_equal(back.matrix, camera.matrix)
    np.testing.assert_array_equal(back.distortion, camera.distortion)
    assert (back.width_px, back.height_px) == (1920, 1080)
    assert [entry.name for entry in path.parent.iterdir()] == ["camera.yaml"]


def test_a_camera_that_cannot_be_saved_says_so_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    camera = load_camera(plain_file(tmp_path, _PLAIN))
    with pytest.raises(OutputError, match="Choose another path"):
        save_camera(camera, tmp_path / "file" / "camera.yaml")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError):
        save_camera(camera, tmp_path / "folder")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["camera.yaml", "file", "folder"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (_PLAIN.replace("535.9", ".nan"), "finite numbers for fx, fy, cx, cy"),
        (_PLAIN.replace("-0.266", ".inf"), "finite numbers for k1"),
        (_PLAIN.replace("535.9", "wide"), "numbers for fx, fy, cx, cy"),
        (_PLAIN.replace("535.9", "-535.9"), "focal lengths above 0"),
        (_PLAIN.replace("fx: 535.9", ""), "without fx"),
        (_PLAIN.replace("width_px: 640", ""), "Add width_px and height_px"),
        (_PLAIN.replace("640", "640.5"), "whole pixels"),
        (_PLAIN.replace("640", "0"), "whole pixels"),
        (_PLAIN.replace("640", "320"), "Give the size of the pictures that the camera was calibrated on"),
        (_PLAIN + "k4: 0.1\n", "only the keys"),
        (_PLAIN + "distortion: [0, 0, 0, 0, 0]\n", "either distortion or k1"),
        (_PLAIN + "matrix: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n", "either matrix or fx"),
        ("{width_px: 640, height_px: 480, matrix: [[500, 0], [0, 500]]}", "3x3 numbers for matrix"),
        ("{width_px: 640, height_px: 480, matrix: [[500, 3, 320], [0, 500, 240], [0, 0, 1]]}", "without skew"),
        (_PLAIN.split("k1")[0] + "distortion: [0, 0, 0, 0, 0, 0.1, 0, 0]\n", "at most five distortion coefficients"),
        (_PLAIN.split("k1")[0] + "distortion: [0, 0, 0]\n", "0, 4 or 5 distortion coefficients"),
        ("fx: [1, 2", "not YAML"),
        ("just words", "a mapping"),
        ("", "nothing"),
    ],
)
def test_a_plain_file_that_is_wrong_gets_one_line_that_says_how(tmp_path: Path, text: str, message: str) -> None:
    assert message in one_line_error(plain_file(tmp_path, text))


def test_an_opencv_file_without_a_size_says_what_to_add(tmp_path: Path) -> None:
    path = opencv_file(tmp_path / "camera.yml", np.diag([500.0, 500.0, 1.0]), np.zeros(5), None)
    assert "Add image_width and image_height" in one_line_error(path)


def test_an_opencv_file_with_nan_says_so(tmp_path: Path) -> None:
    matrix = np.array([[np.nan, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    assert "finite numbers" in one_line_error(opencv_file(tmp_path / "a.yml", matrix, np.zeros(5), (640, 480)))
    matrix[0, 0], distortion = 500.0, np.array([np.nan, 0.0, 0.0, 0.0, 0.0])
    assert "finite" in one_line_error(opencv_file(tmp_path / "b.yml", matrix, distortion, (640, 480)))


def test_an_opencv_file_of_a_richer_lens_model_is_refused(tmp_path: Path) -> None:
    matrix = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    path = opencv_file(tmp_path / "camera.yml", matrix, np.full(8, 0.01), (640, 480))
    assert "at most five distortion coefficients" in one_line_error(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (_OPENCV.split("distortion_coefficients")[0], "distortion_coefficients"),
        (_OPENCV.replace("camera_matrix: !!opencv-matrix", "camera_matrix: 3\nwas:"), "'was'"),
        (_OPENCV.replace("rows: 3", "rows: 2"), "2 x 3 numbers"),
        (_OPENCV.replace("rows: 4", "rows: four"), "2 numbers for rows and cols"),
        (_OPENCV.replace("image_width: 1280", "image_height: 720"), "after line 4"),
        ("%YAML:1.0\n---\ncamera_matrix: [\n", "not YAML"),
        (_OPENCV_XML.replace("opencv_storage", "storage"), "<storage>"),
        (_OPENCV_XML.replace("image_height", "image_width"), "<image_width> twice"),
        (_OPENCV_XML.replace("<opencv", "<!DOCTYPE a><opencv", 1), "a document type"),
    ],
)
def test_a_broken_opencv_file_gets_one_line(tmp_path: Path, text: str, message: str) -> None:
    assert message in one_line_error(plain_file(tmp_path, text))


def test_what_is_no_camera_file_gets_one_line(tmp_path: Path) -> None:
    assert "no such file" in one_line_error(tmp_path / "missing.yaml")
    assert "expected a camera file" in one_line_error(tmp_path)
    binary = tmp_path / "camera.yaml"
    binary.write_bytes(b"\xff\xd8\xff\xe0")
    assert "a binary file" in one_line_error(binary)
