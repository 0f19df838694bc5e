"""Draw a small site with exactly known geometry: a film, the boxes in it, and the true distances.

    python draw_site.py OUT [--frames 180] [--seed 0]

A camera hovers 22 m above flat ground with a painted square of 2.89 m, the paper's footing. Two workers, an
excavator and a wheel loader are plain blocks; one worker walks towards the loader. It needs no data and no model, so
it shows the whole monitor anywhere: see README.md in this folder.
"""

from __future__ import annotations

import argparse
import csv
import json
from dataclasses import dataclass
from pathlib import Path

import av
import cv2
import numpy as np
import numpy.typing as npt

SIZE_PX = (1280, 720)
FRAMES_PER_S = 15
SQUARE_M = 2.89
FOCAL_PX = 1150.0
_GROUND_PX_PER_M = 40
_GROUND_HALF_M = 50.0

Array = npt.NDArray[np.float64]
Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Block:
    """One entity: where its middle is at the start, how it moves, how large it is, its colour (BGR)."""

    name: str
    class_id: int
    start_m: tuple[float, float]
    velocity_mps: tuple[float, float]
    size_m: tuple[float, float, float]
    colour: tuple[int, int, int]

    def middle_m(self, time_s: float) -> Array:
        """Return (2,) its place on the ground."""
        return np.array(self.start_m) + time_s * np.array(self.velocity_mps)

    def corners_m(self, time_s: float) -> Array:
        """Return (8, 3): the four corners of its base, counter-clockwise, then those of its top."""
        length, width, height = self.size_m
        base = self.middle_m(time_s) + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (length / 2, width / 2)
        return np.vstack([np.column_stack([base, np.full(4, z)]) for z in (0.0, height)])


BLOCKS = (
    Block("walking worker", 0, (-9.0, 3.5), (1.1, 0.25), (0.5, 0.5, 1.75), (40, 120, 235)),
    Block("standing worker", 0, (10.5, -3.0), (0.0, 0.0), (0.5, 0.5, 1.75), (60, 200, 220)),
    Block("excavator", 1, (-7.5, 14.0), (0.0, 0.0), (7.0, 2.8, 3.0), (30, 175, 235)),
    Block("wheel loader", 2, (12.0, 10.0), (-0.55, -0.15), (6.5, 2.7, 3.2), (35, 200, 245)),
)


def camera(time_s: float) -> Array:
    """Return (3, 4) the projection from site metres to pixels: hovering, swaying a little in the wind."""
    sway = np.array([0.5 * np.sin(0.7 * time_s), 0.4 * np.sin(0.9 * time_s + 1.0), 0.2 * np.sin(1.3 * time_s)])
    position = np.array([1.0, -19.0, 22.0]) + sway
    forward = np.array([1.5 + 0.3 * np.sin(0.5 * time_s), 5.0, 0.0]) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.vstack([right, np.cross(forward, right), forward])
    matrix = np.array([[FOCAL_PX, 0, SIZE_PX[0] / 2], [0, FOCAL_PX, SIZE_PX[1] / 2], [0, 0, 1]])
    projection: Array = matrix @ np.column_stack([rotation, -rotation @ position])
    return projection


def project(projection: Array, points_m: Array) -> Array:
    """Return (N, 2) pixels of (N, 3) points."""
    image = np.column_stack([points_m, np.ones(len(points_m))]) @ projection.T
    pixels: Array = image[:, :2] / image[:, 2:]
    return pixels


def draw_ground(seed: int) -> Picture:
    """Return the ground from above, 40 px a metre, north up, with the painted square at the origin."""
    rng = np.random.default_rng(seed)
    side_px = int(2 * _GROUND_HALF_M * _GROUND_PX_PER_M)
    relief = np.zeros((side_px, side_px), np.float32)
    for cells, strength in ((12, 16.0), (60, 12.0), (400, 10.0), (1600, 9.0)):
        noise = rng.standard_normal((cells, cells)).astype(np.float32)
        relief += strength * cv2.resize(noise, (side_px, side_px), interpolation=cv2.INTER_CUBIC)
    soil = np.array([96.0, 124.0, 148.0]) + relief[:, :, None] * np.array([0.8, 0.95, 1.0])
    ground: Picture = np.clip(soil, 0, 255).astype(np.uint8)
    origin = int(_GROUND_HALF_M * _GROUND_PX_PER_M)
    far = round(SQUARE_M * _GROUND_PX_PER_M)
    cv2.rectangle(ground, (origin, origin - far), (origin + far - 1, origin - 1), (214, 220, 222), cv2.FILLED)
    return ground


