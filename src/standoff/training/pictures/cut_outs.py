"""Hide parts of things behind patches of the same picture, as spoil, posts and other machines do."""

from __future__ import annotations

import numpy as np

from standoff.core.boxes import areas_px2, shared_px2
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray, IntArray
from standoff.training.pictures.augment_params import AugmentParams
from standoff.training.pictures.views import log_uniform

_TRIES = 5


def hide_parts(rng: np.random.Generator, image: ImageArray, xyxy_px: FloatArray, params: AugmentParams) -> BoolArray:
    """Copy small rectangles without objects elsewhere, half of them onto objects.

    Args:
        rng: Decides everything.
        image: (H, W, 3) changed in place.
        xyxy_px: (N, 4) boxes in it; 0 is the left edge of the first pixel.
        params: How many, and how much of a box may be hidden.

    Returns:
        (N,) True for boxes of which too little is left to be seen.
    """
    size = np.array([image.shape[1], image.shape[0]])
    hidden_px2 = np.zeros(len(xyxy_px))
    for _ in range(rng.integers(1, params.cut_outs + 1)):
        on_object = len(xyxy_px) > 0 and rng.random() < 0.5
        centre, sides = _on_object(rng, xyxy_px) if on_object else _anywhere(rng, size)
        start = np.clip(np.round(centre - sides / 2.0), 0, size).astype(int)
        end = np.clip(np.round(centre + sides / 2.0), 0, size).astype(int)
        if (end - start).min() < 1:
            continue
        source = _empty_place(rng, xyxy_px, end - start, size)
        if source is None:
            continue
        patch = image[source[1] : source[1] + end[1] - start[1], source[0] : source[0] + end[0] - start[0]].copy()
        image[start[1] : end[1], start[0] : end[0]] = patch
        hidden_px2 += shared_px2(xyxy_px, np.concatenate([start, end])[None])[:, 0]
    return np.asarray(hidden_px2 > params.hidden_share * areas_px2(xyxy_px))


def _on_object(rng: np.random.Generator, xyxy_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return centre and sides of a patch over one side of a box."""
    box_px = xyxy_px[rng.integers(len(xyxy_px))]
    sides = box_px[2:] - box_px[:2]
    side = np.array([(-0.5, 0.0), (0.5, 0.0), (0.0, 0.5)][rng.integers(3)])
    return (box_px[:2] + box_px[2:]) / 2.0 + side * sides, sides * rng.uniform(0.4, 1.1, 2)


def _anywhere(rng: np.random.Generator, size: IntArray) -> tuple[FloatArray, FloatArray]:
    sides = np.array([log_uniform(rng, (0.02, 0.15)), log_uniform(rng, (0.02, 0.15))]) * size.min()
    return rng.uniform(0.0, 1.0, 2) * size, sides


def _empty_place(rng: np.random.Generator, xyxy_px: FloatArray, sides: IntArray, size: IntArray) -> IntArray | None:
    """Return the corner of a rectangle that shares nothing with any box; None if several tries find none."""
    for _ in range(_TRIES):
        start = rng.integers(0, size - sides + 1)
        if not shared_px2(xyxy_px, np.concatenate([start, start + sides])[None]).any():
            return start
    return None
