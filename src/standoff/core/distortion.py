"""How lenses bend directions: Brown and Conrady's polynomial, and the equidistant fisheye.

Directions are normalised: (N, 2) x / z and y / z in the camera frame, so that only what lies less than 90 degrees off
the axis has one. Coefficients are in OpenCV's order: k1, k2, p1, p2, k3 of Brown and Conrady (`cv2.undistortPoints`);
k1 to k4 of the fisheye (`cv2.fisheye`), whose radius in the picture is theta (1 + k1 theta^2 + ... + k4 theta^8), theta
the angle off the axis (Kannala and Brandt 2006, Eq. 6).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from standoff.core.homography import FloatArray

_CENTRE: Final = 1e-12
"""Square of the radius below which a fisheye's quotients would lose their digits: there it is its own limit."""
_NO_BEND: Final = 1e-30
_ROUNDS: Final = 60
_TOLERANCE: Final = 1e-14


def bent_by_brown(normalised: FloatArray, coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (N, 2) directions as a lens of five coefficients bends them, and (N, 2, 2) the derivative."""
    k1, k2, p1, p2, k3 = coefficients
    x, y = normalised.T
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
    x2, y2 = 2.0 * x, 2.0 * y
    xx2, xy2, yy2, p1x2, p2x2 = x2 * x, x2 * y, y2 * y, 2.0 * p1 * x, 2.0 * p2 * x
    bent, jacobian = np.empty((len(x), 2)), np.empty((len(x), 2, 2))
    bent[:, 0] = x * radial + p1x2 * y + p2 * (r2 + xx2)
    bent[:, 1] = y * radial + p1 * (r2 + yy2) + p2x2 * y
    jacobian[:, 0, 0] = radial + xx2 * slope + p1 * y2 + 6.0 * p2 * x
    jacobian[:, 0, 1] = jacobian[:, 1, 0] = xy2 * slope + p1x2 + p2 * y2
    jacobian[:, 1, 1] = radial + yy2 * slope + 6.0 * p1 * y + p2x2
    return bent, jacobian


def bent_by_fisheye(normalised: FloatArray, coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (N, 2) directions as a fisheye of four coefficients bends them, and (N, 2, 2) the derivative."""
    x, y = normalised.T
    r2 = x * x + y * y
    at_centre = r2 < _CENTRE
    safe_r2 = np.where(at_centre, 1.0, r2)
    radius = np.sqrt(safe_r2)
    bent_radius, slope = _fisheye_radius(np.arctan(radius), coefficients)
    radial = np.where(at_centre, 1.0, bent_radius / radius)
    across = np.where(at_centre, 2.0 * coefficients[0] - 2.0 / 3.0, (slope / (1.0 + safe_r2) - radial) / safe_r2)
    jacobian = np.empty((len(x), 2, 2))
    jacobian[:, 0, 0] = radial + x * x * across
    jacobian[:, 0, 1] = jacobian[:, 1, 0] = x * y * across
    jacobian[:, 1, 1] = radial + y * y * across
    return normalised * radial[:, None], jacobian


def straightened_by_fisheye(bent: FloatArray, coefficients: FloatArray, fold_r2: float) -> FloatArray:
    """Return (N, 2) the directions that a fisheye bends to (N, 2) given ones; NaN where there are none.

    Args:
        bent: As the lens shows them.
        coefficients: (4,).
        fold_r2: From `fisheye_fold_r2`.
    """
    radius = np.hypot(bent[:, 0], bent[:, 1])
    largest = math.atan(math.sqrt(fold_r2))
    # Newton's method within an interval that always holds the angle: far out, the polynomial may bend either way.
    low, high = np.zeros(len(radius)), np.full(len(radius), largest)
    angle = np.clip(radius, 0.0, largest)
    for _ in range(_ROUNDS):
        value, slope = _fisheye_radius(angle, coefficients)
        off = value - radius
        if not (np.abs(off) > _TOLERANCE).any():
            break
        low, high = np.where(off < 0.0, angle, low), np.where(off > 0.0, angle, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = angle - off / slope
        angle = np.where((step > low) & (step < high), step, (low + high) / 2.0)
    value, _slope = _fisheye_radius(angle, coefficients)
    found = (np.abs(value - radius) < 1e-9) & (angle < largest)
    with np.errstate(divide="ignore", invalid="ignore"):
        stretch = np.where(radius < math.sqrt(_CENTRE), 1.0, np.tan(angle) / radius)
    straight: FloatArray = np.where(found[:, None], bent * stretch[:, None], np.nan)
    return straight


def brown_by_k1(normalised: FloatArray) -> FloatArray:
    """Return (N, 2) the derivative of `bent_by_brown` by k1."""
    moved: FloatArray = normalised * (normalised**2).sum(axis=1, keepdims=True)
    return moved


def fisheye_by_k1(normalised: FloatArray) -> FloatArray:
    """Return (N, 2) the derivative of `bent_by_fisheye` by k1."""
    radius = np.sqrt((normalised**2).sum(axis=1, keepdims=True))
    moved: FloatArray = normalised * np.arctan(radius) ** 3 / np.maximum(radius, math.sqrt(_CENTRE))
    return moved


def brown_fold_r2(coefficients: FloatArray) -> float:
    """Return the square of the undistorted radius at which the radial polynomial first turns back; inf if never."""
    k1, k2, _, _, k3 = coefficients.tolist()
    if k3 == 0.0:
        return _first_root(3.0 * k1, 5.0 * k2)
    return _first_positive_root([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])


def fisheye_fold_r2(coefficients: FloatArray) -> float:
    """Return the square of the undistorted radius at which the fisheye's polynomial first turns back.

    Infinite where it grows up to 90 degrees off the axis.
    """
    k1, k2, k3, k4 = coefficients.tolist()
    fold = math.sqrt(_first_positive_root([9.0 * k4, 7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0]))
    return math.tan(fold) ** 2 if fold < math.pi / 2.0 else math.inf


def _fisheye_radius(angle: FloatArray, coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (N,) radii in the picture of angles off the axis (rad), and their derivative."""
    k1, k2, k3, k4 = coefficients
    a2 = angle * angle
    radius = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
    slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))
    return radius, slope


def _first_positive_root(polynomial: list[float]) -> float:
    """Return the smallest positive root of a polynomial, highest power first; inf if there is none."""
    # What is smaller only makes roots where no lens sees, and overflows.
    roots = np.roots([0.0 if abs(one) < _NO_BEND else one for one in polynomial])
    real = roots.real[(roots.real > 0) & (np.abs(roots.imag) < 1e-12)]
    return float(real.min(initial=np.inf))


def _first_root(slope: float, bend: float) -> float:
    """Return the smallest positive root of 1 + slope x + bend x^2, without cancellation; inf if there is none."""
    discriminant = slope * slope - 4.0 * bend
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    if slope > 0.0:
        return -(slope + root) / (2.0 * bend) if bend < 0.0 else math.inf
    return 2.0 / (root - slope) if root > slope else math.inf
