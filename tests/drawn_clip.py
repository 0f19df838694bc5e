"""A clip folder with exact truth that needs no simulator: flat ground, a painted square, entities without height.

Nobody is drawn: the true boxes say where everybody is, and the monitor only has to find the square.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import av
import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from standoff.core.homography import FloatArray

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "drawn_site"))
import draw_site

FRAMES = 36
HIDDEN = range(12, 15)
"""Frames in which something lies on the square."""

UNSEEN = range(20, 22)
"""Frames in which the excavator cannot be seen."""

SIDE_M = round(draw_site.SQUARE_M * 40) / 40
"""As drawn: whole pixels of a ground of 40 px a metre."""

SQUARE_M = np.array([[0.0, 0.0], [SIDE_M, 0.0], [SIDE_M, SIDE_M], [0.0, SIDE_M]])
REFERENCE_ID = 9
_DRAWN_PX = -0.25
"""The pictures are drawn at double size and shrunk: pixel i is the middle of i2 and i2 + 1, a quarter further on."""


@dataclass(frozen=True)
class Entity:
    entity_id: int
    class_id: int
    class_name: str
    start_m: tuple[float, float]
    velocity_mps: tuple[float, float]

    def xy_m(self, time_s: float) -> FloatArray:
        return np.array(self.start_m) + time_s * np.array(self.velocity_mps)


ENTITIES = (
    Entity(1, 0, "worker", (-4.0, 2.0), (1.2, 0.3)),
    Entity(2, 2, "wheel_loader", (6.0, 7.0), (-0.8, 0.0)),
    Entity(3, 1, "excavator", (-5.0, 9.0), (0.0, 0.0)),
)
_SMALL_M = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def time_s(frame: int) -> float:
    return frame / draw_site.FRAMES_PER_S


def seen_px(frame: int, points_m: FloatArray) -> FloatArray:
    on_ground = np.column_stack([points_m, np.zeros(len(points_m))])
    return draw_site.project(draw_site.camera(time_s(frame)), on_ground) + _DRAWN_PX


def write_clip(folder: Path, preset: str = "mobile") -> Path:
    folder.mkdir(parents=True)
    (folder / "video.mp4").write_bytes(_film())
    width, height = draw_site.SIZE_PX
    camera = {"width_px": width, "height_px": height, "fx": draw_site.FOCAL_PX, "fy": draw_site.FOCAL_PX}
    (folder / "camera.yaml").write_text(
        yaml.safe_dump(camera | {"cx": width / 2 + _DRAWN_PX, "cy": height / 2 + _DRAWN_PX})
    )
    reference = {"ground": {"reference": {"corners_m": SQUARE_M.tolist(), "height_m": 0.0}, "camera": "camera.yaml"}}
    (folder / "reference.yaml").write_text(yaml.safe_dump(reference))
    top_m = np.column_stack([SQUARE_M, np.zeros(4)]).tolist()
    scene = {
        "format": 1,
        "preset": preset,
        "seed": 0,
        "entities": [{"entity_id": e.entity_id, "class_name": e.class_name} for e in ENTITIES],
        "reference": {
            "entity_id": REFERENCE_ID,
            "top_m": top_m,
            "base_m": top_m,
            "ground_m": 0.0,
            "height_m": 0.0,
            "covers": [],
        },
        "board": None,
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    write_tables(folder)
    return folder


def write_tables(folder: Path, frames: int = FRAMES) -> None:
    truth = [_entity_row(frame, entity) for frame in range(frames) for entity in ENTITIES]
    truth += [_reference_row(frame) for frame in range(frames)]
    pairs = [
        {"frame": frame, "entity_a": a.entity_id, "entity_b": b.entity_id, "centre_m": true_distance_m(frame, a, b)}
        for frame in range(frames)
        for a, b in ((ENTITIES[0], ENTITIES[1]), (ENTITIES[0], ENTITIES[2]), (ENTITIES[1], ENTITIES[2]))
    ]
    for name, rows in (("truth", truth), ("pairs", pairs), ("frames", [_frame_row(k) for k in range(frames)])):
        pq.write_table(pa.Table.from_pylist(rows), folder / f"{name}.parquet")


def true_distance_m(frame: int, first: Entity, second: Entity) -> float:
    return float(np.hypot(*(first.xy_m(time_s(frame)) - second.xy_m(time_s(frame)))))


@cache
def _film() -> bytes:
    """Return the file; it takes seconds to draw and encode, and many modules want it."""
    ground, file = draw_site.draw_ground(seed=3), BytesIO()
    with patch.object(draw_site, "BLOCKS", ()), av.open(file, "w", format="mp4") as container:
        stream = container.add_stream("h264", rate=draw_site.FRAMES_PER_S, options={"crf": "14"})
        stream.width, stream.height, stream.pix_fmt = *draw_site.SIZE_PX, "yuv420p"
        for frame in range(FRAMES):
            picture = draw_site.draw_frame(ground, time_s(frame))
            if frame in HIDDEN:
                centre = seen_px(frame, SQUARE_M).mean(axis=0).round().astype(int).tolist()
                cv2.circle(picture, centre, 110, (96, 124, 148), cv2.FILLED)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        container.mux(stream.encode(None))
    return file.getvalue()


def _box(points_px: FloatArray) -> dict[str, float]:
    return dict(zip(("x1_px", "y1_px"), points_px.min(axis=0).tolist(), strict=True)) | dict(
        zip(("x2_px", "y2_px"), points_px.max(axis=0).tolist(), strict=True)
    )


def _entity_row(frame: int, entity: Entity) -> dict[str, Any]:
    xy_m = entity.xy_m(time_s(frame))
    box = _box(seen_px(frame, xy_m + _SMALL_M))
    if entity.class_name == "excavator" and frame in UNSEEN:
        box = dict.fromkeys(box, float("nan"))
    ids = {"frame": frame, "entity_id": entity.entity_id, "class_id": entity.class_id}
    return ids | _place(frame, xy_m) | box


def _place(frame: int, xy_m: FloatArray) -> dict[str, float]:
    ((foot_x_px, foot_y_px),) = seen_px(frame, xy_m[None]).tolist()
    return {"x_m": float(xy_m[0]), "y_m": float(xy_m[1]), "foot_x_px": foot_x_px, "foot_y_px": foot_y_px}


def _reference_row(frame: int) -> dict[str, Any]:
    ids = {"frame": frame, "entity_id": REFERENCE_ID, "class_id": 6}
    return ids | _place(frame, SQUARE_M.mean(axis=0)) | _box(seen_px(frame, SQUARE_M))


def _camera_of(frame: int) -> dict[str, Any]:
    projection = draw_site.camera(time_s(frame))
    width, height = draw_site.SIZE_PX
    matrix = np.array([[draw_site.FOCAL_PX, 0, width / 2], [0, draw_site.FOCAL_PX, height / 2], [0, 0, 1]])
    rotation = np.linalg.inv(matrix) @ projection[:, :3]
    position_m = -np.linalg.solve(projection[:, :3], projection[:, 3])
    place = dict(zip(("camera_x_m", "camera_y_m", "camera_z_m"), position_m.tolist(), strict=True))
    return place | {"site_to_camera": rotation.ravel().tolist()}


def _frame_row(frame: int) -> dict[str, Any]:
    x_px, y_px = seen_px(frame, SQUARE_M).T.tolist()
    return {
        "frame": frame,
        "reference_top_x_px": x_px,
        "reference_top_y_px": y_px,
        "reference_covered": frame in HIDDEN,
        "reference_visible_share": 1.0,
        "board_x_px": np.zeros(0).tolist(),
        "board_y_px": np.zeros(0).tolist(),
        **_camera_of(frame),
    }


def change_scene(folder: Path, **changes: object) -> None:
    """Write other values into what a clip says of itself."""
    path = folder / "scene.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
