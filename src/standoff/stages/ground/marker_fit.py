"""Find the camera from known points of the site: a start from each marker, least squares, and a gate for mistakes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, View
from standoff.core.types import NoGroundMap
from standoff.stages.ground.observation import PointObservation
from standoff.stages.ground.view_prior import PriorRows

NO_VIEW = "no camera above the ground sees the marker so"
AMBIGUOUS = "the marker is too small in the picture to tell how the ground is tilted"

_GATE_CHI2 = 26.1
"""Eight coordinates exceed it once in a thousand times."""

_ROUNDS = 25
_SETTLED = 1e-9
_SAME_TURN_RAD = np.deg2rad(2.0)
_AMBIGUOUS_COST = 6.0
"""Two views that differ by less in their sums of squares are both possible: the worse one once in twenty times."""


@dataclass(frozen=True, slots=True, eq=False)
class PointFit:
    """The view that explains prior and points best.

    Attributes:
        view: The camera.
        information: (8, 8) that the points alone add.
        covariance: (8, 8) of the view by prior and points together.
        cost: Sum of squares of all residuals, in standard errors.
        used: What was believed.
    """

    view: View
    information: FloatArray
    covariance: FloatArray
    cost: float
    used: tuple[PointObservation, ...]


def fit_points(
    start: View, seen: Sequence[PointObservation], prior: PriorRows, place_sigma_m: float
) -> PointFit | None:
    """Minimise all residuals from a start (Levenberg and Marquardt); None where it does not settle.

    Args:
        start: About where the camera is.
        seen: Points.
        prior: What is known without them.
        place_sigma_m: Standard error of each coordinate of where a marker lies, shared by its corners.
    """
    view, damping = start, 1e-3
    rows = _rows(view, seen, prior, place_sigma_m)
    for _ in range(_ROUNDS):
        if rows is None:
            return None
        residual, by_change, _ = rows
        normal = by_change.T @ by_change
        damped = normal + damping * np.diag(np.diag(normal) + 1e-12)
        change = -np.asarray(np.linalg.solve(damped, by_change.T @ residual), dtype=np.float64)
        trial = view.changed(change)
        tried = _rows(trial, seen, prior, place_sigma_m)
        if tried is None or tried[0] @ tried[0] > residual @ residual * (1.0 + 1e-12) + 1e-12:
            damping *= 10.0
            if damping > 1e8:
                break
            continue
        gained = float(residual @ residual - tried[0] @ tried[0])
        view, rows, damping = trial, tried, max(damping / 10.0, 1e-9)
        if gained < _SETTLED:
            break
    if rows is None:
        return None
    residual, by_change, of_points = rows
    information = of_points.T @ of_points
    try:
        covariance = np.asarray(np.linalg.inv(by_change.T @ by_change), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None
    return PointFit(view, information, covariance, float(residual @ residual), tuple(seen))


def agrees(view: View, covariance: FloatArray, seen: PointObservation, place_sigma_m: float) -> bool:
    """Return whether points are where a view with an (8, 8) covariance lets expect them (Mahalanobis)."""
    expected_px, by_view, by_point = view.project_with_jacobians(seen.points_m)
    misfit = (seen.points_px - expected_px).ravel()
    if not np.isfinite(misfit).all():
        return False
    by_view = by_view.reshape(-1, CHANGES)
    spread = by_view @ covariance @ by_view.T + _noise(seen, by_point, place_sigma_m)
    return bool(misfit @ np.linalg.solve(spread, misfit) <= _GATE_CHI2 * len(misfit) / 8.0)


def agreeing(
    view: View, covariance: FloatArray, seen: Sequence[PointObservation], place_sigma_m: float
) -> list[PointObservation]:
    """Return those that `agrees`."""
    return [one for one in seen if agrees(view, covariance, one, place_sigma_m)]


def first_fit(
    seen: Sequence[PointObservation], camera: Camera, prior: PriorRows, place_sigma_m: float
) -> PointFit | NoGroundMap:
    """Find the view without knowing where to begin, and without those observations that contradict the most.

    Args:
        seen: One or more.
        camera: The likely lens.
        prior: What is known without points.
        place_sigma_m: As in `fit_points`.
    """
    fits: list[PointFit] = []
    for one in seen:
        for start in _starts(one, camera):
            fit = fit_points(start, [one], prior, place_sigma_m)
            if fit is None or fit.view.position_m[2] <= 0:
                continue
            others = [other for other in seen if other is not one]
            together = [one, *agreeing(fit.view, fit.covariance, others, place_sigma_m)]
            whole = fit if len(together) == 1 else fit_points(fit.view, together, prior, place_sigma_m)
            if whole is not None and whole.view.position_m[2] > 0:
                fits.append(whole)
    if not fits:
        return NoGroundMap(NO_VIEW)
    most = max(len(fit.used) for fit in fits)
    best = min((fit for fit in fits if len(fit.used) == most), key=lambda fit: fit.cost)
    for fit in fits:
        turned = float(np.linalg.norm(fit.view.change_from(best.view)[:3]))
        if len(fit.used) == most and turned > _SAME_TURN_RAD and fit.cost < best.cost + _AMBIGUOUS_COST:
            return NoGroundMap(AMBIGUOUS)
    return best


def _starts(seen: PointObservation, camera: Camera) -> list[View]:
    """Return the one or two views that see the points of a plane about so (Collins and Bartoli 2014)."""
    pinhole_px = camera.undistort(seen.points_px)
    if not np.isfinite(pinhole_px).all():
        return []
    count, turns, shifts, _ = cv2.solvePnPGeneric(
        _flattened(seen.points_m), pinhole_px, camera.matrix, None, flags=cv2.SOLVEPNP_IPPE
    )
    views = []
    for turn, shift in zip(turns[:count], shifts[:count], strict=True):
        rotation = cv2.Rodrigues(turn)[0]
        position_m = -rotation.T @ shift.ravel()
        if np.isfinite(position_m).all():
            views.append(View(camera, position_m, rotation))
    return views


def _flattened(points_m: FloatArray) -> FloatArray:
    """Return (N, 3) points moved onto the plane that is nearest to them: a start need not know of the relief."""
    middle_m = points_m.mean(axis=0)
    normal = np.linalg.svd(points_m - middle_m)[2][2]
    flat: FloatArray = points_m - ((points_m - middle_m) @ normal)[:, None] * normal
    return flat


def _rows(
    view: View, seen: Sequence[PointObservation], prior: PriorRows, place_sigma_m: float
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return residuals, their derivatives, and the points' share of these; None where a point is not in sight."""
    known, known_by_change = prior(view)
    residuals, derivatives = [known], [known_by_change]
    for one in seen:
        expected_px, by_view, by_point = view.project_with_jacobians(one.points_m)
        misfit = (expected_px - one.points_px).ravel()
        if not np.isfinite(misfit).all():
            return None
        root = np.linalg.cholesky(_noise(one, by_point, place_sigma_m))
        residuals.append(np.linalg.solve(root, misfit))
        derivatives.append(np.linalg.solve(root, by_view.reshape(-1, CHANGES)))
    return np.concatenate(residuals), np.concatenate(derivatives), np.concatenate(derivatives[1:])


def _noise(seen: PointObservation, by_point: FloatArray, place_sigma_m: float) -> FloatArray:
    """Return (2N, 2N) covariance of the points' coordinates in the picture."""
    shared = by_point.reshape(-1, 3) * place_sigma_m
    noise: FloatArray = np.diag(np.repeat(seen.sigma_px, 2) ** 2) + shared @ shared.T
    return noise
