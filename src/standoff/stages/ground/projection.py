"""What a `View` projects, compiled: of some hundred points at most, where numpy takes longer to begin than to work.

The formulas are those of `standoff.core.pose` and `standoff.core.distortion`, which must do without a compiler; a test
holds the two together. A lens is told by its coefficients: five are Brown and Conrady's, four a fisheye's.
"""

from __future__ import annotations

import numpy as np

from standoff.core.camera import COEFFICIENTS
from standoff.core.compiled import compiled
from standoff.core.homography import FloatArray
from standoff.core.pose import CHANGES, View

_UNDISTORT_ITERATIONS, _UNDISTORT_TOLERANCE, _UNDISTORTED = 50, 1e-12, 1e-9
"""Of Newton's method as in `Camera.undistort`, in normalised coordinates."""
_FISHEYE = COEFFICIENTS["fisheye"]
_CENTRE = 1e-12
"""Square of the radius below which quotients would lose their digits; the same as in `standoff.core.distortion`."""

Eye = tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]


def eye_of(view: View) -> Eye:
    """Return what compiled loops take for a view.

    That is its position (3,), its rotation (3, 3), its camera matrix (3, 3), its distortion (5,) or (4,), and the
    square of the radius at which the lens's polynomial first turns back.
    """
    camera = view.camera
    return view.position_m, view.site_to_camera, camera.matrix, camera.distortion, camera.first_fold_r2()


def project(view: View, points_m: FloatArray) -> FloatArray:
    """Show where points of the site appear, as `View.project`.

    Args:
        view: The camera.
        points_m: (N, 3), site frame.

    Returns:
        (N, 2) pixels, in or outside the picture; NaN behind the camera or outside the lens model.
    """
    return seen(np.ascontiguousarray(points_m), *eye_of(view))


