"""Camera files: OpenCV's own (YAML, XML or JSON, as its calibration sample writes) and a plain YAML.

The plain file holds the size of the pictures and either single numbers or lists:

    width_px: 640
    height_px: 480
    fx: 535.9            # or: matrix: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
    fy: 535.9
    cx: 342.3            # the centre of the top-left pixel is (0, 0), as in OpenCV
    cy: 235.6
    k1: -0.266           # or: distortion: [k1, k2, p1, p2, k3]; left out: 0
    k2: -0.039
    p1: 0.0018
    p2: -0.0003
    k3: 0.238

An entry `calibration` may say where the numbers come from; it is not read.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from standoff.core.camera import Camera
from standoff.core.errors import GroundError, OutputError
from standoff.core.homography import FloatArray
from standoff.stages.ground.yaml_file import check_keys, numbers, parse_mapping, read_text

_WHAT = "a camera file"
_PINHOLE = ("fx", "fy", "cx", "cy")
_DISTORTION = ("k1", "k2", "p1", "p2", "k3")
_PLAIN_KEYS = ("width_px", "height_px", *_PINHOLE, *_DISTORTION, "matrix", "distortion", "calibration")
_OPENCV_WIDTH = ("image_width", "image_Width")
_OPENCV_HEIGHT = ("image_height", "image_Height")
_OPENCV_MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix")
_OPENCV_DISTORTION = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs")


def load_camera(path: Path | str) -> Camera:
    """Read a camera file.

    Args:
        path: OpenCV's YAML, XML or JSON, or the plain YAML of this module's head.

    Raises:
        GroundError: It does not describe a pinhole camera with at most five distortion coefficients.
    """
    path = Path(path)
    text = read_text(path, _WHAT)
    if path.suffix.lower() in (".xml", ".json") or text.lstrip().startswith(("%YAML", "<?xml")):
        size, matrix, distortion = _read_opencv(text, path)
    else:
        size, matrix, distortion = _read_plain(parse_mapping(text, path, _WHAT), path)
    return _checked_camera(size, matrix, distortion, path)


def save_camera(camera: Camera, path: Path | str, *, calibration: Mapping[str, Any] | None = None) -> None:
    """Write the plain camera file, whole or not at all.

    Args:
        camera: What to write.
        path: An existing file is replaced.
        calibration: Where the numbers come from, for the reader; numbers and texts only.

    Raises:
        OutputError: The file cannot be written.
    """
    path = Path(path)
    content: dict[str, Any] = {"width_px": camera.width_px, "height_px": camera.height_px}
    content |= dict(zip(_PINHOLE, camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), strict=True))
    content |= dict(zip(_DISTORTION, camera.distortion.tolist(), strict=True))
    if calibration:
        content["calibration"] = dict(calibration)
    text = yaml.safe_dump(content, sort_keys=False)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, encoding="utf-8", delete=False) as partial:
            partial.write(text)
        try:
            Path(partial.name).chmod(0o644)
            os.replace(partial.name, path)  # noqa: PTH105
        except OSError:
            Path(partial.name).unlink()
            raise
    except OSError as error:
        found = f"{path}: {error.strerror}"
        raise OutputError(expected="a camera file to write", found=found, fix="choose another path") from None


def _read_plain(content: Mapping[str, Any], path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    check_keys(content, _PLAIN_KEYS, str(path))
    if "width_px" not in content or "height_px" not in content:
        raise _missing_size(path, "width_px and height_px")
    size = numbers([content["width_px"], content["height_px"]], (2,), f"width_px and height_px in {path}")
    if "matrix" in content:
        _refuse_both(content, "matrix", _PINHOLE, path)
        matrix = numbers(content["matrix"], (3, 3), f"matrix in {path}")
    else:
        missing = [key for key in _PINHOLE if key not in content]
        if missing:
            found = f"{path} without {', '.join(missing)}"
            raise GroundError(expected="fx, fy, cx and cy, or matrix", found=found, fix="add them, in pixels")
        fx, fy, cx, cy = numbers([content[key] for key in _PINHOLE], (4,), f"fx, fy, cx, cy in {path}")
        matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    if "distortion" in content:
        _refuse_both(content, "distortion", _DISTORTION, path)
        distortion = numbers(content["distortion"], (-1,), f"distortion in {path}")
    else:
        values = [content.get(key, 0.0) for key in _DISTORTION]
        distortion = numbers(values, (5,), f"k1, k2, p1, p2, k3 in {path}")
    return size, matrix, distortion


def _refuse_both(content: Mapping[str, Any], whole: str, single: tuple[str, ...], path: Path) -> None:
    twice = [key for key in single if key in content]
    if twice:
        found = f"both in {path}"
        raise GroundError(expected=f"either {whole} or {', '.join(twice)}", found=found, fix="remove one of them")


def _read_opencv(text: str, path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, SystemError):
        raise _not_opencv(path) from None
    with contextlib.closing(_Storage(storage, path)) as file:
        width, height = file.number(_OPENCV_WIDTH), file.number(_OPENCV_HEIGHT)
        if width is None or height is None:
            raise _missing_size(path, "image_width and image_height")
        matrix, distortion = file.matrix(_OPENCV_MATRIX), file.matrix(_OPENCV_DISTORTION)
    size = numbers([width, height], (2,), f"image_width and image_height in {path}")
    return size, numbers(matrix, (3, 3), f"the camera matrix in {path}"), distortion.ravel()


class _Storage:
    """An open OpenCV file: looks a key up under the spellings that OpenCV's own samples have used."""

    def __init__(self, storage: Any, path: Path) -> None:  # noqa: ANN401 - cv2 has no types
        self._storage, self._path = storage, path

    def number(self, keys: tuple[str, ...]) -> float | None:
        nodes = [self._storage.getNode(key) for key in keys]
        return next((float(node.real()) for node in nodes if node.isInt() or node.isReal()), None)

    def matrix(self, keys: tuple[str, ...]) -> FloatArray:
        node = next((n for n in (self._storage.getNode(key) for key in keys) if not n.empty()), None)
        if node is None:
            found = f"{self._path} without it"
            raise GroundError(expected=f"an entry {keys[0]}", found=found, fix="add it, or use the plain camera file")
        try:
            value = node.mat()
        except cv2.error:
            value = None
        if value is None:
            raise _not_opencv(self._path)
        array: FloatArray = np.asarray(value, dtype=np.float64)
        return array

    def close(self) -> None:
        self._storage.release()


