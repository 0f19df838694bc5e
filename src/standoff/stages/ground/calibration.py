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

from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.stages.ground.boards import BoardView, check_square, read_boards
from standoff.stages.ground.camera_check import impossible_distortion, lens_warnings
from standoff.stages.ground.view_agreement import FittedBoards, check_one_camera, without_repeats

_Float32Array = npt.NDArray[np.float32]

_FEWEST_VIEWS = 3
_LEAST_COMMON = 2.0 / 3.0
"""So large a share of the photographs must have one size, or nobody knows which of two cameras is meant."""
_STOP = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 300, 1e-14)
"""OpenCV's own 30 rounds end on the way where the lens's axis is far from the middle: 0.4 px off with exact corners."""
_LARGEST_RMS_PX, _LARGEST_RMS = 1.0, 1e-3
"""Sharp pictures leave 0.1 to 0.5 px, soft ones of 4000 px some more; of a wrong pattern, 5 to 20 px remain."""
_SUSPECT_RMS = 4e-4
"""In longer sides of the picture: from here on it is worth asking whether the lens is a fisheye."""
_FISHEYE_RAD = 0.7
"""Corners must lie so far off the axis for the lens to be called a fisheye: nearer to it, both models say the same."""
_SQUARE = 0.03
"""The pixels of nearly all cameras are square to a thousandth; what a calibration says of them to half a hundredth."""
_FARTHEST_AXIS = 0.2
"""A lens's axis is at most this share of a side off the middle: photographs measured so far have 0.04 at most."""
_LEAST_COVERED = 0.3
"""The hull of all corners must cover this share of the picture: 13 photographs that make a good camera cover 0.46."""
_FEWER_COEFFICIENTS = (0, cv2.CALIB_FIX_K3, cv2.CALIB_FIX_K3 | cv2.CALIB_FIX_K2)
"""Where boards lie in the picture's middle only, the higher ones are noise."""
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
        views_repeated: Names of those that show the board just as another one does, which counts once.
        warnings: What should be known before the camera is used.
    """

    camera: Camera
    rms_px: float
    focal_sigma_px: float
    views_used: tuple[str, ...]
    per_view_rms_px: FloatArray
    views_failed: tuple[str, ...]
    views_of_other_size: tuple[str, ...] = ()
    views_repeated: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return how good the calibration is, as JSON types; the camera itself goes to the camera file."""
        return {
            "rms_px": self.rms_px,
            "focal_sigma_px": self.focal_sigma_px,
            "per_view_rms_px": dict(zip(self.views_used, self.per_view_rms_px.tolist(), strict=True)),
            "views_failed": list(self.views_failed),
            "views_of_other_size": list(self.views_of_other_size),
            "views_repeated": list(self.views_repeated),
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
        GroundError: They do not determine the camera, it does not explain them, or they are not of one.
    """
    check_square(square_m)
    seen, odd = _of_one_size(views)
    image_size_px = seen[0].image_size_px
    rows, columns = seen[0].corners_px.shape[:2]
    board_m = np.zeros((rows * columns, 3))
    board_m[:, :2] = np.indices((rows, columns))[::-1].reshape(2, -1).T * square_m
    _check_turned(board_m, [view.corners_px for view in seen], image_size_px)
    used, repeats = without_repeats(seen)
    if len(used) < _FEWEST_VIEWS:
        raise GroundError(
            expected=f"at least {_FEWEST_VIEWS} different photographs of the board",
            found=f"{len(used)}, and copies of them ({', '.join(view.name for view in repeats)})",
            fix="add photographs with the board tilted to different sides",
        )
    boards_px = [view.corners_px for view in used]

    flags, fitted = _bent_as_lenses_are(board_m, boards_px, image_size_px)
    _check_fit(fitted.boards.rms_px, board_m, boards_px, image_size_px)
    _check_lens(fitted.boards.matrix, image_size_px)
    check_one_camera(
        [view.name for view in used],
        board_m,
        boards_px,
        image_size_px,
        lambda others_px: _fit(board_m, others_px, image_size_px, flags).boards,
    )
    camera = Camera(*image_size_px, fitted.boards.matrix, fitted.boards.distortion)
    return CalibrationResult(
        camera=camera,
        rms_px=fitted.boards.rms_px,
        focal_sigma_px=fitted.focal_sigma_px,
        views_used=tuple(view.name for view in used),
        per_view_rms_px=fitted.per_view_rms_px,
        views_failed=tuple(view.name for view in views if not view.found),
        views_of_other_size=tuple(view.name for view in odd),
        views_repeated=tuple(view.name for view in repeats),
        warnings=(
            *_left_out(image_size_px, odd, repeats),
            *_warnings(used, fitted.per_view_rms_px),
            *lens_warnings(CameraPrior.calibrated(camera)),
        ),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A fitted camera, and how sure it is.

    Attributes:
        boards: The camera, and where the boards were.
        focal_sigma_px: Standard error of fx and fy, the larger one.
        per_view_rms_px: (V,).
    """

    boards: FittedBoards
    focal_sigma_px: float
    per_view_rms_px: FloatArray


def _bent_as_lenses_are(
    board_m: FloatArray, boards_px: Sequence[FloatArray], image_size_px: tuple[int, int]
) -> tuple[int, _Fit]:
    """Return flags of OpenCV and what it fits by them: with fewer coefficients where more would fold the picture.

    Raises:
        GroundError: One is too many already.
    """
    for flags in _FEWER_COEFFICIENTS:
        fitted = _fit(board_m, boards_px, image_size_px, flags)
        camera = Camera(*image_size_px, fitted.boards.matrix, fitted.boards.distortion)
        doing = impossible_distortion(camera)
        if not doing:
            return flags, fitted
    raise GroundError(
        expected="photographs that tell the lens's distortion",
        found=f"one by which {doing}",
        fix="photograph the board in the picture's corners, too, and check the pattern (columns x rows)",
    )


def _fit(board_m: FloatArray, boards_px: Sequence[FloatArray], image_size_px: tuple[int, int], flags: int) -> _Fit:
    rms_px, matrix, distortion, turns, shifts, sigmas, _, per_view = cv2.calibrateCameraExtended(
        [board_m.astype(np.float32)] * len(boards_px),
        _points(boards_px),
        image_size_px,
        None,
        None,
        flags=flags,
        criteria=_STOP,
    )
    poses = np.reshape(turns, (-1, 3)), np.reshape(shifts, (-1, 3))
    boards = FittedBoards(matrix, distortion.ravel(), *poses, float(rms_px))
    return _Fit(boards, float(sigmas.ravel()[:2].max()), per_view.ravel())


def _points(boards_px: Sequence[FloatArray]) -> list[_Float32Array]:
    """Return corners as OpenCV takes them, (N, 1, 2) each."""
    return [board.reshape(-1, 1, 2).astype(np.float32) for board in boards_px]


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
    rms_px: float, board_m: FloatArray, boards_px: Sequence[FloatArray], image_size_px: tuple[int, int]
) -> None:
    """Refuse a lens that does not explain the corners, and say so where a fisheye would."""
    if rms_px > _SUSPECT_RMS * max(image_size_px):
        fisheye_px = _fisheye_rms_px(board_m, boards_px, image_size_px)
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