def project_with_jacobians(view: View, points_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Project points, and say how their pictures move, as `View.project_with_jacobians`.

    Args:
        view: The camera.
        points_m: (N, 3), site frame.

    Returns:
        (N, 2) pixels as seen in the picture; (N, 2, 8) their derivative by a change of the view; (N, 2, 3) by the
        points; NaN behind the camera.
    """
    return projected(
        np.ascontiguousarray(points_m), view.position_m, view.site_to_camera, view.camera.matrix, view.camera.distortion
    )


@compiled
def seen(
    points_m: FloatArray,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
    first_fold_r2: float,
) -> FloatArray:
    """Return what `project` does, for an eye as `eye_of` tells it."""
    pixels = np.full((len(points_m), 2), np.nan)
    in_camera, bent, slope = np.empty(3), np.empty(2), np.empty((2, 2))
    for n in range(len(points_m)):
        _to_camera(points_m[n], position_m, rotation, in_camera)
        if not in_camera[2] > 0.0:
            continue
        x, y = in_camera[0] / in_camera[2], in_camera[1] / in_camera[2]
        _bend(x, y, distortion, bent, slope)
        determinant = slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]
        if determinant > 0.0 and slope[0, 0] + slope[1, 1] > 0.0 and x * x + y * y < first_fold_r2:
            for axis in range(2):
                pixels[n, axis] = matrix[axis, axis] * bent[axis] + matrix[axis, 2]
    return pixels


@compiled
def projected(
    points_m: FloatArray,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what `project_with_jacobians` does."""
    count = len(points_m)
    pixels, by_view, by_point = np.empty((count, 2)), np.empty((count, 2, CHANGES)), np.empty((count, 2, 3))
    in_camera, bent, slope, by_camera = np.empty(3), np.empty(2), np.empty((2, 2)), np.empty(3)
    for n in range(count):
        _to_camera(points_m[n], position_m, rotation, in_camera)
        right, down, depth = in_camera[0], in_camera[1], in_camera[2]
        if not depth > 0.0:
            pixels[n], by_view[n], by_point[n] = np.nan, np.nan, np.nan
            continue
        x, y = right / depth, down / depth
        _bend(x, y, distortion, bent, slope)
        for axis in range(2):
            focal = matrix[axis, axis]
            pixels[n, axis] = focal * bent[axis] + matrix[axis, 2]
            by_camera[0], by_camera[1] = focal * slope[axis, 0] / depth, focal * slope[axis, 1] / depth
            by_camera[2] = -(by_camera[0] * x + by_camera[1] * y)
            # A turn w moves a point p of the camera frame by w x p.
            by_view[n, axis, 0] = by_camera[2] * down - by_camera[1] * depth
            by_view[n, axis, 1] = by_camera[0] * depth - by_camera[2] * right
            by_view[n, axis, 2] = by_camera[1] * right - by_camera[0] * down
            for k in range(3):
                moved = by_camera[0] * rotation[0, k] + by_camera[1] * rotation[1, k] + by_camera[2] * rotation[2, k]
                by_point[n, axis, k], by_view[n, axis, 3 + k] = moved, -moved
            by_view[n, axis, 6] = focal * bent[axis]
            by_view[n, axis, 7] = focal * _by_k1(x * x + y * y, distortion) * (x if axis == 0 else y)
    return pixels, by_view, by_point


@compiled
def on_ground(
    points_px: FloatArray,
    position_m: FloatArray,
    rotation: FloatArray,
    matrix: FloatArray,
    distortion: FloatArray,
    first_fold_r2: float,
) -> FloatArray:
    """Return (N, 2) where rays of picture points (N, 2) meet the ground z = 0, as `View.to_plane`; NaN where none."""
    places = np.full((len(points_px), 2), np.nan)
    straight, ray = np.empty(2), np.empty(3)
    for n in range(len(points_px)):
        x = (points_px[n, 0] - matrix[0, 2]) / matrix[0, 0]
        y = (points_px[n, 1] - matrix[1, 2]) / matrix[1, 1]
        if not _straighten(x, y, distortion, first_fold_r2, straight):
            continue
        for k in range(3):
            ray[k] = straight[0] * rotation[0, k] + straight[1] * rotation[1, k] + rotation[2, k]
        reach = -position_m[2] / ray[2]
        if reach > 0.0 and np.isfinite(reach):
            places[n, 0], places[n, 1] = position_m[0] + reach * ray[0], position_m[1] + reach * ray[1]
    return places


@compiled
def turned_by(vector: FloatArray, rotation: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) after a turn by a vector (3,), as `View.changed` turns a view."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    # Both factors at their limits, where the quotients would lose them.
    sine, bend = 1.0, 0.5
    if angle >= 1e-8:
        sine, bend = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
    turned = np.empty((3, 3))
    for k in range(3):
        x, y, z = rotation[0, k], rotation[1, k], rotation[2, k]
        along = bend * (vector[0] * x + vector[1] * y + vector[2] * z)
        kept = 1.0 - bend * angle**2
        turned[0, k] = kept * x + along * vector[0] + sine * (vector[1] * z - vector[2] * y)
        turned[1, k] = kept * y + along * vector[1] + sine * (vector[2] * x - vector[0] * z)
        turned[2, k] = kept * z + along * vector[2] + sine * (vector[0] * y - vector[1] * x)
    # A Newton step to the nearest rotation, so that many small turns in a row remain one.
    nearest = np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            nearest[i, k] = 1.5 * turned[i, k]
            for j in range(3):
                across = turned[i, 0] * turned[j, 0] + turned[i, 1] * turned[j, 1] + turned[i, 2] * turned[j, 2]
                nearest[i, k] -= 0.5 * across * turned[j, k]
    return nearest


@compiled
def _straighten(x: float, y: float, distortion: FloatArray, first_fold_r2: float, straight: FloatArray) -> bool:
    """Fill in (2,) the direction that the lens bends to x, y, by Newton's method; return whether there is one."""
    if len(distortion) == _FISHEYE:
        return _straighten_fisheye(x, y, distortion, first_fold_r2, straight)
    bent, slope = np.empty(2), np.empty((2, 2))
    straight[0], straight[1] = x, y
    for _ in range(_UNDISTORT_ITERATIONS):
        _bend(straight[0], straight[1], distortion, bent, slope)
        off_x, off_y = bent[0] - x, bent[1] - y
        determinant = slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]
        if not max(abs(off_x), abs(off_y)) >= _UNDISTORT_TOLERANCE:
            break
        straight[0] -= (slope[1, 1] * off_x - slope[0, 1] * off_y) / determinant
        straight[1] -= (slope[0, 0] * off_y - slope[1, 0] * off_x) / determinant
    _bend(straight[0], straight[1], distortion, bent, slope)
    determinant = slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]
    unfolded = determinant > 0.0 and slope[0, 0] + slope[1, 1] > 0.0
    unfolded = unfolded and straight[0] ** 2 + straight[1] ** 2 < first_fold_r2
    found: bool = unfolded and max(abs(bent[0] - x), abs(bent[1] - y)) < _UNDISTORTED
    return found


