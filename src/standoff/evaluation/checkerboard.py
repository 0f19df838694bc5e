"""The paper's lab test: distances on a checkerboard before and after rectification (section 5.2).

The first square of the board is the reference object. Before rectification its first side gives Eq. 6's scale
for distances in the picture; after rectification its four corners give the homography. Both ways measure from
the first corner to every other one, and Eq. 7 compares with the squares' true size.

The first corner is the one of the board's four outer corners that is nearest to the picture's top left; the first
side runs from there along the longer side of the board. The figures depend on that choice, by one or two per
cent before rectification: another end of the board is nearer to or further from the camera.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES
from standoff.stages.ground import (
    Belief,
    BoardView,
    PointObservation,
    belief_from_points,
    check_square,
    map_from_view,
    read_boards,
)

FIRST_CORNER = "of the board's four outer corners the one nearest to the picture's top left"


_CORNER_SIGMA_PX = 0.13
"""Standard error of a coordinate of a found corner: calibrations leave 0.18 px of both together."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewAccuracy:
    """Distances from the first corner to all others in one photograph.

    Attributes:
        name: File name.
        first_corner_px: (2,) the first corner as seen in the picture.
        tilt_deg: Between the board's normal and the camera's axis; NaN without a camera.
        truth_m: (T,) true distances.
        before_m: (T,) by Eq. 6's scale alone.
        after_m: (T,) through the homography of the first square.
        after_pose_m: (T,) through the map that the ground stage makes of the first square, a flat reference object, and
            the camera; NaN without a camera.
    """

    name: str
    first_corner_px: FloatArray
    tilt_deg: float
    truth_m: FloatArray
    before_m: FloatArray
    after_m: FloatArray
    after_pose_m: FloatArray

    @property
    def before_percent(self) -> float:
        """Eq. 7 before rectification."""
        return accuracy_percent(self.truth_m, self.before_m)

    @property
    def after_percent(self) -> float:
        """Eq. 7 after rectification."""
        return accuracy_percent(self.truth_m, self.after_m)

    @property
    def after_pose_percent(self) -> float:
        """Eq. 7 through the camera pose; NaN without a camera."""
        return accuracy_percent(self.truth_m, self.after_pose_m)

    @property
    def worst_error_m(self) -> float:
        """Largest distance error after rectification."""
        return float(np.abs(self.after_m - self.truth_m).max())


