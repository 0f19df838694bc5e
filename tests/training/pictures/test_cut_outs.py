from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from training.drawn_pictures import draw_boxes, draw_ellipses, thing_share

from standoff.training.pictures.augment_params import AugmentParams
from standoff.training.pictures.cut_outs import hide_parts


@examples(60)
@given(st.integers(0, 10_000))
def test_patches_hide_things_and_never_copy_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes_px = draw_boxes(rng)
    image = draw_ellipses(boxes_px)
    things = thing_share(image) > 0.5
    # Boxes of labels count from the centre of the first pixel, those of samples from its edge.
    ignored = hide_parts(rng, image, boxes_px + 0.5, replace(AugmentParams(), cut_outs=8))
    left = thing_share(image) > 0.5
    assert not (left & ~things).any()
    for (x0, y0, x1, y1), is_ignored in zip(boxes_px.round().astype(int), ignored, strict=True):
        share_left = left[y0:y1, x0:x1].sum() / things[y0:y1, x0:x1].sum()
        assert is_ignored or share_left > 0.15
        assert not is_ignored or share_left < 0.7


def test_a_box_that_is_hidden_for_the_most_part_is_ignored() -> None:
    outcomes = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        boxes_px = draw_boxes(rng) + 0.5
        image = draw_ellipses(boxes_px - 0.5)
        outcomes.append(hide_parts(rng, image, boxes_px, AugmentParams(cut_outs=12)).any())
    assert 0.02 < np.mean(outcomes) < 0.6


@pytest.mark.parametrize("seed", range(5))
def test_without_things_patches_fall_anywhere(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 255, (200, 300, 3), dtype=np.uint8)
    before = image.copy()
    assert hide_parts(rng, image, np.zeros((0, 4)), AugmentParams()).shape == (0,)
    assert 0 < (image != before).any(axis=2).mean() < 0.2


def test_where_things_are_everywhere_nothing_is_copied() -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 255, (200, 300, 3), dtype=np.uint8)
    before = image.copy()
    assert not hide_parts(rng, image, np.array([[0.0, 0.0, 300.0, 200.0]]), AugmentParams()).any()
    np.testing.assert_array_equal(image, before)