def _not_opencv(path: Path) -> GroundError:
    return GroundError(
        expected="an OpenCV camera file (FileStorage)",
        found=f"{path}, which OpenCV cannot read",
        fix="write it with cv2.FileStorage, or use the plain camera file",
    )


def _missing_size(path: Path, keys: str) -> GroundError:
    return GroundError(
        expected=f"{keys} in the camera file, the size of the pictures that it was calibrated on",
        found=f"{path} without them",
        fix=f"add {keys}",
    )


def _checked_camera(size: FloatArray, matrix: FloatArray, distortion: FloatArray, path: Path) -> Camera:
    width_px, height_px = size
    if (size < 1).any() or (size != np.round(size)).any():
        found = f"{width_px:g}x{height_px:g} in {path}"
        raise GroundError(expected="a picture size in whole pixels", found=found, fix="correct the file")
    if len(distortion) > 5 and np.any(distortion[5:]):
        raise GroundError(
            expected="at most five distortion coefficients: k1, k2, p1, p2, k3",
            found=f"{len(distortion)} in {path} (a rational, thin-prism or tilted model)",
            fix="calibrate again with the five-coefficient model (standoff calibrate)",
        )
    if len(distortion) not in (0, 4, 5, 8, 12, 14):
        found = f"{len(distortion)} in {path}"
        raise GroundError(expected="0, 4 or 5 distortion coefficients", found=found, fix="correct the file")
    five = np.zeros(5)
    five[: len(distortion)] = distortion[:5]
    if matrix[0, 1] != 0 or matrix[1, 0] != 0 or (matrix[2] != [0, 0, 1]).any():
        expected = "a camera matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] without skew"
        raise GroundError(expected=expected, found=f"{matrix.tolist()} in {path}", fix="correct the file")
    if not ((matrix[:2, 2] > 0) & (matrix[:2, 2] < size)).all():
        raise GroundError(
            expected=f"cx, cy inside the {width_px:g}x{height_px:g} picture",
            found=f"{matrix[0, 2]:g}, {matrix[1, 2]:g} in {path}",
            fix="give the size of the pictures that the camera was calibrated on",
        )
    try:
        return Camera(int(width_px), int(height_px), matrix, five)
    except ValueError as error:
        raise GroundError(expected="a pinhole camera", found=f"{path}: {error}", fix="correct the file") from None
