"""`tracks`, `proximity`, `frames` and `detections.parquet`: every number of a run, for other people's tools.

A number that was not measured is null, never NaN and never a stand-in. Each column carries its unit and description in
its Arrow field metadata; one whose description does not speak of null is never null. `time_to_contact_s` alone can be
infinite: not approaching.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa

from standoff import __version__
from standoff.clips import (
    COLUMNS,
    FOOT_COLUMNS,
    FRAME_COLUMNS,
    MAP_COLUMNS,
    Column,
    map_values,
    metadata_of,
    schema_of,
)
from standoff.core.classes import CLASSES
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.outputs import SCHEMA_VERSION
from standoff.core.types import Detections, Frame, FrameResult, IntArray, Outcome, TextArray, WatchedGround
from standoff.core.watched_shares import around_tracks
from standoff.files.json_text import plain
from standoff.stages.sinks.params import TableParams
from standoff.stages.sinks.parquet_parts import Columns, ParquetParts

_CLASS = pa.dictionary(pa.int32(), pa.string())
_NAMES: TextArray = np.array([site_class.name for site_class in CLASSES], dtype=object)

_TRACK_COLUMNS = (
    *FRAME_COLUMNS,
    ("track_id", pa.int64(), "", "unique in the stream, never used again"),
    ("class", _CLASS, "", "what it is"),
    ("score", pa.float64(), "", "confidence of the last detection, 0 to 1"),
    ("x1_px", pa.float64(), "px", "left edge of the box"),
    ("y1_px", pa.float64(), "px", "top edge"),
    ("x2_px", pa.float64(), "px", "right edge"),
    ("y2_px", pa.float64(), "px", "bottom edge"),
    *FOOT_COLUMNS,
    ("observed", pa.bool_(), "", "false: predicted, no detection supports it in this frame"),
    ("age_s", pa.float64(), "s", "since the track was first seen"),
    ("x_m", pa.float64(), "m", "site frame; null where the position is invalid"),
    ("y_m", pa.float64(), "m", "site frame; null where the position is invalid"),
    ("vx_mps", pa.float64(), "m/s", "site frame; null while unknown"),
    ("vy_mps", pa.float64(), "m/s", "site frame; null while unknown"),
    ("sigma_x_m", pa.float64(), "m", "standard error of x_m; null with it"),
    ("sigma_y_m", pa.float64(), "m", "standard error of y_m; null with it"),
    ("cov_xy_m2", pa.float64(), "m^2", "covariance of x_m and y_m; null with them"),
    ("radius_m", pa.float64(), "m", "action radius"),
    ("valid", pa.bool_(), "", "whether there is a position"),
    ("reason", pa.string(), "", "why not; empty where valid"),
    ("standing_s", pa.float64(), "s", "for how long it has not moved; null while unknown"),
    ("sight", pa.string(), "", "observed; hidden: looked for and not found; predicted: not looked for; unknown"),
    ("around_watched", pa.float64(), "", "watched share of the circle about a machine; null: none, or no place"),
)
_ZONES_COLUMN = ("zones", pa.list_(pa.string()), "", "names of the zones that an open hazard of this track is about")
_PROXIMITY_COLUMNS = (
    *FRAME_COLUMNS,
    ("track_a", pa.int64(), "", "the smaller track id"),
    ("track_b", pa.int64(), "", "the larger track id"),
    ("class_a", _CLASS, "", "class of track_a"),
    ("class_b", _CLASS, "", "class of track_b"),
    ("distance_m", pa.float64(), "m", "centre to centre on the ground; null where not measured"),
    ("gap_m", pa.float64(), "m", "distance less both action radii; negative is a breach; null where not measured"),
    ("sigma_m", pa.float64(), "m", "standard error of the distance; null where not measured"),
    ("closing_mps", pa.float64(), "m/s", "positive: approaching; null while unknown"),
    ("time_to_contact_s", pa.float64(), "s", "until the gap is 0; infinity: never at this speed; null while unknown"),
    ("filtered", pa.bool_(), "", "true: the outlier filter replaced the distance"),
    ("measured", pa.bool_(), "", "false: the distance is unknown, which is not the same as far away"),
    ("observed", pa.bool_(), "", "false: at least one of the two is predicted, no detection supports it in this frame"),
    ("closest_m", pa.float64(), "m", "least distance of the likeliest paths within the horizon; null: not measured"),
    ("closest_in_s", pa.float64(), "s", "until then; null where not measured"),
    ("breach_now", pa.float64(), "", "probability that the gap is negative; null where not measured"),
    ("breach_ahead", pa.float64(), "", "probability that it is, or will be within the horizon; null: not measured"),
    ("excuse", pa.string(), "", "why it is no hazard however near; empty where it may be one"),
)
_FRAMES_COLUMNS = (
    *FRAME_COLUMNS,
    ("detected", pa.bool_(), "", "false: the detector rested in this frame"),
    ("detections", pa.int64(), "", "number of detections; null where the detector rested"),
    ("tracks", pa.int64(), "", "number of live tracks"),
    *MAP_COLUMNS,
    ("watched_share", pa.float64(), "", "part of the picture's ground where a worker would be found; null: not judged"),
    ("unwatched_reason", pa.string(), "", "why most of the rest is not watched; null where all of it is"),
    ("missed_share", pa.float64(), "", "of workers on watched ground, share missed in one picture; null: unknown"),
    ("watched_cells", pa.list_(pa.int8()), "", "18 x 32, row by row: -1 no ground, 0 watched, else why not; or null"),
)


@dataclass(frozen=True, slots=True)
class Table:
    """One table's columns and how a frame fills them.

    Attributes:
        schema: Arrow schema with units and descriptions.
        rows: A frame's rows, one array or list for each column.
    """

    schema: pa.Schema
    rows: Callable[[FrameResult], Columns]


class TableSink:
    """Write one table as Parquet; a killed run leaves its parts readable.

    Args:
        path: Final file, `tracks.parquet` for instance; while the run goes on, see `tracks.parts/`.
        table: `TRACKS`, `PROXIMITY`, `FRAMES`, or `detections_table(...)`.
        params: How often parts are written.
    """

    def __init__(self, path: Path | str, table: Table, params: TableParams | None = None) -> None:
        params = params or TableParams()
        self._rows = table.rows
        self._parts = ParquetParts(Path(path), table.schema, flush_s=params.flush_s, flush_rows=params.flush_rows)

    def write(self, result: FrameResult) -> None:
        """Add this frame's rows."""
        self._parts.append(self._rows(result))

    def close(self, outcome: Outcome) -> None:
        """Merge the parts into the final file."""
        self._parts.close()


