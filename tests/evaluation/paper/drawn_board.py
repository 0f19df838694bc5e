"""A clip folder of a checkerboard under a moving pinhole camera, drawn through exact homographies."""

from __future__ import annotations

import json
from pathlib import Path

import av
import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from standoff.core import homography
from standoff.core.homography import FloatArray

FRAMES = 6
EMPTY = 4
"""A frame without a board."""

SIDE = 7
_SIZE_PX = (640, 480)
_SQUARE_PX = 40
_FOCAL_PX = 700.0


def corners_px(frame: int) -> FloatArray:
    """Return (49, 2) inner corners, row by row."""
    grid = np.stack(np.meshgrid(np.arange(1, SIDE + 1), np.arange(1, SIDE + 1)), axis=-1).reshape(-1, 2)
    return homography.apply(_board_to_picture(frame), grid.astype(np.float64))[0]


def _board_to_picture(frame: int) -> FloatArray:
    """Return the map from squares, the board's corner at 0, to pixels of a camera that tilts more and more."""
    tilt, spin = np.deg2rad(5.0 + 8.0 * frame), np.deg2rad(4.0 * frame)
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    about_z = np.array([[np.cos(spin), -np.sin(spin), 0], [np.sin(spin), np.cos(spin), 0], [0, 0, 1]])
    axes = about_x @ about_z
    middle = axes[:, 0] * 4.0 + axes[:, 1] * 4.0
    matrix = np.array([[_FOCAL_PX, 0, 319.5], [0, _FOCAL_PX, 239.5], [0, 0, 1]])
    return homography.signed(
        matrix @ np.column_stack([axes[:, 0], axes[:, 1], np.array([0, 0, 16.0]) - middle]), np.array([4.0, 4.0])
    )


def write_clip(folder: Path) -> Path:
    folder.mkdir(parents=True)
    squares = np.indices((8, 8)).sum(axis=0) % 2
    board = np.full((10 * _SQUARE_PX, 10 * _SQUARE_PX), 225, np.uint8)
    board[_SQUARE_PX:-_SQUARE_PX, _SQUARE_PX:-_SQUARE_PX] = np.kron(
        np.where(squares == 0, 30, 225), np.ones((_SQUARE_PX, _SQUARE_PX))
    ).astype(np.uint8)
    # Texture pixel u covers u - 0.5 .. u + 0.5; square 0 starts after a margin of one square.
    to_squares = np.array([[1, 0, 0.5 - _SQUARE_PX], [0, 1, 0.5 - _SQUARE_PX], [0, 0, _SQUARE_PX]]) / _SQUARE_PX
    with av.open(str(folder / "video.mp4"), "w") as container:
        stream = container.add_stream("h264", rate=10, options={"crf": "8"})
        stream.width, stream.height, stream.pix_fmt = *_SIZE_PX, "yuv420p"
        for frame in range(FRAMES):
            picture = np.full((_SIZE_PX[1], _SIZE_PX[0]), 150, np.uint8)
            if frame != EMPTY:
                fine = np.array([[4, 0, 1.5], [0, 4, 1.5], [0, 0, 1]])
                size_px = (4 * _SIZE_PX[0], 4 * _SIZE_PX[1])
                large = cv2.warpPerspective(
                    board, fine @ _board_to_picture(frame) @ to_squares, size_px, borderValue=150
                )
                picture = cv2.resize(large, _SIZE_PX, interpolation=cv2.INTER_AREA)
            colour = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(colour, format="bgr24")))
        container.mux(stream.encode(None))
    pinhole = {"width_px": 640, "height_px": 480, "fx": _FOCAL_PX, "fy": _FOCAL_PX, "cx": 319.5, "cy": 239.5}
    (folder / "camera.yaml").write_text(yaml.safe_dump(pinhole))
    (folder / "reference.yaml").write_text(yaml.safe_dump({"ground": {"camera": "camera.yaml"}}))
    board_m = np.zeros((SIDE * SIDE, 3)).tolist()
    scene = {"format": 1, "preset": "board", "seed": 0, "entities": [], "reference": None}
    (folder / "scene.json").write_text(json.dumps(scene | {"board": {"corners_m": board_m, "square_m": 3.125}}))
    _write_tables(folder)
    return folder


def _write_tables(folder: Path) -> None:
    frames = [
        {
            "frame": frame,
            "reference_top_x_px": np.zeros(0).tolist(),
            "reference_top_y_px": np.zeros(0).tolist(),
            "reference_covered": False,
            "reference_visible_share": float("nan"),
            "board_x_px": corners_px(frame)[:, 0].tolist(),
            "board_y_px": corners_px(frame)[:, 1].tolist(),
            "camera_x_m": 0.0,
            "camera_y_m": 0.0,
            "camera_z_m": 0.0,
            "site_to_camera": np.eye(3).ravel().tolist(),
        }
        for frame in range(FRAMES)
    ]
    pq.write_table(pa.Table.from_pylist(frames), folder / "frames.parquet")
    integers, floats = pa.int32(), pa.float64()
    truth = [("frame", integers), ("entity_id", integers), ("class_id", integers)]
    places = ("x_m", "y_m", "foot_x_px", "foot_y_px", "x1_px", "y1_px", "x2_px", "y2_px")
    truth += [(name, floats) for name in places]
    pairs = [("frame", integers), ("entity_a", integers), ("entity_b", integers), ("centre_m", floats)]
    for name, schema in (("truth", truth), ("pairs", pairs)):
        pq.write_table(pa.schema(schema).empty_table(), folder / f"{name}.parquet")
