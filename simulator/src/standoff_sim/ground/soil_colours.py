"""Colours of soils, grass and concrete from wet or shaded to dry, as they look from the air."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from standoff_sim.ground.terrain_plan import Soil


def _ramp(*codes: str) -> npt.NDArray[np.uint8]:
    """Return (256, 1, 3) sRGB, red first, through evenly spaced colours."""
    stops = np.array([[int(code[i : i + 2], 16) for i in (1, 3, 5)] for code in codes], dtype=np.float64)
    at = np.linspace(0.0, 255.0, len(stops))
    ramp = np.column_stack([np.interp(np.arange(256), at, channel) for channel in stops.T])
    table = np.round(ramp).astype(np.uint8)[:, None, :]
    table.setflags(write=False)
    return table


PALETTES: Mapping[str, npt.NDArray[np.uint8]] = MappingProxyType(
    {
        Soil.BROWN_EARTH: _ramp("#2c231b", "#57483a", "#857361", "#a8967f", "#c6b8a2"),
        Soil.RED_CLAY: _ramp("#3d2a1c", "#6f523b", "#9a795a", "#b79879", "#d3bfa3"),
        Soil.GREY_GRAVEL: _ramp("#33322f", "#63615d", "#8f8c86", "#adaaa3", "#d2cfc8"),
        Soil.OCHRE_SAND: _ramp("#54462f", "#8b7a5c", "#b5a485", "#cabb9e", "#e0d5bf"),
        Soil.WET_MUD: _ramp("#1f1b16", "#413a31", "#655c50", "#82786a", "#a69c8d"),
        Soil.CONCRETE: _ramp("#3b3a38", "#71706c", "#9b9993", "#b3b1aa", "#d0cec8"),
        "grass": _ramp("#1d2414", "#3a4526", "#616b3c", "#8a8b58", "#b5ad82"),
        "dead grass": _ramp("#2a2617", "#56502f", "#82784e", "#a89b70", "#c9bd98"),
    }
)
"""(256, 1, 3) sRGB by tone; soils are pale and washed-out, as dust and haze make them."""


def palette_of(soil: Soil) -> npt.NDArray[np.uint8]:
    """Return the (256, 1, 3) colours of a soil by tone, red first."""
    return PALETTES[soil]
