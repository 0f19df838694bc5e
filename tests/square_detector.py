"""A detector of coloured squares whose weights are written down, not trained, and pictures for it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch

from standoff.core.types import ImageArray
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.export import export_darknet
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import save_weights

CELL_PX = 16
SIZE_PX = (128, 96)
NAMES = ("worker", "vehicle")
_COLOURS_BGR = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))

_CFG = """[net]
width={width}
height={height}
channels=3

[convolutional]
size={cell}
stride={cell}
pad=0
filters=4
activation=leaky
{passing}
[convolutional]
size=1
stride=1
filters=7
activation=linear

[yolo]
mask=0
anchors={cell},{cell}
classes=2
num=1
"""
_PASSING = """
[convolutional]
size=1
stride=1
filters=4
activation=linear
"""


def write_detector(folder: Path, *, passing: int = 0, loud: Sequence[int] = (), half: bool = False) -> Path:
    """Write a network of one box a cell: mean red and blue of the cell decide what it is.

    Args:
        folder: For the ONNX file and what it is made from.
        passing: Convolutions in the middle that pass on what they get.
        loud: Layers, counted from 0, in which a useless channel is ten thousand times louder than the others: a
            single scale for all of them has no level left for the useful ones.
        half: Store half-precision weights.
    """
    cfg = _CFG.format(width=SIZE_PX[0], height=SIZE_PX[1], cell=CELL_PX, passing=_PASSING * passing)
    network = DarknetNetwork(parse_cfg(cfg))
    blocks = [block for _, block in network.convolutions()]
    with torch.no_grad():
        for block in blocks:
            block.convolution.weight.zero_()
            assert block.convolution.bias is not None
            block.convolution.bias.zero_()
        for channel in range(3):
            blocks[0].convolution.weight[channel, channel] = 1 / CELL_PX**2
        blocks[0].convolution.weight[3] = 1 / CELL_PX**2
        for block in blocks[1:-1]:
            block.convolution.weight[:, :, 0, 0] = torch.eye(4)
        for layer in loud:
            blocks[layer].convolution.weight[3] *= 1e4
            blocks[layer + 1].convolution.weight[:, 3] /= 1e4
        head = blocks[-1].convolution
        head.weight[4, :3, 0, 0] = torch.tensor([15.0, -30.0, 15.0])
        head.weight[5, :3, 0, 0] = torch.tensor([20.0, 0.0, -20.0])
        head.weight[6, :3, 0, 0] = torch.tensor([-20.0, 0.0, 20.0])
        assert head.bias is not None
        head.bias[4] = -3.0
    (folder / "squares.cfg").write_text(cfg)
    save_weights(network, folder / "squares.weights")
    (folder / "squares.names").write_text("\n".join(NAMES))
    out = folder / "squares.onnx"
    export_darknet(folder / "squares.cfg", folder / "squares.weights", folder / "squares.names", None, out, half=half)
    return out


@dataclass(frozen=True, slots=True)
class Square:
    """One thing in a picture."""

    class_id: int
    column: int
    row: int
    strength: float


def draw_squares(rng: np.random.Generator, count: int) -> tuple[ImageArray, list[Square]]:
    """Draw squares on noise, from plain to hardly seen; some of the faint ones are no things."""
    columns, rows = (side // CELL_PX for side in SIZE_PX)
    image = rng.normal(0.35, 0.03, (SIZE_PX[1], SIZE_PX[0], 3))
    squares = []
    for cell in rng.permutation(columns * rows)[:count].tolist():
        square = Square(int(rng.integers(2)), cell % columns, cell // columns, float(rng.uniform(0.02, 0.5)))
        y, x = square.row * CELL_PX, square.column * CELL_PX
        colour = np.array(_COLOURS_BGR[square.class_id]) - 0.3
        image[y : y + CELL_PX, x : x + CELL_PX] += square.strength * colour
        if square.strength > 0.1 * rng.uniform(0.5, 1.5):
            squares.append(square)
    return np.asarray(np.clip(image * 255, 0, 255), dtype=np.uint8), squares


def write_data(folder: Path, *, train: int, val: int, seed: int = 0) -> Path:
    """Write a COCO data set of drawn squares, six in each picture."""
    rng = np.random.default_rng(seed)
    (folder / "annotations").mkdir(parents=True)
    for split, pictures in (("train", train), ("val", val)):
        images, annotations = [], []
        for number in range(pictures):
            image, squares = draw_squares(rng, 6)
            name = f"{split}_{number:03d}.png"
            cv2.imwrite(str(folder / "annotations" / name), image)
            images.append({"id": number, "file_name": name, "width": SIZE_PX[0], "height": SIZE_PX[1]})
            annotations += [
                {
                    "id": 1000 * number + k,
                    "image_id": number,
                    "category_id": square.class_id,
                    "bbox": [square.column * CELL_PX, square.row * CELL_PX, CELL_PX, CELL_PX],
                    "area": CELL_PX**2,
                    "iscrowd": 0,
                }
                for k, square in enumerate(squares)
            ]
        content = {
            "images": images,
            "annotations": annotations,
            "categories": [{"id": k, "name": name} for k, name in enumerate(NAMES)],
        }
        (folder / "annotations" / f"{split}.json").write_text(json.dumps(content))
    return folder
