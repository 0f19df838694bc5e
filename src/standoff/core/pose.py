"""Where a camera is and where it looks: site coordinates to pixels and back.

Site frame: x east, y north, z up, metres. Camera frame: x to the right of the picture, y down, z forward.
Pixels follow the half-pixel convention of `standoff.core.camera`.

A *change* of a view has eight parameters, `CHANGES`: a small turn about the camera's own axes (rad), a shift of its
position in the site frame (m), the logarithm of a factor of the focal length, and an addition to the lens's k1.
Covariances of views are of these.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray

CHANGES = 8
"""Parameters of a change: turn (3), shift (3), log focal length, k1."""

TURN, SHIFT, POSE, LENS = slice(0, 3), slice(3, 6), slice(0, 6), slice(6, 8)
"""Their places in a change."""

_MAX_STRETCH, _MAX_SKEW = 1e-5, 1e-9
"""A rotation's axes may miss being unit vectors by so much, and right angles hardly: matrices are read from files."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A camera at a place, looking somewhere.

    Attributes:
        camera: Lens and picture size.
        position_m: (3,) of the optical centre, site frame.
        site_to_camera: (3, 3) rotation; its rows are the camera's axes in the site frame.
    """

    camera: Camera
    position_m: FloatArray
    site_to_camera: FloatArray

    def __post_init__(self) -> None:
        position = np.array(self.position_m, dtype=np.float64)
        rotation = np.array(self.site_to_camera, dtype=np.float64)
        if position.shape != (3,) or rotation.shape != (3, 3):
            raise ValueError(f"position must be (3,), rotation (3, 3), not {position.shape} and {rotation.shape}")
        if not _is_rotation(rotation):
            raise ValueError("site_to_camera must be a rotation")
        position.setflags(write=False)
        rotation.setflags(write=False)
        object.__setattr__(self, "position_m", position)
        object.__setattr__(self, "site_to_camera", rotation)

    @classmethod
    def aimed(
        cls, camera: Camera, position_m: FloatArray, *, heading_deg: float, pitch_deg: float, roll_deg: float = 0.0
    ) -> Self:
        """Point the camera as a gimbal does.

        Args:
            camera: Lens and picture size.
            position_m: (3,) site frame.
            heading_deg: Where the picture's upper edge points on the ground, clockwise from north.
            pitch_deg: Downwards from the horizon: 0 looks at it, 90 straight down.
            roll_deg: Right side of the picture down is positive.
        """
        heading, pitch, roll = np.deg2rad([heading_deg, pitch_deg, roll_deg])
        right = np.array([np.cos(heading), -np.sin(heading), 0.0])
        ahead = np.array([np.sin(heading), np.cos(heading), 0.0])
        forward = np.cos(pitch) * ahead - np.sin(pitch) * np.array([0.0, 0.0, 1.0])
        down = np.cross(forward, right)
        rolled_right = np.cos(roll) * right + np.sin(roll) * down
        return cls(camera, position_m, np.stack([rolled_right, np.cross(forward, rolled_right), forward]))

    @property
    def heading_rad(self) -> float:
        """Where the picture's upper edge points on the ground, clockwise from the site's y axis."""
        return float(np.arctan2(-self.site_to_camera[0, 1], self.site_to_camera[0, 0]))

    @property
    def pitch_rad(self) -> float:
        """How far the camera looks down from the horizon."""
        return float(roll_and_pitch(self.site_to_camera)[1])

    @property
    def roll_rad(self) -> float:
        """How far the picture's right side is down."""
        return float(roll_and_pitch(self.site_to_camera)[0])

    def project(self, points_m: FloatArray) -> FloatArray:
        """Show where points of the site appear, lens distortion included.

        Args:
            points_m: (N, 3), site frame.

        Returns:
            (N, 2) pixels, in or outside the picture; NaN behind the camera or outside the lens model.
        """
        return self.camera.distort(self.project_pinhole(points_m))

    def project_pinhole(self, points_m: FloatArray) -> FloatArray:
        """Show where points of the site would appear without lens distortion; NaN behind the camera."""
        offset = np.asarray(points_m, dtype=np.float64).reshape(-1, 3) - self.position_m
        homogeneous = offset @ (self.camera.matrix @ self.site_to_camera).T
        depth_m = homogeneous[:, 2:]
        pinhole_px: FloatArray = homogeneous[:, :2] / np.where(depth_m > 0, depth_m, np.nan)
        return pinhole_px

    def rays(self, points_px: FloatArray) -> FloatArray:
        """Return (N, 3) unit vectors in the site frame from the camera through picture points (N, 2); NaN if none."""
        pinhole_px = self.camera.undistort(np.asarray(points_px, dtype=np.float64).reshape(-1, 2))
        homogeneous = np.column_stack([pinhole_px, np.ones(len(pinhole_px))])
        direction = homogeneous @ (self.site_to_camera.T @ np.linalg.inv(self.camera.matrix)).T
        unit: FloatArray = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        return unit

    def to_plane(self, points_px: FloatArray, height_m: float = 0.0) -> FloatArray:
        """Intersect the rays of picture points with the horizontal plane z = height_m.

        Args:
            points_px: (N, 2), as seen in the picture.
            height_m: Of the plane.

        Returns:
            (N, 2) x east, y north; NaN where the ray does not meet the plane in front of the camera.
        """
        ray = self.rays(points_px)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach_m = (height_m - self.position_m[2]) / ray[:, 2]
        reach_m = np.where(np.isfinite(reach_m) & (reach_m > 0), reach_m, np.nan)
        xy_m: FloatArray = self.position_m[:2] + ray[:, :2] * reach_m[:, None]
        return xy_m

    def plane_to_pinhole(self, height_m: float = 0.0) -> FloatArray:
        """Return the signed (3, 3) homography from the plane z = height_m to undistorted pixels."""
        camera_from_plane = np.column_stack(
            [self.site_to_camera[:, :2], self.site_to_camera @ (np.array([0.0, 0.0, height_m]) - self.position_m)]
        )
        homography: FloatArray = self.camera.matrix @ camera_from_plane
        return homography

    def changed(self, change: FloatArray) -> View:
        """Return the view after a change of eight parameters (see the module's head)."""
        change = np.asarray(change, dtype=np.float64)
        camera = self.camera
        log_focal, k1 = change[LENS].tolist()
        if log_focal or k1:
            camera = camera.refocused(math.exp(log_focal), float(camera.distortion[0]) + k1)
        turned = rotation_from_vector(change[TURN]) @ self.site_to_camera
        # Many small turns in a row must remain a rotation: a Newton step to the nearest one doubles the right digits.
        turned = 1.5 * turned - 0.5 * turned @ turned.T @ turned
        return View(camera, self.position_m + change[SHIFT], turned)

    def change_from(self, other: View) -> FloatArray:
        """Return the change (8,) that leads from another view to this one."""
        change = np.empty(CHANGES)
        change[TURN] = vector_from_rotation(self.site_to_camera @ other.site_to_camera.T)
        change[SHIFT] = self.position_m - other.position_m
        change[6] = math.log(self.camera.matrix[0, 0] / other.camera.matrix[0, 0])
        change[7] = self.camera.distortion[0] - other.camera.distortion[0]
        return change

    def project_with_jacobians(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Project points, and say how their pictures move with the view and with the points.

        Args:
            points_m: (N, 3), site frame.

        Returns:
            (N, 2) pixels as seen in the picture; (N, 2, 8) their derivative by a change of the view; (N, 2, 3) by the
            points; NaN behind the camera.
        """
        points_m = np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
        in_camera = (points_m - self.position_m) @ self.site_to_camera.T
        depth = np.where(in_camera[:, 2] > 0, in_camera[:, 2], np.nan)
        normalised = in_camera[:, :2] / depth[:, None]
        distorted, by_normalised = self.camera.distorted_with_jacobian(normalised)
        focal = np.array([self.camera.matrix[0, 0], self.camera.matrix[1, 1]])
        points_px = distorted * focal + self.camera.matrix[:2, 2]

        by_camera_point = np.zeros((len(points_m), 2, 3))
        by_camera_point[:, 0, 0] = by_camera_point[:, 1, 1] = 1.0 / depth
        by_camera_point[:, :, 2] = -normalised / depth[:, None]
        by_camera_point = focal[:, None] * (by_normalised @ by_camera_point)
        by_point = by_camera_point @ self.site_to_camera
        by_view = np.empty((len(points_m), 2, CHANGES))
        # A turn w moves a point p of the camera frame by w x p.
        x, y, z = in_camera.T
        zero = np.zeros_like(x)
        cross = np.stack([np.stack([zero, z, -y], -1), np.stack([-z, zero, x], -1), np.stack([y, -x, zero], -1)], 1)
        by_view[:, :, TURN] = by_camera_point @ cross
        by_view[:, :, SHIFT] = -by_point
        by_view[:, :, 6] = distorted * focal
        by_view[:, :, 7] = self.camera.distorted_by_k1(normalised) * focal
        return points_px, by_view, by_point


def roll_and_pitch(site_to_camera: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far the picture's right side is down, and how far the camera looks down.

    Args:
        site_to_camera: (..., 3, 3) rotations.

    Returns:
        (...) both, rad.
    """
    right, down, forward = site_to_camera[..., 0, 2], site_to_camera[..., 1, 2], site_to_camera[..., 2, 2]
    pitch = np.arcsin(np.clip(-forward, -1.0, 1.0))
    # Looking straight down there is no roll: every turn is one of heading.
    level = np.maximum(np.hypot(right, down), 1e-9)
    return np.arcsin(np.clip(-right / level, -1.0, 1.0)) * np.cos(pitch), pitch


def rotation_from_vector(vector: FloatArray) -> FloatArray:
    """Return the (3, 3) rotation by |vector| radians about a vector (Rodrigues).

    >>> np.round(rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])) @ [1.0, 0.0, 0.0], 9) + 0.0
    array([0., 1., 0.])
    """
    x, y, z = (float(component) for component in vector)
    angle = math.sqrt(x * x + y * y + z * z)
    # Both factors at their limits, where the quotients would lose them.
    turned, bent = (1.0, 0.5) if angle < 1e-8 else (math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2)
    return np.array(
        [
            [1.0 - bent * (y * y + z * z), bent * x * y - turned * z, bent * x * z + turned * y],
            [bent * x * y + turned * z, 1.0 - bent * (x * x + z * z), bent * y * z - turned * x],
            [bent * x * z - turned * y, bent * y * z + turned * x, 1.0 - bent * (x * x + y * y)],
        ]
    )


def vector_from_rotation(rotation: FloatArray) -> FloatArray:
    """Return the vector (3,) of `rotation_from_vector`, for turns of less than half a circle.

    >>> np.round(vector_from_rotation(rotation_from_vector(np.array([0.1, -0.2, 0.3]))), 9)
    array([ 0.1, -0.2,  0.3])
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    x, y, z = zy - yz, xz - zx, yx - xy
    sine, cosine = math.sqrt(x * x + y * y + z * z) / 2.0, (xx + yy + zz - 1.0) / 2.0
    factor = 0.5 if sine < 1e-9 else math.atan2(sine, cosine) / (2.0 * sine)
    return np.array([x * factor, y * factor, z * factor])


def _is_rotation(matrix: FloatArray) -> bool:
    """Return whether the rows of (3, 3) are unit vectors at right angles, right-handed; numpy would take longer."""
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    return bool(
        abs(a * a + b * b + c * c - 1.0) <= _MAX_STRETCH
        and abs(d * d + e * e + f * f - 1.0) <= _MAX_STRETCH
        and abs(g * g + h * h + i * i - 1.0) <= _MAX_STRETCH
        and abs(a * d + b * e + c * f) <= _MAX_SKEW
        and abs(d * g + e * h + f * i) <= _MAX_SKEW
        and abs(g * a + h * b + i * c) <= _MAX_SKEW
        and (b * f - c * e) * g + (c * d - a * f) * h + (a * e - b * d) * i > 0.0
    )


def poses_of_plane(plane_to_camera: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the poses whose view of the ground z = 0 is nearest to given homographies.

    The first two columns of such a homography are the first two of the rotation, times a scale that both share.
    Where they are not quite at right angles and equally long, the nearest two that are take their place.

    Args:
        plane_to_camera: (..., 3, 3) signed, from metres to normalised pinhole coordinates (x / z, y / z).

    Returns:
        (..., 3, 3) rotations site_to_camera and (..., 3) positions in the site frame; below the ground where the
        homography is a mirror's.
    """
    columns = plane_to_camera[..., :2]
    gram = np.swapaxes(columns, -1, -2) @ columns
    product = np.sqrt(np.linalg.det(gram))[..., None, None]
    both = np.sqrt(np.trace(gram, axis1=-2, axis2=-1)[..., None, None] + 2.0 * product)
    # Of the 2 x 2 matrix G, (G + sqrt(det G) I) / sqrt(trace G + 2 sqrt(det G)) is the square root.
    root = (gram + product * np.eye(2)) / both
    axes = columns @ np.linalg.inv(root)
    rotation = np.concatenate([axes, np.cross(axes[..., 0], axes[..., 1])[..., None]], axis=-1)
    shift_m = plane_to_camera[..., 2] / (both[..., 0] / 2.0)
    position_m: FloatArray = -np.einsum("...ji,...j->...i", rotation, shift_m)
    return rotation, position_m


def view_from_homography(image_to_ground: FloatArray, camera: Camera) -> View:
    """Return where a known camera is, from its map of the ground.

    Args:
        image_to_ground: (3, 3) signed homography from undistorted pixels to metres, x east, y north seen from above.
        camera: Lens; a homography that no pose of this camera explains exactly gives the nearest one.

    Raises:
        GroundError: No camera above the ground sees it so: the ground's axes are left-handed, or it is seen edge on.

    >>> camera = Camera(200, 100, np.array([[90.0, 0.0, 100.0], [0.0, 90.0, 50.0], [0.0, 0.0, 1.0]]), np.zeros(5))
    >>> view = View.aimed(camera, np.array([1.0, 2.0, 30.0]), heading_deg=10.0, pitch_deg=50.0)
    >>> view_from_homography(np.linalg.inv(view.plane_to_pinhole()), camera).position_m.round(9).tolist()
    [1.0, 2.0, 30.0]
    """
    try:
        plane_to_camera = np.linalg.inv(camera.matrix) @ np.linalg.inv(image_to_ground)
        rotation, position_m = poses_of_plane(plane_to_camera)
    except np.linalg.LinAlgError as error:
        raise _no_view("a matrix that has no inverse") from error
    if not np.isfinite(rotation).all() or not np.isfinite(position_m).all():
        raise _no_view("a plane seen edge on")
    if position_m[2] <= 0:
        raise _no_view("the ground seen from below, as in a mirror")
    return View(camera, position_m, rotation)


def _no_view(found: str) -> GroundError:
    return GroundError(
        expected="a map of ground that a camera above it sees",
        found=found,
        fix="give x and y of the ground so that y is to the left of x, seen from above",
    )
