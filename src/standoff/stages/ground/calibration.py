"""Calibrate a camera from photographs of a checkerboard (Zhang 2000, as OpenCV does it)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.stages.ground.boards import BoardView, check_square, read_boards

_Float32Array = npt.NDArray[np.float32]

_FEWEST_VIEWS = 3
_LEAST_COMMON = 2.0 / 3.0
"""Of the photographs have one size, or nobody knows which of two cameras is meant."""
_STOP = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 300, 1e-14)
"""OpenCV's own 30 rounds end on the way where the lens's axis is far from the middle: 0.4 px off with exact corners."""
_LARGEST_RMS_PX, _LARGEST_RMS = 1.0, 1e-3
"""Sharp pictures leave 0.1 to 0.5 px, soft ones of 4000 px some more; of a wrong pattern, 5 to 20 px remain."""
_SUSPECT_RMS = 4e-4
"""In longer sides of the picture: from here on it is worth asking whether the lens is a fisheye."""
_FISHEYE_RAD = 0.7
"""Corners must lie so far off the axis for the lens to be called a fisheye: nearer to it, both models say the same."""
_MOST_OBLONG = 1.5
"""Of pixels: those of films of 1440 x 1080 are 4 : 3; of a wrong pattern, fx and fy differ by factors of 2 and more."""
_SQUARE = 0.03
"""The pixels of nearly all cameras are square to a thousandth; what a calibration says of them to half a hundredth."""
_FARTHEST_AXIS = 0.2
"""From the middle of the picture, as a share of its side: photographs measured so far have 0.04 at most."""
_LEAST_COVERED = 0.3
"""Of the picture, by the hull of all corners: 13 photographs that make a good camera cover 0.46."""
# Parallel boards leave the focal length open (Zhang 2000, section 3.2), and OpenCV's standard error does not show it.
_SMALLEST_TURN_DEG = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationResult:
    """A calibrated camera and how well it explains the photographs.

    Attributes:
        camera: The camera.
        rms_px: Root mean square distance of all corners from where the model puts them.
        focal_sigma_px: Standard error of fx and fy, the larger one.
        views_used: Names of the photographs where the whole board was found.
        per_view_rms_px: (V,) the same root mean square for each of them.
        views_failed: Names of the photographs without a whole board.
        views_of_other_size: Names of those that were left out because most are of another size.
        warnings: What should be known before the camera is used.
    """

    camera: Camera
    rms_px: float
    focal_sigma_px: float
    views_used: tuple[str, ...]
    per_view_rms_px: FloatArray
    views_failed: tuple[str, ...]
    views_of_other_size: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return how good the calibration is, as JSON types; the camera itself goes to the camera file."""
        return {
            "rms_px": self.rms_px,
            "focal_sigma_px": self.focal_sigma_px,
            "per_view_rms_px": dict(zip(self.views_used, self.per_view_rms_px.tolist(), strict=True)),
            "views_failed": list(self.views_failed),
            "views_of_other_size": list(self.views_of_other_size),
            "warnings": list(self.warnings),
        }


def calibrate(
    pictures: Path | str | Iterable[Path], pattern: tuple[int, int] = (9, 6), square_m: float = 0.025
) -> CalibrationResult:
    """Calibrate a camera from photographs of one flat checkerboard.

    Args:
        pictures: A folder of photographs, or picture files; at least three show the whole board, at
            different tilts.
        pattern: (columns, rows) of inner corners.
        square_m: Side of a square.

    Raises:
        SourceError: The photographs cannot be read.
        GroundError: They do not determine the camera.
    """
    return calibrate_views(read_boards(pictures, pattern), square_m)


