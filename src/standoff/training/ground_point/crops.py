"""Crops of labelled things with their ground points, as training draws them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np

from standoff.core.assignment import assign
from standoff.core.boxes import overlaps
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.protocols import Detector
from standoff.core.types import ImageArray, IntArray
from standoff.labels import LabelledPicture, load_picture
from standoff.stages.detect import POINT_CLASSES, POINT_CROP_AROUND, POINT_CROP_PX, point_crop, point_squares_px
from standoff.stages.frames import frame_from_array
from standoff.training.pictures.augment_params import AugmentParams
from standoff.training.pictures.degrade import degrade

PATCH_PX: Final = 144
"""Side of what is kept of a thing: at the scale of a crop, half as much again for turns and shifts."""
_BOX_ZOOM: Final = 0.12
_BOX_SHIFT: Final = 0.045
"""How far off a detector's boxes are, as standard deviations: logarithm of the size, and shift in sides of a crop. The
shipped detector's of workers and excavators are off by 0.11 to 0.13 and 0.03 to 0.045 in six simulated clips."""
_LEAST_BOX_PX: Final = 8.0
_FOUND_SCORE: Final = 0.3
"""What is found less surely starts no track."""
_FOUND_OVERLAP: Final = 0.4
_FARTHEST_SIDES: Final = 1.0
"""A point further from the middle of its crop, in sides of it, tells of a thing that is hardly in the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """Things in boxes (N).

    Attributes:
        images: (N, PATCH_PX, PATCH_PX, 3).
        point: (N, 2) in patches, from 0 to 1 across and down.
        class_index: (N,) place in `POINT_CLASSES`.
        height_px: (N,) of the box.
    """

    images: ImageArray
    point: FloatArray
    class_index: IntArray
    height_px: FloatArray

    def __len__(self) -> int:
        return len(self.point)


def read_patches(
    pictures: Iterable[LabelledPicture], classes: Sequence[str], on_picture: Callable[[], None] | None = None
) -> Patches:
    """Cut out whatever has a ground point.

    Args:
        pictures: Labelled.
        classes: Names of their classes.
        on_picture: Called after each.
    """
    place = {name: k for k, name in enumerate(POINT_CLASSES)}
    of_class = np.array([place.get(name, -1) for name in classes])
    images, points, class_index, heights = [], [], [], []
    for picture in pictures:
        sides_px = picture.xyxy_px[:, 2:] - picture.xyxy_px[:, :2]
        squares = point_squares_px(picture.xyxy_px, POINT_CROP_AROUND * PATCH_PX / POINT_CROP_PX)
        inside = (picture.foot_px + 0.5 - squares[:, :2]) / squares[:, 2:]
        usable = ~picture.ignored & (of_class[picture.class_id] >= 0) & (sides_px[:, 1] >= _LEAST_BOX_PX)
        usable &= np.abs(np.nan_to_num(inside, nan=9.0) - 0.5).max(axis=1) * PATCH_PX / POINT_CROP_PX < _FARTHEST_SIDES
        rows = np.flatnonzero(usable)
        image = load_picture(picture) if len(rows) else None
        for row in rows.tolist():
            assert image is not None
            images.append(point_crop(image, squares[row], PATCH_PX))
            points.append(inside[row])
            class_index.append(of_class[picture.class_id[row]])
            heights.append(sides_px[row, 1])
        if on_picture is not None:
            on_picture()
    return Patches(
        np.array(images, dtype=np.uint8).reshape(-1, PATCH_PX, PATCH_PX, 3),
        np.array(points, dtype=np.float64).reshape(-1, 2),
        np.array(class_index, dtype=np.int64),
        np.array(heights, dtype=np.float64),
    )


def as_found(picture: LabelledPicture, classes: Sequence[str], detector: Detector) -> LabelledPicture:
    """Return a picture with the boxes that a detector finds in place of those that were marked.

    What it does not find, or takes for another kind of thing, is left out: nobody will ask for its point.

    Args:
        picture: Labelled.
        classes: Names of its classes.
        detector: Finds the same classes.
    """
    found = detector.detect(frame_from_array(load_picture(picture), index=0, time_s=0.0))
    found = found[found.score >= _FOUND_SCORE]
    ids = np.array([CLASS_BY_NAME[name].id if name in CLASS_BY_NAME else -1 for name in classes])[picture.class_id]
    similarity = overlaps(picture.xyxy_px, found.xyxy_px) * (ids[:, None] == found.class_id) * ~picture.ignored[:, None]
    marked, seen = assign(similarity, _FOUND_OVERLAP)
    return replace(
        picture, xyxy_px=found.xyxy_px[seen], class_id=picture.class_id[marked], ignored=picture.ignored[marked],
        foot_px=picture.foot_px[marked],
    )  # fmt: skip


def boxed_crop(patch: ImageArray, point: FloatArray) -> tuple[ImageArray, FloatArray]:
    """Return what the network sees of a patch whose box is a detector's, and the point in it."""
    return _seen(patch, point, (1.0, np.zeros(2)), np.eye(2))


def drawn_crop(
    rng: np.random.Generator, patch: ImageArray, point: FloatArray, params: AugmentParams
) -> tuple[ImageArray, FloatArray]:
    """Draw one view: as a detector boxes it, mirrored, turned a little, worse to see; and the point in it.

    Args:
        rng: Of all that is random.
        patch: (PATCH_PX, PATCH_PX, 3).
        point: (2,) in the patch, from 0 to 1.
        params: How pictures are made worse.
    """
    box = _off(rng)
    turn = np.radians(rng.normal(0.0, 4.0))
    mirror = -1.0 if rng.random() < 0.5 else 1.0
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ np.diag([mirror, 1.0])
    seen, place = _seen(patch, point, box, turned)
    if rng.random() < 0.25:
        small = int(rng.integers(12, POINT_CROP_PX // 2))
        seen = cv2.resize(
            cv2.resize(seen, (small, small), interpolation=cv2.INTER_AREA), (POINT_CROP_PX, POINT_CROP_PX)
        )
    if rng.random() < 0.3:
        # Something stands before it.
        width, height = rng.integers(8, POINT_CROP_PX // 2, 2)
        left, top = rng.integers(-8, POINT_CROP_PX - 8, 2)
        seen = seen.copy()
        seen[max(top, 0) : top + height, max(left, 0) : left + width] = rng.integers(0, 256, 3)
    return degrade(rng, np.ascontiguousarray(seen), params), place


_Box = tuple[float, FloatArray]


def _off(rng: np.random.Generator) -> _Box:
    """Draw by how much a detector's box is off: zoom, and shift in pixels of a crop."""
    return float(np.exp(rng.normal(0.0, _BOX_ZOOM))), rng.normal(0.0, _BOX_SHIFT * POINT_CROP_PX, 2)


def _seen(patch: ImageArray, point: FloatArray, box: _Box, turned: FloatArray) -> tuple[ImageArray, FloatArray]:
    """Cut a patch about its middle as a box has it, after a (2, 2) rotation or reflection."""
    zoom, moved_px = box
    linear = zoom * turned
    shift = np.full(2, POINT_CROP_PX / 2.0) + moved_px - linear @ np.full(2, PATCH_PX / 2.0)
    # OpenCV counts pixels from the centre of the first, the point from its edge.
    matrix = np.column_stack([linear, shift + linear @ np.full(2, 0.5) - 0.5])
    seen = cv2.warpAffine(
        patch, matrix, (POINT_CROP_PX, POINT_CROP_PX), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(seen, dtype=np.uint8), (linear @ (point * PATCH_PX) + shift) / POINT_CROP_PX