def draw_frame(ground: Picture, time_s: float) -> Picture:
    """Return one picture: the ground in perspective, then the blocks from far to near."""
    projection = camera(time_s)
    half_px = _GROUND_HALF_M * _GROUND_PX_PER_M
    texture_to_site = np.array(
        [[1 / _GROUND_PX_PER_M, 0, (0.5 - half_px) / _GROUND_PX_PER_M],
         [0, -1 / _GROUND_PX_PER_M, (half_px - 0.5) / _GROUND_PX_PER_M], [0, 0, 1]]
    )  # fmt: skip
    site_to_image = projection[:, [0, 1, 3]]
    doubled = np.diag([2.0, 2.0, 1.0])
    large = cv2.warpPerspective(ground, doubled @ site_to_image @ texture_to_site, (2 * SIZE_PX[0], 2 * SIZE_PX[1]))
    picture: Picture = cv2.resize(large, SIZE_PX, interpolation=cv2.INTER_AREA).astype(np.uint8)
    for block in sorted(BLOCKS, key=lambda block: -block.middle_m(time_s)[1]):
        _draw_block(picture, block, project(projection, block.corners_m(time_s)))
    return picture


def _draw_block(picture: Picture, block: Block, corners_px: Array) -> None:
    faces = {(2, 3, 7, 6): 0.45, (3, 0, 4, 7): 0.65, (1, 2, 6, 5): 0.65, (0, 1, 5, 4): 0.8, (4, 5, 6, 7): 1.0}
    for face, light in faces.items():
        polygon = np.round(corners_px[list(face)] * 16).astype(np.int32)
        colour = [light * channel for channel in block.colour]
        cv2.fillPoly(picture, [polygon], colour, lineType=cv2.LINE_AA, shift=4)


def box_px(block: Block, time_s: float) -> list[float]:
    """Return left, top, right, bottom of a block in the picture."""
    corners = project(camera(time_s), block.corners_m(time_s))
    return [*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()]


def square_box_px(time_s: float = 0.0) -> list[float]:
    """Return the box of the painted square, as a user would draw it: three pixels wide of it."""
    corners = np.array([[0, 0, 0], [SQUARE_M, 0, 0], [SQUARE_M, SQUARE_M, 0], [0, SQUARE_M, 0]])
    pixels = project(camera(time_s), corners)
    return [*(pixels.min(axis=0) - 3).tolist(), *(pixels.max(axis=0) + 3).tolist()]


def write_site(out: Path, frames: int, seed: int) -> None:
    """Write site.mp4, boxes.json, distances.csv and settings for `standoff run` into a folder."""
    out.mkdir(parents=True, exist_ok=True)
    times_s = [index / FRAMES_PER_S for index in range(frames)]
    ground = draw_ground(seed)
    with av.open(str(out / "site.mp4"), "w") as container:
        stream = container.add_stream("h264", rate=FRAMES_PER_S, options={"crf": "16"})
        stream.width, stream.height, stream.pix_fmt = *SIZE_PX, "yuv420p"
        for time_s in times_s:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(draw_frame(ground, time_s), format="bgr24")))
        container.mux(stream.encode(None))
    boxes = [[{"class_id": block.class_id, "xyxy_px": box_px(block, t)} for block in BLOCKS] for t in times_s]
    (out / "boxes.json").write_text(json.dumps(boxes), encoding="utf-8")
    with (out / "distances.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "worker", "machine", "distance_m"])
        for index, time_s in enumerate(times_s):
            for worker in BLOCKS[:2]:
                for machine in BLOCKS[2:]:
                    offset = worker.middle_m(time_s) - machine.middle_m(time_s)
                    rows.writerow([index, worker.name, machine.name, round(float(np.hypot(*offset)), 4)])
    settings = {
        "ground": {"reference": {"square_m": SQUARE_M, "box_px": [round(edge, 1) for edge in square_box_px()]}},
        "replace": {
            "detect": {"factory": "scripted_boxes:ScriptedBoxes", "options": {"path": str(out / "boxes.json")}}
        },
    }
    (out / "site.yaml").write_text(json.dumps(settings, indent=2), encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Draw a small site with exactly known geometry.")
    parser.add_argument("out", type=Path)
    parser.add_argument("--frames", type=int, default=180)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    write_site(arguments.out, arguments.frames, arguments.seed)
