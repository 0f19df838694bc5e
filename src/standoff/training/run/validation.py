"""Score a network on labelled pictures while it is being trained."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import torch

from standoff.core.errors import DataError
from standoff.core.types import Detections
from standoff.evaluation.detection import DetectionScore, score_detections
from standoff.labels import LabelledPicture, load_picture
from standoff.stages.detect import DetectParams
from standoff.stages.detect.feet import feet_of
from standoff.stages.detect.letterbox import Letterbox, resize
from standoff.stages.detect.outputs import read_rows as read_candidates
from standoff.stages.detect.suppression import suppress
from standoff.training.darknet.network import DarknetNetwork, DecodedNetwork
from standoff.training.run.precision import autocast

_LEAST_SCORE = 0.01
_MOST_ROWS = 1000
_PARAMS = DetectParams()


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
        found.append(read_rows(boxes[0].cpu().numpy(), points[0].cpu().numpy(), letterbox))
    return readable, found


def read_rows(rows: npt.NDArray[np.float32], points: npt.NDArray[np.float32], letterbox: Letterbox) -> Detections:
    """Turn what a network says into boxes and ground points of the picture, without duplicates.

    Args:
        rows: (N, 5 + classes) of a decoded network.
        points: (N, 4) of them, or (N, 0).
        letterbox: Where the picture lies in the network's input.
    """
    surest = np.argsort(-rows[:, 4], kind="stable")[:_MOST_ROWS]
    outputs = [rows[None, surest], *([points[None, surest]] if points.size else [])]
    candidates = read_candidates(outputs, _LEAST_SCORE)
    xyxy_px = letterbox.to_source(candidates.xyxy_px)
    class_id = candidates.probability.argmax(axis=1)
    score = candidates.probability.max(axis=1).astype(np.float64)
    wanted = (score >= _LEAST_SCORE) & (xyxy_px[:, 2:] > xyxy_px[:, :2]).all(axis=1)
    return suppress(
        Detections(xyxy_px, score, class_id, *feet_of(candidates, letterbox))[wanted],
        _PARAMS.nms_iou,
        _PARAMS.max_detections,
    )


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
