"""Things with their shadows over a photograph, as bright, coloured, soft and grainy as it is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.types import ImageArray
from standoff_sim.render import Cutout
from standoff_sim.scene.light import level_luminance
from standoff_sim.scene.scene import Light
from standoff_sim.solids.mesh import Float32Array

_LUMA_BGR = np.array([0.0722, 0.7152, 0.2126], dtype=np.float32)
_CODES = 4096
_ALBEDO = (0.16, 0.32)
"""Of the ground that a photograph's middle brightness is taken for."""
_WHITE, _LIT_WHITE = 0.8, (0.45, 1.25)
"""Albedo of white paint, and the least and most that it may show in the light."""
_GREY_SHARE, _CAST_SHARE = 0.2, 0.5
"""Of a photograph that is taken for grey, and how much of its colour is taken for the light's."""
_BLUE_SHADOW = np.array([0.93, 1.0, 1.05], dtype=np.float32)
"""Exponents of what shadows leave of blue, green, red: skylight is blue."""
_DARKEST_VEIL = 0.03
_KNEE = 0.6
_SHADE = (0.22, 0.5)
"""Brightness over the middle one: below the first a place lies in shade, above the second in the light."""
_SHADE_LEFT = 0.38
_SHADE_STEP_PX, _SHADE_REACH_PX = 8, 41
_NOTHING = 1e-3
_TILE_PX = 512
_SHARPEST_PX, _DRAWN_SOFT_PX = 0.25, 0.3
_PHOTO_SOFT_PX = (0.25, 0.6)
"""Standard deviation of a photograph's own blur, in its pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """How rendered light is made to fit a photograph.

    Attributes:
        gain: (3,) on linear blue, green, red.
        saturation: 0 grey, 1 as rendered.
        contrast: Slope of the tone curve around middle grey.
        veil: Linear value of the photograph's black.
        softness_px: Standard deviation of the blur.
        grain: Standard deviation of the noise, as a share of the light.
    """

    gain: Float32Array
    saturation: float
    contrast: float
    veil: float
    softness_px: float
    grain: float

    @classmethod
    def draw(cls, rng: np.random.Generator, photo: ImageArray, zoom: float, light: Light) -> Self:
        """Read brightness, colour and black off a photograph, (H, W, 3) uint8 BGR, and draw the rest."""
        linear = decoded(photo[::4, ::4]).reshape(-1, 3)
        luminance = linear @ _LUMA_BGR
        middle = float(np.median(luminance))
        level = level_luminance(light)
        gain = middle / (float(rng.uniform(*_ALBEDO)) * level)
        gain = float(np.clip(gain, *np.array(_LIT_WHITE) / (_WHITE * level))) * float(2.0 ** rng.normal(0.0, 0.2))
        colourful = np.ptp(linear, axis=1) / np.maximum(linear.max(axis=1), 1e-3)
        grey = np.median(linear[colourful <= np.quantile(colourful, _GREY_SHARE)], axis=0)
        cast = grey / max(float(grey @ _LUMA_BGR), 1e-3)
        return cls(
            (gain * cast**_CAST_SHARE).astype(np.float32),
            float(rng.uniform(0.8, 1.15)),
            float(rng.uniform(0.95, 1.25)),
            min(float(np.percentile(luminance, 0.5)), _DARKEST_VEIL),
            float(np.sqrt(max((rng.uniform(*_PHOTO_SOFT_PX) * zoom) ** 2 - _DRAWN_SOFT_PX**2, 0.0))),
            float(rng.uniform(0.01, 0.07)),
        )


def blend(rng: np.random.Generator, photo: ImageArray, cutout: Cutout, match: Match) -> ImageArray:
    """Lay a cutout over a photograph.

    Args:
        rng: Decides on the grain.
        photo: (H, W, 3) uint8 BGR.
        cutout: Of the same size.
        match: How it is to look.

    Returns:
        (H, W, 3) uint8 BGR.
    """
    lit = _lit(photo)
    alpha = cutout.light[..., 3]
    colour = _developed(cutout.light[..., 2::-1], alpha, match, lit)
    # a shadow that falls where it is dark already takes little away
    over = cv2.merge([*cv2.split(colour), np.where(colour[..., 1] > 0.0, alpha, alpha * lit)])
    if match.softness_px > _SHARPEST_PX:
        over = cv2.GaussianBlur(over, (0, 0), match.softness_px)
    rows, columns = np.nonzero(over[..., 3] > _NOTHING)
    touched = over[rows, columns]
    grain = _grain(rng, match)[rows % _TILE_PX, columns % _TILE_PX]
    left = np.maximum(1.0 - touched[:, 3:], 0.0) ** _BLUE_SHADOW
    blended = photo.copy()
    blended[rows, columns] = encoded(touched[:, :3] * (1.0 + grain[:, None]) + _decoding()[photo[rows, columns]] * left)
    return blended


def decoded(image: ImageArray) -> Float32Array:
    """Return the linear light, 0 to 1, of a picture."""
    linear: Float32Array = cv2.LUT(np.ascontiguousarray(image), _decoding())
    return linear


def encoded(linear: Float32Array) -> ImageArray:
    """Return the picture of linear light, cut at white.

    >>> image = np.arange(256, dtype=np.uint8).reshape(1, 256, 1).repeat(3, axis=2)
    >>> bool((encoded(decoded(image)) == image).all())
    True
    """
    code = np.clip(linear, 0.0, 1.0)
    np.sqrt(code, out=code)
    image: ImageArray = _encoding()[(code * (_CODES - 1) + 0.5).astype(np.uint16)]
    return image


@lru_cache(maxsize=1)
def _decoding() -> Float32Array:
    code = np.arange(256) / 255.0
    table: Float32Array = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)
    table.setflags(write=False)
    return table


@lru_cache(maxsize=1)
def _encoding() -> npt.NDArray[np.uint8]:
    """Return the code of each square root of linear light, which is fine enough in the darks."""
    linear = (np.arange(_CODES) / (_CODES - 1)) ** 2
    code = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    table: npt.NDArray[np.uint8] = np.rint(255.0 * code).astype(np.uint8)
    table.setflags(write=False)
    return table


def _grain(rng: np.random.Generator, match: Match) -> Float32Array:
    """Return a square tile of noise as coarse as the photograph's own."""
    noise = rng.standard_normal((_TILE_PX, _TILE_PX), np.float32)
    if match.softness_px > _SHARPEST_PX:
        noise = cv2.GaussianBlur(noise, (0, 0), 0.7 * match.softness_px)
    scaled: Float32Array = noise * np.float32(match.grain / noise.std())
    return scaled


