"""Camera files of other programs: OpenCV's (YAML, XML, JSON), ROS's, Kalibr's and OpenDroneMap's.

What a file says of its lens in words that are not known here is refused by name: another model's numbers would pass
for a pinhole's, and move everything. All count pixels as we do, from the centre of the top-left one; OpenDroneMap
counts from the middle of the picture in shares of its longer side, focal lengths as well (OpenSfM, "Normalized image
coordinates").
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from standoff.core.camera import Lens
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.stages.ground.yaml_file import as_mapping, check_keys, numbers


class Stated(NamedTuple):
    """A camera as a file states it, not looked at yet.

    Attributes:
        size_px: (2,) width and height.
        matrix: (3, 3), pixels.
        distortion: (N,) in OpenCV's order.
        lens: Whose coefficients they are.
    """

    size_px: FloatArray
    matrix: FloatArray
    distortion: FloatArray
    lens: Lens


def foreign_reader(content: Mapping[str, Any]) -> Callable[[Mapping[str, Any], Path], Stated] | None:
    """Return what reads a file with this content; None: it is no other program's that is known."""
    if any(isinstance(one, Mapping) and "projection_type" in one for one in content.values()):
        return _read_opendronemap
    if any(re.fullmatch(r"cam\d+", key) for key in content):
        return _read_kalibr
    return _read_opencv if _KEYS_OF_MATRIX & {_folded(key) for key in content} else None


def opencv_yaml(text: str) -> str:
    """Return what OpenCV writes as YAML as other readers take it: without its header and its names of types."""
    text = re.sub(r"\A\s*%YAML[: ]1\.0[^\n]*", "", text)
    return re.sub(r"!!opencv-(nd-)?matrix", "", text)


def opencv_xml(text: str, path: Path) -> dict[str, Any]:
    """Return what OpenCV's XML says, by name.

    Raises:
        GroundError: It is other XML.
    """
    # Entities can make gigabytes of a line; OpenCV writes none.
    if "<!" in text.replace("<!--", ""):
        raise _not_opencv(path, "a document type")
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        raise _not_opencv(path, str(error)) from None
    if root.tag != "opencv_storage":
        raise _not_opencv(path, f"<{root.tag}>")
    return _children(root, path)


def _children(node: ET.Element, path: Path) -> dict[str, Any]:
    names = [child.tag for child in node]
    twice = sorted({name for name in names if names.count(name) > 1 and name != "_"})
    if twice:
        found = f"<{twice[0]}> twice in {path}"
        raise GroundError(expected="each entry of a camera file once", found=found, fix="keep one of them")
    return {child.tag: _children(child, path) if len(child) else _words(child.text or "") for child in node}


def _words(text: str) -> Any:  # noqa: ANN401
    """Return the number, the numbers, or the text that an element holds."""
    try:
        values = [float(word) for word in text.lower().replace(".nan", "nan").replace(".inf", "inf").split()]
    except ValueError:
        return text.strip().strip('"')
    return values[0] if len(values) == 1 else values


_OPENCV_SIZE: Final = (("imagewidth", "image_width"), ("imageheight", "image_height"))
_KEYS_OF_MATRIX: Final = {"cameramatrix"}
_KEYS_OF_DISTORTION: Final = ("distortioncoefficients", "distcoeffs", "distortioncoeffs")
_KEYS_OF_LENS: Final = ("fisheyemodel", "distortionmodel", "cameramodel")
_TOLD_BESIDE: Final = frozenset(
    (
        *("calibrationtime", "nframes", "nrofframes", "boardwidth", "boardheight", "squaresize", "markersize"),
        *("aspectratio", "fixaspectratio", "flags", "avgreprojectionerror", "perviewreprojectionerrors"),
        *("extrinsicparameters", "imagepoints", "gridpoints", "cameraname", "rectificationmatrix", "projectionmatrix"),
    )
)
"""What OpenCV's calibration sample and ROS write beside the lens; of the picture as it comes, none of it counts."""

_ROS_LENSES: Final[Mapping[str, Lens]] = {
    "plumb_bob": "brown",
    "radtan": "brown",
    "radial-tangential": "brown",
    "rational_polynomial": "brown",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
}
"""Of a rational polynomial only what has no more than five coefficients that are not zero: see `camera_file`."""


def _folded(key: str) -> str:
    """Return a key without what OpenCV's samples spell in several ways: image_width, image_Width, imageWidth."""
    return key.lower().replace("_", "")


