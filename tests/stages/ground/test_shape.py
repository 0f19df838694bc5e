from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from laws import examples
from tolerances import GEOMETRY_REL

from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.stages.ground.shape import ReferenceShape

radii = st.lists(st.floats(0.5, 5.0), min_size=4, max_size=4)
jitters = st.lists(st.floats(-0.6, 0.6), min_size=4, max_size=4)


def convex_corners(radius: list[float], jitter: list[float]) -> FloatArray:
    angles = np.arange(4) * np.pi / 2 + np.array(jitter)
    corners = np.column_stack([np.cos(angles), np.sin(angles)]) * np.array(radius)[:, None]
    sides = np.roll(corners, -1, axis=0) - corners
    unit = sides / np.linalg.norm(sides, axis=1)[:, None]
    before = np.roll(unit, 1, axis=0)
    assume((before[:, 0] * unit[:, 1] - before[:, 1] * unit[:, 0] > 0.05).all())
    return np.asarray(corners)


@given(radii, jitters)
def test_five_lengths_give_back_the_shape_that_they_were_measured_on(radius: list[float], jitter: list[float]) -> None:
    corners = convex_corners(radius, jitter)
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    shape = ReferenceShape.from_sides(sides.tolist(), float(np.linalg.norm(corners[2] - corners[0])))
    distances = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    rebuilt = np.linalg.norm(shape.corners_m[:, None] - shape.corners_m[None], axis=2)
    np.testing.assert_allclose(rebuilt, distances, rtol=1e4 * GEOMETRY_REL)
    np.testing.assert_allclose(shape.sides_m, sides, rtol=1e4 * GEOMETRY_REL)
    assert shape.corners_m[0].tolist() == [0.0, 0.0]
    assert shape.corners_m[1, 1] == 0.0


@given(radii, jitters)
def test_a_clockwise_list_of_corners_is_turned_around_its_first(radius: list[float], jitter: list[float]) -> None:
    corners = convex_corners(radius, jitter)
    clockwise = ReferenceShape.from_corners(corners[[0, 3, 2, 1]])
    np.testing.assert_array_equal(clockwise.corners_m, ReferenceShape.from_corners(corners).corners_m)


@st.composite
def polygons(draw: st.DrawFn) -> FloatArray:
    """Corners on an ellipse, counter-clockwise: convex however many there are."""
    gaps = np.array(draw(st.lists(st.floats(1.0, 3.0), min_size=3, max_size=12)))
    angles = draw(st.floats(0.0, 6.0)) + 2.0 * np.pi * np.cumsum(gaps) / gaps.sum()
    axes = draw(st.floats(0.5, 4.0)), draw(st.floats(0.5, 4.0))
    return np.asarray(np.column_stack([np.cos(angles), np.sin(angles)]) * axes + 7.0)


@given(polygons())
def test_corners_of_a_convex_polygon_are_taken_either_way_round(corners: FloatArray) -> None:
    shape = ReferenceShape.from_corners(corners)
    np.testing.assert_array_equal(shape.corners_m, corners)
    clockwise = np.roll(corners[::-1], 1, axis=0)
    np.testing.assert_array_equal(ReferenceShape.from_corners(clockwise).corners_m, corners)
    # The first corner stays the first, and side 0 still starts there.
    assert shape.sides_m[0] == pytest.approx(np.linalg.norm(corners[1] - corners[0]), rel=GEOMETRY_REL)


@examples(50)
@given(polygons(), st.integers(0, 11), st.sampled_from(["dent", "swap", "twice"]))
def test_a_polygon_spoilt_at_one_corner_is_refused(corners: FloatArray, at: int, how: str) -> None:
    k = at % len(corners)
    following, before = (k + 1) % len(corners), k - 1
    assume(len(corners) > 3)
    if how == "dent":
        between = corners[[before, following]].mean(axis=0)
        corners[k] = between + 0.3 * (between - corners[k])
    elif how == "swap":
        corners[[k, following]] = corners[[following, k]]
    else:
        corners[following] = corners[k]
    with pytest.raises(GroundError):
        ReferenceShape.from_corners(corners)


@pytest.mark.parametrize("count", range(3, 13))
def test_a_regular_polygon_starts_at_the_origin_along_x_and_turns_onto_itself_every_way(count: int) -> None:
    shape = ReferenceShape.regular(count, 1.5)
    np.testing.assert_allclose(shape.sides_m, 1.5, rtol=GEOMETRY_REL)
    np.testing.assert_allclose(shape.corners_m[:2], [[0.0, 0.0], [1.5, 0.0]], atol=1e-12)
    assert shape.turns_onto_itself() == tuple(range(count))


