"""What a drone's camera, the weather and the radio link do to a picture."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import cv2
import numpy as np
from scipy import special

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray
from standoff.training.pictures.augment_params import AugmentParams
from standoff.training.pictures.views import log_uniform

_BGR_TO_YIQ: Final = ((0.114, 0.587, 0.299), (-0.3213, -0.2746, 0.5959), (0.3112, -0.5227, 0.2115))
_SUBPIXEL_BITS: Final = 4
_HAZE_LIGHT: Final = (0.7, 0.95)
_SAMPLES: Final = 8
"""Of a blur's kernel, across each pixel."""


def degrade(rng: np.random.Generator, image: ImageArray, params: AugmentParams) -> ImageArray:
    """Return a picture as another camera, another day and another link would show it; nothing moves.

    The order is roughly that of the light's way: shadows on the ground, exposure and haze, blur, sensor, compression.
    """
    changes: tuple[tuple[float, Callable[[np.random.Generator, ImageArray, AugmentParams], ImageArray]], ...] = (
        (params.shadows, _cast_shadows),
        (params.colour, _recolour),
        (params.blur, _blur),
        (params.lost_detail, _lose_detail),
        (params.noise, _add_noise),
        (params.jpeg, _compress),
    )
    for chance, change in changes:
        if rng.random() < chance:
            image = change(rng, image, params)
    return image


def _cast_shadows(rng: np.random.Generator, image: ImageArray, params: AugmentParams) -> ImageArray:
    """Darken one to three quadrilaterals, from a mast's narrow one to a building's."""
    height, width = image.shape[0] // 2, image.shape[1] // 2
    light = np.full((height, width), 255, np.uint8)
    for _ in range(rng.integers(1, 4)):
        half = np.array([log_uniform(rng, (0.1, 0.6)), log_uniform(rng, (0.01, 0.3))]) * width
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half * rng.uniform(0.7, 1.3, (4, 2))
        angle = rng.uniform(0.0, math.pi)
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        placed = corners @ turn.T + rng.uniform(0.0, 1.0, 2) * [width, height]
        fixed_point = np.round(placed * 2**_SUBPIXEL_BITS).astype(np.int32)
        cv2.fillPoly(light, [fixed_point], 255 * rng.uniform(*params.shadow_light), cv2.LINE_AA, _SUBPIXEL_BITS)
    light = cv2.GaussianBlur(light, (0, 0), rng.uniform(0.5, 2.5))
    light = cv2.resize(light, (image.shape[1], image.shape[0]))
    return np.asarray(cv2.multiply(image, cv2.merge([light, light, light]), scale=1.0 / 255.0))


def _recolour(rng: np.random.Generator, image: ImageArray, params: AugmentParams) -> ImageArray:
    """Tone curve, contrast, exposure, white balance and haze in one table; hue and saturation in one matrix.

    Haze comes last, though the camera exposes for it: brightened haze would leave nothing but white.
    """
    levels: FloatArray = np.linspace(0.0, 1.0, 256)[:, None].repeat(3, axis=1)
    levels = levels ** log_uniform(rng, (1.0 / params.gamma, params.gamma))
    levels = (levels - 0.5) * rng.uniform(*params.contrast) + 0.5
    levels = levels * log_uniform(rng, (1.0 / params.exposure, params.exposure))
    levels = levels * params.white_balance ** rng.uniform(-1.0, 1.0, 3)
    if rng.random() < params.haze:
        share = rng.uniform(*params.haze_share)
        levels = (1.0 - share) * levels + share * rng.uniform(*_HAZE_LIGHT)
    table = np.clip(levels * 255.0 + 0.5, 0.0, 255.0).astype(np.uint8)
    toned = cv2.LUT(image, table[:, None, :])
    return np.asarray(cv2.transform(toned, _colour_matrix(rng, params)))


def _colour_matrix(rng: np.random.Generator, params: AugmentParams) -> FloatArray:
    """Return the (3, 3) matrix that turns and scales the chroma of BGR and leaves the luma."""
    hue = math.radians(rng.uniform(-params.hue_deg, params.hue_deg))
    saturation = rng.uniform(*params.saturation) * (rng.random() >= params.gray)
    cosine, sine = saturation * math.cos(hue), saturation * math.sin(hue)
    chroma = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    to_yiq = np.array(_BGR_TO_YIQ)
    matrix: FloatArray = np.linalg.inv(to_yiq) @ chroma @ to_yiq
    return matrix


def _blur(rng: np.random.Generator, image: ImageArray, params: AugmentParams) -> ImageArray:
    """Blur by atmosphere, motion or defocus; all three of the drawn standard deviation."""
    sigma_px = rng.uniform(*params.blur_px)
    kind = rng.integers(3)
    if kind == 0:
        return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px))
    return np.asarray(cv2.filter2D(image, -1, _kernel(sigma_px, rng.uniform(0.0, math.pi) if kind == 1 else None)))


def _kernel(sigma_px: float, angle: float | None) -> FloatArray:
    """Return a kernel that is even along a line, or on a disc if there is no angle; averaged over each pixel.

    The variance is h^2 / 3 along a line of half length h and r^2 / 4 along each axis of a disc of radius r; the average
    over a pixel adds 1/12.
    """
    half_px = math.sqrt((sigma_px**2 - 1.0 / 12.0) * (4.0 if angle is None else 3.0))
    size = 2 * math.ceil(half_px) + 1
    offset = (np.arange(size * _SAMPLES) + 0.5) / _SAMPLES - size / 2.0
    x, y = offset[None, :], offset[:, None]
    if angle is None:
        inside = np.hypot(x, y) <= half_px
    else:
        along, across = x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)
        inside = (np.abs(along) <= half_px) & (np.abs(across) <= 0.5)
    kernel = inside.reshape(size, _SAMPLES, size, _SAMPLES).mean(axis=(1, 3))
    return np.asarray(kernel / kernel.sum(), dtype=np.float64)


def _lose_detail(rng: np.random.Generator, image: ImageArray, params: AugmentParams) -> ImageArray:
    height, width = image.shape[:2]
    factor = rng.uniform(*params.lost_detail_factor)
    smaller = cv2.resize(image, (round(width / factor), round(height / factor)), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(smaller, (width, height), interpolation=cv2.INTER_LINEAR))


def _add_noise(rng: np.random.Generator, image: ImageArray, params: AugmentParams) -> ImageArray:
    """Add Gaussian noise, by a table of quantiles because random bytes come ten times as fast as normal numbers."""
    quantile = (np.arange(256) + 0.5) / 256.0
    normal = math.sqrt(2.0) * np.asarray(special.erfinv(2.0 * quantile - 1.0))
    table = np.clip(np.round(128.0 + normal * rng.uniform(*params.noise_levels)), 0, 255).astype(np.uint8)
    noise = cv2.LUT(rng.integers(0, 256, image.shape, dtype=np.uint8), table)
    return np.asarray(cv2.addWeighted(image, 1.0, noise, 1.0, -128.0))


def _compress(rng: np.random.Generator, image: ImageArray, params: AugmentParams) -> ImageArray:
    quality = int(rng.integers(params.jpeg_quality[0], params.jpeg_quality[1] + 1))
    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)
