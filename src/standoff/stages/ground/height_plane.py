"""The plane through surveyed heights: ground that slopes, and how far it lies off that plane.

Positions stay what they are everywhere in standoff, metres east and north: distances are horizontal, on a slope a
little less than a tape on the ground measures. What needs the ground to be z = 0 works in the frame of the plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, islice
from typing import Any, Final

import numpy as np

from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import View, rotation_from_vector
from standoff.core.relief import Relief
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.point_fit import belief_from_points

_USUAL_RELIEF_M: Final = 0.1
"""Standard deviation of a site's ground about a plane, before anything of it is known."""
_USUAL_COUNTS: Final = 2.0
"""For so many heights what is usual counts beside those that were surveyed."""
_DOUBTFUL: Final = 4.0
"""Standard deviations off the plane of the others from which a height is rather a mistake, or no ground."""
_MOUND_M: Final = 0.25
"""So far off the plane, once and again, is ground of any site."""
_STEEPEST_DEG: Final = 35.0
"""Loose ground does not stand steeper, nor do machines."""
_ROUGHEST: Final = 0.15
"""Heights that scatter about their plane by more than this share of their extent are of no ground that a plane is."""
_ON_A_LINE: Final = 0.05
_MOST_TRIALS: Final = 2000
_FIX: Final = "write z_m in metres, upwards, all from one level"
NOT_LAID: Final = "how far points lie off the plane of the heights could not be allowed for: no camera sees them so"


@dataclass(frozen=True, slots=True, eq=False)
class HeightPlane:
    """A plane through surveyed heights.

    Attributes:
        height_m: Of the plane at the site's origin, from the level of the heights.
        rise: (2,) of the plane a metre, east and north.
        relief: How far the ground is off it.
        off_m: (N,) how far each point is above it; 0 where no height was given, or one that is not believed.
        doubtful: Names of points whose heights are not believed.
    """

    height_m: float
    rise: FloatArray
    relief: Relief
    off_m: FloatArray
    doubtful: tuple[str, ...]

    @property
    def text(self) -> str:
        """What it says of the ground, for people."""
        return f"ground that slopes by {self.slope_deg:.1f} degrees, give or take {self.relief.sigma_m:.2f} m"

    @property
    def warnings(self) -> list[str]:
        """What an operator should look at."""
        if not self.doubtful:
            return []
        names = ", ".join(map(repr, self.doubtful))
        return [f"the others contradict the height (z_m) of {names}, which is left out: a mistake, or no ground"]

    def describe(self) -> dict[str, Any]:
        """Return what it is, for the record; JSON types only."""
        return {
            "slope_deg": self.slope_deg,
            "rise_east": float(self.rise[0]),
            "rise_north": float(self.rise[1]),
            "relief_sigma_m": self.relief.sigma_m,
            "off_m": self.off_m.tolist(),
        }

    @property
    def slope_deg(self) -> float:
        """How steep it is."""
        return float(np.rad2deg(np.arctan(np.hypot(*self.rise))))

    @property
    def plane_to_site(self) -> FloatArray:
        """(3, 3) rotation from the plane's frame to the site's; where the plane is level both have the same axes.

        The origin of the plane's frame is on the plane, above or below the site's.
        """
        normal = np.array([-self.rise[0], -self.rise[1], 1.0])
        normal /= np.linalg.norm(normal)
        axis = np.array([-normal[1], normal[0], 0.0])
        sine = float(np.linalg.norm(axis))
        angle = np.arctan2(sine, normal[2])
        return rotation_from_vector(axis * (angle / sine if sine > 1e-12 else 1.0))

    def in_plane(self, xy_m: FloatArray, off_m: FloatArray) -> FloatArray:
        """Return (N, 3) points in the plane's frame.

        Args:
            xy_m: (N, 2) site frame.
            off_m: (N,) how far they are above the plane.
        """
        points_m = np.column_stack([xy_m, xy_m @ self.rise + off_m])
        in_frame: FloatArray = points_m @ self.plane_to_site
        return in_frame


def fit_heights(points_m: FloatArray, heights_m: FloatArray, names: Sequence[str]) -> HeightPlane:
    """Fit a plane to heights, without those that the others contradict.

    Args:
        points_m: (N, 2) where the points are, site frame.
        heights_m: (N,) upwards, from any level; NaN where none was measured.
        names: N names, for errors.

    Raises:
        GroundError: Fewer than three heights, heights on a line, or of no ground that a plane is.
    """
    given = np.flatnonzero(np.isfinite(heights_m))
    named = [names[k] for k in given.tolist()]
    _check_spread(points_m[given], named)
    terms = np.column_stack([np.ones(len(given)), points_m[given]])
    heights = heights_m[given]
    off = heights - terms @ _most_agreed(terms, heights)
    believed = np.abs(off) <= _DOUBTFUL * _scatter(off)
    inlying = terms[believed]
    plane = np.asarray(np.linalg.lstsq(inlying, heights[believed], rcond=None)[0], dtype=np.float64)
    off = heights - terms @ plane
    squares = float((off[believed] ** 2).sum()) + _USUAL_COUNTS * _USUAL_RELIEF_M**2
    sigma_m = float(np.sqrt(squares / (_USUAL_COUNTS + max(int(believed.sum()) - 3, 0))))
    _check_ground(plane, sigma_m, points_m[given])
    off_m = np.zeros(len(points_m))
    off_m[given[believed]] = off[believed]
    return HeightPlane(
        height_m=float(plane[0]),
        rise=plane[1:],
        relief=Relief(sigma_m, sigma_m**2 * np.linalg.inv(inlying.T @ inlying), inlying[:, 1:]),
        off_m=off_m,
        doubtful=tuple(name for name, good in zip(named, believed, strict=True) if not good),
    )


