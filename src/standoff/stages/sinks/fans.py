"""Where moving entities are likely to be soon: a fan on the ground ahead of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.ground_motion import transition, wandering
from standoff.core.homography import FloatArray
from standoff.core.types import GroundPositions

FAN_OPACITY = 0.35
_AHEAD_S = np.array([0.5, 1.0, 1.5, 2.0])
_LEAST_TRAVEL_M, _LEAST_SIGMAS = 0.5, 3.0
"""Whoever gets no further is taken to stand, and whose velocity may be noise: a fan would only tell of that."""


@dataclass(frozen=True, slots=True, eq=False)
class Fan:
    """What is ahead of one entity.

    Attributes:
        row: Of the positions.
        path_m: (T, 2) site frame, the likeliest way, from where it is now.
        outline_m: (2 T - 1, 2) around the places within one standard error to both sides of it.
    """

    row: int
    path_m: FloatArray
    outline_m: FloatArray


def fans_of(positions: GroundPositions) -> list[Fan]:
    """Return the fans of all entities that move."""
    variance = positions.state_covariance[:, 2, 2] + positions.state_covariance[:, 3, 3]
    speed_mps = np.linalg.norm(positions.velocity_mps, axis=1)
    moving = np.flatnonzero(positions.valid & (speed_mps > _LEAST_SIGMAS * np.sqrt(variance / 2.0)))
    if not len(moving):
        return []
    state = np.concatenate([positions.xy_m[moving], positions.velocity_mps[moving]], axis=1)
    paths, widths = [state[:, :2]], []
    for ahead_s in _AHEAD_S.tolist():
        forth = transition(positions.class_id[moving], ahead_s)
        gained = wandering(positions.class_id[moving], ahead_s, positions.standing_s[moving])
        covariance = forth @ positions.state_covariance[moving] @ forth.transpose(0, 2, 1) + gained
        paths.append((forth @ state[:, :, None])[:, :2, 0])
        widths.append(np.sqrt((covariance[:, 0, 0] + covariance[:, 1, 1]) / 2.0))
    return [
        _fan(int(row), np.array([path[i] for path in paths]), np.array([width[i] for width in widths]))
        for i, row in enumerate(moving)
        if np.linalg.norm(paths[-1][i] - paths[0][i]) >= _LEAST_TRAVEL_M
    ]


def _fan(row: int, path_m: FloatArray, width_m: FloatArray) -> Fan:
    along = path_m[-1] - path_m[0]
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    left = path_m[1:] + width_m[:, None] * across
    right = path_m[1:] - width_m[:, None] * across
    return Fan(row, path_m, np.vstack([path_m[:1], left, right[::-1]]))
