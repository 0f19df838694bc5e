"""The picture from which the motion counts, its points, and how they are found again in another one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.stages.motion.follow import follow_points
from standoff.stages.motion.lens import Lens
from standoff.stages.motion.movers import inside
from standoff.stages.motion.params import MotionParams
from standoff.stages.motion.picture import FollowedPicture
from standoff.stages.motion.plane import PlaneMotion, fit_plane
from standoff.stages.motion.plane_rounds import MIN_PAIRS, expect_points

_MORE = 4
_TRUST_STEP = 0.25
_TRUSTED = 0.4
_FEWER_INLIERS = 0.6
"""Share of the first picture's points of the ground below which a keyframe is worn out."""

_CELLS = (4, 3)
_LEAST_CELLS = 3
"""Parts of the picture in which there must be ground: what lies in one corner says nothing of the rest."""


@dataclass(frozen=True, slots=True)
class Match:
    """A keyframe found again.

    Attributes:
        plane: How the ground moved, from the keyframe's pixels to the picture's, without lens distortion.
        in_view: How many of the keyframe's points are in the picture and not behind something that moves.
        inliers: How many of those move with the ground.
        noise_px: Standard error of a point along an axis by how the residuals changed since the picture before; NaN
            where it is not known.
        surprise_px: How far the points of the ground were from where they were looked for, the median; followed px.
        seen_px: (K, 2) each: points of the keyframe, and where they are in the picture; as seen, lens and all.
    """

    plane: PlaneMotion
    in_view: int
    inliers: int
    noise_px: float
    surprise_px: float
    seen_px: tuple[FloatArray, FloatArray]


