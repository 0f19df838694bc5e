"""How the camera turns light into picture values."""

from __future__ import annotations

from dataclasses import dataclass

from standoff.core.homography import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """Exposure and development of one picture; the defaults are a neutral, linear rendering with a soft shoulder.

    Attributes:
        exposure: Factor on light: at 1 a white card in full sun is just below white.
        contrast: Slope of the tone curve around middle grey: 1 natural, 0.85 washed out, 1.2 hard.
        lift: Linear value that black becomes: veiling glare up to about 0.04; below 0 as much is taken for black.
        saturation: 0 grey, 1 natural.
        white_balance: Factors on linear red, green, blue.
        vignette: Share of light lost in the corners.
        blur: (3, 3) homography from a pixel of this moment's undistorted picture to where the same point of the
            site is one exposure later, or None. The smear is centred on the moment.
    """

    exposure: float = 1.0
    contrast: float = 1.0
    lift: float = 0.0
    saturation: float = 1.0
    white_balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vignette: float = 0.0
    blur: FloatArray | None = None
