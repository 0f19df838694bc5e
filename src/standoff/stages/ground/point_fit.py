"""Find the camera that explains where known points of the site are seen in one picture."""

from __future__ import annotations

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, LENS, SHIFT, TURN, View, poses_of_plane, rotation_from_vector
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.solid import STATE, SolidState
from standoff.stages.ground.solid_fit import Belief

_ROUNDS = 50
_SETTLED = 1e-10
"""A change this small, in radians, metres and shares, changes nothing any more."""

_FREE_RAD, _FREE_EXTENTS = 10.0, 1e3
"""Standard errors of a camera of which nothing is known: in angle, and in place by the extent of the points."""

_HALVINGS = 12


def fit_points(prior: Belief, observation: PointObservation) -> Belief:
    """Correct a belief by points that were seen.

    Args:
        prior: What is known beforehand; its state is where the fit begins, so the points must lie in front of it.
        observation: What was seen; errors of different points are taken as independent.

    Returns:
        The most likely state, and what is known of it by prior and points together. The solid's height is the prior's:
        points do not depend on it.

    Raises:
        GroundError: The points lie behind the camera.
    """
    state, cost = prior.state, _cost(prior, prior.state, observation)
    if not np.isfinite(cost):
        raise GroundError(
            expected=f"{observation.name} in front of the camera",
            found="a point behind it",
            fix="begin from a view that sees the points",
        )
    for _ in range(_ROUNDS):
        rows, values = _weighted(state, observation)
        information = prior.information + rows.T @ rows
        pull = rows.T @ values - prior.information @ state.change_from(prior.state)
        change = np.asarray(np.linalg.solve(information, pull), dtype=np.float64)
        following, better = _downhill(prior, observation, state, change)
        if not better < cost:
            break
        state, cost = following, better
        if np.abs(change).max() < _SETTLED:
            break
    rows, _ = _weighted(state, observation)
    return Belief(state, prior.information + rows.T @ rows)


def _downhill(
    prior: Belief, observation: PointObservation, state: SolidState, change: FloatArray
) -> tuple[SolidState, float]:
    """Go the step, or a part of it: a whole one may lead where a point lies behind the camera."""
    limit = _cost(prior, state, observation)
    for _ in range(_HALVINGS):
        following = state.changed(change)
        cost = _cost(prior, following, observation)
        if cost < limit:
            return following, cost
        change = change / 2.0
    return state, limit


def belief_from_points(camera: CameraPrior, observation: PointObservation) -> Belief:
    """Find the camera from points of level ground, when nothing is known of where it is or how it is held.

    Args:
        camera: What is known of it, for pictures of this size.
        observation: At least four points of z = 0, no three of them on one line.

    Returns:
        The most likely state, of the two views in which a plane can look so, with no height.

    Raises:
        GroundError: No camera above the ground sees the points so.
    """
    pinhole_px = camera.camera.undistort(observation.points_px)
    fits = []
    if np.isfinite(pinhole_px).all():
        for view in views_of_plane(pinhole_px, observation.points_m[:, :2], camera.camera):
            prior = _prior(camera, view, observation)
            if np.isfinite(_cost(prior, prior.state, observation)):
                fit = fit_points(prior, observation)
                fits.append((_cost(prior, fit.state, observation), fit))
    if not fits:
        raise GroundError(
            expected=f"{observation.name} as a camera above the ground sees it",
            found="a picture that no such camera takes",
            fix="check which point is which; y is to the left of x, seen from above",
        )
    return min(fits, key=lambda one: one[0])[1]


def views_of_plane(pinhole_px: FloatArray, points_m: FloatArray, camera: Camera) -> list[View]:
    """Return the two views from above in which a plane looks about so, the better one first.

    Seen from afar, a plane tilted towards the camera and one tilted as much away from it look alike. OpenCV's closed
    form (IPPE) gives both as well, but loses its way where a plane is seen from straight above.

    Args:
        pinhole_px: (N, 2) undistorted, N >= 4.
        points_m: (N, 2) of the plane z = 0, site frame.
        camera: Lens.
    """
    normalised = (pinhole_px - camera.matrix[:2, 2]) / np.array([camera.matrix[0, 0], camera.matrix[1, 1]])
    plane_to_camera = homography.signed(homography.fit(points_m, normalised), points_m.mean(axis=0))
    rotation, position_m = poses_of_plane(plane_to_camera)
    if not np.isfinite(position_m).all() or position_m[2] <= 0:
        return []
    middle = np.append(points_m.mean(axis=0), 0.0)
    place = rotation @ (middle - position_m)
    # The plane's normal, mirrored at the line of sight: a turn about what is perpendicular to both, twice as far.
    sight, normal = place / np.linalg.norm(place), rotation[:, 2]
    axis = np.cross(sight, -normal)
    angle = np.arctan2(np.linalg.norm(axis), -sight @ normal)
    axis /= max(float(np.linalg.norm(axis)), 1e-12)
    other = rotation_from_vector(-2.0 * angle * axis) @ rotation
    views = [View(camera, position_m, rotation), View(camera, middle - other.T @ place, other)]
    return [view for view in views if view.position_m[2] > 0]


def _prior(camera: CameraPrior, view: View, observation: PointObservation) -> Belief:
    """Return what is known beforehand: the lens alone."""
    sigma = np.ones(STATE)
    sigma[TURN], sigma[SHIFT] = _FREE_RAD, _FREE_EXTENTS * float(np.ptp(observation.points_m, axis=0).max())
    sigma[LENS] = camera.focal_sigma, camera.k1_sigma
    return Belief(SolidState(view, 0.0), np.diag(1.0 / sigma**2))


def _weighted(state: SolidState, observation: PointObservation) -> tuple[FloatArray, FloatArray]:
    """Return (2 N, 9) how the points move with the state, and (2 N,) how far they are off, in standard errors."""
    points_px, by_view, _ = state.view.project_with_jacobians(observation.points_m)
    weight = 1.0 / observation.sigma_px
    rows = np.zeros((len(points_px), 2, STATE))
    rows[:, :, :CHANGES] = by_view * weight[:, None, None]
    values = (observation.points_px - points_px) * weight[:, None]
    return rows.reshape(-1, STATE), values.ravel()


def _cost(prior: Belief, state: SolidState, observation: PointObservation) -> float:
    """Return the squared misfit to points and prior in standard errors; infinite where a point lies behind."""
    off = (observation.points_px - state.view.project(observation.points_m)) / observation.sigma_px[:, None]
    change = state.change_from(prior.state)
    cost = float((off**2).sum() + change @ prior.information @ change)
    return cost if np.isfinite(cost) else np.inf