def calibrate_views(views: Sequence[BoardView], square_m: float = 0.025) -> CalibrationResult:
    """Calibrate a camera from corners that were found already.

    Raises:
        GroundError: They do not determine the camera, or it does not explain them.
    """
    check_square(square_m)
    used, odd = _of_one_size(views)
    image_size_px = used[0].image_size_px
    rows, columns = used[0].corners_px.shape[:2]
    board_m = np.zeros((rows * columns, 3), np.float32)
    board_m[:, :2] = np.indices((rows, columns))[::-1].reshape(2, -1).T * square_m
    corners_px = [view.corners_px.reshape(-1, 1, 2).astype(np.float32) for view in used]
    _check_turned(board_m, corners_px, image_size_px)
    rms_px, matrix, distortion, _, _, sigmas, _, per_view = cv2.calibrateCameraExtended(
        [board_m] * len(used), corners_px, image_size_px, None, None, criteria=_STOP
    )
    _check_fit(float(rms_px), board_m, corners_px, image_size_px)
    _check_lens(matrix, image_size_px)
    return CalibrationResult(
        camera=Camera(*image_size_px, matrix, distortion),
        rms_px=float(rms_px),
        focal_sigma_px=float(sigmas.ravel()[:2].max()),
        views_used=tuple(view.name for view in used),
        per_view_rms_px=per_view.ravel(),
        views_failed=tuple(view.name for view in views if not view.found),
        views_of_other_size=tuple(view.name for view in odd),
        warnings=(*_warnings(used, odd, per_view.ravel()), *_oblong(matrix)),
    )


def _of_one_size(views: Sequence[BoardView]) -> tuple[list[BoardView], list[BoardView]]:
    """Return the views with a board whose size most have, and those of other sizes."""
    found = [view for view in views if view.found]
    if len(found) < _FEWEST_VIEWS:
        raise GroundError(
            expected=f"the whole board in at least {_FEWEST_VIEWS} photographs",
            found=f"it in {len(found)} of {len(views)}",
            fix="check the pattern (columns x rows of inner corners) or add photographs",
        )
    counts = Counter(view.image_size_px for view in found)
    common, count = counts.most_common(1)[0]
    if count < max(_FEWEST_VIEWS, _LEAST_COMMON * len(found)):
        first = {view.image_size_px: view.name for view in reversed(found)}
        sizes = ", ".join(f"{width}x{height} ({name})" for (width, height), name in first.items())
        raise GroundError(expected="photographs of one size", found=sizes, fix="use one camera and one setting")
    used = [view for view in found if view.image_size_px == common]
    return used, [view for view in found if view.image_size_px != common]


def _largest_rms_px(image_size_px: tuple[int, int]) -> float:
    return max(_LARGEST_RMS_PX, _LARGEST_RMS * max(image_size_px))


def _check_fit(
    rms_px: float, board_m: _Float32Array, corners_px: Sequence[_Float32Array], image_size_px: tuple[int, int]
) -> None:
    """Refuse a lens that does not explain the corners, and say so where a fisheye would."""
    if rms_px > _SUSPECT_RMS * max(image_size_px):
        fisheye_px = _fisheye_rms_px(board_m, corners_px, image_size_px)
        if fisheye_px < rms_px / 2.0:
            raise GroundError(
                expected="a lens with Brown and Conrady's distortion",
                found=f"one that leaves {rms_px:.2f} px where a fisheye leaves {fisheye_px:.2f}",
                fix="calibrate it as a fisheye (cv2.fisheye.calibrate, Kalibr's pinhole-equi) and give that file",
            )
    if not rms_px <= _largest_rms_px(image_size_px):
        raise GroundError(
            expected=f"corners within {_largest_rms_px(image_size_px):.2g} px of where a lens puts them",
            found=f"{rms_px:.2f} px, root mean square",
            fix="check the pattern (columns x rows of inner corners), that the board is flat, the pictures sharp",
        )


def _fisheye_rms_px(
    board_m: _Float32Array, corners_px: Sequence[_Float32Array], image_size_px: tuple[int, int]
) -> float:
    """Return how well OpenCV's fisheye model explains the corners; infinite where it finds no lens that is so wide."""
    width_px, height_px = image_size_px
    # Most show about half a circle along the longer side.
    focal_px = max(image_size_px) / np.pi
    guess = np.array([[focal_px, 0.0, (width_px - 1) / 2], [0.0, focal_px, (height_px - 1) / 2], [0.0, 0.0, 1.0]])
    flags = cv2.fisheye.CALIB_USE_INTRINSIC_GUESS | cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
    board, seen = board_m.reshape(-1, 1, 3).astype(np.float64), [corners.astype(np.float64) for corners in corners_px]
    try:
        rms_px, matrix, *_ = cv2.fisheye.calibrate(
            [board] * len(seen), seen, image_size_px, guess, np.zeros(4), flags=flags
        )
    except cv2.error:
        return np.inf
    angles_rad = np.linalg.norm((np.concatenate(seen)[:, 0] - matrix[:2, 2]) / np.diag(matrix)[:2], axis=1)
    return float(rms_px) if angles_rad.max() > _FISHEYE_RAD else np.inf


