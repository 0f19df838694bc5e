"""Calibrate a camera from photographs of a checkerboard (Zhang 2000, as OpenCV does it)."""

from __future__ import annotations

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
from standoff.stages.ground.boards import BoardView, read_boards

_Float32Array = npt.NDArray[np.float32]

_FEWEST_VIEWS = 3
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
    """

    camera: Camera
    rms_px: float
    focal_sigma_px: float
    views_used: tuple[str, ...]
    per_view_rms_px: FloatArray
    views_failed: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return how good the calibration is, as JSON types; the camera itself goes to the camera file."""
        return {
            "rms_px": self.rms_px,
            "focal_sigma_px": self.focal_sigma_px,
            "per_view_rms_px": dict(zip(self.views_used, self.per_view_rms_px.tolist(), strict=True)),
            "views_failed": list(self.views_failed),
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
        GroundError: They do not determine the camera.
    """
    used, image_size_px = _usable(views, square_m)
    rows, columns = used[0].corners_px.shape[:2]
    board_m = np.zeros((rows * columns, 3), np.float32)
    board_m[:, :2] = np.indices((rows, columns))[::-1].reshape(2, -1).T * square_m
    corners_px = [view.corners_px.reshape(-1, 1, 2).astype(np.float32) for view in used]
    _check_turned(board_m, corners_px, image_size_px)
    rms_px, matrix, distortion, _, _, sigmas, _, per_view = cv2.calibrateCameraExtended(
        [board_m] * len(used), corners_px, image_size_px, None, None
    )
    return CalibrationResult(
        camera=Camera(*image_size_px, matrix, distortion),
        rms_px=float(rms_px),
        focal_sigma_px=float(sigmas.ravel()[:2].max()),
        views_used=tuple(view.name for view in used),
        per_view_rms_px=per_view.ravel(),
        views_failed=tuple(view.name for view in views if not view.found),
    )


def _usable(views: Sequence[BoardView], square_m: float) -> tuple[list[BoardView], tuple[int, int]]:
    if not (square_m > 0 and np.isfinite(square_m)):
        raise GroundError(expected="a square with a positive side", found=f"{square_m} m", fix="measure one square")
    used = [view for view in views if view.found]
    if len(used) < _FEWEST_VIEWS:
        raise GroundError(
            expected=f"the whole board in at least {_FEWEST_VIEWS} photographs",
            found=f"it in {len(used)} of {len(views)}",
            fix="check the pattern (columns x rows of inner corners) or add photographs",
        )
    sizes = {view.image_size_px: view.name for view in used}
    if len(sizes) > 1:
        found = ", ".join(f"{width}x{height} ({name})" for (width, height), name in sizes.items())
        raise GroundError(expected="photographs of one size", found=found, fix="use one camera and one setting")
    return used, used[0].image_size_px


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
