"""Where a thing with a frame of its own stands on the site, and what seeing it says of the camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, SHIFT, View
from standoff.stages.ground.pose_filter import Estimate
from standoff.stages.ground.solid import HEIGHT, STATE, SolidState
from standoff.stages.ground.solid_fit import Belief, SolidFit

_FREE_RAD, _FREE_M = 3.0, 30.0
"""Standard errors of a place that nobody has told."""


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """A turn about the vertical and a shift over the ground, from a thing's own frame to the site's.

    Attributes:
        turn_rad: Counter-clockwise, seen from above.
        xy_m: (2,) where the own frame's origin lies on the site.
    """

    turn_rad: float
    xy_m: FloatArray

    @classmethod
    def identity(cls) -> Self:
        """Return that of a thing whose frame is the site's."""
        return cls(0.0, np.zeros(2))

    @classmethod
    def between(cls, own: View, site: View, middle_m: FloatArray, height_m: float) -> Self:
        """Return where a thing stands that one camera sees in its own frame and knows its own place on the site.

        Args:
            own: The camera in the thing's frame.
            site: The same camera on the site.
            middle_m: (2,) of the thing, its own frame.
            height_m: Of the thing above the ground.
        """
        turn_rad = site.heading_rad - own.heading_rad
        # Headings turn clockwise, seen from above.
        turn_rad = float(-np.arctan2(np.sin(turn_rad), np.cos(turn_rad)))
        seen_px = own.project(np.array([[*middle_m, height_m]]))
        on_site_m = site.to_plane(seen_px, height_m)[0]
        return cls(turn_rad, on_site_m - _rotation(turn_rad) @ middle_m)

    def to_site(self, points_m: FloatArray) -> FloatArray:
        """Return (N, 2) points of the own frame on the site."""
        return np.asarray(points_m @ _rotation(self.turn_rad).T + self.xy_m)

    def site_view(self, own: View) -> View:
        """Return a camera of the own frame on the site."""
        turn = _upright(self.turn_rad)
        position_m = turn @ own.position_m + np.append(self.xy_m, 0.0)
        return View(own.camera, position_m, own.site_to_camera @ turn.T)

    def own_view(self, site: View) -> View:
        """Return a camera of the site in the own frame."""
        if self.turn_rad == 0.0 and not self.xy_m.any():
            return site
        turn = _upright(self.turn_rad)
        position_m = turn.T @ (site.position_m - np.append(self.xy_m, 0.0))
        return View(site.camera, position_m, site.site_to_camera @ turn)

    def moved_by(self, other: Placement, middle_m: FloatArray) -> float:
        """Return how many metres apart two placements put a thing's middle (2,)."""
        return float(np.linalg.norm(self.to_site(middle_m) - other.to_site(middle_m)))


class Through:
    """A belief about the camera on the site, as it is in the frame of a thing that stands there.

    Args:
        now: The camera on the site.
        placement: Where the thing stands.
        height_m: Of the thing.
        height_sigma_m: Its standard error.
        place_known: Whether the placement is certain. If not, looks take it for unknown: it was learned through the
            belief, whose errors must not come back as if they were something new.
    """

    def __init__(
        self, now: Estimate, placement: Placement, height_m: float, height_sigma_m: float, *, place_known: bool
    ) -> None:
        by_state, by_place = _derivatives(now.state.view, placement)
        spread = by_place * np.array([_FREE_RAD, _FREE_M, _FREE_M]) * (0.0 if place_known else 1.0)
        own_height = np.zeros((STATE, STATE))
        own_height[HEIGHT, HEIGHT] = height_sigma_m**2
        self._now = now
        self._across = now.covariance @ by_state.T
        before = by_state @ self._across + own_height + spread @ spread.T
        self.covariance: FloatArray = (before + before.T) / 2.0
        """(9, 9) of `belief`."""
        state = SolidState(placement.own_view(now.state.view), height_m)
        self.belief = Belief(state, np.asarray(np.linalg.inv(self.covariance), dtype=np.float64))
        self.placed_covariance: FloatArray = by_state @ now.total @ by_state.T + own_height
        """(9, 9) of the state in the own frame, all errors included but those of the placement."""

    def seen(self, fit: SolidFit) -> tuple[SolidState, FloatArray]:
        """Return what a look that began from `belief` says of the camera on the site.

        Returns:
            The most likely state by belief and look together, and (9, 9) the information that the look adds; both for
            `PoseFilter.correct`.
        """
        gain = self._across @ self.belief.information
        after = np.linalg.inv(self.belief.information + fit.information)
        covariance = self._now.covariance - gain @ (self.covariance - after) @ gain.T
        information = np.linalg.inv((covariance + covariance.T) / 2.0) - np.linalg.inv(self._now.covariance)
        values, vectors = np.linalg.eigh((information + information.T) / 2.0)
        # What rounding makes of nothing must not be less than nothing.
        information = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return self._now.state.changed(gain @ fit.state.change_from(self.belief.state)), information


def _derivatives(site: View, placement: Placement) -> tuple[FloatArray, FloatArray]:
    """Return (9, 9) how the state in the own frame moves with that on the site, and (9, 3) with turn and shift."""
    back = _upright(placement.turn_rad).T
    own = placement.own_view(site)
    by_state = np.zeros((STATE, STATE))
    by_state[:CHANGES, :CHANGES] = np.eye(CHANGES)
    by_state[SHIFT, SHIFT] = back
    by_place = np.zeros((STATE, 3))
    by_place[:3, 0] = site.site_to_camera[:, 2]
    by_place[3:5, 0] = own.position_m[1], -own.position_m[0]
    by_place[3:5, 1:] = -back[:2, :2]
    return by_state, by_place


def _rotation(turn_rad: float) -> FloatArray:
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    return np.array([[cos, -sin], [sin, cos]])


def _upright(turn_rad: float) -> FloatArray:
    turn = np.eye(3)
    turn[:2, :2] = _rotation(turn_rad)
    return turn