def _check_lens(matrix: FloatArray, image_size_px: tuple[int, int]) -> None:
    """Refuse a camera that nobody builds: such numbers come out of corners that were put in a wrong order."""
    fx, fy = np.diag(matrix)[:2].tolist()
    size_px = np.array(image_size_px, dtype=np.float64)
    if not 1.0 / _MOST_OBLONG < fx / fy < _MOST_OBLONG:
        expected, found = "about square pixels", f"fx {fx:.0f}, fy {fy:.0f}"
    elif (abs(matrix[:2, 2] - (size_px - 1.0) / 2.0) > _FARTHEST_AXIS * size_px).any():
        expected = f"a lens whose axis is near the middle of the {image_size_px[0]}x{image_size_px[1]} picture"
        found = f"it at {matrix[0, 2]:.0f}, {matrix[1, 2]:.0f}"
    else:
        return
    raise GroundError(
        expected=expected,
        found=found,
        fix="check the pattern (columns x rows of inner corners) or add photographs at other tilts",
    )


def _oblong(matrix: FloatArray) -> list[str]:
    fx, fy = np.diag(matrix)[:2].tolist()
    if abs(fx / fy - 1.0) <= _SQUARE:
        return []
    return [f"fx {fx:.0f} and fy {fy:.0f} differ by more than {100 * _SQUARE:g} %: are the pixels of a film so oblong?"]


def _warnings(used: Sequence[BoardView], odd: Sequence[BoardView], per_view_rms_px: FloatArray) -> tuple[str, ...]:
    warnings = []
    (width_px, height_px), points_px = (
        used[0].image_size_px,
        np.concatenate([v.corners_px.reshape(-1, 2) for v in used]),
    )
    if odd:
        named = ", ".join(f"{view.name} ({view.image_size_px[0]}x{view.image_size_px[1]})" for view in odd)
        warnings.append(f"left out what is not {width_px}x{height_px} as the others are: {named}")
    limit_px = _largest_rms_px((width_px, height_px))
    bad = [view.name for view, rms_px in zip(used, per_view_rms_px, strict=True) if rms_px > limit_px]
    if bad:
        warnings.append(
            f"corners more than {limit_px:.2g} px off in {', '.join(bad)}: was the board found right there?"
        )
    covered = float(cv2.contourArea(cv2.convexHull(points_px.astype(np.float32)))) / (width_px * height_px)
    if covered < _LEAST_COVERED:
        warnings.append(
            f"the boards cover {100 * covered:.0f} % of the picture: the distortion beyond is a guess; "
            "photograph the board in the corners, too"
        )
    return tuple(warnings)


def _check_turned(board_m: _Float32Array, corners_px: Sequence[_Float32Array], image_size_px: tuple[int, int]) -> None:
    """Refuse boards that are all nearly parallel, judged with a focal length of one picture width.

    The calibrated one cannot judge: where it is wrong, it invents the tilts that it needs.
    """
    width_px, height_px = image_size_px
    matrix = np.array([[width_px, 0.0, (width_px - 1) / 2], [0.0, width_px, (height_px - 1) / 2], [0.0, 0.0, 1.0]])
    turns = [cv2.solvePnP(board_m, corners, matrix, None, flags=cv2.SOLVEPNP_IPPE)[1] for corners in corners_px]
    normals = np.stack([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    largest_deg = float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0))).max())
    if largest_deg < _SMALLEST_TURN_DEG:
        raise GroundError(
            expected=f"boards tilted by at least {_SMALLEST_TURN_DEG:g} degrees against each other",
            found=f"{largest_deg:.1f} degrees at most in {len(corners_px)} views",
            fix="add photographs with the board tilted to different sides",
        )
