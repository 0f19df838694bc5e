"""Lay a solid of any outline over the edges of a box, from everywhere, and keep the places where it comes to rest.

A level camera at every heading and pitch sees the solid fill the box. Each such pose is pulled to the nearest edges
that run as its own do, the best of them more often, until their outlines lie on edges, rightly or not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.pose import roll_and_pitch
from standoff.core.types import IntArray
from standoff.stages.ground.edge_field import EdgeField
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.solid_poses import AROUND, Poses, poses_in_box, to_pinhole

_AROUND, _LEAST, _UPRIGHT = 36, 3, 3
"""Points around each of both outlines, at least on each side, and on each upright edge."""

_FIRST_REACH = 12.0
_STAGES = ((200, (12.0, 12.0)), (80, (10.0, 8.0, 6.0)), (40, (5.0, 4.0, 3.0, 3.0)))
"""So many poses are pulled at edges within so many cells of the field, round by round."""

_LAST_REACH = 2.5
_CHUNK = 1000
_BARE_COST = 0.45
_NARROW = 1.5
_ALIKE = 2.0
"""Cells: a strip that is narrower has one edge, and outlines that are nearer to each other are the same."""

_PULL_SIGMA, _STEP_SIGMA = 3.0, 0.5
"""Of an outline about its edges, px for each px of outline; and of a step, rad or distances to the solid."""

_ROLL_SIGMA_RAD = np.deg2rad(5.0)
_MAX_ROLL_RAD, _MIN_PITCH_RAD = np.deg2rad(30.0), np.deg2rad(5.0)
_MAX_STEP = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class _Wire:
    """Points on all edges of a solid of N corners: N edges of the top, then N of the base, then N upright ones.

    Attributes:
        xy_m: (S, 2) site frame.
        z_share: (S,) of the height.
        edge: (S,) on which edge each is.
        mean: (S, 3 N) takes the mean over the points of each edge.
    """

    xy_m: FloatArray
    z_share: FloatArray
    edge: IntArray
    mean: FloatArray

    @classmethod
    def of(cls, shape: ReferenceShape) -> _Wire:
        """Put points on the edges, evenly."""
        corners, count = shape.corners_m, len(shape.corners_m)
        following = np.roll(corners, -1, axis=0)
        on_side = np.maximum(np.rint(_AROUND * shape.sides_m / shape.sides_m.sum()), _LEAST).astype(np.int64)
        side = np.repeat(np.arange(count), on_side)
        along = (np.arange(len(side)) - np.repeat(np.cumsum(on_side) - on_side, on_side) + 0.5) / on_side[side]
        level = corners[side] + along[:, None] * (following - corners)[side]
        upright = np.repeat(np.arange(count), _UPRIGHT)
        edge = np.concatenate([side, count + side, 2 * count + upright])
        shares = np.tile((np.arange(_UPRIGHT) + 0.5) / _UPRIGHT, count)
        belongs = edge[:, None] == np.arange(3 * count)
        return cls(
            xy_m=np.concatenate([level, level, corners[upright]]),
            z_share=np.concatenate([np.ones(len(side)), np.zeros(len(side)), shares]),
            edge=edge,
            mean=belongs / belongs.sum(axis=0),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Looks:
    """What lies near the edges of a solid at P poses.

    Attributes:
        in_camera: (P, S, 3) the wire's points, camera frame.
        normal: (P, S, 2) across their edges, in the picture.
        across_px: (P, S) how far along the normal the nearest edge point is that runs the same way.
        distance_px: (P, S) of it; inf where there is none.
        length_px: (P, 3 N) of each edge as the camera sees it; 0 where it does not.
    """

    in_camera: FloatArray
    normal: FloatArray
    across_px: FloatArray
    distance_px: FloatArray
    length_px: FloatArray


def matching_states(
    field: EdgeField,
    box_xyxy_px: FloatArray,
    shape: ReferenceShape,
    camera: Camera,
    heights_m: tuple[float, ...],
    height_sigma_m: float,
) -> list[SolidState]:
    """Find the states in which a solid's outline lies on edges.

    Args:
        field: The edges in and around the box.
        box_xyxy_px: (4,) undistorted, about where the solid is.
        shape: Of the solid.
        camera: Lens and picture size.
        heights_m: Of the solid, to begin with.
        height_sigma_m: Standard error of each.

    Returns:
        The best first, no two alike; what they are worth has to be seen in the picture.
    """
    wire = _Wire.of(shape)
    poses = poses_in_box(box_xyxy_px, shape, camera, heights_m)
    parts = [poses[k : k + _CHUNK] for k in range(0, len(poses), _CHUNK)]
    first_px = _FIRST_REACH * field.cell_px
    score = np.concatenate(
        [np.zeros(0), *(_scores(_look(field, part, wire, shape, camera), wire, first_px) for part in parts)]
    )
    order = np.argsort(-score, kind="stable")
    for count, reaches in _STAGES:
        poses = poses[order[:count]]
        begun_m = poses.height_m
        for reach in reaches:
            looks = _look(field, poses, wire, shape, camera)
            poses = _pulled(looks, poses, wire, camera, reach * field.cell_px, begun_m, height_sigma_m)
        score = _scores(_look(field, poses, wire, shape, camera), wire, _LAST_REACH * field.cell_px)
        order = _ranked(score, poses, shape, camera, _ALIKE * field.cell_px)
    return [poses.state(k, camera) for k in order.tolist()]


def _look(field: EdgeField, poses: Poses, wire: _Wire, shape: ReferenceShape, camera: Camera) -> _Looks:
    """Look for the nearest edges, and see which edges of the solid show at all."""
    in_camera = poses.in_camera(wire.xy_m, wire.z_share)
    top, base = _outlines_px(poses, shape, camera)
    along = np.concatenate([np.roll(top, -1, axis=1) - top, np.roll(base, -1, axis=1) - base, base - top], axis=1)
    length = np.linalg.norm(along, axis=2)
    faces = poses.facing_sides(shape)
    shows = np.concatenate([np.ones_like(faces), faces, faces | np.roll(faces, 1, axis=1)], axis=1)
    length[~shows] = 0.0
    angle = np.arctan2(along[..., 1], along[..., 0])
    across = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    count = len(shape.corners_m)
    drop = (base - top + np.roll(base - top, -1, axis=1)) / 2.0
    narrow = np.abs((drop * across[:, :count]).sum(axis=2)) < _NARROW * field.cell_px
    length[:, count : 2 * count][narrow] = 0.0
    normal = across[:, wire.edge]
    offset = field.offsets(to_pinhole(in_camera, camera), angle[:, wire.edge])
    with np.errstate(invalid="ignore"):
        across_px = (offset * normal).sum(axis=2)
    return _Looks(in_camera, normal, across_px, np.linalg.norm(offset, axis=2), np.nan_to_num(length))


def _outlines_px(poses: Poses, shape: ReferenceShape, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return (P, N, 2) corners of the top and of the base."""
    count = len(shape.corners_m)
    corners_px = to_pinhole(poses.in_camera(np.tile(shape.corners_m, (2, 1)), np.repeat([1.0, 0.0], count)), camera)
    return corners_px[:, :count], corners_px[:, count:]