def _fisheye_rms_px(board_m: FloatArray, boards_px: Sequence[FloatArray], image_size_px: tuple[int, int]) -> float:
    """Return how well OpenCV's fisheye model explains the corners; infinite where it finds no lens that is so wide."""
    width_px, height_px = image_size_px
    # Most show about half a circle along the longer side.
    focal_px = max(image_size_px) / np.pi
    guess = np.array([[focal_px, 0.0, (width_px - 1) / 2], [0.0, focal_px, (height_px - 1) / 2], [0.0, 0.0, 1.0]])
    flags = cv2.fisheye.CALIB_USE_INTRINSIC_GUESS | cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
    board, seen = board_m.reshape(-1, 1, 3), [board.reshape(-1, 1, 2) for board in boards_px]
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
    if abs(np.log(fx / fy)) > _SQUARE:
        expected, found = f"square pixels, fx and fy within {100 * _SQUARE:g} %", f"fx {fx:.0f}, fy {fy:.0f}"
    elif (abs(matrix[:2, 2] - (size_px - 1.0) / 2.0) > _FARTHEST_AXIS * size_px).any():
        expected = f"a lens whose axis is near the middle of the {image_size_px[0]}x{image_size_px[1]} picture"
        found = f"it at {matrix[0, 2]:.0f}, {matrix[1, 2]:.0f}"
    else:
        return
    raise GroundError(
        expected=expected,
        found=found,
        fix="check the pattern (columns x rows of inner corners), add photographs at other tilts, undo any stretching",
    )


def _left_out(image_size_px: tuple[int, int], odd: Sequence[BoardView], repeats: Sequence[BoardView]) -> list[str]:
    warnings = []
    if odd:
        named = ", ".join(f"{view.name} ({view.image_size_px[0]}x{view.image_size_px[1]})" for view in odd)
        warnings.append(f"left out what is not {image_size_px[0]}x{image_size_px[1]} as the others are: {named}")
    if repeats:
        named = ", ".join(view.name for view in repeats)
        warnings.append(f"left out what shows the board just as another photograph does: {named}")
    return warnings


def _warnings(used: Sequence[BoardView], per_view_rms_px: FloatArray) -> list[str]:
    warnings = []
    width_px, height_px = used[0].image_size_px
    points_px = np.concatenate([view.corners_px.reshape(-1, 2) for view in used])
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
    return warnings


def _check_turned(board_m: FloatArray, boards_px: Sequence[FloatArray], image_size_px: tuple[int, int]) -> None:
    """Refuse boards that are all nearly parallel, judged with a focal length of one picture width.

    The calibrated one cannot judge: where it is wrong, it invents the tilts that it needs.
    """
    width_px, height_px = image_size_px
    matrix = np.array([[width_px, 0.0, (width_px - 1) / 2], [0.0, width_px, (height_px - 1) / 2], [0.0, 0.0, 1.0]])
    turns = [cv2.solvePnP(board_m, corners, matrix, None, flags=cv2.SOLVEPNP_IPPE)[1] for corners in _points(boards_px)]
    normals = np.stack([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    largest_deg = float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0))).max())
    if largest_deg < _SMALLEST_TURN_DEG:
        raise GroundError(
            expected=f"boards tilted by at least {_SMALLEST_TURN_DEG:g} degrees against each other",
            found=f"{largest_deg:.1f} degrees at most in {len(boards_px)} views",
            fix="add photographs with the board tilted to different sides",
        )
