"""Camera files: a plain YAML, and those of OpenCV, ROS, Kalibr and OpenDroneMap (`foreign_cameras`).

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
    lens: brown          # or fisheye, the equidistant model of cv2.fisheye, with k1 to k4 alone

An entry `calibration` may say where the numbers come from; it is not read.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from standoff.core.camera import COEFFICIENTS, Camera, Lens
from standoff.core.errors import GroundError, OutputError
from standoff.core.homography import FloatArray
from standoff.files.json_text import parse_json
from standoff.files.plain_text import read_text
from standoff.files.yaml_text import parse_yaml, write_yaml
from standoff.stages.ground.camera_check import check_axis, check_distortion, check_focal
from standoff.stages.ground.foreign_cameras import Stated, foreign_reader, missing_size, opencv_xml, opencv_yaml
from standoff.stages.ground.yaml_file import as_mapping, check_keys, numbers

_WHAT = "a camera file"
_PINHOLE = ("fx", "fy", "cx", "cy")
_DISTORTION: Final[Mapping[Lens, tuple[str, ...]]] = {
    "brown": ("k1", "k2", "p1", "p2", "k3"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}
_PLAIN_KEYS = ("width_px", "height_px", *_PINHOLE, "matrix", "distortion", "lens", "calibration")


def load_camera(path: Path | str) -> Camera:
    """Read a camera file.

    Args:
        path: The plain YAML of this module's head; OpenCV's YAML, XML or JSON, as its calibration sample writes; ROS's
            camera_info YAML; Kalibr's camchain; OpenDroneMap's cameras.json.

    Raises:
        GroundError: It does not describe a camera whose lens is known here, or one that cannot be.
    """
    path = Path(path)
    text = read_text(path, _WHAT, GroundError)
    content = _content(text, path)
    read = foreign_reader(content) or _read_plain
    return _checked_camera(read(content, path), path)


def _content(text: str, path: Path) -> Mapping[str, Any]:
    if text.lstrip().startswith("<"):
        return opencv_xml(text.lstrip(), path)
    if path.suffix.lower() == ".json":
        return as_mapping(parse_json(text, _WHAT, str(path), GroundError), _WHAT, path)
    return as_mapping(parse_yaml(opencv_yaml(text), _WHAT, str(path), GroundError), _WHAT, path)


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
    if camera.lens != "brown":
        content["lens"] = camera.lens
    content |= dict(zip(_DISTORTION[camera.lens], camera.distortion.tolist(), strict=True))
    if calibration:
        content["calibration"] = dict(calibration)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        found = f"{path}: {error.strerror}"
        raise OutputError(expected="a camera file to write", found=found, fix="choose another path") from None
    write_yaml(path, content)


def _read_plain(content: Mapping[str, Any], path: Path) -> Stated:
    lens: Lens = content.get("lens", "brown")
    if lens not in get_args(Lens):
        expected = f"one of the lenses {', '.join(get_args(Lens))}"
        raise GroundError(expected=expected, found=f"{lens!r} in {path}", fix="calibrate with one of these models")
    coefficients = _DISTORTION[lens]
    check_keys(content, (*_PLAIN_KEYS, *coefficients), f"{path}, whose lens is {lens}")
    if "width_px" not in content or "height_px" not in content:
        raise missing_size(path, "width_px and height_px")
    size_px = numbers([content["width_px"], content["height_px"]], (2,), f"width_px and height_px in {path}")
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
        _refuse_both(content, "distortion", coefficients, path)
        distortion = numbers(content["distortion"], (-1,), f"distortion in {path}")
    else:
        values = [content.get(key, 0.0) for key in coefficients]
        distortion = numbers(values, (len(values),), f"{', '.join(coefficients)} in {path}")
    return Stated(size_px, matrix, distortion, lens)


def _refuse_both(content: Mapping[str, Any], whole: str, single: tuple[str, ...], path: Path) -> None:
    twice = [key for key in single if key in content]
    if twice:
        found = f"both in {path}"
        raise GroundError(expected=f"either {whole} or {', '.join(twice)}", found=found, fix="remove one of them")


def _checked_camera(stated: Stated, path: Path) -> Camera:
    (width_px, height_px), matrix = stated.size_px, stated.matrix
    if (stated.size_px < 1).any() or (stated.size_px != np.round(stated.size_px)).any():
        found = f"{width_px:g}x{height_px:g} in {path}"
        raise GroundError(expected="a picture size in whole pixels", found=found, fix="correct the file")
    if matrix[0, 1] != 0 or matrix[1, 0] != 0 or (matrix[2] != [0, 0, 1]).any():
        expected = "a camera matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] without skew"
        raise GroundError(expected=expected, found=f"{matrix.tolist()} in {path}", fix="correct the file")
    check_focal(stated.size_px, matrix, stated.lens, path)
    check_axis(stated.size_px, matrix, path)
    distortion = _all_coefficients(stated, path)
    try:
        camera = Camera(int(width_px), int(height_px), matrix, distortion, stated.lens)
    except ValueError as error:
        raise GroundError(expected="a camera", found=f"{path}: {error}", fix="correct the file") from None
    check_distortion(camera, path)
    return camera


def _all_coefficients(stated: Stated, path: Path) -> FloatArray:
    """Return as many coefficients as the lens has, zeros where the file leaves them out."""
    count, given = COEFFICIENTS[stated.lens], stated.distortion
    if stated.lens == "brown" and len(given) > count and np.any(given[count:]):
        raise GroundError(
            expected="at most five distortion coefficients: k1, k2, p1, p2, k3",
            found=f"{len(given)} in {path} (a rational, thin-prism or tilted model)",
            fix="calibrate again with the five-coefficient model (standoff calibrate)",
        )
    allowed = {"brown": (0, 4, 5, 8, 12, 14), "fisheye": (0, 4)}[stated.lens]
    if len(given) not in allowed:
        wanted = "0, 4 or 5" if stated.lens == "brown" else "0 or 4"
        expected = f"{wanted} distortion coefficients of a {stated.lens} lens"
        raise GroundError(expected=expected, found=f"{len(given)} in {path}", fix="correct the file")
    distortion = np.zeros(count)
    distortion[: min(len(given), count)] = given[:count]
    return distortion