_ABOUT: Final = {
    "standoff_version": __version__,
    "schema_version": str(SCHEMA_VERSION),
    "missing_values": "null: not measured",
}


def _schema(columns: tuple[Column, ...]) -> pa.Schema:
    return schema_of(columns, _ABOUT)


def _frame_columns(frame: Frame, rows: int) -> dict[str, TextArray]:
    values = {
        "stream_id": frame.stream_id,
        "frame": frame.index,
        "time_s": frame.time_s,
        "captured_at": frame.captured_at,
        "told_by": frame.told_by,
    }
    return {name: np.full(rows, value, dtype=object) for name, value in values.items()}


def _track_rows(result: FrameResult) -> Columns:
    tracks, positions = result.tracks, result.positions
    variance = positions.covariance_m2
    return {
        **_frame_columns(result.frame, len(tracks)),
        "track_id": tracks.track_id,
        "class": _NAMES[tracks.class_id],
        "score": tracks.score,
        **_box_columns(tracks.xyxy_px),
        **_foot_columns(tracks.foot_px, tracks.foot_covariance_px2),
        "observed": tracks.observed,
        "age_s": tracks.age_s,
        "x_m": positions.xy_m[:, 0],
        "y_m": positions.xy_m[:, 1],
        "vx_mps": positions.velocity_mps[:, 0],
        "vy_mps": positions.velocity_mps[:, 1],
        "sigma_x_m": np.sqrt(variance[:, 0, 0]),
        "sigma_y_m": np.sqrt(variance[:, 1, 1]),
        "cov_xy_m2": variance[:, 0, 1],
        "radius_m": positions.radius_m,
        "standing_s": positions.standing_s,
        "around_watched": around_tracks(result.watched, len(result.tracks)),
        "sight": _sight(result),
        "valid": positions.valid,
        "reason": positions.reason,
    }


def _sight(result: FrameResult) -> TextArray:
    """Return (M,) what each position rests on; a track that is seen, but not well enough, is predicted."""
    positions = result.positions
    hidden = result.detected & ~result.tracks.observed
    sight: TextArray = np.where(positions.predicted, np.where(hidden, "hidden", "predicted"), "observed").astype(object)
    sight[~positions.valid] = "unknown"
    return sight


def _box_columns(xyxy_px: FloatArray) -> dict[str, FloatArray]:
    return {f"{edge}_px": xyxy_px[:, i] for i, edge in enumerate(("x1", "y1", "x2", "y2"))}