def test_a_star_goes_around_its_middle_twice_and_is_no_polygon() -> None:
    star = ReferenceShape.regular(5, 2.0).corners_m[[0, 2, 4, 1, 3]]
    with pytest.raises(GroundError, match="cross each other"):
        ReferenceShape.from_corners(star)


@pytest.mark.parametrize("count", [-1, 0, 2, 13])
def test_a_regular_polygon_has_three_to_twelve_sides(count: int) -> None:
    with pytest.raises(GroundError, match="3 to 12 corners"):
        ReferenceShape.regular(count, 1.0)


def test_the_papers_footing_is_a_square_of_2_89_m() -> None:
    np.testing.assert_array_equal(ReferenceShape.square(2.89).sides_m, np.full(4, 2.89))


@pytest.mark.parametrize(
    ("shape", "turns"),
    [
        (ReferenceShape.square(2.0), (0, 1, 2, 3)),
        (ReferenceShape.rectangle(2.0, 2.5), (0, 2)),
        (ReferenceShape.from_sides((2.0, 3.0, 2.0, 3.0), 4.0), (0, 2)),
        (ReferenceShape.from_sides((2.4, 2.6, 0.6, 2.6), 2.7), (0,)),
        (ReferenceShape.from_corners([[0, 0], [2.0, 0], [1.0, 3.0]]), (0,)),
        (ReferenceShape.from_corners([[2, 0], [1, 1.5], [-1, 1.5], [-2, 0], [-1, -1.5], [1, -1.5]]), (0, 3)),
    ],
)
def test_only_turns_that_change_no_distance_count_as_symmetries(shape: ReferenceShape, turns: tuple[int, ...]) -> None:
    assert shape.turns_onto_itself() == turns


@pytest.mark.parametrize(
    ("corners", "found"),
    [
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "cross each other"),
        ([[0, 0], [4, 0], [1, 1], [0, 4]], "points inwards"),
        ([[0, 0], [1, 0], [2, 0], [1, 1]], "three corners on one line"),
        ([[0, 0], [0, 0], [2, 0], [1, 1]], "two corners at the same place"),
        ([[0, 0], [1, 0]], "shape (2, 2)"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], "shape (3, 3)"),
        ([[0, 0], [2, 0], [1, 0.5], [2, 2], [0, 2]], "points inwards"),
        ([[k, k * k] for k in range(13)], "shape (13, 2)"),
        ([[0, 0], [1, 0], [1, 1], [0, float("nan")]], "not a finite number"),
        ([[0, 0], [1, 0], [1, 1], [0]], "[0]"),
        ([[0, 0], [1, 0], [1, 1], ["a", 1]], "'a'"),
    ],
)
def test_corners_that_make_no_convex_polygon_are_refused_in_one_line(corners: list[list[float]], found: str) -> None:
    with pytest.raises(GroundError) as caught:
        ReferenceShape.from_corners(corners)
    assert found in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("sides", "diagonal", "found"),
    [
        ((1.0, 1.0, 1.0, 1.0), 2.5, "with a diagonal of 2.5 m"),
        ((1.0, 5.0, 1.0, 1.0), 1.5, "sides 1 m and 5 m"),
        ((1.0, 1.0, 3.0, 1.0), 1.5, "sides 1 m and 3 m"),
        ((1.0, 1.0, 1.0, 1.0), float("nan"), "nan"),
        ((1.0, 1.0, 1.0, -1.0), 1.4, "-1.0"),
        ((1.0, 1.0, 1.0), 1.4, "[1.0, 1.0, 1.0, 1.4]"),
        ((1.2, 1.0, 1.0, 1.3), 0.5, "points inwards"),
    ],
)
def test_lengths_that_close_no_convex_quadrilateral_are_refused(
    sides: tuple[float, ...], diagonal: float, found: str
) -> None:
    with pytest.raises(GroundError) as caught:
        ReferenceShape.from_sides(sides, diagonal)
    assert found in str(caught.value)


def test_side_lengths_of_a_rectangle_must_be_lengths() -> None:
    for bad in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(GroundError):
            ReferenceShape.square(bad)
        with pytest.raises(GroundError):
            ReferenceShape.regular(6, bad)
