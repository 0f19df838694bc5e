"""What is known of a camera's view before a picture's points are looked at, as rows of a least squares problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, LENS, View
from standoff.core.telemetry import Telemetry
from standoff.core.types import NoGroundMap
from standoff.stages.ground.solid import STATE, SolidState
from standoff.stages.ground.solid_fit import Belief
from standoff.stages.ground.telemetry_pose import view_from_telemetry

PriorRows = Callable[[View], tuple[FloatArray, FloatArray]]
"""From a view to residuals (M,) in standard errors, and their derivatives (M, 8) by a change of it."""

_HEIGHT_SIGMA_M = 1e-3
"""The belief's last entry is the height of a reference object, of which there is none here."""

_FRAME_SIGMA = np.array([1e-4] * 3 + [1e-2] * 2 + [1e-4] * 3)
"""Standard errors of what is certain, as it says where the site frame is: without it the covariance had no inverse."""

_LEVEL_SIGMA = np.sin(np.deg2rad(3.0))
"""A gimbal, and whoever sets up a camera, keeps the picture's lower edge level."""

_FREE_DEG, _FREE_M = 1e3, 1e4
_UP = np.array([0.0, 0.0, 1.0])
_TERRAIN_M = 1.0
"""Standard error of the ground's height below the drone against that of the point of take-off."""


def belief_of(view: View, covariance: FloatArray) -> Belief:
    """Return the belief in a view with the (8, 8) covariance of its changes, which may be singular."""
    information = np.zeros((STATE, STATE))
    information[:CHANGES, :CHANGES] = np.linalg.inv(covariance + np.diag(_FRAME_SIGMA**2))
    information[CHANGES, CHANGES] = _HEIGHT_SIGMA_M**-2
    return Belief(SolidState(view, 0.0), information)


def telemetry_view(
    now: Telemetry, first: Telemetry, prior: CameraPrior, *, frame_is_free: bool = False
) -> tuple[View, FloatArray] | NoGroundMap:
    """Return where telemetry puts the camera, and the (8, 8) covariance of that, the lens's included.

    Args:
        now: The readings of the moment.
        first: Those that the site's origin lies below.
        prior: The lens.
        frame_is_free: Whether place and heading count as unknown, for another site frame than telemetry's. If not,
            they count as certain: they say where the site frame is.
    """
    if not now.has_position or not first.has_position:
        now, first = (replace(one, latitude_deg=0.0, longitude_deg=0.0, position_sigma_m=1.0) for one in (now, first))
    heading_deg, place_m = (_FREE_DEG, _FREE_M) if frame_is_free else (0.02, 0.02)
    readings = replace(now, heading_sigma_deg=heading_deg, position_sigma_m=place_m)
    pose = view_from_telemetry(readings, prior.camera, first=first)
    if isinstance(pose, NoGroundMap):
        return pose
    covariance = np.zeros((CHANGES, CHANGES))
    covariance[:6, :6] = pose.covariance
    covariance[5, 5] += _TERRAIN_M**2
    covariance[LENS, LENS] = np.diag([prior.focal_sigma**2, prior.k1_sigma**2])
    return pose.view, covariance


def in_frame_of(view: View, other: View) -> View:
    """Return a view turned about the vertical and shifted over the ground to where another one is."""
    turn = other.heading_rad - view.heading_rad
    cos, sin = np.cos(turn), np.sin(turn)
    # Headings turn clockwise, seen from above.
    rotation = view.site_to_camera @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    left, _, right = np.linalg.svd(rotation)
    return View(view.camera, np.append(other.position_m[:2], view.position_m[2]), left @ right)


def carried_prior(view: View, information: FloatArray) -> PriorRows:
    """Return the rows of a belief (8, 8) in one view."""
    root = np.asarray(np.linalg.cholesky((information + information.T) / 2.0).T, dtype=np.float64)

    def rows(now: View) -> tuple[FloatArray, FloatArray]:
        return root @ now.change_from(view), root

    return rows


def telemetry_prior(telemetry: View, covariance: FloatArray) -> PriorRows:
    """Return the rows of a telemetry whose place and heading are of another site frame than the view's."""
    root = np.asarray(np.linalg.cholesky(np.linalg.inv(covariance)).T, dtype=np.float64)

    def rows(now: View) -> tuple[FloatArray, FloatArray]:
        return root @ now.change_from(in_frame_of(telemetry, now)), root

    return rows


def level_prior(prior: CameraPrior, up: FloatArray = _UP) -> PriorRows:
    """Return the rows of a camera of which only the lens is known, and that its picture is level.

    Args:
        prior: The lens.
        up: (3,) where the vertical points in the frame of the view.
    """
    wanted = prior.camera

    def rows(now: View) -> tuple[FloatArray, FloatArray]:
        upwards = now.site_to_camera @ up
        focal = np.log(now.camera.matrix[0, 0] / wanted.matrix[0, 0]) / prior.focal_sigma
        k1 = (now.camera.distortion[0] - wanted.distortion[0]) / prior.k1_sigma
        by_change = np.zeros((3, CHANGES))
        by_change[0, :3] = np.array([0.0, upwards[2], -upwards[1]]) / _LEVEL_SIGMA
        by_change[1, 6], by_change[2, 7] = 1.0 / prior.focal_sigma, 1.0 / prior.k1_sigma
        return np.array([upwards[0] / _LEVEL_SIGMA, focal, k1]), by_change

    return rows
