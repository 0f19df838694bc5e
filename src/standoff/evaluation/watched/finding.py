"""How small a worker a detector finds, from runs of clips with exact truth: what its file should say of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.optimize import isotonic_regression

from standoff.core.finding import WorkerFinding
from standoff.evaluation.watched.samples import WorkerSamples

_HEIGHTS_PX: Final = tuple(8.0 * 2.0 ** (step / 2.0) for step in range(10))
_FEWEST: Final = 20
_LEAST_IN_TRACK: Final = 0.75


def measure_finding(samples: Sequence[WorkerSamples]) -> WorkerFinding:
    """Count which of the workers are in a track, or suspected, of whom nothing is hidden: of what hides nobody knows.

    Who is only suspected is not warned: where fewer than three of four are in a track, no more than these count.

    Bands of height, each a factor of the root of 2 wide, are made to rise with the height, as few workers in one of
    them would else make it fall (isotonic regression: Barlow et al. 1972). Bands of fewer than 20 are left out.

    Args:
        samples: Of runs with one detector; one at least.

    Returns:
        The detector's with what was measured; `measured` is False where there are not 20 workers in one band.
    """
    seen = np.concatenate([one.whole for one in samples])
    height_px = np.concatenate([one.input_height_px for one in samples])[seen]
    found = np.concatenate([one.found for one in samples])[seen]
    noticed = found | np.concatenate([one.suspected for one in samples])[seen]
    edges = np.sqrt(np.multiply(_HEIGHTS_PX[:-1], _HEIGHTS_PX[1:]))
    band = np.searchsorted(edges, height_px)
    counts = np.bincount(band, minlength=len(_HEIGHTS_PX))
    asked = counts >= _FEWEST
    if not asked.any():
        return samples[0].detector
    in_track, at_all = (np.bincount(band, which, len(_HEIGHTS_PX))[asked] / counts[asked] for which in (found, noticed))
    shares = np.where(in_track >= _LEAST_IN_TRACK, at_all, in_track)
    rising = isotonic_regression(shares, weights=counts[asked]).x
    heights_px = tuple(np.round(np.array(_HEIGHTS_PX)[asked], 1).tolist())
    return samples[0].detector.measured_as(heights_px, tuple(np.round(rising, 3).tolist()))