def _scores(looks: _Looks, wire: _Wire, reach_px: float) -> FloatArray:
    """Return (P,) px of outline with edges within reach, the nearer the better, less what is bare of the top."""
    near = np.maximum(1.0 - (looks.distance_px / reach_px) ** 2, 0.0) @ wire.mean
    worth = looks.length_px * (near - _BARE_COST)
    count = worth.shape[1] // 3
    scores: FloatArray = worth[:, :count].sum(axis=1) + np.maximum(worth[:, count:], 0.0).sum(axis=1)
    return scores


def _pulled(
    looks: _Looks,
    poses: Poses,
    wire: _Wire,
    camera: Camera,
    reach_px: float,
    begun_m: FloatArray,
    height_sigma_m: float,
) -> Poses:
    """Return the poses after one weighted Gauss-Newton step to the edges within reach.

    A level horizon and the heights (P,) that they began with hold them back.
    """
    share = (wire.mean.max(axis=0) * looks.length_px)[:, wire.edge]
    weight = np.maximum(1.0 - (looks.distance_px / reach_px) ** 2, 0.0) ** 2 * share
    used = weight > 0
    x, y, z = np.moveaxis(np.where(used[..., None], looks.in_camera, 1.0), -1, 0)
    residual = np.where(used, looks.across_px, 0.0)
    by_x, by_y = looks.normal[..., 0] * camera.matrix[0, 0] / z, looks.normal[..., 1] * camera.matrix[1, 1] / z
    by_place = np.stack([by_x, by_y, -(by_x * x + by_y * y) / z], axis=-1)
    # A turn w moves a point p of the camera frame by w x p. Shifts are counted in distances to the solid.
    turn = np.cross(np.stack([x, y, z], axis=-1), by_place)
    depth_m = np.linalg.norm(looks.in_camera.mean(axis=1), axis=1)
    rise = (by_place @ poses.site_to_camera[:, :, 2:]) * wire.z_share[:, None]
    jacobian = np.concatenate([turn, by_place * depth_m[:, None, None], rise], axis=-1)
    jacobian[~used] = 0.0
    weighted = jacobian * weight[..., None] / _PULL_SIGMA**2
    information = weighted.transpose(0, 2, 1) @ jacobian
    pull = (weighted * residual[..., None]).sum(axis=1)
    information += np.diag([_STEP_SIGMA**-2.0] * 6 + [height_sigma_m**-2.0])
    roll, _ = roll_and_pitch(poses.site_to_camera)
    information[:, 2, 2] += _ROLL_SIGMA_RAD**-2
    pull[:, 2] -= roll / _ROLL_SIGMA_RAD**2
    pull[:, 6] -= (poses.height_m - begun_m) / height_sigma_m**2
    step = np.linalg.solve(information, pull[..., None])[..., 0].clip(-_MAX_STEP, _MAX_STEP)
    rotation = _rotations(step[:, :3]) @ poses.site_to_camera
    moved_m = np.einsum("pji,pj->pi", rotation, step[:, 3:6] * depth_m[:, None])
    return Poses(rotation, poses.position_m - moved_m, np.maximum(poses.height_m + step[:, 6], 0.0))


