"""Which part of a picture a sample shows, how large and how turned; and its boxes there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from standoff.core.boxes import areas_px2
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray
from standoff.labels.types import LabelledPicture
from standoff.training.pictures.augment_params import AugmentParams

GREY: Final = 128
"""Where there is no picture, as `stages.detect` fills its letterbox."""
_OFF_CENTRE: Final = 0.45
"""What a view is aimed at lies at most this far from its middle, as a part of its sides: not cut by its border."""

_ABOUT_WHOLE: Final = (0.9, 1.1)
"""Of the zoom at which the whole picture fits."""


@dataclass(frozen=True, slots=True, eq=False)
class PictureView:
    """An affine view of a picture.

    Attributes:
        source_to_view: (2, 3) from picture pixels to the view's; in both, 0 is the left edge of the first pixel.
        source_size_px: (width, height) of the picture.
        size_px: (width, height) of the view.
    """

    source_to_view: FloatArray
    source_size_px: tuple[int, int]
    size_px: tuple[int, int]

    @property
    def zoom(self) -> float:
        """View pixels for each pixel of the picture."""
        return math.sqrt(abs(float(np.linalg.det(self.source_to_view[:, :2]))))

    def warp(self, image: ImageArray, onto: ImageArray) -> None:
        """Draw the picture, which may have been shrunk on reading, onto an array of the view's size."""
        height, width = image.shape[:2]
        enlarged = np.array([self.source_size_px[0] / width, self.source_size_px[1] / height])
        # OpenCV counts from the centres of the first pixels.
        matrix = self.source_to_view.copy()
        matrix[:, :2] *= enlarged
        matrix[:, 2] += matrix[:, :2].sum(axis=1) * 0.5 - 0.5
        fill = (GREY, GREY, GREY)
        onto[:] = cv2.warpAffine(image, matrix, self.size_px, flags=cv2.INTER_LINEAR, borderValue=fill)

    def carry(self, xyxy_px: FloatArray) -> FloatArray:
        """Return boxes of the picture in the view, not cut at its border.

        The view of the ellipse that the box holds is boxed: with half axes a, b and the linear part L of the view, the
        new half sides are sqrt((L11 a)^2 + (L12 b)^2) and sqrt((L21 a)^2 + (L22 b)^2). That is exact for flips and
        quarter turns; the box about the four turned corners would be up to sqrt(2) too large.

        Args:
            xyxy_px: (N, 4) as `LabelledPicture` has them: 0 is the centre of the first pixel.

        Returns:
            (N, 4); 0 is the left edge of the view's first pixel.
        """
        edges_px = xyxy_px.reshape(-1, 4) + 0.5
        linear, shift = self.source_to_view[:, :2], self.source_to_view[:, 2]
        centre = (edges_px[:, :2] + edges_px[:, 2:]) @ linear.T / 2.0 + shift
        half = np.sqrt(((edges_px[:, 2:] - edges_px[:, :2]) / 2.0) ** 2 @ (linear**2).T)
        return np.concatenate([centre - half, centre + half], axis=1)

    def carry_points(self, points_px: FloatArray) -> FloatArray:
        """Return (N, 2) points of the picture, 0 the centre of its first pixel, in the view, 0 the edge of its first.

        What becomes of a box's foot is known even where the view cuts the box off: the point is not cut.
        """
        carried: FloatArray = (points_px + 0.5) @ self.source_to_view[:, :2].T + self.source_to_view[:, 2]
        return carried


