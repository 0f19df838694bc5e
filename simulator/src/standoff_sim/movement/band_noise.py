"""Band-limited noise as an explicit function of time: a sum of sines with random phases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray

_SINES = 9


@dataclass(frozen=True, slots=True, eq=False)
class BandNoise:
    """Noise that any moment can be asked for alone.

    Attributes:
        angular_rad_ps: (K,) angular frequencies.
        amplitude: (K,) in the unit of what wanders.
        phase_rad: (K,).
    """

    angular_rad_ps: FloatArray
    amplitude: FloatArray
    phase_rad: FloatArray

    @classmethod
    def draw(cls, rng: np.random.Generator, band_hz: tuple[float, float], rms: float) -> BandNoise:
        """Draw noise of a root mean square value with frequencies spread evenly, by octaves, over a band."""
        low, high = np.log(band_hz)
        edges = np.linspace(low, high, _SINES + 1)
        frequency_hz = np.exp(rng.uniform(edges[:-1], edges[1:]))
        weight = rng.uniform(0.5, 1.0, _SINES)
        return cls(
            2 * np.pi * frequency_hz,
            rms * np.sqrt(2.0) * weight / np.linalg.norm(weight),
            rng.uniform(0.0, 2 * np.pi, _SINES),
        )

    def at(self, time_s: float) -> float:
        """Return the value at a moment."""
        return float(self.amplitude @ np.sin(self.angular_rad_ps * time_s + self.phase_rad))

    @property
    def bound(self) -> float:
        """Return what the absolute value never exceeds."""
        return float(self.amplitude.sum())
