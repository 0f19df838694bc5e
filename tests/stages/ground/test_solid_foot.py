from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_solid import base_px, box_around, drawn, lens, looking_at, random_state, top_px
from tolerances import SOLID_PX

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import ImageArray
from standoff.stages.ground import ReferenceShape
from standoff.stages.ground.solid import SolidState
from standoff.stages.ground.solid_choice import Found
from standoff.stages.ground.solid_foot import height_by_hue, with_foot
from standoff.stages.ground.solid_search import HeightPrior, search_solid

CAMERA = lens()
SQUARE = ReferenceShape.square(2.5)
BROWN = np.array([0.78, 1.0, 1.14])


def coloured(gray: ImageArray, state: SolidState, ground: FloatArray = BROWN) -> ImageArray:
    """Return a picture in which the solid is grey and the ground about as bright, in the sun and in the shade."""
    hull = cv2.convexHull(np.concatenate([top_px(SQUARE, state), base_px(SQUARE, state)]).astype(np.float32))
    mask = np.zeros(gray.shape, np.float32)
    cv2.fillConvexPoly(mask, np.rint(hull * 16).astype(np.int32), 1.0, cv2.LINE_AA, 4)
    share = cv2.GaussianBlur(mask, (0, 0), 0.7)[..., None]
    return np.asarray(np.clip(gray[..., None] * (share + (1.0 - share) * ground), 0, 255), dtype=np.uint8)


def seen(seed: int, height_m: float, *, sun_m: tuple[float, float] | None = None) -> tuple[SolidState, ImageArray]:
    rng = np.random.default_rng(seed)
    state = random_state(rng, SQUARE, CAMERA, height_m)
    return state, drawn(SQUARE, state, seed=seed, sun_m=sun_m, dusk=True)


def guessed(state: SolidState, height_m: float = 0.35) -> SolidState:
    """Return a solid of another height with the same upper edges in the picture."""
    view = state.view
    up_m = np.array([0.0, 0.0, height_m - state.height_m])
    return SolidState(View(view.camera, view.position_m + up_m, view.site_to_camera), height_m)


@pytest.mark.parametrize("sun_m", [None, (0.7, 0.5), (-0.9, 0.4)])
@pytest.mark.parametrize(("seed", "height_m"), [(0, 0.3), (1, 0.55), (2, 0.8), (3, 0.45)])
def test_the_foot_is_where_the_hue_changes_in_the_sun_and_in_the_shade(
    seed: int, height_m: float, sun_m: tuple[float, float] | None
) -> None:
    state, gray = seen(seed, height_m, sun_m=sun_m)
    found = height_by_hue(coloured(gray, state), SQUARE, guessed(state))
    assert found is not None
    assert abs(found[0] - height_m) < 2.0 * found[1], (found, height_m)


@pytest.mark.parametrize("away_m", [5.0, 18.0])
def test_the_foot_is_found_from_near_and_from_afar(away_m: float) -> None:
    view = looking_at(CAMERA, (1.25, 1.25), away_m=away_m, heading_deg=25.0, pitch_deg=45.0)
    state = SolidState(view, 0.5)
    found = height_by_hue(coloured(drawn(SQUARE, state, dusk=True), state), SQUARE, guessed(state))
    assert found is not None
    assert abs(found[0] - 0.5) < 2.0 * found[1], found


@pytest.mark.parametrize("seed", range(3))
def test_without_hues_nothing_is_said_however_sharp_a_shadow_is(seed: int) -> None:
    state, gray = seen(seed, 0.5, sun_m=(0.7, 0.5))
    assert height_by_hue(coloured(gray, state, np.ones(3)), SQUARE, guessed(state)) is None


def test_a_foot_outside_the_picture_is_not_looked_for() -> None:
    state, gray = seen(0, 0.5)
    away = View(state.view.camera, state.view.position_m + np.array([40.0, 0.0, 0.0]), state.view.site_to_camera)
    assert height_by_hue(coloured(gray, state), SQUARE, SolidState(away, 0.5)) is None


@pytest.mark.parametrize("seed", range(3))
def test_the_solid_is_fitted_again_with_its_foot_and_its_upper_edges_stay(seed: int) -> None:
    state, gray = seen(seed, 0.6)
    search = gray, box_around(SQUARE, state), SQUARE, CameraPrior.calibrated(CAMERA), HeightPrior.unknown()
    found = search_solid(*search)
    assert isinstance(found, Found)
    again = with_foot(found, gray, coloured(gray, state), SQUARE)
    assert again is not found
    sigma_m = np.sqrt(np.linalg.inv(again.belief().information)[8, 8])
    assert abs(again.fit.state.height_m - 0.6) < 2.0 * sigma_m
    assert sigma_m <= np.sqrt(np.linalg.inv(found.belief().information)[8, 8]) + 1e-9
    off_px = np.linalg.norm(top_px(SQUARE, again.fit.state)[:, None] - top_px(SQUARE, state)[None], axis=2).min(axis=1)
    assert off_px.max() < 2.0 * SOLID_PX
