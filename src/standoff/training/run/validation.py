"""Score a network on labelled pictures while it is being trained."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from standoff.core.errors import DataError
from standoff.core.types import Detections
from standoff.evaluation.detection import DetectionScore, score_detections
from standoff.labels import LabelledPicture, load_picture
from standoff.stages.detect import Letterbox, detections_in_rows, resize
from standoff.training.darknet.network import DarknetNetwork, DecodedNetwork
from standoff.training.run.precision import autocast


def detect_pictures(
    network: DarknetNetwork, pictures: Sequence[LabelledPicture], *, bf16: bool
) -> tuple[list[LabelledPicture], list[Detections]]:
    """Run a network over pictures, one at a time, letterboxed to its own size.

    Args:
        network: Left in evaluation mode.
        pictures: To look at; those that cannot be decoded are left out.
        bf16: Compute in bfloat16 where it is safe.

    Returns:
        The pictures that could be read, and what was found in each; class ids are the network's.
    """
    device = next(network.parameters()).device
    size_px = network.cfg.width_px, network.cfg.height_px
    decoded = DecodedNetwork(network).to(device).eval()
    readable, found = [], []
    for picture in pictures:
        try:
            image = load_picture(picture)
        except DataError:
            continue
        letterbox = Letterbox.fit(picture.size_px, size_px)
        blob = letterbox.network_input(resize(image, letterbox.inner_size_px))
        with torch.inference_mode():
            with autocast(device, bf16=bf16):
                pixels = torch.from_numpy(blob).to(device).contiguous(memory_format=torch.channels_last)
                heads = network(pixels)
            # bfloat16 has 8 bits: a box at 640 px would be rounded to 4.
            boxes, points = decoded.decode(tuple(head.float() for head in heads))
        readable.append(picture)
        found.append(detections_in_rows(boxes[0].cpu().numpy(), points[0].cpu().numpy(), letterbox))
    return readable, found


def validate(
    network: DarknetNetwork,
    pictures: Sequence[LabelledPicture],
    classes: tuple[str, ...],
    *,
    bf16: bool,
) -> DetectionScore:
    """Score a network; see `score_detections`.

    Raises:
        DataError: None of the pictures can be decoded.
    """
    readable, found = detect_pictures(network, pictures, bf16=bf16)
    if not readable:
        raise DataError(
            expected="validation pictures that can be decoded", found=f"none of {len(pictures)}", fix="check the files"
        )
    return score_detections(readable, found, classes)
