"""One tiling picture of noise that roughens every surface at close range."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

_SIZE = 1024
_STONES = 2600


def _fractal(rng: np.random.Generator, size: int, exponent: float, lowest_cycles: float) -> npt.NDArray[np.float64]:
    """Return tiling noise of zero mean and unit deviation whose spectrum falls with frequency."""
    frequency = np.hypot(*np.meshgrid(np.fft.rfftfreq(size) * size, np.fft.fftfreq(size) * size))
    amplitude = np.where(frequency >= lowest_cycles, np.maximum(frequency, 1.0) ** -exponent, 0.0)
    field: npt.NDArray[np.float64] = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((size, size))) * amplitude)
    unit: npt.NDArray[np.float64] = (field - field.mean()) / field.std()
    return unit


def _pebbles(rng: np.random.Generator, size: int) -> npt.NDArray[np.float64]:
    """Return heights 0..1 of stones of many sizes lying on a tile."""
    height = np.zeros((size, size))
    for x, y, radius in zip(
        rng.uniform(0, size, _STONES), rng.uniform(0, size, _STONES), 2.0 + rng.pareto(2.2, _STONES) * 2.0, strict=True
    ):
        radius = min(radius, 18.0)
        reach = int(np.ceil(radius)) + 1
        offset = np.arange(-reach, reach + 1)
        rows, columns = int(y) + offset, int(x) + offset
        squash, turn = rng.uniform(0.6, 1.0), rng.uniform(0, np.pi)
        across, down = np.meshgrid(columns - x, rows - y)
        along, beside = across * np.cos(turn) + down * np.sin(turn), down * np.cos(turn) - across * np.sin(turn)
        dome = np.sqrt(np.clip(1.0 - (along**2 + (beside / squash) ** 2) / radius**2, 0.0, None)) * radius / 18.0
        place = np.ix_(rows % size, columns % size)
        height[place] = np.maximum(height[place], dome)
    return height


@lru_cache(maxsize=1)
def make_noise() -> npt.NDArray[np.uint8]:
    """Return (1024, 1024, 4): fractal grain, stones, and the slopes in x and y of grain and stones together.

    Grain and slopes have mean 0.5. It is the same at every call.
    """
    rng = np.random.default_rng(20240607)
    grain = _fractal(rng, _SIZE, 0.8, 4.0)
    stones = _pebbles(rng, _SIZE)
    # Stones are broken, not round: their tops are rough.
    relief = stones * (4.0 + 1.2 * _fractal(rng, _SIZE, 1.1, 24.0)) + 0.16 * _fractal(rng, _SIZE, 1.3, 3.0)
    slopes = [np.roll(relief, -1, axis) - np.roll(relief, 1, axis) for axis in (1, 0)]
    stone_tone = np.clip(np.sqrt(stones) * 1.6, 0.0, 1.0)
    channels = [0.5 + 0.17 * grain, stone_tone, *(0.5 + 0.35 * slope for slope in slopes)]
    noise = np.round(255.0 * np.clip(np.stack(channels, axis=-1), 0.0, 1.0)).astype(np.uint8)
    noise.setflags(write=False)
    return noise
