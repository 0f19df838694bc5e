"""The network of ground points: a detector's eyes, a map of where the point may be, and how sure that is.

The mean of a map that sums to 1 is a place that moves smoothly with it (integral regression: Sun et al., Integral
Human Pose Regression, 2018, eq. 2); each class has its own map, and its own errors, of one trunk. The trunk is the
first layers of a detector, which has seen thousands of machines: from nothing, boxes with known points are too few.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, Self

import torch
from torch import Tensor, nn

from standoff.stages.detect import POINT_CLASSES, POINT_CROP_PX
from standoff.training.architectures.efficientnet_lite import efficientnet_lite0_cfg, stage_layers
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.shapes import layer_shapes
from standoff.training.start.exported_weights import read_exported

LOG_SIGMA: Final = (-5.0, 1.0)
"""Least and largest logarithm of a stated standard error, in sides of the crop."""
_REACH: Final = 1.5
"""Side of the area of which the map tells, in sides of the crop: a foot may be cut off with it."""
_AS_IT_IS: Final = 6
"""So many layers of the trunk see edges and colours, and are left as they are."""
_WIDTH: Final = 64


def read_eyes(path: Path) -> DarknetNetwork:
    """Read the detector whose first layers a network of ground points starts with.

    Args:
        path: An exported detector of the architecture `efficientnet-lite0`.

    Raises:
        ModelError: It is none.
    """
    network, _ = read_exported(parse_cfg(efficientnet_lite0_cfg(1)), path)
    return network


class GroundPointNetwork(nn.Module):
    """From crops to ground points of every class.

    Crops are (N, 3, S, S) with S = `POINT_CROP_PX`, red first, 0 to 1; the result is (N, C, 4): x and y from 0 to 1
    across and down the crop, perhaps beyond, and the logarithms of their standard errors.

    Args:
        eyes: A detector, of which it takes the layers up to stride 16; its normalisations stay as they are.
    """

    def __init__(self, eyes: DarknetNetwork) -> None:
        super().__init__()
        count = len(POINT_CLASSES)
        ends = stage_layers()
        self._wanted = ends[2], ends[4]
        self.eyes = eyes
        del eyes.blocks[ends[4] + 1 :]
        for block in eyes.blocks[:_AS_IT_IS]:
            block.requires_grad_(requires_grad=False)
        shapes = layer_shapes(eyes.cfg)
        fine, coarse = (shapes[layer].channels for layer in self._wanted)
        self.fine = nn.Sequential(nn.Conv2d(fine, _WIDTH, 1, bias=False), nn.BatchNorm2d(_WIDTH))
        self.coarse = nn.Sequential(nn.Conv2d(coarse, _WIDTH, 1, bias=False), nn.BatchNorm2d(_WIDTH))
        self.map = nn.Sequential(_layer(_WIDTH, _WIDTH), _layer(_WIDTH, _WIDTH), nn.Conv2d(_WIDTH, count, 1))
        self.sigma = nn.Sequential(nn.Linear(coarse + _WIDTH, 64), nn.ReLU(), nn.Linear(64, 2 * count))
        self.nudge = nn.Linear(coarse, 2 * count)
        nn.init.zeros_(self.nudge.weight)
        cells = POINT_CROP_PX // 8
        places = (torch.arange(cells) + 0.5) / cells
        self.places: Tensor
        self.register_buffer("places", (places - 0.5) * _REACH + 0.5)

    def begin_at(self, points: Tensor) -> None:
        """Let an untrained network say these (C, 2) points, whatever it sees: a flat map says the middle."""
        with torch.no_grad():
            self.nudge.bias.copy_((points - 0.5).flatten())

    def train(self, mode: bool = True) -> Self:
        """Leave the normalisations of the eyes as they are: an exported detector has no statistics to go on with."""
        super().train(mode)
        self.eyes.eval()
        return self

    def forward(self, crops: Tensor) -> Tensor:
        """See the class."""
        fine, coarse = self.eyes.maps(crops, self._wanted)
        above = nn.functional.interpolate(self.coarse(coarse), scale_factor=2.0, mode="nearest")
        joined = torch.relu(self.fine(fine) + above)
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
