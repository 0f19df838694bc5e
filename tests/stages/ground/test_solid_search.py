from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from drawn_solid import box_around, drawn, lens, random_state, top_px
from laws import few
from tolerances import SOLID_PX

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray, NoGroundMap
from standoff.stages.ground import ReferenceShape
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.solid_choice import Candidate, Found, best_of
from standoff.stages.ground.solid_fit import Belief, fit_solid
from standoff.stages.ground.solid_search import HeightPrior, search_solid

SQUARE = ReferenceShape.square(2.89)
RECTANGLE = ReferenceShape.rectangle(1.8, 3.2)
QUADRILATERAL = ReferenceShape.from_sides((4.4, 2.6, 2.6, 3.0), diagonal_m=4.4)
SHAPES = (SQUARE, RECTANGLE, QUADRILATERAL)
CAMERA = lens(k1=-0.04)
HEIGHT_M = 0.4


def _searched(shape: ReferenceShape, state: SolidState, seed: int, box: FloatArray, **drawing: object) -> object:
    picture = drawn(shape, state, seed=seed, noise=4.0, **drawing)  # type: ignore[arg-type]
    return search_solid(picture, box, shape, CameraPrior.calibrated(CAMERA), HeightPrior.known(HEIGHT_M))


def _off_px(found: Found, shape: ReferenceShape, state: SolidState) -> float:
    """Return how far the top's corners are off, whichever of a symmetrical shape's corners is the first."""
    expected, seen = top_px(shape, state), top_px(shape, found.fit.state)
    ways = [np.roll(expected, -turn, axis=0) for turn in shape.turns_onto_itself()]
    return min(float(np.linalg.norm(seen - way, axis=1).max()) for way in ways)


def _crooked(box: FloatArray, seed: int) -> FloatArray:
    """Return a box whose sides are each off by up to a tenth of its size; corners may be cut."""
    size = box[2:] - box[:2]
    return np.asarray(box + np.random.default_rng([seed, 2]).uniform(-0.1, 0.1, 4) * np.tile(size, 2))


@pytest.mark.parametrize("shape", few(SHAPES), ids=["square", "rectangle", "quadrilateral"])
def test_the_reference_is_found_in_a_crooked_box_with_a_shadow_beside_it(shape: ReferenceShape) -> None:
    found = []
    for seed in range(5):
        state = random_state(np.random.default_rng(seed), shape, CAMERA, HEIGHT_M)
        box = _crooked(box_around(shape, state), seed)
        one = _searched(shape, state, seed, box, sun_m=(0.5, 0.3))
        if isinstance(one, Found):
            found.append(_off_px(one, shape, state))
    assert len(found) >= 4
    # A side that shows three pixels narrow is one edge of the picture, in doubt by half of them.
    assert max(found) < 2.0 * SOLID_PX
    assert np.median(found) < SOLID_PX


@pytest.mark.parametrize("seeds", [range(10), pytest.param(range(10, 40), marks=pytest.mark.live)], ids=["few", "many"])
def test_what_is_believed_is_never_wrong(seeds: range) -> None:
    missed = 0
    for seed in seeds:
        shape = SHAPES[seed % 3]
        rng = np.random.default_rng(100 + seed)
        state = random_state(rng, shape, CAMERA, HEIGHT_M)
        sun_m = None if seed % 4 == 0 else (float(rng.uniform(-0.8, 0.8)), float(rng.uniform(-0.8, 0.8)))
        found = _searched(shape, state, seed, _crooked(box_around(shape, state), seed), sun_m=sun_m)
        if not isinstance(found, Found):
            missed += 1
            continue
        assert _off_px(found, shape, state) < 2.0 * SOLID_PX, f"seed {seed}"
    assert missed <= len(seeds) // 5


def test_plain_ground_and_a_box_outside_the_picture_have_no_reference() -> None:
    state = random_state(np.random.default_rng(1), SQUARE, CAMERA, HEIGHT_M)
    assert isinstance(_searched(SQUARE, state, 1, box_around(SQUARE, state), solid=False), NoGroundMap)
    outside = np.array([-300.0, -300.0, -200.0, -200.0])
    assert isinstance(_searched(SQUARE, state, 1, outside), NoGroundMap)


