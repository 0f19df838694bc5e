"""The folder of a clip with exact truth: its files, and the columns of its tables.

Site frame: x east, y north, z up, metres. Pixels: the centre of the top-left pixel is (0, 0); a box of the pixels
i .. j goes from i - 0.5 to j + 0.5. A number that does not exist is NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import pyarrow as pa

from standoff.clips.columns import Column, Columns, read_columns, schema_of
from standoff.clips.detections import FOOT_COLUMNS

CLIP_FORMAT: Final = 1
"""Number of this format; `scene.json` carries it."""

VIDEO_FILE: Final = "video.mp4"
SCENE_FILE: Final = "scene.json"
CAMERA_FILE: Final = "camera.yaml"
REFERENCE_FILE: Final = "reference.yaml"
TELEMETRY_FILE: Final = "telemetry.srt"
ANNOTATIONS_FILE: Final = "annotations.json"
TRUTH_FILE: Final = "truth.parquet"
PAIRS_FILE: Final = "pairs.parquet"
CLIP_FRAMES_FILE: Final = "frames.parquet"
NOISY_DETECTIONS_FILE: Final = "detections.parquet"
DEVICES_FILE: Final = "devices.parquet"

TRUTH_FILES: Final = frozenset({TRUTH_FILE, PAIRS_FILE, CLIP_FRAMES_FILE, SCENE_FILE, CAMERA_FILE, REFERENCE_FILE})
"""What every clip holds."""
CLIP_FILES: Final = TRUTH_FILES | {VIDEO_FILE, ANNOTATIONS_FILE, TELEMETRY_FILE, NOISY_DETECTIONS_FILE, DEVICES_FILE}
"""What a clip may hold; which of them it does depends on how it was made."""

RENDER_AGAIN: Final = "render the clip again with `standoff simulate`"
"""What to do with a clip that is not what it should be."""

_FLOAT, _FLOATS, _WHOLE = pa.float64(), pa.list_(pa.float64()), pa.int32()
_FRAME: Final[tuple[Column, ...]] = (
    ("frame", _WHOLE, "", "index, from 0"),
    ("time_s", _FLOAT, "s", "presentation timestamp"),
)


def _edges(prefix: str, what: str) -> tuple[Column, ...]:
    edges = ("x1", "left"), ("y1", "top"), ("x2", "right"), ("y2", "bottom")
    return tuple((f"{prefix}{edge}_px", _FLOAT, "px", f"{side} edge of {what}") for edge, side in edges)


def _axes(pattern: str, kind: pa.DataType, unit: str, what: str, axes: str = "xyz") -> tuple[Column, ...]:
    return tuple((pattern.format(axis), kind, unit, f"{what}, {axis}") for axis in axes)


_WHERE: Final[tuple[Column, ...]] = (
    *_axes("{}_m", _FLOAT, "m", "middle of the footprint, on the ground"),
    ("heading_deg", _FLOAT, "deg", "where it points, clockwise from north"),
    *_axes("v{}_mps", _FLOAT, "m/s", "velocity", "xy"),
    *_axes("tip_{}_m", _FLOAT, "m", "middle of the edge of its bucket or blade; NaN without one"),
)
_SEEN: Final[tuple[Column, ...]] = (
    *_edges("", "what is visible inside the picture; NaN when nothing is"),
    *_edges("full_", "the whole, through everything in front and beyond the picture's edge"),
    ("visible_share", _FLOAT, "", "visible pixels as a share of the whole silhouette"),
    *_axes("foot_{}_px", _FLOAT, "px", "where the middle of the footprint appears, inside or outside", "xy"),
)

TRUTH_NUMBERS: Final = tuple(name for name, *_ in (*_WHERE, *_SEEN))
"""Columns of `TRUTH_SCHEMA` that hold one number with a fraction, in their order."""

TRUTH_SCHEMA: Final = schema_of(
    (
        *_FRAME,
        ("entity_id", _WHOLE, "", "the same in every frame and every table"),
        ("class_id", _WHOLE, "", "position in `standoff.core.classes.CLASSES`"),
        ("class_name", pa.string(), "", "what it is"),
        ("visible_px", _WHOLE, "px^2", "visible pixels"),
        *_WHERE,
        *_SEEN,
        *_axes("footprint_{}_m", _FLOATS, "m", "outline on the ground: tracks or wheels, not the boom", "xy"),
    )
)
"""One row per frame and entity."""

PAIRS_SCHEMA: Final = schema_of(
    (
        *_FRAME,
        ("entity_a", _WHOLE, "", "the smaller entity_id of the two"),
        ("entity_b", _WHOLE, "", "the larger"),
        ("centre_m", _FLOAT, "m", "horizontal distance of the middles of the footprints"),
        ("footprint_m", _FLOAT, "m", "horizontal distance of the footprints"),
        (
            "tip_m",
            _FLOAT,
            "m",
            "horizontal distance from a tool to the other's middle, the shorter; NaN without tool",
        ),
    )
)
"""One row per frame and pair of entities, the reference object left out."""

CLIP_FRAMES_SCHEMA: Final = schema_of(
    (
        *_FRAME,
        *_axes("camera_{}_m", _FLOAT, "m", "place of the camera"),
        ("site_to_camera", _FLOATS, "", "rotation of the camera, nine numbers row by row"),
        *_axes("reference_top_{}_px", _FLOATS, "px", "corners of the reference object's upper edge", "xy"),
        *_axes("reference_base_{}_px", _FLOATS, "px", "where the reference object's sides meet the ground", "xy"),
        ("reference_covered", pa.bool_(), "", "whether something lies on the reference object"),
        ("reference_visible_share", _FLOAT, "", "share of its pixels that can be seen; NaN without one"),
        *_axes("board_{}_px", _FLOATS, "px", "inner corners of the checkerboard, row by row", "xy"),
    )
)
"""One row per frame: the camera and the reference object."""

NOISY_DETECTIONS_SCHEMA: Final = schema_of(
    (
        *_FRAME,
        *_edges("", "the box"),
        ("score", _FLOAT, "", "confidence, 0 to 1"),
        ("class", pa.string(), "", "what it is"),
        ("class_id", _WHOLE, "", "position in `standoff.core.classes.CLASSES`"),
        *FOOT_COLUMNS,
    )
)
"""One row per detection that a detector might have made, frame by frame, the surest first."""

DEVICES_SCHEMA: Final = schema_of(
    (
        ("time_s", _FLOAT, "s", "when the position held, on the clip's clock"),
        ("device_id", pa.string(), "", "name of the wearable"),
        ("entity_id", _WHOLE, "", "who wears it"),
        ("latitude_deg", _FLOAT, "deg", "reported latitude"),
        ("longitude_deg", _FLOAT, "deg", "reported longitude"),
        *_axes("{}_m", _FLOAT, "m", "the same in the site frame", "xy"),
        ("hdop", _FLOAT, "", "horizontal dilution of precision"),
        ("accuracy_m", _FLOAT, "m", "what the receiver takes for its horizontal error, 68 %"),
    )
)
"""One row per report of a wearable, in the order of time."""


def read_clip_table(folder: Path, name: str, columns: Sequence[str]) -> Columns:
    """Read columns of one of a clip's tables.

    Args:
        folder: Of the clip.
        name: The table's file.
        columns: Their names.

    Raises:
        DataError: The table is missing, unreadable, or lacks a column.
    """
    return read_columns(folder / name, columns, folder="the clip", fix=RENDER_AGAIN)