def _read_opencv(content: Mapping[str, Any], path: Path) -> Stated:
    folded = {_folded(key): value for key, value in content.items()}
    known = {key for key, _ in _OPENCV_SIZE} | _KEYS_OF_MATRIX | {*_KEYS_OF_DISTORTION, *_KEYS_OF_LENS} | _TOLD_BESIDE
    strangers = sorted(key for key in content if _folded(key) not in known)
    if strangers:
        raise GroundError(
            expected="what OpenCV or ROS write of a camera",
            found=f"{', '.join(map(repr, strangers))} in {path}",
            fix="remove it if it says nothing of the lens; other lens models are not read",
        )
    missing = [name for key, name in _OPENCV_SIZE if key not in folded]
    if missing:
        raise missing_size(path, " and ".join(missing))
    coefficients = next((folded[key] for key in _KEYS_OF_DISTORTION if key in folded), None)
    if coefficients is None:
        found = f"{path} without it"
        raise GroundError(expected="an entry distortion_coefficients", found=found, fix="add it, zeros if need be")
    distortion = _entries(coefficients, f"the distortion coefficients in {path}").ravel()
    return Stated(
        numbers([folded[key] for key, _ in _OPENCV_SIZE], (2,), f"image_width and image_height in {path}"),
        _three_by_three(next(folded[key] for key in _KEYS_OF_MATRIX), f"the camera matrix in {path}"),
        distortion,
        _opencv_lens(folded, len(distortion), path),
    )


def _opencv_lens(folded: Mapping[str, Any], count: int, path: Path) -> Lens:
    _require(folded.get("cameramodel", "pinhole"), {"pinhole"}, "camera_model", path)
    told: set[Lens] = set()
    if "distortionmodel" in folded:
        told.add(_ROS_LENSES[_require(folded["distortionmodel"], _ROS_LENSES, "distortion_model", path)])
    if "fisheyemodel" in folded:
        is_fisheye = numbers(folded["fisheyemodel"], (), f"fisheye_model in {path}")
        told.add("fisheye" if is_fisheye else "brown")
    if len(told) > 1:
        found = f"fisheye_model and distortion_model that contradict each other in {path}"
        raise GroundError(expected="one lens model", found=found, fix="correct the file")
    if not told and count == 4:
        raise GroundError(
            expected="to know whose four distortion coefficients these are",
            found=f"k1, k2, p1, p2 of a usual lens or k1 to k4 of a fisheye in {path}",
            fix="add `fisheye_model: 0` for a usual lens (cv2.calibrateCamera), 1 for a fisheye (cv2.fisheye)",
        )
    return told.pop() if told else "brown"


_KALIBR_KEYS: Final = (
    *("camera_model", "intrinsics", "distortion_model", "distortion_coeffs", "resolution", "rostopic", "cam_overlaps"),
    *("T_cn_cnm1", "T_cam_imu", "timeshift_cam_imu"),
)
_KALIBR_LENSES: Final[Mapping[str, tuple[Lens, int]]] = {
    "radtan": ("brown", 4),
    "equidistant": ("fisheye", 4),
    "equi": ("fisheye", 4),
    "none": ("brown", 0),
}


def _read_kalibr(content: Mapping[str, Any], path: Path) -> Stated:
    """Read the one camera of a camchain."""
    name, entry = _only_one(content, path)
    where = f"{name} of {path}"
    check_keys(entry, _KALIBR_KEYS, where)
    _require(entry.get("camera_model"), {"pinhole"}, "camera_model", where)
    lens, count = _KALIBR_LENSES[_require(entry.get("distortion_model"), _KALIBR_LENSES, "distortion_model", where)]
    fu, fv, pu, pv = numbers(entry.get("intrinsics"), (4,), f"intrinsics of {where}")
    return Stated(
        numbers(entry.get("resolution"), (2,), f"resolution of {where}"),
        np.array([[fu, 0.0, pu], [0.0, fv, pv], [0.0, 0.0, 1.0]]),
        _coefficients(entry.get("distortion_coeffs", []), count, f"distortion_coeffs of {where}"),
        lens,
    )


