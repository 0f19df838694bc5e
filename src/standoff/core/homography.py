"""Plane-to-plane projective maps: apply, invert, estimate, and carry errors through them.

A homography here is a (3, 3) float64 matrix *with a sign*: the projective denominator
`w = h31 x + h32 y + h33` is positive for points in front of the camera. A point with w <= 0 is
beyond the horizon and has no image under the map: its result is NaN and `valid` is False. No epsilon
is ever added to a denominator.

The parameters of a map are the nine entries, row by row. A covariance of parameters is (9, 9) and has
rank 8: the common scale of all entries moves no point, so it needs no variance.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def apply(matrix: FloatArray, points: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Map points through a homography.

    Args:
        matrix: (3, 3), source_to_target, signed.
        points: (N, 2) in source units.

    Returns:
        The (N, 2) points in target units, rows of NaN where invalid, and the (N,) validity: False
        beyond the horizon and for points that are not finite.

    Source:
        Paper, section 5.1, Eq. 5.

    >>> apply(np.diag([2.0, 2.0, 1.0]), np.array([[1.0, 3.0]]))[0]
    array([[2., 6.]])
    """
    mapped, _, valid = _applied(matrix, points)
    return mapped, valid


def _applied(matrix: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return what `apply` does, and between the two the (N,) denominators; NaN beyond the horizon."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    with np.errstate(invalid="ignore", over="ignore"):
        w = points @ matrix[2, :2] + matrix[2, 2]
        w = np.where(w > 0, w, np.nan)
        mapped = (points @ matrix[:2, :2].T + matrix[:2, 2]) / w[:, None]
    # Of a point that is not finite the sums are not, or their quotient is not.
    finite = np.isfinite(mapped)
    valid: BoolArray = finite[:, 0] & finite[:, 1]
    mapped[~valid] = np.nan
    return mapped, w, valid


def invert(matrix: FloatArray) -> FloatArray:
    """Invert a signed homography so that the inverse is signed as well.

    A point with a positive denominator under `matrix` has a positive one under the result on its way
    back, because the exact inverse satisfies w_back = 1 / w_forth.

    Raises:
        numpy.linalg.LinAlgError: The matrix is singular.
    """
    return np.linalg.inv(np.asarray(matrix, dtype=np.float64))


def signed(matrix: FloatArray, point_in_front: FloatArray) -> FloatArray:
    """Return the matrix scaled to unit Frobenius norm with w > 0 at a point known to be in front.

    Args:
        matrix: (3, 3), any scale and sign.
        point_in_front: (2,) in source units.

    >>> signed(-np.eye(3), np.array([0.0, 0.0]))[2, 2] > 0
    np.True_
    """
    matrix = matrix / np.linalg.norm(matrix)
    w = float(matrix[2, :2] @ np.asarray(point_in_front, dtype=np.float64) + matrix[2, 2])
    return matrix if w > 0 else -matrix


def point_jacobian(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Return d target / d source point.

    Args:
        matrix: (3, 3), signed.
        points: (N, 2) in source units.

    Returns:
        (N, 2, 2) in target units per source unit; NaN where the point is invalid.

    >>> point_jacobian(np.diag([2.0, 3.0, 1.0]), np.array([[5.0, 5.0]]))[0]
    array([[2., 0.],
           [0., 3.]])
    """
    mapped, w, _ = _applied(matrix, points)
    jacobian: FloatArray = (matrix[None, :2, :2] - mapped[:, :, None] * matrix[2, :2]) / w[:, None, None]
    return jacobian


def stretches(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how long a step of one becomes under each linear map, at most and at least: its singular values.

    Args:
        jacobian: (N, 2, 2).

    Returns:
        (N,) and (N,); NaN where the map is.

    >>> stretches(np.array([[[0.0, -3.0], [2.0, 0.0]]]))
    (array([3.]), array([2.]))
    """
    (a, b), (c, d) = jacobian.transpose(1, 2, 0)
    longest: FloatArray = (np.hypot(a + d, b - c) + np.hypot(a - d, b + c)) / 2.0
    # The difference of the two would cancel; of a turn they are equal, but for rounding.
    shortest: FloatArray = np.minimum(np.abs(a * d - b * c) / np.where(longest > 0.0, longest, 1.0), longest)
    return longest, shortest


def parameter_jacobian(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Return d target point / d the nine entries of the matrix, row by row.

    Args:
        matrix: (3, 3), signed.
        points: (N, 2) in source units.

    Returns:
        (N, 2, 9); NaN where the point is invalid.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    mapped, w, valid = _applied(matrix, points)
    over_w = np.ones((len(points), 3))
    over_w[:, :2] = np.where(valid[:, None], points, np.nan)
    over_w /= w[:, None]
    jacobian = np.zeros((len(points), 2, 9))
    jacobian[:, 0, 0:3] = over_w
    jacobian[:, 1, 3:6] = over_w
    jacobian[:, :, 6:9] = -mapped[:, :, None] * over_w[:, None, :]
    jacobian[~valid] = np.nan
    return jacobian


def normalisation(points: FloatArray) -> FloatArray:
    """Return the similarity (3, 3) that centres (N, 2) points and makes their mean square distance 2 (Hartley 1997)."""
    centre = points.mean(axis=0)
    spread = np.sqrt(((points - centre) ** 2).sum(axis=1).mean())
    scale = np.sqrt(2.0) / spread
    return np.array([[scale, 0.0, -scale * centre[0]], [0.0, scale, -scale * centre[1]], [0.0, 0.0, 1.0]])


def fit(source: FloatArray, target: FloatArray) -> FloatArray:
    """Estimate the homography from four or more point pairs by the direct linear transformation.

    Coordinates are normalised first (Hartley 1997), which leaves the exact four-point solution
    unchanged and makes the over-determined one independent of the choice of units.

    Args:
        source: (N, 2), N >= 4, no three collinear among the four that fix the map.
        target: (N, 2).

    Returns:
        (3, 3) source_to_target, unit Frobenius norm, signed so that the mean source point is in front.

    Raises:
        numpy.linalg.LinAlgError: The points do not determine a homography.

    Source:
        Paper, section 5.1, Eq. 4, with the erratum in METHOD.md, section 2.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> np.round(apply(fit(square, 3 * square + 1), np.array([[0.5, 0.5]]))[0], 6)
    array([[2.5, 2.5]])
    """
    source = np.asarray(source, dtype=np.float64)
    target = np.asarray(target, dtype=np.float64)
    if len(source) < 4 or source.shape != target.shape:
        raise np.linalg.LinAlgError("a homography needs four or more point pairs")
    normalise_source, normalise_target = normalisation(source), normalisation(target)
    x, y = apply(normalise_source, source)[0].T
    u, v = apply(normalise_target, target)[0].T
    zero, one = np.zeros_like(x), np.ones_like(x)
    rows = np.concatenate(
        [
            np.column_stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u]),
            np.column_stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v]),
        ]
    )
    if not np.isfinite(rows).all():
        raise np.linalg.LinAlgError("points coincide or are not finite")
    _, singular_values, vt = np.linalg.svd(rows)
    if singular_values[7] < 1e-9 * singular_values[0]:
        raise np.linalg.LinAlgError("points are collinear or coincide")
    normalised = vt[-1].reshape(3, 3)
    if np.linalg.cond(normalised) > 1e9:
        raise np.linalg.LinAlgError("three points are collinear on one side only")
    matrix = np.linalg.inv(normalise_target) @ normalised @ normalise_source
    return signed(matrix, source.mean(axis=0))


def fit_covariance(matrix: FloatArray, source: FloatArray, source_covariance: FloatArray) -> FloatArray:
    """Return the covariance of a fitted homography's entries, first order.

    The fit makes `apply(matrix, source)` equal to the targets in the least-squares sense; a small error
    of the source points moves the entries by the pseudo-inverse of the parameter Jacobian.

    Args:
        matrix: (3, 3) as fitted.
        source: (N, 2) points that it was fitted to.
        source_covariance: (N, 2, 2) of those points, independent of each other, in source units squared.

    Returns:
        (9, 9), rank 8.
    """
    by_parameters = parameter_jacobian(matrix, source).reshape(-1, 9)
    by_points = point_jacobian(matrix, source)
    target_covariance = by_points @ source_covariance @ by_points.transpose(0, 2, 1)
    solve = np.linalg.pinv(by_parameters, rcond=1e-12)
    blocks = solve.reshape(9, len(source), 2)
    covariance = np.einsum("inj,njk,lnk->il", blocks, target_covariance, blocks)
    symmetric: FloatArray = (covariance + covariance.T) / 2.0
    return symmetric
