"""A data set, a network and settings small enough to be trained in a test."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
import yaml

from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.pictures.augment import AugmentParams
from standoff.training.run.params import TrainParams
from standoff.training.start.initial_weights import initialize_layers

CLASSES = ("worker", "vehicle")
_COLOURS_BGR = ((40, 200, 250), (200, 60, 30))
_SIZE_PX = (128, 96)

CFG = """[net]
width=96
height=64
channels=3
[convolutional]
batch_normalize=1
filters=12
size=3
stride=2
pad=1
activation=leaky
[convolutional]
batch_normalize=1
filters=24
size=3
stride=2
pad=1
activation=leaky
[convolutional]
batch_normalize=1
filters=32
size=3
stride=2
pad=1
activation=leaky
[dropout]
probability=0.1
[convolutional]
filters=14
size=1
stride=1
activation=linear
[yolo]
mask=0,1
anchors=10,20, 30,16
classes=2
num=2
"""
"""Eleven thousand parameters; dropout, so that a resumed run must draw the same."""

QUIET = AugmentParams(mosaic=0.0, cut_out=0.0)
"""No drawn picture is worth a mosaic of four."""


FOOT = ((0.5, 1.0), (0.8, 0.5))
"""Of people and of vehicles, where in its box a block has its ground point."""


def write_data(folder: Path, *, pictures: int = 24, seed: int = 0, points: bool = False) -> Path:
    """Write a YOLO data set of coloured blocks: people upright, vehicles wide; a third of it to validate with."""
    rng = np.random.default_rng(seed)
    for index in range(pictures):
        split = "val" if index % 3 == 0 else "train"
        image = rng.integers(70, 110, (_SIZE_PX[1], _SIZE_PX[0], 3)).astype(np.uint8)
        lines, feet = [], []
        for class_id, (width, height) in enumerate(((12, 26), (40, 20))):
            left = int(rng.integers(2, _SIZE_PX[0] // 2 - width)) + class_id * _SIZE_PX[0] // 2
            top = int(rng.integers(2, _SIZE_PX[1] - height - 2))
            image[top : top + height, left : left + width] = _COLOURS_BGR[class_id]
            box = np.array([left + width / 2, top + height / 2, width, height]) / [*_SIZE_PX, *_SIZE_PX]
            foot = (np.array([left, top]) + np.array(FOOT[class_id]) * [width, height]) / _SIZE_PX
            feet.append(" ".join(f"{value:.6f}" for value in foot))
            lines.append(f"{class_id} " + " ".join(f"{value:.6f}" for value in box))
        for kind, suffix in (("images", "png"), ("labels", "txt"), *([("points", "txt")] if points else [])):
            (folder / kind / split).mkdir(parents=True, exist_ok=True)
            path = folder / kind / split / f"scene{index}_0.{suffix}"
            if kind == "images":
                cv2.imwrite(str(path), image)
            else:
                path.write_text("\n".join(lines if kind == "labels" else feet) + "\n")
    names = dict(enumerate(CLASSES))
    (folder / "data.yaml").write_text(yaml.safe_dump({"train": "images/train", "val": "images/val", "names": names}))
    return folder


def small_network(seed: int = 0) -> DarknetNetwork:
    network = DarknetNetwork(parse_cfg(CFG, "small.cfg"))
    layers = [index for index, _ in network.convolutions()]
    initialize_layers(network, layers, torch.Generator().manual_seed(seed))
    return network


def small_params(**changes: object) -> TrainParams:
    """Return settings of a run of seconds."""
    settings: dict[str, object] = {
        "steps": 12, "batch": 4, "size_px": (96, 64), "warmup_steps": 2, "learning_rate": 0.01, "bf16": False,
        "workers": 0, "validate_every": 6, "validate_pictures": 8, "checkpoint_every": 4, "augment": QUIET,
    }  # fmt: skip
    return TrainParams(**(settings | changes))  # type: ignore[arg-type]


def run_side_by_side(words: Sequence[str], environment: Mapping[str, str], count: int = 2) -> None:
    """Run a script in several processes of one crew, as torch's own launcher does, without the launcher's imports."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    crew = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port), "WORLD_SIZE": str(count), "OMP_NUM_THREADS": "1"}
    processes = [
        subprocess.Popen(
            [sys.executable, *words],
            env={**environment, **crew, "RANK": str(rank), "LOCAL_RANK": str(rank)},
            stderr=subprocess.PIPE,
            text=True,
        )
        for rank in range(count)
    ]
    try:
        for process in processes:
            _, error = process.communicate(timeout=240)
            assert process.returncode == 0, error
    finally:
        for process in processes:
            process.kill()
            process.wait()