def cut_boxes(
    carried_px: FloatArray, ignored: BoolArray, size_px: tuple[int, int], params: AugmentParams
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Cut boxes at a view's border and judge what is left of them.

    Args:
        carried_px: (N, 4) whole boxes in the view.
        ignored: (N,) regions of which nothing is known; they stay so, however little is left.
        size_px: (width, height) of the view.
        params: What is enough.

    Returns:
        (N, 4) boxes inside the view; (N,) True for those that are still there; (N,) True for those that are ignored.
    """
    limit = np.array([*size_px, *size_px], dtype=np.float64)
    cut_px: FloatArray = np.clip(carried_px, 0.0, limit)
    sides_px = cut_px[:, 2:] - cut_px[:, :2]
    left_px2, whole_px2 = areas_px2(cut_px), areas_px2(carried_px)
    present = (left_px2 > 0) & (ignored | (left_px2 >= params.drop_share * whole_px2))
    is_small = (np.sort(sides_px, axis=1) < params.least_sides_px).any(axis=1)
    unsure = is_small | (left_px2 < params.keep_share * whole_px2)
    return cut_px, present, ignored | unsure


def draw_view(
    rng: np.random.Generator, picture: LabelledPicture, size_px: tuple[int, int], params: AugmentParams
) -> PictureView:
    """Draw a view of a picture: aimed at one of its objects, at a drawn size, turned, mirrored, stretched."""
    size = np.array(size_px, dtype=np.float64)
    source_size = np.array(picture.size_px, dtype=np.float64)
    turns_freely = picture.source in params.any_rotation_sources
    target = _draw_target(rng, picture, params)
    turn = _draw_turn(rng, turns_freely, params)
    ratios = size / (np.abs(turn) @ source_size)
    # A picture lying on its side would fill a third of the view if all of it had to be seen.
    fits = float(ratios.max() if turns_freely else ratios.min())
    linear = _draw_zoom(rng, picture, target, fits, params) * turn
    if target is None:
        centre = rng.uniform(0.0, 1.0, 2) * source_size
    else:
        box_px = picture.xyxy_px[target]
        offset = rng.uniform(-_OFF_CENTRE, _OFF_CENTRE, 2) * size
        centre = (box_px[:2] + box_px[2:]) / 2.0 + 0.5 - np.linalg.solve(linear, offset)
    # The view stays within the picture, or the picture within the view, whichever is larger.
    reach = np.abs(np.linalg.inv(linear)) @ size / 2.0
    bounds = np.sort(np.stack([reach, source_size - reach]), axis=0)
    centre = np.clip(centre, bounds[0], bounds[1])
    return PictureView(np.column_stack([linear, size / 2.0 - linear @ centre]), picture.size_px, size_px)


def log_uniform(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    """Draw a number; every doubling between the limits has the same chance."""
    return math.exp(rng.uniform(math.log(limits[0]), math.log(limits[1])))


def _draw_target(rng: np.random.Generator, picture: LabelledPicture, params: AugmentParams) -> int | None:
    """Return the row of an object, each class in the picture with the same chance; None for aiming at nothing."""
    known = np.flatnonzero(~picture.ignored)
    if len(known) == 0 or rng.random() >= params.aim:
        return None
    classes = picture.class_id[known]
    alike = known[classes == rng.choice(np.unique(classes))]
    return int(rng.choice(alike))


def _draw_zoom(
    rng: np.random.Generator, picture: LabelledPicture, target: int | None, fits: float, params: AugmentParams
) -> float:
    """Return view pixels for each pixel of the picture.

    Args:
        rng: Decides.
        picture: What is shown.
        target: Row of the box whose size is drawn, if there is one.
        fits: The zoom at which the whole picture is in use.
        params: What may be.
    """
    if rng.random() < params.whole:
        return fits * log_uniform(rng, _ABOUT_WHOLE)
    most = params.zoom[1]
    least = min(max(params.zoom[0], params.least_fill * fits), most)
    if target is None:
        return log_uniform(rng, (least, max(least, 1.0)))
    width_px, height_px = picture.xyxy_px[target, 2:] - picture.xyxy_px[target, :2]
    if picture.class_id[target] in (params.person_classes or ()):
        wanted = log_uniform(rng, params.person_height_px) / height_px
    else:
        wanted = log_uniform(rng, params.other_side_px) / max(width_px, height_px)
    return min(max(float(wanted), least), most)


def _draw_turn(rng: np.random.Generator, turns_freely: bool, params: AugmentParams) -> FloatArray:
    """Return a (2, 2) rotation with a little stretch and perhaps a reflection."""
    angle_deg = rng.uniform(-params.tilt_deg, params.tilt_deg) if rng.random() < params.tilted else 0.0
    if turns_freely:
        any_angle = rng.random() < params.any_angle
        angle_deg = rng.uniform(0.0, 360.0) if any_angle else angle_deg + 90.0 * rng.integers(4)
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    stretch = math.sqrt(log_uniform(rng, (1.0 / params.stretch, params.stretch)))
    side = -1.0 if rng.random() < params.mirrored else 1.0
    turn: FloatArray = np.array([[cosine, -sine], [sine, cosine]]) @ np.diag([side * stretch, 1.0 / stretch])
    return turn
