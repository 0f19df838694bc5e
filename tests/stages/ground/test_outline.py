from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray, NoGroundMap
from standoff.evaluation.drawn_quadrilaterals import draw_quadrilateral
from standoff.evaluation.rectification import corner_errors
from standoff.stages.ground.oriented_outline import RIVALS
from standoff.stages.ground.outline import BOX_OUTSIDE, TOO_FEW_EDGES, OutlineFinder
from standoff.stages.ground.params import ReferenceMethod, ReferenceParams
from standoff.stages.ground.quadrilateral import Quadrilateral

METHODS: tuple[ReferenceMethod, ...] = ("paper", "paper+tls", "oriented")
FINDERS = {method: OutlineFinder(ReferenceParams(method=method)) for method in METHODS}
WORST_PX = {"paper": 3.0, "paper+tls": 0.6, "oriented": 0.15}


def found(
    method: ReferenceMethod,
    gray: ImageArray,
    box: FloatArray,
) -> Quadrilateral:
    outline = FINDERS[method].find(gray, box)
    assert isinstance(outline, Quadrilateral), outline.reason
    return outline


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(8))
def test_corners_of_a_clean_drawing_are_found(method: ReferenceMethod, seed: int) -> None:
    scene = draw_quadrilateral("clean", seed)
    errors, _ = corner_errors(found(method, scene.gray, scene.box_xyxy_px), scene.corners_px)
    assert np.linalg.norm(errors, axis=1).max() < WORST_PX[method]


@pytest.mark.parametrize("method", METHODS)
def test_the_same_picture_gives_the_same_corners_whatever_came_before(method: ReferenceMethod) -> None:
    scene, other = draw_quadrilateral("sand", 1), draw_quadrilateral("sand", 2)
    first = found(method, scene.gray, scene.box_xyxy_px).corners_px
    FINDERS[method].find(other.gray, other.box_xyxy_px)
    fresh = OutlineFinder(ReferenceParams(method=method)).find(scene.gray, scene.box_xyxy_px)
    assert isinstance(fresh, Quadrilateral)
    np.testing.assert_array_equal(found(method, scene.gray, scene.box_xyxy_px).corners_px, first)
    np.testing.assert_array_equal(fresh.corners_px, first)


@examples(15)
@given(st.integers(-40, 40), st.integers(-40, 40), st.sampled_from(METHODS), st.integers(0, 5))
def test_corners_move_with_the_picture(right: int, down: int, method: ReferenceMethod, seed: int) -> None:
    scene = draw_quadrilateral("clean", seed)
    gray = np.pad(scene.gray, 60, mode="reflect")
    shifted = np.roll(gray, (down, right), axis=(0, 1))
    box = scene.box_xyxy_px + 60.0
    here = found(method, gray, box).corners_px
    there = found(method, shifted, box + np.array([right, down, right, down])).corners_px
    np.testing.assert_allclose(there - here, np.broadcast_to([right, down], (4, 2)), atol=1e-6)


@examples(15)
@given(st.integers(0, 5), st.integers(1, 3))
def test_corners_turn_with_the_picture(seed: int, quarters: int) -> None:
    scene = draw_quadrilateral("clean", seed)
    turned, box, truth = scene.gray, scene.box_xyxy_px, scene.corners_px
    for _ in range(quarters):  # counter-clockwise as seen: x, y becomes y, 319 - x
        turned = np.ascontiguousarray(np.rot90(turned))
        truth = np.column_stack([truth[:, 1], 319.0 - truth[:, 0]])
        box = np.array([box[1], 319.0 - box[2], box[3], 319.0 - box[0]])
    errors, _ = corner_errors(found("oriented", turned, box), truth)
    assert np.linalg.norm(errors, axis=1).max() < WORST_PX["oriented"]


@examples(15)
@given(st.floats(0.5, 1.0), st.integers(0, 20), st.booleans(), st.integers(0, 5))
def test_corners_stay_where_light_changes_or_is_inverted(share: float, level: int, inverted: bool, seed: int) -> None:
    scene = draw_quadrilateral("clean", seed)
    # up to white but not beyond: where the bright side saturates, its edge really moves outwards
    gain = share * (255 - level) / float(scene.gray.max())
    lit = np.rint(scene.gray * gain + level).astype(np.uint8)
    gray = 255 - lit if inverted else lit
    errors, _ = corner_errors(found("oriented", gray, scene.box_xyxy_px), scene.corners_px)
    assert np.linalg.norm(errors, axis=1).max() < WORST_PX["oriented"]


@pytest.mark.parametrize("method", METHODS)
def test_a_box_without_a_reference_has_no_outline(method: ReferenceMethod) -> None:
    rng = np.random.default_rng(0)
    box = np.array([60.0, 60.0, 220.0, 220.0])
    flat = np.full((320, 320), 90, np.uint8)
    noise = rng.integers(60, 120, (320, 320)).astype(np.uint8)
    nothing = FINDERS[method].find(flat, box)
    assert isinstance(nothing, NoGroundMap)
    assert nothing.reason == TOO_FEW_EDGES
    assert isinstance(FINDERS[method].find(noise, box), NoGroundMap)


@pytest.mark.parametrize("method", METHODS)
def test_a_box_outside_the_picture_has_no_outline(method: ReferenceMethod) -> None:
    outline = FINDERS[method].find(np.zeros((320, 320), np.uint8), np.array([400.0, 10.0, 500.0, 90.0]))
    assert isinstance(outline, NoGroundMap)
    assert outline.reason == BOX_OUTSIDE


def test_two_outlines_that_fit_equally_well_are_not_guessed_between() -> None:
    gray = np.full((320, 320), 80, np.uint8)
    gray[60:160, 60:160] = 180
    gray[64:164, 170:270] = 180
    outline = FINDERS["oriented"].find(gray, np.array([50.0, 50.0, 280.0, 175.0]))
    assert isinstance(outline, NoGroundMap)
    assert outline.reason == RIVALS


def test_what_the_reference_cannot_be_is_passed_over() -> None:
    gray = np.full((320, 320), 80, np.uint8)
    gray[60:160, 60:160] = 180
    gray[64:164, 170:270] = 180
    finder = OutlineFinder(believable=lambda corners: float(corners.mean(axis=0)[0]) < 120)
    outline = finder.find(gray, np.array([50.0, 50.0, 280.0, 175.0]))
    assert isinstance(outline, Quadrilateral)
    np.testing.assert_allclose(np.sort(outline.corners_px, axis=0), [[59.5] * 2] * 2 + [[159.5] * 2] * 2, atol=0.1)


def test_a_short_sharp_low_threshold_above_the_high_one_is_refused() -> None:
    with pytest.raises(ValueError, match="must not be above high_threshold"):
        ReferenceParams(low_threshold=0.7)
    with pytest.raises(ValueError, match="focal_widths"):
        ReferenceParams(focal_widths=(2.0, 1.0))
