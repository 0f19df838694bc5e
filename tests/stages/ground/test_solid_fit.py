from __future__ import annotations

import numpy as np
from drawn_solid import base_px, box_around, drawn, lens, random_state, top_px
from tolerances import SOLID_CHI2, SOLID_CHI2_LEAST, SOLID_PX

from standoff.core.homography import FloatArray
from standoff.stages.ground import ReferenceShape
from standoff.stages.ground.solid import SolidState, facing_sides, sample_edges
from standoff.stages.ground.solid_fit import Belief, SolidFit, fit_solid
from standoff.stages.ground.solid_rounds import edge_medians

SHAPE = ReferenceShape.rectangle(2.0, 2.89)
CAMERA = lens(k1=-0.05)
SIGMA = np.array([0.004] * 3 + [0.08] * 3 + [1e-3, 2e-3, 0.01])
REACH_PX = 8.0


def _state(seed: int, height_m: float = 0.4) -> SolidState:
    return random_state(np.random.default_rng(seed), SHAPE, CAMERA, height_m)


def _apart_px(one: SolidState, other: SolidState) -> float:
    return float(np.linalg.norm(top_px(SHAPE, one) - top_px(SHAPE, other), axis=1).max())


def _started_off(state: SolidState, seed: int, off_px: float) -> Belief:
    """Return a belief whose picture of the top is so far off, in a direction of its own."""
    change = np.random.default_rng([seed, 1]).normal(size=9) * SIGMA
    for _ in range(6):
        change[:6] *= off_px / _apart_px(state.changed(change), state)
    return Belief(state.changed(change), np.diag(SIGMA**-2))


def _fitted(state: SolidState, seed: int, *, off_px: float, sanded_side: int | None = None) -> tuple[SolidFit, Belief]:
    prior = _started_off(state, seed, off_px)
    fit = fit_solid(drawn(SHAPE, state, seed=seed, sanded_side=sanded_side), SHAPE, prior, REACH_PX)
    assert fit is not None
    return fit, prior


def _chi2(fit: SolidFit, prior: Belief, state: SolidState) -> float:
    error = state.change_from(fit.state)
    return float(error @ (prior.information + fit.information) @ error)


def test_the_errors_of_a_fit_are_as_large_as_it_says() -> None:
    chi2 = []
    for seed in range(20):
        state = _state(seed)
        fit, prior = _fitted(state, seed, off_px=2.0)
        assert _apart_px(fit.state, state) < SOLID_PX
        chi2.append(_chi2(fit, prior, state))
    assert SOLID_CHI2_LEAST < np.mean(chi2) < SOLID_CHI2
    assert max(chi2) < 3.0 * SOLID_CHI2


def test_a_start_four_pixels_off_is_near_enough_where_the_sides_show_wide() -> None:
    for seed in range(10):
        state = _state(seed, height_m=1.2)
        fit, prior = _fitted(state, seed, off_px=4.0)
        assert _apart_px(fit.state, state) < 2.0 * SOLID_PX
        assert _chi2(fit, prior, state) < 3.0 * SOLID_CHI2


def test_with_one_side_under_sand_the_others_hold() -> None:
    for seed in range(10):
        state = _state(seed)
        sanded = int(np.flatnonzero(facing_sides(SHAPE, state.view))[0])
        fit, prior = _fitted(state, seed, off_px=1.0, sanded_side=sanded)
        assert _apart_px(fit.state, state) < SOLID_PX
        assert _chi2(fit, prior, state) < 3.0 * SOLID_CHI2


def test_what_is_not_seen_adds_no_information() -> None:
    state = _state(3)
    seen, _ = _fitted(state, 3, off_px=1.0)
    sanded, _ = _fitted(state, 3, off_px=1.0, sanded_side=int(np.flatnonzero(facing_sides(SHAPE, state.view))[0]))
    assert np.trace(sanded.information[:6, :6]) < np.trace(seen.information[:6, :6])
    values = np.linalg.eigvalsh(seen.information)
    assert values.min() > -1e-6 * values.max()


def test_there_is_no_fit_to_plain_ground_or_outside_the_picture() -> None:
    state = _state(5)
    prior = _started_off(state, 5, 1.0)
    plain = fit_solid(drawn(SHAPE, state, solid=False), SHAPE, prior, REACH_PX)
    assert plain is None or plain.seen_share(4) < 0.3
    away = SolidState(state.view.changed(np.array([0.0, 1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])), state.height_m)
    assert fit_solid(drawn(SHAPE, state), SHAPE, Belief(away, prior.information), REACH_PX) is None


def test_all_of_the_outline_is_seen_in_a_clean_picture() -> None:
    state = _state(7)
    fit, _ = _fitted(state, 7, off_px=1.0)
    assert fit.seen_share(4) > 0.95
    outline: FloatArray = np.concatenate([top_px(SHAPE, state), base_px(SHAPE, state)])
    box = box_around(SHAPE, state, margin_px=0.0)
    assert (outline >= box[:2]).all() and (outline <= box[2:]).all()


def test_the_median_of_each_edge_is_numpy_s() -> None:
    samples = sample_edges(SHAPE, _state(2))
    rng = np.random.default_rng(0)
    residual = rng.normal(size=len(samples))
    for share in (0.0, 0.05, 0.5, 1.0):
        found = rng.uniform(size=len(samples)) < share
        expected = np.zeros(len(samples.length_px))
        for edge in np.unique(samples.edge[found]):
            expected[edge] = np.median(residual[found & (samples.edge == edge)])
        medians = edge_medians(residual, found, samples.edge, len(samples.length_px))
        np.testing.assert_array_equal(medians, expected)