def test_a_solid_of_quite_another_shape_is_not_taken_for_the_reference() -> None:
    state = random_state(np.random.default_rng(2), SQUARE, CAMERA, HEIGHT_M)
    long = ReferenceShape.rectangle(0.7, 3.2)
    found = _searched(long, state, 2, box_around(long, state))
    assert isinstance(found, Found)
    picture = drawn(long, state, noise=4.0)
    wrong = search_solid(
        picture, box_around(long, state), SQUARE, CameraPrior.calibrated(CAMERA), HeightPrior.known(HEIGHT_M)
    )
    assert isinstance(wrong, NoGroundMap)


@pytest.mark.live
def test_sides_as_dark_as_the_ground_are_no_reason_to_put_the_top_elsewhere() -> None:
    found = []
    for seed in range(200, 216):
        state = random_state(np.random.default_rng(seed), SQUARE, CAMERA, HEIGHT_M)
        picture = drawn(SQUARE, state, seed=seed, noise=9.0, dusk=True)
        camera = CameraPrior.calibrated(CAMERA)
        one = search_solid(picture, box_around(SQUARE, state), SQUARE, camera, HeightPrior.known(HEIGHT_M))
        if isinstance(one, Found):
            found.append(_off_px(one, SQUARE, state))
    assert len(found) >= 4
    assert max(found) < 2.0 * SOLID_PX


def test_where_two_ways_are_left_something_else_decides() -> None:
    beliefs: list[Belief] = []

    def none_agrees(belief: Belief) -> bool:
        beliefs.append(belief)
        return False

    state = random_state(np.random.default_rng(3), SQUARE, CAMERA, HEIGHT_M)
    picture, box = drawn(SQUARE, state, seed=3, noise=4.0), box_around(SQUARE, state)
    sure = CameraPrior.calibrated(CAMERA), HeightPrior.known(HEIGHT_M)
    assert isinstance(search_solid(picture, box, SQUARE, *sure, none_agrees), Found)
    assert not beliefs, "nothing needs to be asked where one way is left"
    likely = _candidate(picture, state, 12.0)
    alike = [likely, _aside(likely, 11.9)]
    assert isinstance(best_of(alike, SQUARE, None), NoGroundMap)
    assert isinstance(best_of(alike, SQUARE, none_agrees), NoGroundMap)
    for right in alike:
        chosen = best_of(alike, SQUARE, partial(_is_at, right.state))
        assert isinstance(chosen, Found) and chosen.fit is right.found.fit


def test_what_is_seen_less_of_is_not_believed_beside_what_cannot_be() -> None:
    state = random_state(np.random.default_rng(3), SQUARE, CAMERA, HEIGHT_M)
    picture = drawn(SQUARE, state, seed=3)
    likely = _candidate(picture, state, 12.0)
    less = _aside(likely, 5.0)
    assert isinstance(best_of([replace(likely, believable=False), less], SQUARE, None), NoGroundMap)
    assert isinstance(best_of([likely, replace(less, believable=False)], SQUARE, None), Found)


def _is_at(state: SolidState, belief: Belief) -> bool:
    return belief.state is state


def _aside(one: Candidate, score: float) -> Candidate:
    """Return a candidate half a metre away."""
    moved = one.state.changed(np.array([0.0, 0.0, 0.0, 0.6, 0.3, 0.0, 0.0, 0.0, 0.0]))
    return replace(one, score=score, found=Found(replace(one.found.fit, state=moved), one.found.prior))


def _candidate(picture: ImageArray, state: SolidState, score: float) -> Candidate:
    prior = Belief(state, np.diag([1.0] * 3 + [1e-4] * 3 + [1e6] * 2 + [1e4]))
    fit = fit_solid(picture, SQUARE, prior, 5.0)
    assert fit is not None
    return Candidate(score, Found(fit, prior), believable=True)
