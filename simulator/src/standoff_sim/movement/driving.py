"""Drive or walk along smooth paths with the speeds and accelerations that machines and people have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from scipy.interpolate import BSpline, CubicHermiteSpline, make_interp_spline

from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff_sim.movement.motion import STEP_S, Place
from standoff_sim.scene.scene import Model, Motion

_SPACING_M = 0.02
_EASE_S = 0.5  # how long an acceleration takes to build up
_STEERING_DPS = 25.0  # lock to lock, some 76 degrees, takes 3 s
_MARGIN = 0.98  # of every limit that a plan makes use of


@dataclass(frozen=True, slots=True)
class Mobility:
    """How fast a machine or a person moves.

    Attributes:
        speed_mps: Highest on a site.
        acceleration_mps2: Highest along the path, braking included.
        lateral_mps2: Highest across it, which slows down bends.
        steering: Front wheels turn, the frame bends in its middle, or neither.
        pivot_share: Of the axle that does not steer, ahead of the middle, in footprint lengths; it follows the path.
        wheelbase_share: In footprint lengths.
    """

    speed_mps: float
    acceleration_mps2: float
    lateral_mps2: float
    steering: Literal["front", "articulated", "none"] = "none"
    pivot_share: float = 0.0
    wheelbase_share: float = 0.6


MOBILITY = MappingProxyType(
    {
        # walking 0.6-1.6 m/s; gait starts and stops within a step or two
        "worker": Mobility(1.3, 1.0, 0.8),
        # 20-25 t crawler: 3.0-5.5 km/h in brochures, the lower gear on sites
        "excavator": Mobility(1.1, 0.5, 0.3),
        # 15-20 t loader: 35-40 km/h on roads, about 12 km/h and 1 m/s2 in loading cycles
        "wheel_loader": Mobility(3.3, 1.0, 1.2, "articulated"),
        # 25-40 t truck: about 15 km/h off the haul road
        "dump_truck": Mobility(4.2, 0.8, 1.0, "front", -0.28),
        # 10-13 t single drum: working speed 4-6 km/h, up to 10-12 km/h
        "roller": Mobility(1.6, 0.5, 0.5, "articulated"),
        # 15-20 t crawler: first gear 3-4 km/h, reverse up to 5-8 km/h
        "dozer": Mobility(1.9, 0.6, 0.4),
        # site limit of 15-20 km/h
        "vehicle": Mobility(4.5, 1.4, 1.6, "front", -0.28),
    }
)
"""Typical of brochures and site rules, by class; ranges beside each."""


def kind_of(model: Model) -> str:
    """Return the key of `MOBILITY` for a model."""
    name = CLASSES[model.class_id].name
    if name == "roller_or_dozer":
        return "dozer" if "blade_m" in model.joints else "roller"
    return name


def mobility_of(model: Model, speed_mps: float | None = None) -> Mobility:
    """Return how a model moves, on request with a lower top speed."""
    mobility = MOBILITY[kind_of(model)]
    return mobility if speed_mps is None else replace(mobility, speed_mps=min(speed_mps, mobility.speed_mps))


def drive(
    model: Model, start: Place, end: Place, *, via: Sequence[tuple[float, float]] = (), reverse: bool = False,
    speed_mps: float | None = None,
) -> Motion:  # fmt: skip
    """Drive from rest to rest; the wheels do not slip sideways.

    Args:
        model: Its footprint, joints and class decide how it drives and steers.
        start: Middle of the footprint and heading.
        end: The same at the end.
        via: Points on the way of the axle that does not steer.
        reverse: Backwards; headings are still where the front points.
        speed_mps: Top speed, if lower than the machine's.

    Returns:
        The motion from time 0. Joints, as far as the model has them: `travel_m` or `track_m` (falls in reverse) and
        `steer_deg` (left positive).
    """
    mobility = mobility_of(model, speed_mps)
    length_m = float(np.ptp(model.footprint_m[:, 0]))
    pivot_m = mobility.pivot_share * length_m
    sign = -1.0 if reverse else 1.0
    ends = [start.moved(pivot_m), end.moved(pivot_m)]
    points = np.array([ends[0].xy_m, *via, ends[1].xy_m], dtype=np.float64)
    tangents = np.array([[np.cos(e.heading_rad), np.sin(e.heading_rad)] for e in ends]) * sign
    track = _Track(points, tangents)
    time_s, along_m = _timed(track, mobility, length_m, pivot_m * sign)
    motion = _followed(track, time_s, along_m, pivot_m, sign)
    turns = 2 * np.pi * np.round((start.heading_rad - motion.heading_rad[0]) / (2 * np.pi))
    gone_m = sign * along_m
    joints = {
        "travel_m": gone_m,
        "track_m": gone_m,
        "steer_deg": _steering_deg(mobility, length_m, sign * track.curvature(along_m)),
    }
    return replace(
        motion,
        heading_rad=motion.heading_rad + turns,
        joints={name: values for name, values in joints.items() if name in model.joints},
    )


def walk(points_m: Sequence[tuple[float, float]] | FloatArray, speed_mps: float) -> Motion:
    """Walk along points from rest to rest, looking ahead; joints `stride_m` and `speed_mps`."""
    track = _Track(np.asarray(points_m, dtype=np.float64), None)
    time_s, along_m = _timed(track, replace(MOBILITY["worker"], speed_mps=speed_mps), 0.0, 0.0)
    motion = _followed(track, time_s, along_m, 0.0, 1.0)
    return replace(motion, joints={"stride_m": along_m, "speed_mps": np.gradient(along_m, STEP_S)})


class _Track:
    """A curve of fifth degree through points, without curvature at its ends, by arc length.

    Args:
        points: (N, 2).
        tangents: (2, 2) unit vectors at both ends; None leaves the ends straight.
    """

    def __init__(self, points: FloatArray, tangents: FloatArray | None) -> None:
        knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        if tangents is None:
            ends = [[(2, np.zeros(2)), (3, np.zeros(2))]] * 2
        else:
            ends = [[(1, tangent), (2, np.zeros(2))] for tangent in tangents]
        curve: BSpline = make_interp_spline(knots, points, k=5, bc_type=(ends[0], ends[1]))  # type: ignore[arg-type]
        parameter = np.linspace(0.0, knots[-1], max(64, int(knots[-1] / _SPACING_M)))
        pace = np.linalg.norm(curve(parameter, 1), axis=1)
        steps_m = np.diff(parameter) * (pace[1:] + pace[:-1]) / 2
        self._curve, self._parameter = curve, parameter
        self.along_m = np.concatenate([[0.0], np.cumsum(steps_m)])
        self._parameter_at = CubicHermiteSpline(self.along_m, parameter, 1.0 / pace)

    def points(self, along_m: FloatArray) -> FloatArray:
        found: FloatArray = self._curve(self._parameter_at(along_m))
        return found

    def directions(self, along_m: FloatArray) -> FloatArray:
        slope = self._curve(self._parameter_at(along_m), 1)
        directions: FloatArray = np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))
        return directions

    def curvature(self, along_m: FloatArray) -> FloatArray:
        parameter = self._parameter_at(along_m)
        (x1, y1), (x2, y2) = self._curve(parameter, 1).T, self._curve(parameter, 2).T
        bend: FloatArray = (x1 * y2 - y1 * x2) / np.hypot(x1, y1) ** 3
        return bend


def _timed(track: _Track, mobility: Mobility, length_m: float, pivot_m: float) -> tuple[FloatArray, FloatArray]:
    """Return times and distances along a track: as fast as allowed, accelerations built up smoothly."""
    along_m = track.along_m
    bend = np.abs(track.curvature(along_m))
    limit2 = np.minimum(mobility.speed_mps**2, mobility.lateral_mps2 / np.maximum(bend, 1e-9)) * _MARGIN**2
    limit2 = np.minimum(limit2, _steerable_mps(mobility, length_m, track) ** 2)
    limit2[[0, -1]] = 0.0
    gain = 2 * mobility.acceleration_mps2 * _MARGIN * along_m
    limit2 = np.minimum.accumulate(limit2 - gain) + gain
    limit2 = np.minimum.accumulate((limit2 + gain)[::-1])[::-1] - gain
    speed_mps = np.sqrt(np.maximum(limit2, 0.0))
    steps_s = 2 * np.diff(along_m) / (speed_mps[1:] + speed_mps[:-1])
    reached_s = np.concatenate([np.zeros(1), np.cumsum(steps_s)])
    ease = round(_EASE_S / STEP_S)
    count = int(np.ceil(reached_s[-1] / STEP_S)) + 1
    planned = np.interp(np.arange(count) * STEP_S, reached_s, speed_mps, right=0.0)
    smooth_mps = np.convolve(planned, np.full(ease, 1.0 / ease))
    smooth_mps[[0, -1]] = 0.0
    time_s = np.arange(len(smooth_mps)) * STEP_S
    travelled = np.concatenate([[0.0], np.cumsum((smooth_mps[1:] + smooth_mps[:-1]) / 2 * STEP_S)])
    scale = along_m[-1] / travelled[-1]
    profile = CubicHermiteSpline(time_s, travelled * scale, smooth_mps * scale)
    stretch = _needed_stretch(track, profile(time_s), mobility, pivot_m)
    stretched_s = STEP_S * np.arange(int(np.ceil(time_s[-1] * stretch / STEP_S)) + 1, dtype=np.float64)
    return stretched_s, np.clip(profile(np.minimum(stretched_s / stretch, time_s[-1])), 0.0, along_m[-1])


def _steerable_mps(mobility: Mobility, length_m: float, track: _Track) -> FloatArray:
    """Return (N,) speeds at which the steering can just follow the bends."""
    per_m = np.abs(np.gradient(_steering_deg(mobility, length_m, track.curvature(track.along_m)), track.along_m))
    steerable_mps: FloatArray = _STEERING_DPS / np.maximum(per_m, 1e-9)
    return steerable_mps


def _needed_stretch(track: _Track, along_m: FloatArray, mobility: Mobility, pivot_m: float) -> float:
    """Return by how much all must be slower so that the middle of the machine keeps to every limit."""
    directions = track.directions(along_m)
    centre_m = track.points(along_m) - pivot_m * np.column_stack([np.cos(directions), np.sin(directions)])
    velocity = np.gradient(centre_m, STEP_S, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    change = np.gradient(velocity, STEP_S, axis=0)
    heading = velocity / np.maximum(speed, 1e-6)[:, None]
    along = np.abs((change * heading).sum(axis=1))
    across = np.sqrt(np.maximum((change**2).sum(axis=1) - along**2, 0.0))
    ratio2 = max(
        (speed.max() / mobility.speed_mps) ** 2, along.max() / mobility.acceleration_mps2,
        across.max() / mobility.lateral_mps2,
    )  # fmt: skip
    return float(np.sqrt(max(1.0, ratio2 / _MARGIN)))


def _followed(track: _Track, time_s: FloatArray, along_m: FloatArray, pivot_m: float, sign: float) -> Motion:
    heading_rad = track.directions(along_m) + (0.0 if sign > 0 else np.pi)
    forward = np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
    return Motion(time_s, track.points(along_m) - pivot_m * forward, heading_rad)


def _steering_deg(mobility: Mobility, length_m: float, bend: FloatArray) -> FloatArray:
    """Return the angle of the front wheels, or between the halves of the frame, for a left bend in 1/m."""
    wheelbase_m = mobility.wheelbase_share * length_m
    if mobility.steering == "front":
        return np.rad2deg(np.arctan(wheelbase_m * bend))
    if mobility.steering == "articulated":
        return np.rad2deg(2.0 * np.arctan(wheelbase_m / 2 * bend))
    return np.zeros_like(bend)
