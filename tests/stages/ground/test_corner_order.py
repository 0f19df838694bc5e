from __future__ import annotations

import numpy as np
import pytest
from drawn_solid import lens, random_state, top_px
from tolerances import SAME_MAP_M

from standoff.stages.ground import ReferenceShape
from standoff.stages.ground.corner_order import doubt_between, turned_like
from standoff.stages.ground.solid import STATE, SolidState
from standoff.stages.ground.solid_fit import Belief

SQUARE = ReferenceShape.square(2.0)
HEXAGON = ReferenceShape.regular(6, 1.5)
AWAY = ReferenceShape.from_corners([[5.0, 1.0], [7.0, 1.0], [7.0, 4.0], [5.0, 4.0]])
QUADRILATERAL = ReferenceShape.from_sides((4.4, 2.6, 2.6, 3.0), diagonal_m=4.4)


def _state(seed: int, shape: ReferenceShape) -> SolidState:
    return random_state(np.random.default_rng(seed), shape, lens(), 0.3)


def _belief(state: SolidState) -> Belief:
    root = np.random.default_rng(1).normal(size=(STATE, STATE))
    return Belief(state, root @ root.T)


@pytest.mark.parametrize(("shape", "corners"), [(SQUARE, range(4)), (HEXAGON, range(6)), (AWAY, (0, 2))])
def test_the_hint_chooses_the_corner_and_the_picture_stays(shape: ReferenceShape, corners: range) -> None:
    state = _state(1, shape)
    outline = top_px(shape, state)
    for corner in corners:
        turned = turned_like(_belief(state), shape, last=None, corner_px=outline[corner] + 2.0)
        np.testing.assert_allclose(
            top_px(shape, turned.state), np.roll(outline, -corner, axis=0), atol=SAME_MAP_M, rtol=0.0
        )


def test_without_a_hint_the_first_corner_is_at_the_bottom_left() -> None:
    for seed in range(8):
        state = _state(seed, SQUARE)
        outline = top_px(SQUARE, turned_like(_belief(state), SQUARE, last=None, corner_px=None).state)
        assert (outline[:, 0] - outline[:, 1]).argmin() == 0


@pytest.mark.parametrize("turn", range(4))
def test_a_square_keeps_its_frame_when_it_is_found_again_any_way_round(turn: int) -> None:
    last = _state(3, SQUARE)
    outline = top_px(SQUARE, last)
    other_way = turned_like(_belief(last), SQUARE, last=None, corner_px=outline[turn])
    again = turned_like(other_way, SQUARE, last=last, corner_px=outline[2])
    np.testing.assert_allclose(again.state.change_from(last), 0.0, atol=SAME_MAP_M)


def test_information_turns_with_the_site_so_that_what_is_known_of_the_picture_stays() -> None:
    belief = _belief(_state(4, SQUARE))
    turned = turned_like(belief, SQUARE, last=None, corner_px=top_px(SQUARE, belief.state)[1])
    assert abs(turned.state.view.position_m[:2] - belief.state.view.position_m[:2]).max() > 0.1
    places = np.column_stack([SQUARE.corners_m, np.full(4, 0.3)])
    _, before, _ = belief.state.view.project_with_jacobians(np.roll(places, -1, axis=0))
    _, after, _ = turned.state.view.project_with_jacobians(places)
    covariances = [np.linalg.inv(one.information)[:8, :8] for one in (belief, turned)]
    pictures = [
        by @ covariance @ by.transpose(0, 2, 1) for by, covariance in zip((before, after), covariances, strict=True)
    ]
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-6)


def test_a_shape_that_cannot_be_turned_is_left_as_it_is() -> None:
    belief = _belief(_state(5, QUADRILATERAL))
    assert turned_like(belief, QUADRILATERAL, last=None, corner_px=np.zeros(2)) is belief


def test_alternatives_that_are_the_same_turned_round_leave_no_doubt_and_others_do() -> None:
    one = _belief(_state(4, SQUARE))
    turned = [turned_like(one, SQUARE, last=None, corner_px=px) for px in top_px(SQUARE, one.state)]
    np.testing.assert_allclose(doubt_between(one, turned, SQUARE), 0.0, atol=SAME_MAP_M)
    shift = np.array([0.01, 0.0, 0.0, 0.3, -0.1, 0.4, 0.0, 0.0, 0.0])
    for share in (0.5, 1.0):
        other = Belief(one.state.changed(share * shift), one.information)
        doubt = doubt_between(one, [*turned, other], SQUARE)
        np.testing.assert_allclose(np.diag(doubt), (share * shift) ** 2 / 2.0, rtol=1e-6, atol=1e-9)