def _foot_columns(foot_px: FloatArray, covariance_px2: FloatArray) -> dict[str, FloatArray]:
    return {
        "foot_x_px": foot_px[:, 0],
        "foot_y_px": foot_px[:, 1],
        "foot_sigma_x_px": np.sqrt(covariance_px2[:, 0, 0]),
        "foot_sigma_y_px": np.sqrt(covariance_px2[:, 1, 1]),
        "foot_cov_px2": covariance_px2[:, 0, 1],
    }


def _classes_of(track_id: IntArray, result: FrameResult) -> TextArray:
    names = dict(zip(result.tracks.track_id.tolist(), _NAMES[result.tracks.class_id], strict=True))
    return np.array([names.get(i) for i in track_id.tolist()], dtype=object)


def _proximity_rows(result: FrameResult) -> Columns:
    pairs = result.proximities
    return {
        **_frame_columns(result.frame, len(pairs)),
        **pairs.columns(),
        "class_a": _classes_of(pairs.track_a, result),
        "class_b": _classes_of(pairs.track_b, result),
        "measured": np.isfinite(pairs.distance_m),
        "observed": _seen(pairs.track_a, result) & _seen(pairs.track_b, result),
    }


def _seen(track_id: IntArray, result: FrameResult) -> BoolArray:
    """Return (K,) whether each track is observed in this frame, not only predicted."""
    return np.isin(track_id, result.tracks.track_id[result.tracks.observed])


def _watched_values(watched: WatchedGround) -> dict[str, Any]:
    return {
        "watched_share": watched.share,
        "unwatched_reason": next(iter(watched.unwatched), None),
        "missed_share": watched.missed_share,
        "watched_cells": watched.cells.ravel().tolist() if watched.judged else None,
    }


def _frame_rows(result: FrameResult) -> Columns:
    values = {
        "detected": result.detected,
        "detections": len(result.detections) if result.detected else None,
        "tracks": len(result.tracks),
        **map_values(result.ground),
        **_watched_values(result.watched),
    }
    return {**_frame_columns(result.frame, 1), **{name: [value] for name, value in values.items()}}


def detection_rows(frame: Frame, found: Detections, *, detected: bool) -> Columns:
    """Return a row for each detection, or one without a box: every frame that was read must be in the table."""
    rows = max(len(found), 1)
    columns = {**_frame_columns(frame, rows), "detected": np.full(rows, detected)}
    if len(found) == 0:
        nothing: TextArray = np.array([None], dtype=object)
        names = ("score", "class", "class_id")
        unknown = {
            **_box_columns(np.full((1, 4), np.nan)),
            **_foot_columns(np.full((1, 2), np.nan), np.full((1, 2, 2), np.nan)),
        }
        return {**columns, **unknown, **dict.fromkeys(names, nothing)}
    return {
        **columns,
        **_box_columns(found.xyxy_px),
        **_foot_columns(found.foot_px, found.foot_covariance_px2),
        "score": found.score,
        "class": _NAMES[found.class_id],
        "class_id": found.class_id,
    }


def detections_table(source: Mapping[str, Any], detector: Mapping[str, Any] | None) -> Table:
    """Return `DETECTIONS` with metadata that say whose they are, without which they cannot be replayed.

    Args:
        source: The source's description, `size_px` among it.
        detector: The detector's description, if it has one.
    """
    width_px, height_px = source["size_px"]
    about = metadata_of((width_px, height_px), plain(source), plain(detector or {}))
    schema = DETECTIONS.schema
    return Table(schema.with_metadata({**(schema.metadata or {}), **about}), DETECTIONS.rows)


def _zoned_track_rows(result: FrameResult) -> Columns:
    of_track: dict[int, set[str]] = {}
    for hazard in result.open_hazards.in_zones():
        for track_id in hazard.track_ids:
            of_track.setdefault(track_id, set()).add(hazard.zone)
    return {**_track_rows(result), "zones": [sorted(of_track.get(i, ())) for i in result.tracks.track_id.tolist()]}


TRACKS = Table(_schema(_TRACK_COLUMNS), _track_rows)
ZONED_TRACKS = Table(_schema((*_TRACK_COLUMNS, _ZONES_COLUMN)), _zoned_track_rows)
"""`TRACKS` of a site that has zones, with a column for them."""
PROXIMITY = Table(_schema(_PROXIMITY_COLUMNS), _proximity_rows)
FRAMES = Table(_schema(_FRAMES_COLUMNS), _frame_rows)
DETECTIONS = Table(
    _schema(COLUMNS), lambda result: detection_rows(result.frame, result.detections, detected=result.detected)
)