def _lit(photo: ImageArray) -> Float32Array:
    """Return (H, W) how far each place lies in the photograph's light, 0 to 1: what is much darker lies in shade."""
    height, width = photo.shape[:2]
    small_px = max(width // _SHADE_STEP_PX, 1), max(height // _SHADE_STEP_PX, 1)
    luminance = decoded(cv2.resize(photo, small_px, interpolation=cv2.INTER_AREA)) @ _LUMA_BGR
    blurred = cv2.GaussianBlur(luminance, (0, 0), _SHADE_REACH_PX / _SHADE_STEP_PX)
    low, high = (share * float(np.median(luminance)) for share in _SHADE)
    lit = np.clip((blurred - low) / max(high - low, 1e-6), 0.0, 1.0).astype(np.float32)
    large: Float32Array = cv2.resize(lit, (width, height), interpolation=cv2.INTER_LINEAR)
    return large


def _developed(colour: Float32Array, alpha: Float32Array, match: Match, lit: Float32Array) -> Float32Array:
    """Return the things' own light (H, W, 3) BGR, still times alpha, as the photograph's camera would have shown it."""
    rows, columns = np.nonzero(colour[..., 1] > 0.0)
    opaque = np.maximum(alpha[rows, columns, None], 1e-3)
    own = colour[rows, columns] / opaque * match.gain * (_SHADE_LEFT + (1.0 - _SHADE_LEFT) * lit[rows, columns, None])
    grey = (own @ _LUMA_BGR)[:, None]
    own = np.maximum(grey + match.saturation * (own - grey), 0.0)
    own = 0.18 * (own / 0.18) ** match.contrast
    above = np.maximum(own - _KNEE, 0.0) / (1.0 - _KNEE)
    own = np.minimum(own, _KNEE) + (1.0 - _KNEE) * above / (1.0 + above)
    own = match.veil + (1.0 - match.veil) * own
    developed = np.zeros_like(colour)
    developed[rows, columns] = own * opaque
    return developed