def laid_on_plane(
    plane: HeightPlane, seen_px: FloatArray, ideal_px: FloatArray, points_m: FloatArray, camera: CameraPrior
) -> tuple[FloatArray, bool]:
    """Move points in the picture to where they would be seen on the plane.

    Args:
        plane: Through their heights.
        seen_px: (N, 2) as seen.
        ideal_px: (N, 2) the same without lens distortion.
        points_m: (N, 2) where they are, site frame.
        camera: The lens; one that is roughly known will do, because only the move depends on it.

    Returns:
        (N, 2) without lens distortion, and whether a camera was found that sees the points so; the points as they are
        where not.
    """
    if not plane.off_m.any():
        return ideal_px, True
    points = plane.in_plane(points_m, plane.off_m)
    try:
        view = belief_from_points(camera, PointObservation("points", points, seen_px, np.ones(len(points)))).state.view
    except GroundError:
        return ideal_px, False
    lens = view.camera
    straight = Camera(lens.width_px, lens.height_px, lens.matrix, np.zeros(5))
    pinhole = View(straight, view.position_m, view.site_to_camera)
    shift_px = pinhole.project(plane.in_plane(points_m, np.zeros(len(points)))) - pinhole.project(points)
    return ideal_px + shift_px, True


def _most_agreed(terms: FloatArray, heights: FloatArray) -> FloatArray:
    """Return (3,) the plane through three of the heights that half of all are nearest to (Rousseeuw 1984)."""
    best, least = np.linalg.lstsq(terms, heights, rcond=None)[0], np.inf
    if len(heights) < 5:
        return np.asarray(best, dtype=np.float64)
    extent = float(np.ptp(terms[:, 1:], axis=0).max())
    for three in islice(combinations(range(len(heights)), 3), _MOST_TRIALS):
        corners = terms[list(three)]
        if abs(np.linalg.det(corners)) < _ON_A_LINE * extent**2:
            continue
        plane = np.linalg.solve(corners, heights[list(three)])
        median = float(np.median(np.abs(heights - terms @ plane)))
        if median < least:
            best, least = plane, median
    return np.asarray(best, dtype=np.float64)


def _scatter(off_m: FloatArray) -> float:
    """Return the standard deviation of residuals of which some may be mistakes; kerbs and mounds are none.

    Source:
        Rousseeuw and Leroy, Robust Regression and Outlier Detection, 1987, section 5.1, with its correction for the
        few residuals that are nearly nought because the plane goes through three of them.
    """
    few = 1.0 + 5.0 / max(len(off_m) - 3, 1)
    return max(1.4826 * few * float(np.median(np.abs(off_m))), _MOUND_M)


def _check_spread(points_m: FloatArray, names: Sequence[str]) -> None:
    if len(points_m) < 3:
        found = f"{len(points_m)}: {', '.join(map(repr, names))}"
        fix = "measure z_m of more points, or leave it out everywhere"
        raise GroundError(expected="heights (z_m) of three or more points", found=found, fix=fix)
    across = np.linalg.svd(points_m - points_m.mean(axis=0), compute_uv=False)
    if across[1] < _ON_A_LINE * across[0]:
        listed = ", ".join(map(repr, names))
        fix = "measure z_m of points off that line"
        raise GroundError(expected="heights (z_m) that are not on one line", found=f"{listed} on one", fix=fix)


def _check_ground(plane: FloatArray, sigma_m: float, points_m: FloatArray) -> None:
    slope_deg = float(np.rad2deg(np.arctan(np.hypot(plane[1], plane[2]))))
    if slope_deg > _STEEPEST_DEG:
        found = f"heights (z_m) of a slope of {slope_deg:.0f} degrees"
        raise GroundError(expected=f"ground less steep than {_STEEPEST_DEG:.0f} degrees", found=found, fix=_FIX)
    extent_m = float(np.ptp(points_m, axis=0).max())
    if sigma_m > max(_ROUGHEST * extent_m, _USUAL_RELIEF_M):
        found = f"heights (z_m) {sigma_m:.1f} m off their plane, over {extent_m:.0f} m of ground"
        raise GroundError(expected="ground that is about a plane", found=found, fix=_FIX)
