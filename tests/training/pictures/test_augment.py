from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from laws import examples
from tolerances import GEOMETRY_REL
from training.drawn_pictures import SIZE_PX, draw_boxes, draw_ellipses, label, thing_share

from standoff.core.boxes import areas_px2
from standoff.core.errors import DataError
from standoff.core.types import ImageArray
from standoff.labels import LabelledPicture
from standoff.training.pictures.augment import AugmentParams, Sample, make_sample

CLEAN = replace(AugmentParams(), shadows=0.0, colour=0.0, blur=0.0, lost_detail=0.0, noise=0.0, jpeg=0.0, cut_out=0.0)
"""Nothing but views and mosaics."""
_SIZE_PX = (320, 192)


def _drawn(seed: int, count: int = 6) -> list[LabelledPicture]:
    rng = np.random.default_rng(seed)
    return [label(draw_boxes(rng), Path(f"{number}.png")) for number in range(count)]


def _load(picture: LabelledPicture, reduction: int) -> ImageArray:
    return draw_ellipses(picture.xyxy_px)


def _uniform(data: list[LabelledPicture]) -> Callable[[np.random.Generator], int]:
    return lambda rng: int(rng.integers(len(data)))


def _make(seed: int, params: AugmentParams, size_px: tuple[int, int] = _SIZE_PX) -> Sample:
    data = _drawn(seed)
    return make_sample(np.random.default_rng(seed), data, _uniform(data), _load, size_px, params)


@examples(40)
@given(st.integers(0, 10_000), st.sampled_from([(320, 192), (96, 224), (64, 64)]))
def test_a_sample_has_the_inputs_size_and_its_boxes_lie_inside(seed: int, size_px: tuple[int, int]) -> None:
    sample = _make(seed, AugmentParams(any_rotation_sources=("drawn",), cut_out=0.5, shadows=0.5), size_px)
    assert sample.image.shape == (size_px[1], size_px[0], 3)
    assert sample.image.dtype == np.uint8
    assert sample.xyxy_px.shape == (len(sample.class_id), 4)
    assert sample.ignored.shape == sample.class_id.shape
    assert (sample.xyxy_px >= 0).all()
    assert (sample.xyxy_px <= [*size_px, *size_px]).all()
    assert (sample.xyxy_px[:, 2:] > sample.xyxy_px[:, :2]).all()


@examples(40)
@given(st.integers(0, 10_000))
@example(308)  # 18 px of a thing are left at the border, a fifteenth of its box
@example(1584)
def test_boxes_hold_things_and_things_have_boxes(seed: int) -> None:
    # Nothing is dropped, however little the border leaves of it: then no thing may be without a box.
    sample = _make(seed, replace(CLEAN, mosaic=0.5, drop_share=0.0))
    things = thing_share(sample.image) > 0.5
    unexplained = things.copy()
    for box_px, area_px2, ignored in zip(sample.xyxy_px, areas_px2(sample.xyxy_px), sample.ignored, strict=True):
        left, top = np.floor(box_px[:2]).astype(int)
        right, bottom = np.ceil(box_px[2:]).astype(int)
        # An ellipse fills pi / 4 of its box, and less of the corner of a box that a border cuts.
        assert ignored or things[top:bottom, left:right].sum() > 0.3 * area_px2
        unexplained[max(0, top - 1) : bottom + 1, max(0, left - 1) : right + 1] = False
    assert not unexplained.any()


@examples(40)
@given(st.integers(0, 10_000))
@example(308)
def test_what_is_dropped_would_not_have_counted(seed: int) -> None:
    params = replace(CLEAN, mosaic=0.5)
    whole, sample = _make(seed, replace(params, drop_share=0.0)), _make(seed, params)
    np.testing.assert_array_equal(sample.image, whole.image)
    kept = (whole.xyxy_px[:, None] == sample.xyxy_px[None]).all(axis=2).any(axis=1)
    np.testing.assert_array_equal(whole.xyxy_px[kept], sample.xyxy_px)
    np.testing.assert_array_equal(whole.ignored[kept], sample.ignored)
    assert whole.ignored[~kept].all()


@pytest.mark.parametrize("seed", range(3))
def test_the_same_seed_gives_the_same_sample_and_another_seed_another(seed: int) -> None:
    samples = [_make(seed, AugmentParams()), _make(seed, AugmentParams()), _make(seed + 1, AugmentParams())]
    for name in Sample.__slots__:
        np.testing.assert_array_equal(getattr(samples[0], name), getattr(samples[1], name))
    assert (samples[0].image != samples[2].image).any()


