from __future__ import annotations

import cv2
import numpy as np
import pytest
from stages.watched.drawn_site import site_picture
from tolerances import BLUR_REL, NOISE_REL

from standoff.core.types import ImageArray
from standoff.stages.frames import frame_from_array
from standoff.stages.watched.quality import PictureQuality, picture_quality

ROWS, COLUMNS = 9, 16
SEEDS = range(3)


def judged(gray: ImageArray) -> PictureQuality:
    return picture_quality(frame_from_array(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)).picture, ROWS, COLUMNS)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("size_px", [(1280, 720), (1920, 1080)])
def test_blur_is_told_in_pixels_of_the_full_picture(seed: int, size_px: tuple[int, int]) -> None:
    sharp = site_picture(seed, size_px)
    for sigma_px in (4.0, 6.0, 8.0):
        blurred = cv2.GaussianBlur(sharp, (0, 0), sigma_px)
        assert np.nanmedian(judged(blurred).blur_px) == pytest.approx(sigma_px, rel=BLUR_REL)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_blur_in_one_direction_counts_as_one(seed: int) -> None:
    sharp = site_picture(seed)
    usual = np.nanmedian(judged(sharp).blur_px)
    for kernel in (np.full((1, 25), 1 / 25), np.full((25, 1), 1 / 25)):
        assert np.nanmedian(judged(cv2.filter2D(sharp, -1, kernel)).blur_px) > 2.0 * usual


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_is_no_sharpness_and_no_contrast(seed: int) -> None:
    rng, flat = np.random.default_rng(seed), np.full((720, 1280), 120.0)
    for sigma in (4.0, 12.0):
        quality = judged(np.clip(flat + rng.normal(0.0, sigma, flat.shape), 0, 255).round().astype(np.uint8))
        # Two by two pixels are averaged on the way.
        assert quality.noise == pytest.approx(sigma / 2.0, rel=NOISE_REL)
        assert np.isnan(quality.blur_px).all()
        assert quality.contrast.max() < 2.0 * sigma


@pytest.mark.parametrize("seed", SEEDS)
def test_fog_takes_contrast_in_its_proportion(seed: int) -> None:
    clear = site_picture(seed)
    before = judged(clear)
    for through in (0.6, 0.25):
        after = judged((clear * through + 200.0 * (1.0 - through)).round().astype(np.uint8))
        ratio = np.median(after.contrast / before.contrast)
        assert ratio == pytest.approx(through, rel=0.1)
        np.testing.assert_allclose(after.brightness, before.brightness * through + 200.0 * (1.0 - through), atol=1.0)


def test_a_picture_of_nothing_has_nothing_to_tell() -> None:
    quality = judged(np.zeros((360, 640), dtype=np.uint8))
    assert np.isnan(quality.blur_px).all()
    assert (quality.contrast == 0.0).all() and (quality.brightness == 0.0).all()


@pytest.mark.parametrize("size_px", [(64, 64), (321, 181), (1000, 1000)])
def test_pictures_of_any_size_have_all_their_parts(size_px: tuple[int, int]) -> None:
    quality = judged(site_picture(0, size_px))
    assert quality.blur_px.shape == quality.contrast.shape == quality.brightness.shape == (ROWS, COLUMNS)
