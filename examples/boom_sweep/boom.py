"""Which way an excavator's boom points, from the boxes in which it was seen: a particle filter for each machine.

One box says little: a boom that is curled in looks like one that points away. But size, place and build of a machine
stay while it swings, so the boxes of some seconds together tell them, and with them the direction. What is drawn is a
coarse skeleton of an excavator (tracks, house, counterweight, boom, bucket) whose box in the picture has to be the one
that was seen.

Source:
    Gordon, Salmond and Smith, Novel approach to nonlinear/non-Gaussian Bayesian state estimation, 1993.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import GroundError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import View, view_from_homography
from standoff.core.types import GroundMap, Tracks

_EXCAVATOR: Final = CLASS_BY_NAME["excavator"].id
_PARTICLES: Final = 2000
"""With 400 a view in twenty was locked onto a wrong direction that looked certain."""
_EVERY_S: Final = 0.2 - 1e-6
_LOOKS, _FORGOTTEN_S = 10, 0.5
"""Looks before a direction is told, and the time for which one holds after the last look."""
_MARGIN_PX: Final = 2.0
"""A box that comes so near to the picture's edge may be cut off."""
_FRESH: Final = 0.03
"""Share of particles that are drawn anew at each look, so that a wrong direction is found out."""
_WEIGHT: Final = 0.3
"""Boxes of one machine err together for half a second, so each of five a second counts as a third of an observation."""
_EDGE_SHARE = np.array([0.09, 0.08, 0.13, 0.07])
"""Standard error of the left, top, right and bottom edge by the box's side: the detector's, and the skeleton's own."""
_EDGE_PX: Final = 2.5
_PLACE_SIGMA_M: Final = 0.3
"""The least error of the centre of swing: a ground point is of the footprint, whose middle is about there."""

_SIZE_SIGMA: Final = 0.22
_SWING_RADPS, _SWINGS_S = 0.45, 1.0
"""Standard deviation of the swing's rate, and for how long it is kept."""
_MOVES_S: Final = 3.0
_REACH_M, _APEX_M, _TIP_M = (7.0, 1.5), (4.8, 1.0), (1.2, 1.4)
"""Mean and standard deviation, of a machine of 20 t: the bucket's distance, the boom's highest point, the tip's."""

_RING = np.stack([2.0 * np.cos(np.arange(8) * np.pi / 4.0), 2.0 * np.sin(np.arange(8) * np.pi / 4.0)], axis=1)
"""(8, 2) of the tracks, which turn for themselves."""
_HOUSE = np.array(
    [
        *((x, y, z) for x, y in ((1.2, 1.35), (1.2, -1.35), (-2.6, 1.2), (-2.6, -1.2)) for z in (1.0, 2.3)),
        (0.8, 0.9, 3.0), (-0.4, 0.9, 3.0), (0.8, -0.9, 2.6),
    ]
)  # fmt: skip
"""(11, 3) ahead, left and up, of what swings along: house, cab and counterweight."""

NOT_TOLD = np.full(4, np.nan)


class Booms:
    """The booms of one stream's excavators, looked at five times a second."""

    def __init__(self) -> None:
        self._booms: dict[int, _Boom] = {}

    def reset(self) -> None:
        """Forget all machines."""
        self._booms = {}

    def update(
        self, time_s: float, tracks: Tracks, ground: GroundMap, xy_m: FloatArray, covariance_m2: FloatArray
    ) -> FloatArray:
        """Look at all excavators of a frame.

        Args:
            time_s: Presentation timestamp.
            tracks: Of the frame.
            ground: Its map; without a camera nothing is told, because heights in the picture are not known.
            xy_m: (M, 2) where the tracks stand; NaN where that is unknown.
            covariance_m2: (M, 2, 2) of these.

        Returns:
            (M, 4) direction, counter-clockwise from x, and its standard error, rad; the swing's rate and its standard
            error, rad/s. NaN where it is not told: no excavator, or seen too shortly, cut off, or not now.
        """
        told: FloatArray = np.full((len(tracks), 4), np.nan)
        rows = np.flatnonzero((tracks.class_id == _EXCAVATOR) & np.isfinite(xy_m).all(axis=1))
        view = _view(ground) if len(rows) else None
        ids = tracks.track_id[rows].tolist()
        self._booms = {track: boom for track, boom in self._booms.items() if track in ids}
        if view is None:
            return told
        far_px = np.array(ground.image_size_px) - 1.0 - _MARGIN_PX
        within = np.concatenate([tracks.xyxy_px[:, :2] > _MARGIN_PX, tracks.xyxy_px[:, 2:] < far_px], axis=1)
        whole: BoolArray = np.asarray(within.all(axis=1))
        for row, track in zip(rows.tolist(), ids, strict=True):
            if tracks.observed[row] and whole[row]:
                boom = self._booms.get(track)
                if boom is None:
                    boom = self._booms[track] = _Boom.drawn(time_s, track, covariance_m2[row])
                boom.look(time_s, view, tracks.xyxy_px[row], xy_m[row])
            if track in self._booms:
                told[row] = self._booms[track].told(time_s)
        return told


