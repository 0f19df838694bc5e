"""What a network loses by a wrong point, and by a wrong error of it.

The point follows its residual in units of the error that it states, so that it learns most where much can be known; the
error follows the residual by the Gaussian likelihood. Each is a constant to the other: stated together, a network
finds it cheaper to excuse a residual than to lessen it. What nobody can see, a foot far outside the picture, does not
decide the step: beyond some errors the first grows linearly, the second with the logarithm, so that a residual raises
the stated error by no more than one of four errors does.

Source:
    Kendall and Gal, What Uncertainties Do We Need in Bayesian Deep Learning for Computer Vision?, 2017, eq. 5 and 8
    (the likelihood, and the logarithm as output); He et al., Bounding Box Regression with Uncertainty, 2019, eq. 9 and
    10 (linear beyond an error); Seitzer et al., On the Pitfalls of Heteroscedastic Uncertainty Estimation, 2022,
    section 4 (weights that keep the mean learning: theirs with beta = 0.5 is the first term).
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

from standoff.training.darknet.network import LOG_SIGMA

_FAR_MEAN: Final = 2.0
_FAR_SIGMA: Final = 4.0
"""Standard errors beyond which a residual counts less: for a Gaussian 5 % of them, and one in 16,000."""


def point_loss(residual: Tensor, log_sigma: Tensor, least_log_sigma: float = LOG_SIGMA[0]) -> Tensor:
    """Return the sum over points of both terms; points that nobody marked count nothing.

    Args:
        residual: (P, 2) what is said less what is true, in any unit; NaN where nothing is known.
        log_sigma: (P, 2) logarithm of the stated standard error, in the same unit.
        least_log_sigma: It is this or more; the default is that of heads beside boxes.

    >>> point_loss(torch.tensor([[0.0, torch.nan]]), torch.full((1, 2), LOG_SIGMA[0])).item()
    0.0
    """
    known = torch.isfinite(residual)
    # Counted from the least that can be told, the logarithm keeps the loss from becoming negative.
    above_least = log_sigma - least_log_sigma
    residual, log_sigma = torch.where(known, residual, 0.0), torch.where(known, log_sigma, 0.0)
    sigma = log_sigma.detach().exp()
    mean = sigma * _huber(residual / sigma, _FAR_MEAN)
    spread = above_least + _log_tailed(residual.detach() / log_sigma.exp(), _FAR_SIGMA)
    return ((mean + spread) * known).sum()


def _huber(value: Tensor, linear_from: float) -> Tensor:
    """Return half the square, and its tangent beyond a value."""
    size = value.abs()
    return torch.where(size <= linear_from, size.square() / 2.0, linear_from * (size - linear_from / 2.0))


def _log_tailed(value: Tensor, log_from: float) -> Tensor:
    """Return half the square, and beyond a value what goes on with its slope over the logarithm."""
    size = value.abs()
    tail = log_from**2 * (0.5 + (size.clamp(min=log_from) / log_from).log())
    return torch.where(size <= log_from, size.square() / 2.0, tail)
