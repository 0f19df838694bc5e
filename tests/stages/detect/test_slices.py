from __future__ import annotations

from random import Random

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from standoff.stages.detect.slices import Slice, held_whole_px, views

sizes = st.tuples(st.integers(16, 3000), st.integers(16, 3000))
grids = st.tuples(st.integers(1, 5), st.integers(1, 5))


@given(sizes, grids, st.floats(0, 0.5))
def test_slices_lie_inside_the_frame_and_cover_it(
    size_px: tuple[int, int], grid: tuple[int, int], overlap: float
) -> None:
    whole, *slices = views(size_px, grid, overlap)
    assert (whole.left_px, whole.top_px, whole.width_px, whole.height_px) == (0, 0, *size_px)
    assert len(slices) == (0 if grid == (1, 1) else grid[0] * grid[1])
    columns, rows = np.zeros(size_px[0], bool), np.zeros(size_px[1], bool)
    for view in slices:
        assert view.left_px >= 0
        assert view.top_px >= 0
        assert view.left_px + view.width_px <= size_px[0]
        assert view.top_px + view.height_px <= size_px[1]
        columns[view.left_px : view.left_px + view.width_px] = True
        rows[view.top_px : view.top_px + view.height_px] = True
    assert not slices or (columns.all() and rows.all())


def test_neighbours_share_the_overlap() -> None:
    _, first, second, third = views((1000, 100), (3, 1), 0.25)
    for left, right in ((first, second), (second, third)):
        shared_px = left.left_px + left.width_px - right.left_px
        assert abs(shared_px - 0.25 * left.width_px) <= 1


def test_a_box_is_cut_at_a_border_of_the_slice_but_not_of_the_frame() -> None:
    view = Slice(0, 0, 100, 50, (180, 50))
    boxes = np.array(
        [
            [10.0, 10.0, 97.0, 30.0],  # near the right border, inside the frame
            [10.0, 10.0, 90.0, 30.0],  # not near it
            [-0.5, -0.5, 20.0, 49.5],  # at three borders of the frame
        ]
    )
    assert view.is_cut(boxes, (4.0, 4.0)).tolist() == [True, False, False]


@given(sizes, grids, st.floats(0, 0.5), st.randoms())
def test_a_thing_of_the_held_size_is_whole_in_some_slice_wherever_it_is(
    size_px: tuple[int, int], grid: tuple[int, int], overlap: float, random: Random
) -> None:
    held_px = held_whole_px(size_px, grid, overlap)
    left, top = (random.randint(0, side - held) for side, held in zip(size_px, held_px, strict=True))
    # One slice is the frame itself.
    slices = views(size_px, grid, overlap)[grid != (1, 1) :]
    assert any(
        view.left_px <= left
        and view.top_px <= top
        and left + held_px[0] <= view.left_px + view.width_px
        and top + held_px[1] <= view.top_px + view.height_px
        for view in slices
    )


def test_the_margin_may_differ_across_and_up_and_down() -> None:
    # A network that stretches its picture sees a pixel's width and height at different scales.
    view = Slice(0, 0, 100, 50, (180, 90))
    boxes = np.array([[10.0, 10.0, 94.0, 30.0], [10.0, 10.0, 30.0, 44.0]])
    assert view.is_cut(boxes, (6.0, 3.0)).tolist() == [True, False]