def _view(ground: GroundMap) -> View | None:
    if ground.camera is None:
        return None
    try:
        return view_from_homography(ground.image_to_ground, ground.camera)
    except GroundError:
        return None


@dataclass(slots=True)
class _Boom:
    """What is believed of one machine: (P,) each.

    Attributes:
        rng: Its own, so that machines do not depend on each other.
        size: Against one of 20 t.
        off_m: (P, 2) of the centre of swing from where the track stands.
        swing_rad: Direction of the boom.
        rate_radps: Of the swing.
        reach_m: Of the bucket; this and the next two in units of the machine's size.
        apex_m: Height of the boom's highest point.
        tip_m: Height of the bucket.
        looked_s: When it was last looked at.
        looks: How often.
        now: What is told, as a row of `Booms.update`.
    """

    rng: np.random.Generator
    size: FloatArray
    off_m: FloatArray
    swing_rad: FloatArray
    rate_radps: FloatArray
    reach_m: FloatArray
    apex_m: FloatArray
    tip_m: FloatArray
    looked_s: float
    looks: int
    now: FloatArray

    @classmethod
    def drawn(cls, time_s: float, track_id: int, covariance_m2: FloatArray) -> _Boom:
        """Draw what can be, before the first look."""
        rng, count = np.random.default_rng([track_id, 20]), _PARTICLES
        off_m = rng.multivariate_normal(np.zeros(2), covariance_m2 + _PLACE_SIGMA_M**2 * np.eye(2), count)
        return cls(
            rng=rng,
            size=np.exp(rng.normal(0.0, _SIZE_SIGMA, count)),
            off_m=off_m,
            swing_rad=rng.uniform(0.0, 2.0 * np.pi, count),
            rate_radps=rng.normal(0.0, _SWING_RADPS, count),
            reach_m=rng.normal(*_REACH_M, count),
            apex_m=rng.normal(*_APEX_M, count),
            tip_m=rng.normal(*_TIP_M, count),
            looked_s=time_s,
            looks=0,
            now=NOT_TOLD,
        )

    def told(self, time_s: float) -> FloatArray:
        """Return the row of `Booms.update` at a time."""
        return self.now if self.looks >= _LOOKS and time_s - self.looked_s <= _FORGOTTEN_S else NOT_TOLD

    def look(self, time_s: float, view: View, box_px: FloatArray, xy_m: FloatArray) -> None:
        """Take in a box (4,), unless the last one was taken in just before."""
        if self.looks and time_s - self.looked_s < _EVERY_S:
            return
        self._move(time_s - self.looked_s)
        weights = self._weights(view, box_px, xy_m)
        self.looked_s, self.looks = time_s, self.looks + 1
        if weights is None:
            return
        mean = float(np.angle(weights @ np.exp(1j * self.swing_rad)))
        apart = np.angle(np.exp(1j * (self.swing_rad - mean)))
        rate = float(weights @ self.rate_radps)
        spread = weights @ apart**2, weights @ (self.rate_radps - rate) ** 2
        self.now = np.array([mean, np.sqrt(spread[0]), rate, np.sqrt(spread[1])])
        self._resample(weights)

    def _move(self, step_s: float) -> None:
        """Go on to the next look."""
        rng, count = self.rng, len(self.size)
        kept = np.exp(-step_s / _SWINGS_S)
        self.rate_radps = kept * self.rate_radps + np.sqrt(1.0 - kept**2) * rng.normal(0.0, _SWING_RADPS, count)
        self.swing_rad = self.swing_rad + self.rate_radps * step_s
        kept = np.exp(-step_s / _MOVES_S)
        for name, (mean, sigma) in (("reach_m", _REACH_M), ("apex_m", _APEX_M), ("tip_m", _TIP_M)):
            drawn = rng.normal(0.0, sigma, count)
            setattr(self, name, mean + kept * (getattr(self, name) - mean) + np.sqrt(1.0 - kept**2) * drawn)
        self.off_m = self.off_m + rng.normal(0.0, 0.03, (count, 2))
        self.size = self.size * np.exp(rng.normal(0.0, 0.004, count))
        fresh = rng.random(count) < _FRESH
        some = int(fresh.sum())
        self.swing_rad[fresh], self.rate_radps[fresh] = rng.uniform(0.0, 2.0 * np.pi, some), rng.normal(0.0, 0.3, some)
        for name, usual in (("reach_m", _REACH_M), ("apex_m", _APEX_M), ("tip_m", _TIP_M)):
            getattr(self, name)[fresh] = rng.normal(*usual, some)

    def _weights(self, view: View, box_px: FloatArray, xy_m: FloatArray) -> FloatArray | None:
        """Return (P,) how well each explains a box, adding up to one; None where none does."""
        points_m = self._points_m()
        points_m[:, :, :2] += (self.off_m + xy_m)[:, None]
        seen_px = view.project(points_m.reshape(-1, 3)).reshape(len(points_m), -1, 2)
        boxes_px = np.concatenate([seen_px.min(axis=1), seen_px.max(axis=1)], axis=1)
        sides_px = np.tile(boxes_px[:, 2:] - boxes_px[:, :2], 2)
        sigma_px = np.hypot(_EDGE_SHARE * sides_px, _EDGE_PX)
        likely = -0.5 * (((box_px - boxes_px) / sigma_px) ** 2).sum(axis=1) - np.log(sigma_px).sum(axis=1)
        if not np.isfinite(likely).any():
            return None
        weights = np.nan_to_num(np.exp(_WEIGHT * (likely - np.nanmax(likely))))
        return np.asarray(weights / weights.sum(), dtype=np.float64)

    def _points_m(self) -> FloatArray:
        """Return (P, 30, 3) the skeletons about their centres of swing."""
        count, zero, side = len(self.size), np.zeros_like(self.size), np.full_like(self.size, 0.6)
        ring = np.broadcast_to(np.column_stack([_RING, np.zeros(8)]), (count, 8, 3))
        arm = [
            (0.42 * self.reach_m, zero, self.apex_m),
            (0.6 * self.reach_m, zero, self.apex_m),
            (0.85 * self.reach_m, zero, 0.5 * (self.apex_m + self.tip_m)),
            *((self.reach_m, sign * side, self.tip_m) for sign in (1.0, -1.0)),
            *((0.95 * self.reach_m, sign * side, self.tip_m + 1.0) for sign in (1.0, -1.0)),
        ]
        swung = np.concatenate(
            [np.broadcast_to(_HOUSE, (count, *_HOUSE.shape)), np.array(arm).transpose(2, 0, 1)], axis=1
        )
        cos, sin = np.cos(self.swing_rad)[:, None], np.sin(self.swing_rad)[:, None]
        x, y, z = np.moveaxis(swung, 2, 0)
        turned = np.stack([x * cos - y * sin, x * sin + y * cos, z], axis=2)
        points_m: FloatArray = np.concatenate([ring, turned], axis=1) * self.size[:, None, None]
        return points_m

    def _resample(self, weights: FloatArray) -> None:
        """Draw as many again by their weights, evenly (Kitagawa 1996)."""
        at = (np.arange(len(weights)) + self.rng.random()) / len(weights)
        kept = np.searchsorted(np.cumsum(weights), at).clip(0, len(weights) - 1)
        for name in ("size", "off_m", "swing_rad", "rate_radps", "reach_m", "apex_m", "tip_m"):
            setattr(self, name, getattr(self, name)[kept])
