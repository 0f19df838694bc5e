"""Where each track stands on the ground, how sure that is, and how fast it moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from standoff.core import homography, protocols
from standoff.core.classes import CLASSES
from standoff.core.durations import ROUNDING_S, has_lasted
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.map_error import factor, map_jacobian
from standoff.core.polygon import inside
from standoff.core.types import GroundMap, GroundPositions, NoGroundMap, TextArray, Tracks
from standoff.stages.locate import class_prior
from standoff.stages.locate.ground_filter import GroundFilter
from standoff.stages.locate.params import LocateParams
from standoff.stages.locate.uncertainty import horizon_margin, own_covariance, relief_covariance

CUT_OFF = "cut off by the picture's edge"
OUTSIDE_LENS = "outside the lens model"
BEYOND_HORIZON = "beyond the horizon"
NEAR_HORIZON = "too near the horizon"
OUTSIDE_MAP = "outside the ground map"
NOT_SEEN = "not seen any more"

_EDGE_SIGMAS = 2.0
_WHOLE_S = 0.3
"""What was cut off just before is, its box being loose, cut off still."""
_TOP_COUNTS_BELOW = 0.9
"""Level in the box below which an anchor moves with the upper edge by more than with anything else."""


class _Measured(NamedTuple):
    """What one frame tells of each track, (M,) rows; NaN where it tells nothing.

    Attributes:
        xy_m: (M, 2).
        point_m2: (M, 2, 2) its covariance from the point in the picture.
        lasting_m2: (M, 2, 2) from what does not change while a track is seen: its shape, the ground's.
        shared_m2: (M, 2, 2) from the map.
        reason: (M,) why it tells nothing.
    """

    xy_m: FloatArray
    point_m2: FloatArray
    lasting_m2: FloatArray
    shared_m2: FloatArray
    reason: TextArray


class Locator(protocols.Locator):
    """Place each track of one stream on the ground.

    One point stands for the entity and is taken to lie on the ground plane: the detector's own ground point, whose
    error it states, or where it gives none the place in the box where things of its class usually stand. What a box
    leaves open of a machine, two metres of an excavator, is in the covariance. Where the bottom centre of the box is
    asked for, that is a machine's near side, not its middle, and the covariance covers the error of the box alone.

    Args:
        params: Settings; the defaults when left out.
    """

    def __init__(self, params: LocateParams | None = None) -> None:
        self._params = params or LocateParams()
        self._filter = GroundFilter()
        self._cut_off_s: dict[int, float] = {}
        self._factored: tuple[GroundMap, FloatArray] | None = None
        self._site_frame = 0
        self._class_radius_m = np.array([self._params.radius_m.get(c.name, c.action_radius_m) for c in CLASSES])

    def update(self, time_s: float, tracks: Tracks, ground: GroundMap | NoGroundMap) -> GroundPositions:
        """Locate all tracks of one frame.

        Args:
            time_s: Presentation timestamp.
            tracks: The live tracks; what is remembered of others is dropped.
            ground: The frame's map, or why there is none.

        Returns:
            Row i belongs to track i. A row is measured where its track is observed and its box or ground point tells
            where it stands; otherwise predicted, for `predict_s`; then invalid, with its reason: that there is no map,
            that the box may go on outside the picture so that its anchor was not seen (a ground point knows), that it
            is outside the lens model, at or beyond the horizon, or outside the map's polygon. Nothing is predicted
            where there is no map. A velocity is NaN until it is known better than what things of its class do anyway.
        """
        if isinstance(ground, NoGroundMap):
            return self._nowhere(tracks, f"no ground map: {ground.reason}")
        if ground.site_frame != self._site_frame:
            # Places of two site frames make no motion.
            self._filter.reset()
            self._site_frame = ground.site_frame
        measured = self._measure(tracks, ground)
        self._stay_cut_off(time_s, tracks, measured.reason)
        taken = (measured.reason == "") & tracks.observed
        filtered = self._filter.update(
            time_s, tracks.track_id, tracks.class_id, np.where(taken[:, None], measured.xy_m, np.nan),
            self._params.white_share * measured.point_m2,
            (1.0 - self._params.white_share) * measured.point_m2 + measured.lasting_m2, measured.shared_m2,
        )  # fmt: skip
        mean, covariance = filtered.mean, filtered.covariance
        if not self._params.smooth:
            mean[taken, :2] = measured.xy_m[taken]
            covariance[taken, :2, :2] = (measured.point_m2 + measured.lasting_m2)[taken]
        placed = time_s - filtered.seen_s <= self._params.predict_s + ROUNDING_S
        there_px, ahead = homography.apply(homography.invert(ground.image_to_ground), mean[:, :2])
        placed &= ahead
        mean[~placed], covariance[~placed] = np.nan, np.nan
        there_px = np.where(placed[:, None], there_px, np.nan)
        return GroundPositions(
            track_id=tracks.track_id,
            class_id=tracks.class_id,
            xy_m=mean[:, :2],
            velocity_mps=np.where(filtered.velocity_known[:, None], mean[:, 2:], np.nan),
            state_covariance=covariance,
            map_factor_m=map_jacobian(ground, there_px) @ self._root(ground),
            predicted=placed & (filtered.seen_s < time_s),
            standing_s=np.where(placed, filtered.standing_s, np.nan),
            radius_m=self._radii(tracks),
            valid=placed,
            reason=np.where(placed, "", np.where(measured.reason == "", NOT_SEEN, measured.reason)),
        )

    def reset(self) -> None:
        """Forget all tracks."""
        self._filter.reset()
        self._cut_off_s = {}
        self._factored = None

    def _stay_cut_off(self, time_s: float, tracks: Tracks, reason: TextArray) -> None:
        """Let what was cut off a moment ago be so still, in place, and remember what is."""
        ids = tracks.track_id.tolist()
        since = {track: at_s for track, at_s in self._cut_off_s.items() if track in ids}
        for row, track in enumerate(ids):
            if reason[row] == CUT_OFF:
                since[track] = time_s
            elif reason[row] == "" and not has_lasted(since.get(track, -np.inf), time_s, _WHOLE_S):
                reason[row] = CUT_OFF
        self._cut_off_s = since

    def _nowhere(self, tracks: Tracks, reason: str) -> GroundPositions:
        count = len(tracks)
        return GroundPositions(
            track_id=tracks.track_id,
            class_id=tracks.class_id,
            xy_m=np.full((count, 2), np.nan),
            velocity_mps=np.full((count, 2), np.nan),
            state_covariance=np.full((count, 4, 4), np.nan),
            map_factor_m=np.full((count, 2, 10), np.nan),
            predicted=np.zeros(count, dtype=np.bool_),
            standing_s=np.full(count, np.nan),
            radius_m=self._radii(tracks),
            valid=np.zeros(count, dtype=np.bool_),
            reason=np.full(count, reason, dtype=object),
        )

    def _measure(self, tracks: Tracks, ground: GroundMap) -> _Measured:
        """Place all tracks by this frame alone."""
        level = self._levels(tracks, ground)
        seen_px, seen_covariance_px2 = self._standing(tracks, level)
        points_px = ground.undistorted(seen_px)
        root = self._root(ground)
        margin = horizon_margin(ground, root, points_px, seen_covariance_px2)
        reason = self._reasons(tracks, level, ground, points_px, margin)
        points_px = np.where((reason == "")[:, None], points_px, np.nan)
        xy_m, _ = homography.apply(ground.image_to_ground, points_px)
        factor_m = map_jacobian(ground, points_px) @ root
        lasting_m2 = relief_covariance(ground, points_px, self._params.relief_sigma_m)
        lasting_m2 += self._prior_variance_m2(tracks)[:, None, None] * np.eye(2)
        point_m2 = own_covariance(ground, points_px, seen_covariance_px2)
        return _Measured(xy_m, point_m2, lasting_m2, factor_m @ factor_m.transpose(0, 2, 1), reason)

    def _has_point(self, tracks: Tracks) -> BoolArray:
        """Tell (M,) which tracks are placed by their own ground point."""
        if self._params.anchor != "ground_point":
            return np.zeros(len(tracks), dtype=np.bool_)
        return np.asarray(np.isfinite(tracks.foot_px).all(axis=1))

    def _levels(self, tracks: Tracks, ground: GroundMap) -> FloatArray:
        """Return (M,) where the anchor lies between the upper edge of each box, 0, and its lower, 1."""
        if self._params.anchor != "ground_point":
            return np.full(len(tracks), 0.5 if self._params.anchor == "box_centre" else 1.0)
        centre_px = ground.undistorted((tracks.xyxy_px[:, :2] + tracks.xyxy_px[:, 2:]) / 2.0)
        return class_prior.levels(tracks.class_id, class_prior.sines_of_view(ground, centre_px))

    def _prior_variance_m2(self, tracks: Tracks) -> FloatArray:
        """Return (M,) variance of each coordinate that a box leaves open, where its class says where it stands."""
        leaves_open = ~self._has_point(tracks) & (self._params.anchor == "ground_point")
        variance_m2: FloatArray = np.where(leaves_open, class_prior.SIGMA_M[tracks.class_id] ** 2, 0.0)
        return variance_m2

    def _standing(self, tracks: Tracks, level: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (M, 2) the point of each track that stands on the ground, as seen, and its (M, 2, 2) covariance."""
        own = self._has_point(tracks)
        points_px = np.where(own[:, None], tracks.foot_px, self._anchors(tracks, level))
        anchor_px2 = self._anchor_variance(tracks, level)[:, :, None] * np.eye(2)
        covariance_px2 = np.where(own[:, None, None], tracks.foot_covariance_px2, anchor_px2)
        return points_px, covariance_px2

    @staticmethod
    def _anchors(tracks: Tracks, level: FloatArray) -> FloatArray:
        left, top, right, bottom = tracks.xyxy_px.T
        return np.column_stack([(left + right) / 2.0, (1.0 - level) * top + level * bottom])

    def _edge_sigma(self, tracks: Tracks) -> FloatArray:
        """Return (M, 2) standard error in pixels of a vertical and of a horizontal edge of each box."""
        sides_px = tracks.xyxy_px[:, 2:] - tracks.xyxy_px[:, :2]
        return np.maximum(self._params.edge_sigma_fraction * sides_px, self._params.edge_sigma_floor_px)

    def _anchor_variance(self, tracks: Tracks, level: FloatArray) -> FloatArray:
        """Return (M, 2) variance of the anchor: a mean of two independent edges has half that of one."""
        shares = np.column_stack([np.full(len(level), 0.5), (1.0 - level) ** 2 + level**2])
        variance_px2: FloatArray = self._edge_sigma(tracks) ** 2 * shares
        return variance_px2

    def _cut_off(self, tracks: Tracks, level: FloatArray, size_px: tuple[int, int]) -> BoolArray:
        """Tell (M,) which boxes may go on outside the picture on a side that their anchor depends on."""
        margin_px = np.maximum(_EDGE_SIGMAS * self._edge_sigma(tracks), self._params.cut_off_margin_px)
        # The outermost pixels have their centres on 0 and size - 1, their outer edges half a pixel further.
        touches_low = tracks.xyxy_px[:, :2] < margin_px - 0.5
        touches_high = tracks.xyxy_px[:, 2:] > np.array(size_px) - 0.5 - margin_px
        cut_off: BoolArray = touches_low[:, 0] | touches_high.any(axis=1)
        cut_off |= touches_low[:, 1] & (level < _TOP_COUNTS_BELOW)
        return cut_off & ~self._has_point(tracks)

    def _reasons(
        self, tracks: Tracks, level: FloatArray, ground: GroundMap, points_px: FloatArray, margin: FloatArray
    ) -> TextArray:
        """Return (M,) why each track cannot be located, the first cause that applies; empty where it can."""
        _, mapped = homography.apply(ground.image_to_ground, points_px)
        causes = (
            (self._cut_off(tracks, level, ground.image_size_px), CUT_OFF),
            (~np.isfinite(points_px).all(axis=1), OUTSIDE_LENS),
            (~mapped, BEYOND_HORIZON),
            (margin < self._params.horizon_sigmas, NEAR_HORIZON),
            (~inside(ground.valid_px, points_px) & (len(ground.valid_px) > 0), OUTSIDE_MAP),
        )
        reason = np.full(len(tracks), "", dtype=object)
        for affected, text in reversed(causes):
            reason[affected] = text
        return reason

    def _root(self, ground: GroundMap) -> FloatArray:
        """Return the factor of the map's covariance; a fixed camera's map is factored once."""
        if self._factored is None or self._factored[0] is not ground:
            self._factored = (ground, factor(ground.covariance))
        return self._factored[1]

    def _radii(self, tracks: Tracks) -> FloatArray:
        own = self._params.track_radius_m
        by_class = self._class_radius_m[tracks.class_id]
        pairs = zip(tracks.track_id.tolist(), by_class.tolist(), strict=True)
        return np.array([own.get(track, radius_m) for track, radius_m in pairs], dtype=np.float64)
