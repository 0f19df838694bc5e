"""Places and velocities over time: against drawn motions whose truth is known, and against a plain Kalman filter."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.ground_motion import MEMORY_S, SPEED_MPS, transition, wandering
from standoff.core.homography import FloatArray
from standoff.stages.locate.ground_filter import Filtered, GroundFilter

WORKER, LOADER = CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["wheel_loader"].id


def step(
    one: GroundFilter,
    time_s: float,
    xy_m: FloatArray,
    noise_m: float,
    *,
    class_id: int = WORKER,
    lasting_m: float = 0.0,
) -> Filtered:
    count = len(xy_m)
    noise, lasting = (np.tile(np.eye(2) * sigma**2, (count, 1, 1)) for sigma in (noise_m, lasting_m))
    return one.update(time_s, np.arange(count), np.full(count, class_id), xy_m, noise, lasting, np.zeros((count, 2, 2)))


@pytest.mark.parametrize("class_id", [WORKER, LOADER])
@pytest.mark.parametrize("step_s", [0.04, 0.5, 3.0])
def test_the_motion_is_the_solution_of_its_differential_equation(class_id: int, step_s: float) -> None:
    """Van Loan's matrix exponential gives transition and covariance of any linear one."""
    memory_s, speed_mps = MEMORY_S[class_id], SPEED_MPS[class_id]
    drift = np.array([[0.0, 1.0], [0.0, -1.0 / memory_s]])
    driven = np.diag([0.0, 2.0 * speed_mps**2 / memory_s])
    block = expm(np.block([[-drift, driven], [np.zeros((2, 2)), drift.T]]) * step_s)
    forth = block[2:, 2:].T
    gained = forth @ block[:2, 2:]
    ids = np.array([class_id])
    for axis in (0, 1):
        at = np.ix_([0], [axis, axis + 2], [axis, axis + 2])
        np.testing.assert_allclose(transition(ids, step_s)[at][0], forth, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(wandering(ids, step_s)[at][0], gained, rtol=1e-6, atol=1e-9)


def test_two_steps_are_one_of_twice_the_length() -> None:
    ids = np.array([WORKER, LOADER])
    half, whole = transition(ids, 0.3), transition(ids, 0.6)
    np.testing.assert_allclose(half @ half, whole, atol=1e-12)
    gained = half @ wandering(ids, 0.3) @ half.transpose(0, 2, 1) + wandering(ids, 0.3)
    np.testing.assert_allclose(gained, wandering(ids, 0.6), rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("class_id", [WORKER, LOADER])
@pytest.mark.parametrize("seed", [1, 2])
def test_its_stated_error_is_the_error_that_it_makes(class_id: int, seed: int) -> None:
    """Motions drawn from the model itself, seen with drawn noise: normalised errors squared are 4 on average."""
    rng, count, step_s, noise_m = np.random.default_rng(seed), 400, 0.1, 0.3
    ids = np.full(count, class_id)
    state = np.zeros((count, 4))
    state[:, 2:] = SPEED_MPS[class_id] * rng.normal(size=(count, 2))
    forth, root = transition(ids, step_s), np.linalg.cholesky(wandering(ids, step_s) + 1e-15 * np.eye(4))
    one = GroundFilter()
    for k in range(40):
        if k:
            drawn = rng.normal(size=(count, 4, 1))
            state = (forth @ state[:, :, None] + root @ drawn)[:, :, 0]
        seen_m = state[:, :2] + noise_m * rng.normal(size=(count, 2))
        found = step(one, k * step_s, seen_m, noise_m, class_id=class_id)
        off = found.mean - state
        normalised = (off * np.linalg.solve(found.covariance, off[:, :, None])[:, :, 0]).sum(axis=1)
        assert abs(normalised.mean() - 4.0) < 5.0 * np.sqrt(8.0 / count)
    assert np.abs(off[:, :2]).std() < 0.8 * noise_m
    assert found.velocity_known.all()


def test_an_error_that_lasts_does_not_average_out() -> None:
    one = GroundFilter()
    for k in range(100):
        found = step(one, 0.1 * k, np.zeros((1, 2)), 0.3, lasting_m=0.5)
    variance_m2 = found.covariance[0, 0, 0]
    assert 0.5**2 < variance_m2 < 0.5**2 + 0.3**2


def test_a_place_that_cannot_be_is_left_out_and_one_that_stays_is_believed() -> None:
    one = GroundFilter()
    for k in range(20):
        step(one, 0.1 * k, np.zeros((1, 2)), 0.1)
    once = step(one, 2.0, np.array([[30.0, 0.0]]), 0.1)
    assert np.linalg.norm(once.mean[0, :2]) < 0.1 and once.seen_s[0] == pytest.approx(1.9)
    back = step(one, 2.1, np.zeros((1, 2)), 0.1)
    assert np.linalg.norm(back.mean[0, :2]) < 0.1 and back.seen_s[0] == pytest.approx(2.1)
    for k in range(4):
        moved = step(one, 2.2 + 0.1 * k, np.array([[30.0, 0.0]]), 0.1)
    np.testing.assert_allclose(moved.mean[0, :2], [30.0, 0.0], atol=1e-9)
    assert not moved.velocity_known[0]


def test_the_order_of_tracks_changes_nothing_and_those_that_end_are_forgotten() -> None:
    one, other = GroundFilter(), GroundFilter()
    ids, xy_m = np.array([4, 9, 7]), np.array([[0.0, 0.0], [5.0, 1.0], [2.0, 8.0]])
    classes, noise = np.array([0, 1, 2]), np.tile(np.eye(2) * 0.01, (3, 1, 1))
    turned = np.array([2, 0, 1])
    for k in range(5):
        here = xy_m + 0.1 * k
        a = one.update(0.1 * k, ids, classes, here, noise, noise, noise)
        b = other.update(0.1 * k, ids[turned], classes[turned], here[turned], noise, noise, noise)
        np.testing.assert_allclose(a.mean[turned], b.mean)
    only = one.update(0.5, ids[:1], classes[:1], np.full((1, 2), np.nan), noise[:1], noise[:1], noise[:1])
    assert np.isfinite(only.mean).all()
    returned = one.update(0.6, ids, classes, np.full((3, 2), np.nan), noise, noise, noise)
    assert np.isfinite(returned.mean[:, 0]).tolist() == [True, False, False]


def test_who_stays_within_its_error_stands_and_who_walks_does_not() -> None:
    rng, one = np.random.default_rng(4), GroundFilter()
    for k in range(60):
        places_m = np.array([[0.0, 0.0], [1.4 * 0.1 * k, 0.0]]) + 0.1 * rng.normal(size=(2, 2))
        found = step(one, 0.1 * k, places_m, 0.1)
    assert found.standing_s[0] > 5.0
    assert found.standing_s[1] < 1.0


def wobbling(speed_mps: float, moves_at_s: float, until_s: float) -> FloatArray:
    """Return (T, 40) for how long loaders are said to stand; their errors last, and at a time they drive off."""
    rng, step_s, one, loaders = np.random.default_rng(6), 0.2, GroundFilter(), (40, 2)
    kept, bias_m, told = np.exp(-step_s / 4.0), 0.25 * rng.normal(size=loaders), []
    for k in range(round(until_s / step_s)):
        bias_m = kept * bias_m + np.sqrt(1.0 - kept**2) * 0.25 * rng.normal(size=loaders)
        driven_s = max(k * step_s - moves_at_s, 0.0)
        # A metre a second more in each second, up to its speed.
        gone_m = min(0.5 * driven_s**2, speed_mps * (driven_s - speed_mps / 2.0)) if driven_s > speed_mps else (
            0.5 * driven_s**2
        )  # fmt: skip
        seen_m = np.array([[gone_m, 0.0]]) + bias_m + 0.12 * rng.normal(size=loaders)
        told.append(step(one, k * step_s, seen_m, 0.12, class_id=LOADER, lasting_m=0.25).standing_s)
    return np.array(told)


def test_a_machine_stands_while_its_place_wobbles_within_its_stated_error() -> None:
    """Now and then one is taken to stir: in four minutes one of forty at most."""
    assert np.count_nonzero(wobbling(0.0, np.inf, 240.0)[-1] < 200.0) <= 1


@pytest.mark.parametrize("speed_mps", [1.0, 3.0])
def test_a_machine_that_moves_off_does_not_stand_any_more(speed_mps: float) -> None:
    """Once it has gone 2.5 m, ten of its standard errors, it is known to move, however long it stood."""
    told = wobbling(speed_mps, 200.0, 204.0)[round(200.0 / 0.2) :]
    assert np.median(told[0]) > 100.0
    gone_s = np.sqrt(2.0 * 2.5) if speed_mps > np.sqrt(2.0 * 2.5) else 2.5 / speed_mps + speed_mps / 2.0
    assert (told[: round(gone_s / 0.2) + 1].min(axis=0) < gone_s).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_machine_that_creeps_does_not_stand(seed: int) -> None:
    rng, one = np.random.default_rng(seed), GroundFilter()
    longest_s = 0.0
    for k in range(600):
        seen_m = np.array([[0.15 * 0.2 * k, 0.0]]) + 0.12 * rng.normal(size=(1, 2))
        longest_s = max(
            longest_s, float(step(one, 0.2 * k, seen_m, 0.12, class_id=LOADER, lasting_m=0.25).standing_s[0])
        )
    assert longest_s < 30.0


def test_of_what_is_placed_to_two_metres_nobody_can_say_that_it_stands() -> None:
    rng, one = np.random.default_rng(5), GroundFilter()
    for k in range(600):
        seen_m = 2.0 * rng.normal(size=(1, 2)) * (k // 20 % 2)
        found = step(one, 0.2 * k, seen_m, 0.3, class_id=LOADER, lasting_m=2.0)
    assert found.standing_s[0] < 60.0
