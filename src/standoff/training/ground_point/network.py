"""The network of ground points: convolutions, a map of where the point may be, and how sure that is.

The mean of a map that sums to 1 is a place that moves smoothly with it (integral regression: Sun et al., Integral
Human Pose Regression, 2018, eq. 2); each class has its own map, and its own errors, of one trunk.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from standoff.stages.detect import POINT_CLASSES, POINT_CROP_PX

LOG_SIGMA: Final = (-5.0, 1.0)
"""Least and largest logarithm of a stated standard error, in sides of the crop."""
_REACH: Final = 1.5
"""Side of the area of which the map tells, in sides of the crop: a foot may be cut off with it."""


class GroundPointNetwork(nn.Module):
    """From crops to ground points of every class.

    Crops are (N, 3, S, S) with S = `POINT_CROP_PX`, red first, 0 to 1; the result is (N, C, 4): x and y from 0 to 1
    across and down the crop, perhaps beyond, and the logarithms of their standard errors.
    """

    def __init__(self) -> None:
        super().__init__()
        count = len(POINT_CLASSES)
        self.fine = nn.Sequential(
            _layer(3, 16, 2), _layer(16, 24, 2), _layer(24, 32), _layer(32, 64, 2), _layer(64, 64), _layer(64, 64)
        )
        self.coarse = nn.Sequential(_layer(64, 96, 2), _layer(96, 96), _layer(96, 96))
        self.back = nn.Sequential(nn.Conv2d(96, 64, 1, bias=False), nn.BatchNorm2d(64))
        self.map = nn.Sequential(_layer(64, 64), nn.Conv2d(64, count, 1))
        self.sigma = nn.Sequential(nn.Linear(96 + 64, 64), nn.ReLU(), nn.Linear(64, 2 * count))
        self.nudge = nn.Linear(96, 2 * count)
        nn.init.zeros_(self.nudge.weight)
        cells = POINT_CROP_PX // 8
        places = (torch.arange(cells) + 0.5) / cells
        self.places: Tensor
        self.register_buffer("places", (places - 0.5) * _REACH + 0.5)

    def begin_at(self, points: Tensor) -> None:
        """Let an untrained network say these (C, 2) points, whatever it sees: a flat map says the middle."""
        with torch.no_grad():
            self.nudge.bias.copy_((points - 0.5).flatten())

    def forward(self, crops: Tensor) -> Tensor:
        """See the class."""
        fine = self.fine(crops - 0.45)
        coarse = self.coarse(fine)
        joined = torch.relu(fine + nn.functional.interpolate(self.back(coarse), scale_factor=2.0, mode="nearest"))
        logits = self.map(joined)
        shares = logits.flatten(2).softmax(dim=2).reshape(logits.shape)
        x, y = (shares.sum(dim=2) * self.places).sum(dim=2), (shares.sum(dim=3) * self.places).sum(dim=2)
        whole = coarse.mean(dim=(2, 3))
        points = torch.stack([x, y], dim=2) + self.nudge(whole).reshape(-1, logits.shape[1], 2)
        sigma = self.sigma(torch.cat([whole, joined.mean(dim=(2, 3))], dim=1)).reshape(-1, logits.shape[1], 2)
        middle, half = sum(LOG_SIGMA) / 2.0, (LOG_SIGMA[1] - LOG_SIGMA[0]) / 2.0
        return torch.cat([points, middle + half * torch.tanh(sigma / half)], dim=2)


class ToldPoints(nn.Module):
    """What goes into the file: one class a crop, standard errors with what was found missing in them.

    Args:
        network: Trained.
        stretch: (C, 2) by how much the standard errors of each class are to be multiplied.
    """

    def __init__(self, network: GroundPointNetwork, stretch: Tensor) -> None:
        super().__init__()
        self.network = network
        self.stretch: Tensor
        self.register_buffer("stretch", stretch)

    def forward(self, crops: Tensor, class_index: Tensor) -> Tensor:
        """Return (N, 4) x, y and their standard errors in sides of the crop, for (N,) classes."""
        told = self.network(crops)
        own = told.gather(1, class_index.reshape(-1, 1, 1).expand(-1, 1, 4)).squeeze(1)
        return torch.cat([own[:, :2], own[:, 2:].exp() * self.stretch[class_index]], dim=1)


def _layer(before: int, after: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(before, after, 3, stride, 1, bias=False), nn.BatchNorm2d(after), nn.ReLU(inplace=True)
    )
