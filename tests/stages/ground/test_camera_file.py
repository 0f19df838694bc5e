from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

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


def opencv_file(path: Path, matrix: np.ndarray, distortion: np.ndarray, size_px: tuple[int, int] | None) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    if size_px is not None:
        storage.write("image_width", size_px[0])
        storage.write("image_height", size_px[1])
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
        (_PLAIN.replace("535.9", "-535.9"), "focal lengths must be positive"),
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
        ("just words", "a YAML mapping"),
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
        ("%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n", "camera_matrix"),
        ("%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: 3\n", "OpenCV cannot read"),
        ("%YAML:1.0\n---\ncamera_matrix: [\n", "OpenCV cannot read"),
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