def _rotations(vectors: FloatArray) -> FloatArray:
    """Return (P, 3, 3) rotations by vectors (P, 3), as `rotation_from_vector`."""
    angle = np.maximum(np.linalg.norm(vectors, axis=1), 1e-9)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], axis=1)
    rotations: FloatArray = (
        np.eye(3) + np.sin(angle) / angle * cross + (1.0 - np.cos(angle)) / angle**2 * (cross @ cross)
    )
    return rotations


def _ranked(score: FloatArray, poses: Poses, shape: ReferenceShape, camera: Camera, alike_px: float) -> IntArray:
    """Return the poses that a camera can have, the best first, without those that look like a better one."""
    roll, pitch = roll_and_pitch(poses.site_to_camera)
    held = (np.abs(roll) < _MAX_ROLL_RAD) & (pitch > _MIN_PITCH_RAD) & (poses.position_m[:, 2] > poses.height_m)
    middle = shape.corners_m.mean(axis=0)
    around_m = poses.in_camera(middle + AROUND * (shape.corners_m - middle), np.zeros(len(shape.corners_m)))
    # The ground around tells poses apart from which the solid itself looks the same.
    outlines_px = np.concatenate([*_outlines_px(poses, shape, camera), to_pinhole(around_m, camera) / AROUND], axis=1)
    chosen: list[int] = []
    score = np.where(held, score, 0.0)
    for k in np.argsort(-score, kind="stable")[: int((score > 0).sum())]:
        if not chosen or np.nanmax(np.abs(outlines_px[chosen] - outlines_px[k]), axis=(1, 2)).min() > alike_px:
            chosen.append(int(k))
    return np.array(chosen, dtype=np.int64)
