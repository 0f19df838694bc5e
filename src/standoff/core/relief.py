"""How far the ground may lie off the plane that a map takes it for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from standoff.core.homography import FloatArray

_BENDS_IN_M: Final = 4.0
"""So far from where it was surveyed, ground lies off the plane by as much again: rough ground bends more."""


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """The error of heights that a plane through surveyed ones stands for: least among them, growing away from them.

    Attributes:
        sigma_m: Standard deviation of the ground's height about the plane, where it was surveyed.
        plane_covariance: (3, 3) of the plane's height at the site's origin, and of its rises a metre east and north.
        surveyed_m: (P, 2) where heights were surveyed, site frame; P >= 1.

    >>> relief = Relief(0.1, np.zeros((3, 3)), np.zeros((1, 2)))
    >>> relief.sigma_at(np.array([[0.0, 0.0], [3.0, 4.0], [10.0, 0.0]])).round(3).tolist()
    [0.1, 0.16, 0.269]
    """

    sigma_m: float
    plane_covariance: FloatArray
    surveyed_m: FloatArray

    def sigma_at(self, xy_m: FloatArray) -> FloatArray:
        """Return (N,) standard errors of the ground's height at (N, 2) places in the site frame; NaN where one is.

        Source:
            The variance of a prediction by a straight fit (Draper and Smith, Applied Regression Analysis, 3rd edition,
            section 5.4), and `_BENDS_IN_M` for ground that is not straight.
        """
        terms = np.column_stack([np.ones(len(xy_m)), xy_m])
        away_m = np.linalg.norm(np.asarray(xy_m)[:, None] - self.surveyed_m, axis=2).min(axis=1)
        variance_m2 = self.sigma_m**2 + np.einsum("ni,ij,nj->n", terms, self.plane_covariance, terms)
        sigma_m: FloatArray = np.sqrt(variance_m2 + (self.sigma_m * away_m / _BENDS_IN_M) ** 2)
        return sigma_m
