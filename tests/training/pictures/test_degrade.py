from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from scipy import stats

from standoff.core.types import ImageArray
from standoff.training.pictures.augment_params import AugmentParams
from standoff.training.pictures.degrade import degrade

_NONE = AugmentParams(shadows=0, colour=0, haze=0, gray=0, blur=0, lost_detail=0, noise=0, jpeg=0)


def _scene(seed: int = 0) -> ImageArray:
    """Blotches of all sizes and colours, far enough from black and white."""
    rng = np.random.default_rng(seed)
    layers = [cv2.resize(rng.uniform(80, 170, (side, side, 3)), (160, 120)) for side in (3, 9, 40)]
    return np.asarray(np.mean(layers, axis=0), dtype=np.uint8)


def _only(**settings: Any) -> AugmentParams:
    return replace(_NONE, **settings)


@examples(30)
@given(st.integers(0, 10_000))
def test_a_picture_keeps_its_size_and_most_of_its_content(seed: int) -> None:
    scene = _scene()
    seen = degrade(np.random.default_rng(seed), scene, AugmentParams(shadows=0.0))
    assert seen.shape == scene.shape
    assert seen.dtype == np.uint8
    blurred = [cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (0, 0), 4).ravel() for image in (scene, seen)]
    assert stats.pearsonr(*blurred).statistic > 0.5


def test_without_any_chance_nothing_changes() -> None:
    np.testing.assert_array_equal(degrade(np.random.default_rng(0), _scene(), _NONE), _scene())


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("sigma_px", [0.6, 1.4])
def test_every_blur_has_the_drawn_standard_deviation(seed: int, sigma_px: float) -> None:
    point = np.zeros((41, 41, 3), np.uint8)
    point[20, 20] = 255
    rng = np.random.default_rng(seed)
    params = _only(blur=1.0, blur_px=(sigma_px, sigma_px))
    spread = degrade(rng, point, params)[..., 0]
    offsets = np.stack(np.meshgrid(np.arange(41) - 20, np.arange(41) - 20)).reshape(2, -1)
    covariance = np.cov(offsets, aweights=spread.ravel(), ddof=0)
    assert math.sqrt(np.linalg.eigvalsh(covariance)[1]) == pytest.approx(sigma_px, rel=0.15)
    assert float(spread.sum()) == pytest.approx(255, rel=0.05)


@pytest.mark.parametrize("sigma", [2.0, 8.0])
def test_noise_has_the_drawn_deviation_and_no_bias(sigma: float) -> None:
    flat = np.full((300, 300, 3), 120, np.uint8)
    noise = degrade(np.random.default_rng(0), flat, _only(noise=1.0, noise_levels=(sigma, sigma))).astype(float) - 120
    # 256 quantiles cut the tails (0.6 %), rounding adds 1/12.
    assert noise.std() == pytest.approx(math.sqrt(sigma**2 + 1 / 12), rel=0.02)
    assert abs(noise.mean()) < 0.05
    assert abs(np.corrcoef(noise[..., 0].ravel(), noise[..., 2].ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("seed", range(6))
def test_hue_and_saturation_leave_the_luma(seed: int) -> None:
    params = _only(colour=1.0, gamma=1.0, contrast=(1.0, 1.0), exposure=1.0, white_balance=1.0, hue_deg=30)
    seen = degrade(np.random.default_rng(seed), _scene(seed), params)
    luma = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(int) for image in (_scene(seed), seen)]
    assert np.abs(luma[0] - luma[1]).max() <= 2
    assert (seen != _scene(seed)).mean() > 0.2


def test_a_gray_picture_has_three_equal_channels() -> None:
    seen = degrade(np.random.default_rng(0), _scene(), _only(colour=1.0, gray=1.0)).astype(int)
    assert np.abs(seen - seen[..., :1]).max() <= 1


def test_haze_takes_contrast_and_adds_light() -> None:
    plain = _only(
        colour=1.0, gamma=1.0, contrast=(1.0, 1.0), exposure=1.0, white_balance=1.0, hue_deg=0, saturation=(1, 1)
    )
    seen = degrade(np.random.default_rng(0), _scene(), replace(plain, haze=1.0, haze_share=(0.4, 0.4)))
    assert seen.std() == pytest.approx(0.6 * _scene().std(), rel=0.05)
    assert seen.mean() > _scene().mean()


@pytest.mark.parametrize("seed", range(6))
def test_a_shadow_darkens_by_the_drawn_light_where_it_falls(seed: int) -> None:
    flat = np.full((120, 160, 3), 200, np.uint8)
    seen = degrade(np.random.default_rng(seed), flat, _only(shadows=1.0, shadow_light=(0.5, 0.5)))
    assert seen.max() <= 200
    assert (seen[..., 0] == seen[..., 2]).all()


def test_shadows_fall_on_parts_of_most_pictures() -> None:
    flat = np.full((120, 160, 3), 200, np.uint8)
    dark = [(degrade(np.random.default_rng(seed), flat, _only(shadows=1.0)) < 190).mean() for seed in range(40)]
    assert 0.05 < np.median(dark) < 0.5


def test_lost_detail_is_fine_detail() -> None:
    rng = np.random.default_rng(0)
    fine = rng.integers(60, 190, (120, 160, 3), dtype=np.uint8)
    smooth = np.asarray(cv2.resize(_scene()[40:60, 40:60], (160, 120)))
    params = _only(lost_detail=1.0, lost_detail_factor=(2.0, 2.0))
    assert degrade(rng, fine, params).std() < 0.6 * fine.std()
    assert np.abs(degrade(rng, smooth, params).astype(int) - smooth).max() <= 3


def test_compression_at_a_lower_quality_changes_more() -> None:
    errors = []
    for quality in (95, 60, 25):
        seen = degrade(np.random.default_rng(0), _scene(), _only(jpeg=1.0, jpeg_quality=(quality, quality)))
        errors.append(np.abs(seen.astype(int) - _scene()).mean())
    assert 0 < errors[0] < errors[1] < errors[2] < 10