def test_a_mosaic_shows_four_pictures_with_their_own_boxes() -> None:
    whole = np.array([[-0.5, -0.5, SIZE_PX[0] - 0.5, SIZE_PX[1] - 0.5]])
    data = [label(whole, Path(str(number))) for number in range(4)]
    order = iter(range(4))

    def load(picture: LabelledPicture, reduction: int) -> ImageArray:
        return np.full((SIZE_PX[1], SIZE_PX[0], 3), 50 * int(picture.path.name), np.uint8)

    params = replace(CLEAN, mosaic=1.0, aim=1.0, whole=0.0, tilted=0.0, zoom=(0.4, 0.4))
    sample = make_sample(np.random.default_rng(0), data, lambda _: next(order), load, _SIZE_PX, params)
    corners = sample.image[[0, 0, -1, -1], [0, -1, 0, -1], 0]
    assert corners.tolist() == [0, 50, 100, 150]
    assert len(sample.xyxy_px) == 4
    for level, (left, top, right, bottom) in zip(corners, sample.xyxy_px, strict=True):
        assert (sample.image[int(top) : int(bottom), int(left) : int(right)] == level).all()
    assert (sample.xyxy_px[:, 2:] - sample.xyxy_px[:, :2]).prod(axis=1).sum() == pytest.approx(320 * 192)


def test_a_picture_that_cannot_be_read_is_replaced_by_the_next_draw() -> None:
    data = _drawn(0, 2)
    order = iter([0, 0, 1])

    def load(picture: LabelledPicture, reduction: int) -> ImageArray:
        if picture is data[0]:
            raise DataError(expected="a picture", found="none", fix="find it")
        return _load(picture, reduction)

    sample = make_sample(
        np.random.default_rng(0), data, lambda _: next(order), load, _SIZE_PX, replace(CLEAN, mosaic=0)
    )
    assert (thing_share(sample.image) > 0.5).any()


def test_a_folder_of_unreadable_pictures_is_an_error() -> None:
    def load(picture: LabelledPicture, reduction: int) -> ImageArray:
        raise DataError(expected="a picture", found="none", fix="find it")

    data = _drawn(0)
    with pytest.raises(DataError, match=r"in a row that cannot, the last .*png"):
        make_sample(np.random.default_rng(0), data, _uniform(data), load, _SIZE_PX, AugmentParams())


def test_chances_and_ranges_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="zoom must be"):
        AugmentParams(zoom=(2.0, 1.0))
    with pytest.raises(ValueError, match=r"mosaic_split must be .* within 0\.1 to 0\.9"):
        AugmentParams(mosaic_split=(0.0, 0.5))


def test_without_any_chance_a_picture_stays_as_it_is() -> None:
    params = replace(CLEAN, mosaic=0.0, aim=0.0, whole=0.0, tilted=0.0, mirrored=0.0, zoom=(1.0, 1.0), stretch=1.0)
    (picture,) = _drawn(3, 1)
    sample = make_sample(np.random.default_rng(0), [picture], lambda _: 0, _load, SIZE_PX, params)
    np.testing.assert_array_equal(sample.image, draw_ellipses(picture.xyxy_px))
    np.testing.assert_allclose(sample.xyxy_px, picture.xyxy_px + 0.5, rtol=GEOMETRY_REL)


@pytest.mark.parametrize("seed", range(10))
def test_ground_points_go_along_with_their_boxes(seed: int) -> None:
    """Marked in the middle of each box, they are there in every sample where the box is whole."""
    data = [replace(picture, foot_px=(picture.xyxy_px[:, :2] + picture.xyxy_px[:, 2:]) / 2) for picture in _drawn(seed)]
    params = replace(CLEAN, mosaic=0.0, any_rotation_sources=("drawn",))
    sample = make_sample(np.random.default_rng(seed), data, _uniform(data), _load, _SIZE_PX, params)
    middle_px = (sample.xyxy_px[:, :2] + sample.xyxy_px[:, 2:]) / 2
    whole = ((sample.xyxy_px > 0) & (sample.xyxy_px < [*_SIZE_PX, *_SIZE_PX])).all(axis=1)
    np.testing.assert_allclose(sample.foot_px[whole], middle_px[whole], rtol=GEOMETRY_REL, atol=1e-6)
    # Of a box that is cut off, the point stays where it was: on the side that is gone.
    mosaic = make_sample(
        np.random.default_rng(seed), data, _uniform(data), _load, _SIZE_PX, replace(params, mosaic=1.0)
    )
    sides_px = mosaic.xyxy_px[:, 2:] - mosaic.xyxy_px[:, :2]
    off_px = np.abs(mosaic.foot_px - (mosaic.xyxy_px[:, :2] + mosaic.xyxy_px[:, 2:]) / 2)
    assert (off_px <= 0.5 * sides_px / params.drop_share).all()
    assert np.isnan(_make(seed, params).foot_px).all(), "unmarked points stay unknown"