@compiled
def _straighten_fisheye(x: float, y: float, distortion: FloatArray, first_fold_r2: float, straight: FloatArray) -> bool:
    """Do what `_straighten` does for a fisheye, by the angle off the axis."""
    radius, largest = np.sqrt(x * x + y * y), np.arctan(np.sqrt(first_fold_r2))
    low, high, angle = 0.0, largest, min(radius, largest)
    for _ in range(_UNDISTORT_ITERATIONS):
        value, slope = _fisheye_radius(angle, distortion)
        off = value - radius
        # Not a number ends it, too.
        if not abs(off) > _UNDISTORT_TOLERANCE:
            break
        if off < 0.0:
            low = angle
        else:
            high = angle
        angle -= off / slope if slope != 0.0 else np.inf
        if not low < angle < high:
            angle = (low + high) / 2.0
    stretch = np.tan(angle) / radius if radius > 0.0 else 1.0
    straight[0], straight[1] = x * stretch, y * stretch
    found: bool = angle < largest and abs(_fisheye_radius(angle, distortion)[0] - radius) < _UNDISTORTED
    return found


@compiled
def _to_camera(point_m: FloatArray, position_m: FloatArray, rotation: FloatArray, in_camera: FloatArray) -> None:
    """Fill in (3,) the point to the right, down and ahead of the camera."""
    for axis in range(3):
        in_camera[axis] = 0.0
        for k in range(3):
            in_camera[axis] += rotation[axis, k] * (point_m[k] - position_m[k])


@compiled
def _bend(x: float, y: float, distortion: FloatArray, bent: FloatArray, slope: FloatArray) -> None:
    """Fill in (2,) a direction x / z, y / z as the lens bends it, and (2, 2) the derivative."""
    r2 = x * x + y * y
    if len(distortion) == _FISHEYE:
        radial, across = 1.0, 2.0 * distortion[0] - 2.0 / 3.0
        if r2 >= _CENTRE:
            radius = np.sqrt(r2)
            bent_radius, steepness = _fisheye_radius(np.arctan(radius), distortion)
            radial = bent_radius / radius
            across = (steepness / (1.0 + r2) - radial) / r2
        bent[0], bent[1] = x * radial, y * radial
        slope[0, 0], slope[1, 1] = radial + x * x * across, radial + y * y * across
        slope[0, 1] = slope[1, 0] = x * y * across
        return
    k1, k2, p1, p2, k3 = distortion[0], distortion[1], distortion[2], distortion[3], distortion[4]
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    growth = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
    bent[0] = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    bent[1] = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    slope[0, 0] = radial + 2.0 * x * x * growth + 2.0 * p1 * y + 6.0 * p2 * x
    slope[0, 1] = slope[1, 0] = 2.0 * x * y * growth + 2.0 * p1 * x + 2.0 * p2 * y
    slope[1, 1] = radial + 2.0 * y * y * growth + 6.0 * p1 * y + 2.0 * p2 * x


@compiled
def _fisheye_radius(angle: float, distortion: FloatArray) -> tuple[float, float]:
    """Return the radius in the picture of an angle off the axis, and its derivative."""
    k1, k2, k3, k4 = distortion[0], distortion[1], distortion[2], distortion[3]
    a2 = angle * angle
    radius = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
    return radius, 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))


@compiled
def _by_k1(r2: float, distortion: FloatArray) -> float:
    """Return the derivative of a bent direction by k1, as a share of the direction, whose squared radius is given."""
    if len(distortion) != _FISHEYE:
        return r2
    radius = np.sqrt(r2)
    by_k1: float = np.arctan(radius) ** 3 / radius if r2 >= _CENTRE else r2
    return by_k1