@dataclass(frozen=True, slots=True, eq=False)
class CheckerboardResult:
    """The lab test over all photographs.

    Attributes:
        pattern: (columns, rows) of inner corners.
        square_m: Side of a square.
        views: One entry a photograph that could be measured.
        views_failed: Reason by name for each photograph that could not.
    """

    pattern: tuple[int, int]
    square_m: float
    views: tuple[ViewAccuracy, ...]
    views_failed: Mapping[str, str] = field(default_factory=dict)

    @property
    def truth_m(self) -> FloatArray:
        """(T,) true distances, the same in every view: along the board's longer side first."""
        return self.views[0].truth_m

    @property
    def before_percent(self) -> float:
        """Eq. 7 before rectification over all views."""
        return float(np.mean([view.before_percent for view in self.views]))

    @property
    def after_percent(self) -> float:
        """Eq. 7 after rectification over all views."""
        return float(np.mean([view.after_percent for view in self.views]))

    @property
    def after_pose_percent(self) -> float:
        """Eq. 7 through the camera pose over all views; NaN without a camera."""
        return float(np.mean([view.after_pose_percent for view in self.views]))

    @property
    def per_view(self) -> list[dict[str, Any]]:
        """One row a view; None where there is no camera to tell."""
        return [
            {
                "view": view.name,
                "first_corner_px": [round(float(value), 2) for value in view.first_corner_px],
                "tilt_deg": _or_none(view.tilt_deg),
                "before_percent": view.before_percent,
                "after_percent": view.after_percent,
                "after_pose_percent": _or_none(view.after_pose_percent),
                "worst_error_m": view.worst_error_m,
            }
            for view in self.views
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON types: the figures, then the rows of Tables 4 and 5."""
        return {
            "before_percent": self.before_percent,
            "after_percent": self.after_percent,
            "after_pose_percent": _or_none(self.after_pose_percent),
            "pattern": list(self.pattern),
            "square_m": self.square_m,
            "first_corner": FIRST_CORNER,
            "views_measured": len(self.views),
            "views_failed": dict(self.views_failed),
            "per_view": self.per_view,
            "tables": [
                {
                    "target": row + 1,
                    "truth_m": float(truth_m),
                    "before_m": [float(view.before_m[row]) for view in self.views],
                    "after_m": [float(view.after_m[row]) for view in self.views],
                }
                for row, truth_m in enumerate(self.truth_m)
            ],
        }


def accuracy_percent(truth_m: FloatArray, estimate_m: FloatArray) -> float:
    """Return 100 % less the mean absolute percentage error.

    Args:
        truth_m: (T,) true distances, none 0.
        estimate_m: (T,) their estimates.

    Source:
        Paper, section 5.2, Eq. 7.

    >>> accuracy_percent(np.array([1.0, 2.0]), np.array([1.1, 2.0]))
    95.0
    """
    return float(100.0 - 100.0 * np.mean(np.abs((truth_m - estimate_m) / truth_m)))


def evaluate_checkerboard(
    pictures: Path | str | Iterable[Path],
    pattern: tuple[int, int] = (9, 6),
    square_m: float = 0.025,
    camera: Camera | None = None,
) -> CheckerboardResult:
    """Repeat the paper's lab test on photographs of a checkerboard.

    Args:
        pictures: A folder, or picture files.
        pattern: (columns, rows) of inner corners.
        square_m: Side of a square.
        camera: Removes the lens distortion first and adds the camera-pose figures.

    Raises:
        SourceError: The photographs cannot be read.
        DataError: No photograph could be measured, or the camera is for pictures of another shape.
    """
    return evaluate_views(read_boards(pictures, pattern), pattern, square_m, camera)


def evaluate_views(
    views: Sequence[BoardView], pattern: tuple[int, int], square_m: float, camera: Camera | None = None
) -> CheckerboardResult:
    """Repeat the lab test on corners that were found already.

    Raises:
        DataError: No photograph could be measured, or the camera is for pictures of another shape.
    """
    check_square(square_m)
    measured, failed = [], {}
    for view in views:
        if not view.found:
            failed[view.name] = "no whole board found"
            continue
        accuracy = _measure(view, square_m, camera)
        if np.isfinite(accuracy.after_m).all():
            measured.append(accuracy)
        else:
            failed[view.name] = "a corner lies beyond the horizon of the first square's homography"
    if not measured:
        raise DataError(
            expected=f"a board of {pattern[0]}x{pattern[1]} inner corners in at least one photograph",
            found=f"none in {len(views)}",
            fix="check the pattern: count the corners where four squares meet, not the squares",
        )
    return CheckerboardResult(pattern, square_m, tuple(measured), failed)


def first_corner_first(corners_px: FloatArray) -> FloatArray:
    """Turn a grid of corners so that it starts nearest to the picture's top left and runs along its longer side.

    Args:
        corners_px: (rows, columns, 2).

    Returns:
        The same corners, (shorter, longer, 2).

    >>> first_corner_first(np.array([[[9.0, 9.0], [5.0, 9.0], [1.0, 9.0]], [[9.0, 1.0], [5.0, 1.0], [1.0, 1.0]]]))[0]
    array([[1., 1.],
           [5., 1.],
           [9., 1.]])
    """
    grid = corners_px if corners_px.shape[0] <= corners_px.shape[1] else corners_px.transpose(1, 0, 2)
    ends = [grid, grid[::-1], grid[:, ::-1], grid[::-1, ::-1]]
    return min(ends, key=lambda end: float(np.linalg.norm(end[0, 0])))


def _measure(view: BoardView, square_m: float, camera: Camera | None) -> ViewAccuracy:
    grid_px = first_corner_first(view.corners_px)
    first_corner_px = grid_px[0, 0]
    grid_m = np.stack(np.meshgrid(*(np.arange(n) * square_m for n in grid_px.shape[1::-1])), axis=-1)
    pose_m, tilt_deg = np.full_like(grid_px, np.nan), float("nan")
    if camera is not None:
        camera = _fitting(camera, view)
        pose_m = _through_ground_stage(grid_px, grid_m, camera)
        tilt_deg = _tilt_deg(grid_px, grid_m, camera)
        grid_px = camera.undistort(grid_px.reshape(-1, 2)).reshape(grid_px.shape)
    square_px, square_corners_m = grid_px[:2, :2].reshape(-1, 2), grid_m[:2, :2].reshape(-1, 2)
    after_m = _map_all(homography.fit(square_px, square_corners_m), grid_px)
    scale_m_per_px = square_m / float(np.linalg.norm(grid_px[0, 1] - grid_px[0, 0]))
    return ViewAccuracy(
        name=view.name,
        first_corner_px=first_corner_px,
        tilt_deg=tilt_deg,
        truth_m=_from_first(grid_m),
        before_m=scale_m_per_px * _from_first(grid_px),
        after_m=_from_first(after_m),
        after_pose_m=_from_first(pose_m),
    )


def _fitting(camera: Camera, view: BoardView) -> Camera:
    try:
        return camera.scaled_to(*view.image_size_px)
    except ValueError as error:
        fix = "give the camera file of these photographs"
        raise DataError(expected=f"a camera for {view.name}", found=str(error), fix=fix) from None


def _from_first(grid: FloatArray) -> FloatArray:
    distances: FloatArray = np.linalg.norm(grid - grid[0, 0], axis=2).ravel()[1:]
    return distances


def _map_all(image_to_ground: FloatArray, grid_px: FloatArray) -> FloatArray:
    return homography.apply(image_to_ground, grid_px.reshape(-1, 2))[0].reshape(grid_px.shape)


def _through_ground_stage(grid_px: FloatArray, grid_m: FloatArray, camera: Camera) -> FloatArray:
    """Return the grid's places through the ground stage's own map from a flat reference: the first square."""
    belief = _belief(grid_px[:2, :2], grid_m[:2, :2], camera)
    covariance = np.asarray(np.linalg.inv(belief.information)[:CHANGES, :CHANGES], dtype=np.float64)
    square_px = grid_px[:2, :2].reshape(-1, 2)
    ground = map_from_view(
        belief.state.view, covariance, method="first square", scale_m_per_px=np.nan, anchors_px=square_px
    )
    return ground.to_ground(grid_px.reshape(-1, 2))[0].reshape(grid_px.shape)


def _tilt_deg(grid_px: FloatArray, grid_m: FloatArray, camera: Camera) -> float:
    """Return the angle between the board's normal and the camera's axis, by all corners."""
    toward = _belief(grid_px, grid_m, camera).state.view.site_to_camera[2, 2]
    return float(np.degrees(np.arccos(min(1.0, abs(toward)))))


def _belief(grid_px: FloatArray, grid_m: FloatArray, camera: Camera) -> Belief:
    """Return where the camera is, the board being the ground."""
    along, across = grid_px[0, -1] - grid_px[0, 0], grid_px[-1, 0] - grid_px[0, 0]
    # Seen from above y is to the left of x; rows that run to its right run down.
    left = -1.0 if along[0] * across[1] > along[1] * across[0] else 1.0
    points_m = np.column_stack([grid_m.reshape(-1, 2) * [1.0, left], np.zeros(grid_m.size // 2)])
    sigma_px = np.full(len(points_m), _CORNER_SIGMA_PX)
    seen = PointObservation("the board's corners", points_m, grid_px.reshape(-1, 2), sigma_px)
    return belief_from_points(CameraPrior.calibrated(camera), seen)


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else value
