"""Where a drone would be to take a picture of somebody at work, and how it moves while it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.camera.flight import Still, drone_camera
from standoff_sim.scene.moment import EntityState
from standoff_sim.scene.scene import Batch

_TRIES = 12
_LOWEST_M, _HIGHEST_M = 15.0, 60.0
_LANDING_SHARE, _LANDING_M = 0.15, (4.0, 15.0)
"""Of views from a drone that comes down, and how high it then is."""
_PITCHES_DEG = ((20.0, 40.0), (40.0, 70.0), (70.0, 90.0))
_PITCH_SHARES = (0.4, 0.42, 0.18)
_PERSON_M = 1.75
_PERSON_SHARE, _LANDING_PERSON_SHARE = (0.008, 0.11), (0.06, 0.32)
"""Smallest and largest a person in the middle may be before foreshortening, as a share of the picture's width."""
_WANTED = 3
_BARE_SHARE = 0.1
"""Of pictures may show fewer actors than are wanted."""
_MACHINES = frozenset(CLASS_BY_NAME[name].id for name in ("excavator", "wheel_loader", "dump_truck", "roller_or_dozer"))
_MACHINE_WEIGHT = 2.0
"""Of a machine as the target: there are several workers to each."""
_TALL_M = 3.0
_ROOM_M = 2.5
_NEAR_SHARE, _NEAR_M = 0.6, 35.0
"""What is nearer than this share of the way to the ground, and this, hides too much of a picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Passing:
    """A drone that flies straight on; implements `standoff_sim.scene.scene.Flight`.

    Attributes:
        fixed: The view at `time_s`.
        time_s: When.
        velocity_mps: (3,) site frame.
    """

    fixed: View
    time_s: float
    velocity_mps: FloatArray

    def view(self, time_s: float) -> View:
        """Return the view at a moment."""
        moved_m = (time_s - self.time_s) * self.velocity_mps
        return replace(self.fixed, position_m=self.fixed.position_m + moved_m)


@dataclass(frozen=True, slots=True, eq=False)
class Obstacles:
    """Boxes around all that is tall enough to stand in front of a camera.

    Attributes:
        site_to_box: (N, 4, 4) into each box's own frame.
        low: (N, 3) corners in that frame, with some room around.
        high: (N, 3) opposite corners.
    """

    site_to_box: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, batches: Sequence[Batch]) -> Self:
        """Take the tall instances of the batches."""
        poses, lows, highs = [np.empty((0, 4, 4))], [np.empty((0, 3))], [np.empty((0, 3))]
        for batch in batches:
            low, high = batch.mesh.vertices_m.min(axis=0), batch.mesh.vertices_m.max(axis=0)
            pose = batch.poses.astype(np.float64)
            height_m = np.abs(pose[:, 2, :3]) @ (high - low)
            tall = pose[height_m > _TALL_M]
            room = _ROOM_M / np.linalg.norm(tall[:, :3, :3], axis=1)
            poses.append(tall)
            lows.append(low - room)
            highs.append(high + room)
        return cls(np.linalg.inv(np.concatenate(poses)), np.concatenate(lows), np.concatenate(highs))

    def hide(self, start_m: FloatArray, stop_m: FloatArray) -> bool:
        """Return whether a box is between two points, (3,) each."""
        start = (self.site_to_box @ np.append(start_m, 1.0))[:, :3]
        along = (self.site_to_box @ np.append(stop_m - start_m, 0.0))[:, :3]
        along = np.where(np.abs(along) < 1e-9, 1e-9, along)
        first, second = (self.low - start) / along, (self.high - start) / along
        enters = np.minimum(first, second).max(axis=1)
        leaves = np.maximum(first, second).min(axis=1)
        return bool(np.any((enters <= leaves) & (leaves >= 0.0) & (enters <= 1.0)))


def draw_view(
    rng: np.random.Generator, size_px: tuple[int, int], bodies: Sequence[EntityState], obstacles: Obstacles
) -> View:
    """Draw a view from 15 to 60 m, now and then from 4 m on, that shows some of the bodies, nothing right before it.

    Args:
        rng: Decides.
        size_px: Of the picture.
        bodies: Who is there; may be nobody.
        obstacles: Of the site.
    """
    wanted = 0 if rng.random() < _BARE_SHARE else min(_WANTED, len(bodies))
    lands = rng.random() < _LANDING_SHARE
    best, best_worth = None, (False, False, -1)
    for _ in range(_TRIES):
        target_m = _draw_target(rng, bodies)
        view = _aim(rng, size_px, target_m, lands=lands)
        worth = (
            _is_clear(view, obstacles),
            _shows_people_well(view, target_m, lands=lands),
            min(_count(view, bodies), wanted),
        )
        if best is None or worth > best_worth:
            best, best_worth = view, worth
        if worth == (True, True, wanted):
            break
    assert best is not None
    return best


def draw_flight(rng: np.random.Generator, view: View, time_s: float) -> Still | Passing:
    """Let the drone hover, or pass at up to 10 m/s at the moment of the picture."""
    if rng.random() < 0.5:
        return Still(view)
    direction_rad, speed_mps = rng.uniform(0.0, 2 * np.pi), rng.uniform(0.5, 10.0)
    return Passing(view, time_s, speed_mps * np.array([np.cos(direction_rad), np.sin(direction_rad), 0.0]))


def _draw_target(rng: np.random.Generator, bodies: Sequence[EntityState]) -> FloatArray:
    """Draw a point among one, two or three bodies that are near each other; half the time among several."""
    spread_m: FloatArray = np.append(rng.normal(0.0, 3.5, 2), 0.0)
    if not bodies:
        return 3.0 * spread_m
    centres = np.array([body.centre_m for body in bodies])
    weights = np.array([_MACHINE_WEIGHT if body.class_id in _MACHINES else 1.0 for body in bodies])
    first = centres[rng.choice(len(centres), p=weights / weights.sum())]
    away_m = np.linalg.norm(centres - first, axis=1)
    count = int(rng.choice([1, 2, 3], p=[0.5, 0.25, 0.25]))
    middle: FloatArray = centres[np.argsort(away_m)[:count]].mean(axis=0)
    return middle + spread_m


def _aim(rng: np.random.Generator, size_px: tuple[int, int], target_m: FloatArray, *, lands: bool) -> View:
    camera = drone_camera(*size_px, float(rng.uniform(36.0, 84.0)), rng)
    low_deg, high_deg = _PITCHES_DEG[int(rng.choice(len(_PITCHES_DEG), p=_PITCH_SHARES))]
    lowest_m, highest_m = _LANDING_M if lands else (_LOWEST_M, _HIGHEST_M)
    still = Still.over(
        camera,
        target_m[:2],
        altitude_m=float(lowest_m * (highest_m / lowest_m) ** rng.beta(1.0, 1.8)),
        pitch_deg=float(rng.uniform(low_deg, high_deg)),
        heading_deg=float(rng.uniform(0.0, 360.0)),
        roll_deg=float(rng.normal(0.0, 1.0)),
    )
    return still.fixed


def _shows_people_well(view: View, target_m: FloatArray, *, lands: bool) -> bool:
    focal_px = float(view.camera.matrix[0, 0])
    share = focal_px * _PERSON_M / float(np.linalg.norm(view.position_m - target_m)) / view.camera.width_px
    least, most = _LANDING_PERSON_SHARE if lands else _PERSON_SHARE
    return least <= share <= most


def _count(view: View, bodies: Sequence[EntityState]) -> int:
    """Return how many bodies stand in the picture."""
    if not bodies:
        return 0
    centres_px = view.project(np.array([body.centre_m for body in bodies]))
    size = np.array([view.camera.width_px, view.camera.height_px])
    return int(np.count_nonzero(((centres_px > 0.03 * size) & (centres_px < 0.97 * size)).all(axis=1)))


def _is_clear(view: View, obstacles: Obstacles) -> bool:
    """Return whether rays all over the picture run free for the first part of their way."""
    size = np.array([view.camera.width_px, view.camera.height_px])
    shares = np.array([(0.5, 0.5), (0.2, 0.5), (0.8, 0.5), (0.2, 0.85), (0.8, 0.85), (0.5, 0.85)])
    rays = view.rays(shares * size)
    down = np.maximum(-rays[:, 2], 0.05)
    reach_m = np.minimum(_NEAR_SHARE * view.position_m[2] / down, _NEAR_M)
    ends = view.position_m + reach_m[:, None] * rays
    return not any(obstacles.hide(view.position_m, end) for end in ends)