_ODM_LENSES: Final[Mapping[str, tuple[Lens, tuple[str, ...], tuple[str, ...]]]] = {
    "perspective": ("brown", ("focal", "focal"), ("k1", "k2")),
    "simple_radial": ("brown", ("focal_x", "focal_y", "c_x", "c_y"), ("k1",)),
    "radial": ("brown", ("focal_x", "focal_y", "c_x", "c_y"), ("k1", "k2")),
    "brown": ("brown", ("focal_x", "focal_y", "c_x", "c_y"), ("k1", "k2", "p1", "p2", "k3")),
    "fisheye": ("fisheye", ("focal", "focal"), ("k1", "k2")),
    "fisheye_opencv": ("fisheye", ("focal_x", "focal_y", "c_x", "c_y"), ("k1", "k2", "k3", "k4")),
}
"""Of OpenSfM's models those that are ours: lens, entries of the matrix, coefficients in our order, the rest zero."""


def _read_opendronemap(content: Mapping[str, Any], path: Path) -> Stated:
    """Read the one camera of a cameras.json."""
    name, entry = _only_one(content, path)
    where = f"{name!r} of {path}"
    model = _require(entry.get("projection_type"), _ODM_LENSES, "projection_type", where)
    lens, intrinsics, coefficients = _ODM_LENSES[model]
    stated = {key: value for key, value in entry.items() if not key.endswith("_prior")}
    check_keys(stated, ("projection_type", "width", "height", *intrinsics, *coefficients), where)
    size_px = numbers([entry.get("width"), entry.get("height")], (2,), f"width and height of {where}")
    shares = numbers([entry.get(key) for key in intrinsics], (len(intrinsics),), f"{', '.join(intrinsics)} of {where}")
    longer_px = size_px.max()
    matrix = np.diag([*shares[:2] * longer_px, 1.0])
    matrix[:2, 2] = (size_px - 1.0) / 2.0 + (shares[2:] * longer_px if len(shares) == 4 else 0.0)
    distortion = np.zeros(4 if lens == "fisheye" else 5)
    distortion[: len(coefficients)] = numbers(
        [entry.get(key) for key in coefficients], (len(coefficients),), f"{', '.join(coefficients)} of {where}"
    )
    return Stated(size_px, matrix, distortion, lens)


def _only_one(content: Mapping[str, Any], path: Path) -> tuple[str, Mapping[str, Any]]:
    if len(content) != 1:
        found = f"{len(content)} in {path}: {', '.join(content)}"[:200]
        raise GroundError(expected="a file of one camera", found=found, fix="keep the one whose pictures are measured")
    name, entry = next(iter(content.items()))
    return name, as_mapping(entry, f"the camera {name}", path)


def _require(model: object, known: Collection[str], key: str, where: object) -> str:
    if not isinstance(model, str) or model not in known:
        raise GroundError(
            expected=f"one of the {key}s {', '.join(sorted(known))}",
            found=f"{model!r} in {where}",
            fix="calibrate again with one of them (standoff calibrate)",
        )
    return model


def _entries(value: object, where: str) -> FloatArray:
    """Return the numbers of OpenCV's and ROS's {rows, cols, data}, (rows, cols), or of lists, as they are."""
    if not isinstance(value, Mapping):
        return numbers(value, (-1, -1) if _is_nested(value) else (-1,), where)
    rows, columns = numbers([value.get("rows"), value.get("cols")], (2,), f"rows and cols of {where}").tolist()
    data = numbers(value.get("data"), (-1,), f"data of {where}")
    if rows * columns != len(data):
        found = f"{len(data)}"
        raise GroundError(expected=f"{rows:g} x {columns:g} numbers for {where}", found=found, fix="correct the file")
    return data.reshape(int(rows), int(columns))


def _three_by_three(value: object, where: str) -> FloatArray:
    entries = _entries(value, where)
    return numbers((entries.reshape(3, 3) if entries.shape == (9,) else entries).tolist(), (3, 3), where)


def _is_nested(value: object) -> bool:
    return isinstance(value, Sequence) and any(isinstance(row, Sequence) and not isinstance(row, str) for row in value)


def _coefficients(value: object, count: int, where: str) -> FloatArray:
    # numpy makes floats of an empty list: that there are none is a statement, too.
    return np.zeros(0) if count == 0 and value == [] else numbers(value, (count,), where)


def missing_size(path: Path, keys: str) -> GroundError:
    """Return what is wrong with a camera file that does not say for pictures of which size it is."""
    return GroundError(
        expected=f"{keys} in the camera file, the size of the pictures that it was calibrated on",
        found=f"{path} without them",
        fix=f"add {keys}",
    )


def _not_opencv(path: Path, found: str) -> GroundError:
    return GroundError(
        expected="an OpenCV camera file (FileStorage)",
        found=f"{path}, which is none ({found})",
        fix="write it with cv2.FileStorage, or use the plain camera file",
    )
