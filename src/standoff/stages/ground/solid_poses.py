"""Where a level camera would have to be to see a solid fill a box, and what it would then see: many poses at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.camera import Camera
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import View
from standoff.core.types import IntArray
from standoff.stages.ground.shape import ReferenceShape
from standoff.stages.ground.solid import SolidState

_HEADING_STEP_RAD, _PITCH_STEP_RAD = np.deg2rad(8.0), np.deg2rad(6.0)
_MIN_SLANT = np.sin(np.deg2rad(6.0))
"""Ground that is seen flatter than at six degrees shows no outline."""

_SCALES = (0.87, 1.0, 1.15)
"""The solid as a share of its box: boxes cut corners, and take in shadows."""

_MOST_ASPECT = 1.8
"""A box may be so many times too wide or too high for what is in it."""

AROUND = 3.0
"""The outer points lie so many times as far from the reference's middle as its corners."""

_PLACED_ROUNDS = 3
_NEAREST_M = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """States of one solid, as a struct of arrays.

    Attributes:
        site_to_camera: (P, 3, 3) rotations.
        position_m: (P, 3) of the camera, site frame.
        height_m: (P,) of the solid's top.
    """

    site_to_camera: FloatArray
    position_m: FloatArray
    height_m: FloatArray

    def __len__(self) -> int:
        return len(self.height_m)

    def __getitem__(self, chosen: BoolArray | IntArray | slice) -> Poses:
        return Poses(self.site_to_camera[chosen], self.position_m[chosen], self.height_m[chosen])

    def state(self, k: int, camera: Camera) -> SolidState:
        """Return one of them."""
        left, _, right = np.linalg.svd(self.site_to_camera[k])
        return SolidState(View(camera, self.position_m[k], left @ right), float(self.height_m[k]))

    def in_camera(self, xy_m: FloatArray, z_share: FloatArray) -> FloatArray:
        """Return (P, S, 3) camera frame of points (S, 2) of the site at (S,) shares of the solid's height."""
        offset_m = np.empty((len(self), len(z_share), 3))
        offset_m[..., :2] = xy_m - self.position_m[:, None, :2]
        offset_m[..., 2] = z_share * self.height_m[:, None] - self.position_m[:, 2:]
        in_camera: FloatArray = offset_m @ self.site_to_camera.transpose(0, 2, 1)
        return in_camera

    def facing_sides(self, shape: ReferenceShape) -> BoolArray:
        """Return (P, N) which upright sides face the camera."""
        along = np.roll(shape.corners_m, -1, axis=0) - shape.corners_m
        outward = np.column_stack([along[:, 1], -along[:, 0]])
        return np.asarray(((self.position_m[:, None, :2] - shape.corners_m) * outward).sum(axis=2) > 0)


def to_pinhole(in_camera: FloatArray, camera: Camera) -> FloatArray:
    """Return (..., 2) undistorted pixels of points (..., 3) of the camera frame; NaN nearer than a hand's breadth."""
    depth = np.where(in_camera[..., 2:] > _NEAREST_M, in_camera[..., 2:], np.nan)
    pinhole: FloatArray = in_camera[..., :2] / depth * np.diag(camera.matrix)[:2] + camera.matrix[:2, 2]
    return pinhole


def ground_around_px(view: View, shape: ReferenceShape) -> FloatArray:
    """Return (N, 2) undistorted pixels of points of the ground around the reference, beyond its corners."""
    middle = shape.corners_m.mean(axis=0)
    return view.project_pinhole(
        np.column_stack([middle + AROUND * (shape.corners_m - middle), np.zeros(len(shape.corners_m))])
    )


def poses_in_box(box_xyxy_px: FloatArray, shape: ReferenceShape, camera: Camera, heights_m: tuple[float, ...]) -> Poses:
    """Return the poses of a level camera that see a solid about fill a box, at all headings and pitches.

    Args:
        box_xyxy_px: (4,) undistorted.
        shape: Of the solid.
        camera: Lens and picture size.
        heights_m: Of the solid, to be tried.
    """
    span = 2.0 * np.pi / len(shape.turns_onto_itself())
    headings = np.linspace(0.0, span, int(np.ceil(span / _HEADING_STEP_RAD)), endpoint=False)
    pitches = np.arange(_PITCH_STEP_RAD / 2.0, np.pi / 2.0, _PITCH_STEP_RAD)
    pitch, heading, height_m = (
        axis.ravel() for axis in np.meshgrid(pitches, headings, np.array(heights_m), indexing="ij")
    )
    rotation = _level_rotations(heading, pitch)
    focal, middle_px = np.diag(camera.matrix)[:2], (box_xyxy_px[:2] + box_xyxy_px[2:]) / 2.0
    size_px = box_xyxy_px[2:] - box_xyxy_px[:2]
    ray = np.append((middle_px - camera.matrix[:2, 2]) / focal, 1.0)
    centre_m = np.column_stack([np.tile(shape.corners_m.mean(axis=0), (len(pitch), 1)), height_m / 2.0])
    corners, shares = np.tile(shape.corners_m, (2, 1)), np.repeat([1.0, 0.0], len(shape.corners_m))
    around = Poses(rotation, centre_m, height_m).in_camera(corners, shares)
    # Seen from afar a point's place is that of its shadow along the ray on a plane across the view.
    wide = np.ptp(around[..., :2] - around[..., 2:] * ray[:2], axis=1) * focal / size_px
    slant = -(ray @ rotation)[:, 2] / np.linalg.norm(ray)
    fits = (np.abs(np.log(wide[:, 0] / wide[:, 1])) < np.log(_MOST_ASPECT)) & (slant > _MIN_SLANT)
    rotation, centre_m, height_m, around = rotation[fits], centre_m[fits], height_m[fits], around[fits]
    depth_m = np.sqrt(wide[fits].prod(axis=1))
    placed = []
    for scale in _SCALES:
        shift = ray * depth_m[:, None] / scale
        for _ in range(_PLACED_ROUNDS):
            seen_px = to_pinhole(around + shift[:, None], camera)
            low, high = seen_px.min(axis=1), seen_px.max(axis=1)
            shift = shift * np.sqrt(((high - low) / (size_px * scale)).prod(axis=1))[:, None]
            shift[:, :2] -= ((low + high) / 2.0 - middle_px) / focal * shift[:, 2:]
        position_m = centre_m - np.einsum("pji,pj->pi", rotation, shift)
        above = position_m[:, 2] > height_m
        placed.append(Poses(rotation, position_m, height_m)[above])
    return Poses(
        np.concatenate([one.site_to_camera for one in placed]),
        np.concatenate([one.position_m for one in placed]),
        np.concatenate([one.height_m for one in placed]),
    )


def _level_rotations(heading_rad: FloatArray, pitch_rad: FloatArray) -> FloatArray:
    """Return (P, 3, 3) rotations of level cameras, as `View.aimed` has them."""
    zero = np.zeros_like(heading_rad)
    right = np.stack([np.cos(heading_rad), -np.sin(heading_rad), zero], axis=-1)
    ahead = np.stack([np.sin(heading_rad), np.cos(heading_rad), zero], axis=-1)
    forward = np.cos(pitch_rad)[:, None] * ahead - np.sin(pitch_rad)[:, None] * np.array([0.0, 0.0, 1.0])
    return np.stack([right, np.cross(forward, right), forward], axis=1)