@dataclass(slots=True, eq=False)
class _Points:
    """Points of a keyframe.

    Attributes:
        small_px: (N, 2) followed pixels.
        ideal_px: (N, 2) frame pixels without lens distortion.
        trust: (N,) how often each moved with the ground of late, 0 to 1.
        residual_px: (N, 2) how far each was from its place in the picture before; NaN unknown.
    """

    small_px: FloatArray
    ideal_px: FloatArray
    trust: FloatArray
    residual_px: FloatArray

    @classmethod
    def of(cls, small_px: FloatArray, picture: FollowedPicture, lens: Lens) -> _Points:
        """Take points of a picture, those that its lens can see."""
        ideal_px = lens.undistorted(picture.to_full(small_px))
        known = np.isfinite(ideal_px).all(axis=1)
        small_px, ideal_px = small_px[known], ideal_px[known]
        return cls(small_px, ideal_px, np.ones(len(small_px)), np.full_like(small_px, np.nan))


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Points of a keyframe that were followed to another picture.

    Attributes:
        which: (K,) of the keyframe's points.
        target_px: (K, 2) where they are, as seen.
        target: (K, 2) the same without distortion.
        off_px: (K,) how far from where they were looked for; followed px.
        in_view: How many were looked for.
    """

    which: IntArray
    target_px: FloatArray
    target: FloatArray
    off_px: FloatArray
    in_view: int


class Keyframe:
    """A picture and well-textured points spread over it.

    A point that has moved otherwise than the ground is trusted less, so that a second plane, a roof or a lorry that no
    detector knows, does not become the ground from one picture to the next.

    Args:
        picture: The keyframe.
        movers_px: (M, 4) boxes in frame pixels in which nothing is ground.
        lens: At the frame's size.
        params: Settings.
    """

    def __init__(self, picture: FollowedPicture, movers_px: FloatArray, lens: Lens, params: MotionParams) -> None:
        self.picture = picture
        self.lens, self._params = lens, params
        edge = params.window_px // 2 + 1
        self._points = _Points.of(picture.corners(params.points, movers_px, edge), picture, lens)
        self._more_points = _Points.of(picture.corners(_MORE * params.points, movers_px, edge), picture, lens)
        self._first_inliers = 0

    @property
    def usable(self) -> bool:
        """Whether there is enough to follow."""
        small_px = self._points.small_px
        return len(small_px) >= self._params.min_points and _is_spread(small_px, self.picture)

    def find(self, picture: FollowedPicture, expected: FloatArray, movers_px: FloatArray, levels: int) -> Match | None:
        """Look for the keyframe's ground in another picture.

        Args:
            picture: Of the same size.
            expected: (N, 2) where its points may be, frame pixels without distortion; see `expect`.
            movers_px: (M, 4) boxes in frame pixels in which nothing is ground.
            levels: How often the pictures are halved: not at all where the expectation is good.

        Returns:
            None where too few points move alike.
        """
        return self._found(self._points, picture, expected, movers_px, levels)

    def find_better(self, picture: FollowedPicture, match: Match, movers_px: FloatArray) -> Match:
        """Look again with many more points, where an error would stay: in a picture that becomes the keyframe.

        Returns:
            The match as it is where that fails.
        """
        expected, _ = homography.apply(match.plane.matrix, self._more_points.ideal_px)
        better = self._found(self._more_points, picture, expected, movers_px, 0)
        return match if better is None else replace(match, plane=better.plane, seen_px=better.seen_px)

    def _found(
        self, points: _Points, picture: FollowedPicture, expected: FloatArray, movers_px: FloatArray, levels: int
    ) -> Match | None:
        start_px = self.lens.distorted(expected)
        seen = self._in_view(picture, start_px, movers_px)
        if np.count_nonzero(seen) < self._params.min_points:
            return None
        end_px, good = follow_points(
            self.picture.gray,
            picture.gray,
            points.small_px[seen],
            picture.to_small(start_px[seen]),
            window_px=self._params.window_px,
            levels=levels,
            round_trip_px=self._params.round_trip_px,
        )
        target_px = picture.to_full(end_px)
        good &= ~inside(target_px, movers_px)
        target = self.lens.undistorted(target_px)
        good &= np.isfinite(target).all(axis=1)
        off_px = np.linalg.norm(end_px - picture.to_small(start_px[seen]), axis=1)[good]
        which = np.flatnonzero(seen)[good]
        return self._agreed(points, picture, _Found(which, target_px[good], target[good], off_px, int(seen.sum())))

    def expect(self, pose: FloatArray, step: FloatArray | None, ratio: float) -> FloatArray:
        """Return (N, 2) where the points should be: where they were last, and on by a share of the last step.

        Args:
            pose: (3, 3) motion from the keyframe to the picture before.
            step: (3, 3) from the one before that to the picture before; None if unknown.
            ratio: How many times that step.
        """
        back = np.eye(3) if step is None else homography.invert(step)
        return expect_points(self._points.ideal_px, pose, back, ratio)

    def is_worn_out(self, match: Match, centre_px: FloatArray) -> bool:
        """Say whether the view has changed so much since the keyframe that a new one is due.

        Args:
            match: Of the picture in question.
            centre_px: (2,) middle of the picture.
        """
        params = self._params
        self._first_inliers = self._first_inliers or match.inliers
        if match.in_view < params.min_overlap * len(self._points.small_px):
            return True
        if match.inliers < _FEWER_INLIERS * self._first_inliers:
            return True
        turned_rad, grown, shrunk = _turn_and_scales(match.plane.matrix, centre_px)
        return not (
            abs(turned_rad) <= np.deg2rad(params.max_turn_deg)
            and grown <= params.max_scale
            and shrunk >= 1.0 / params.max_scale
        )

    def _agreed(self, points: _Points, picture: FollowedPicture, found: _Found) -> Match | None:
        """Return what most of the points that were found again tell."""
        params, scale = self._params, float(picture.full_per_small.mean())
        which, target = found.which, found.target
        plane = fit_plane(
            points.ideal_px[which],
            target,
            trusted=points.trust[which] >= _TRUSTED,
            inlier_px=params.inlier_px * scale,
            followed_px=scale,
        )
        if plane is None:
            return None
        inliers = int(np.count_nonzero(plane.inlier))
        if inliers < max(params.min_points, params.min_inliers * found.in_view):
            return None
        if not _is_spread(picture.to_small(target[plane.inlier]), picture):
            return None
        points.trust[which] += _TRUST_STEP * (plane.inlier - points.trust[which])
        changed = (plane.residual_px - points.residual_px[which])[plane.inlier]
        points.residual_px[:] = np.nan
        points.residual_px[which] = plane.residual_px
        return Match(
            plane=plane,
            in_view=found.in_view,
            inliers=inliers,
            noise_px=_noise_px(changed),
            surprise_px=_median(found.off_px[plane.inlier]),
            seen_px=(self.picture.to_full(points.small_px[which]), found.target_px),
        )

    def _in_view(self, picture: FollowedPicture, start_px: FloatArray, movers_px: FloatArray) -> BoolArray:
        edge = self._params.window_px / 2.0
        small = picture.to_small(start_px)
        height, width = picture.gray.shape
        with np.errstate(invalid="ignore"):
            within = (small >= edge) & (small <= np.array([width, height]) - 1.0 - edge)
        seen: BoolArray = np.all(within, axis=1) & ~inside(start_px, movers_px)
        return seen


def _is_spread(small_px: FloatArray, picture: FollowedPicture) -> bool:
    height, width = picture.gray.shape
    # Without distortion a point may lie a little outside.
    cell = np.clip(small_px / np.array([width, height]) * _CELLS, 0, np.array(_CELLS) - 1).astype(np.int64)
    return int(np.count_nonzero(np.bincount(cell[:, 1] * _CELLS[0] + cell[:, 0]))) >= _LEAST_CELLS


def _turn_and_scales(matrix: FloatArray, point_px: FloatArray) -> tuple[float, float, float]:
    """Return by what a homography turns the picture at a point (2,), and its largest and smallest scale there.

    The turn is that of the nearest rotation. NaN beyond the horizon, and where the picture is mirrored.
    """
    jacobian = homography.point_jacobian(matrix, point_px)[0]
    (a, b), (c, d) = jacobian.tolist()
    alike, unlike = math.hypot(a + d, c - b) / 2.0, math.hypot(a - d, b + c) / 2.0
    if not alike > unlike:
        return math.nan, math.nan, math.nan
    return math.atan2(c - b, a + d), alike + unlike, alike - unlike


def _median(values: FloatArray) -> float:
    """Return the median of (N,), N >= 1, none of them NaN; of so few values sorting is quicker than `np.median`."""
    ordered = np.sort(values)
    return float(ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2.0


def _noise_px(changed_px: FloatArray) -> float:
    """Return what following adds at random, from the (N, 2) changes of the same points' residuals; NaN rows unknown.

    Heights change a residual slowly. The noise of both pictures changes it from one to the next, and a residual holds
    that of two pictures as well, the keyframe's and the last one's.
    """
    length = np.hypot(changed_px[:, 0], changed_px[:, 1])
    length = length[np.isfinite(length)]
    return _median(length) / 1.177 if len(length) >= MIN_PAIRS else np.nan
