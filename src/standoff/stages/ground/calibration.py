"""Calibrate a camera from photographs of a checkerboard (Zhang 2000, as OpenCV does it)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.stages.ground.boards import BoardView, read_boards

_FEWEST_VIEWS = 3
_LARGEST_FOCAL_ERROR = 0.05


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
    rms_px, matrix, distortion, _, _, sigmas, _, per_view = cv2.calibrateCameraExtended(
        [board_m] * len(used), corners_px, image_size_px, None, None
    )
    focal_sigma_px = float(sigmas.ravel()[:2].max())
    if not np.isfinite(focal_sigma_px) or focal_sigma_px > _LARGEST_FOCAL_ERROR * matrix[0, 0]:
        raise GroundError(
            expected=f"views that fix the focal length to {_LARGEST_FOCAL_ERROR:.0%}",
            found=f"{matrix[0, 0]:.0f} px with a standard error of {focal_sigma_px:.0f} px from {len(used)} views",
            fix="add photographs with the board tilted to different sides",
        )
    return CalibrationResult(
        camera=Camera(*image_size_px, matrix, distortion),
        rms_px=float(rms_px),
        focal_sigma_px=focal_sigma_px,
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
