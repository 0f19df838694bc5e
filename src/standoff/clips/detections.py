"""`detections.parquet`: everything that the detector of a run said, and on which frames it was asked.

Every frame that was read has at least one row. A frame on which nothing was seen, or on which the detector rested, has
a single one whose box, score and class are null: so the table alone tells a frame without anybody from one that nobody
looked at, also when only its first parts were written. Whose detections they are stands in the file's metadata, as JSON
under one key: the format's number, the pictures' size, the source and the detector.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from standoff.clips.columns import FRAME_COLUMNS, Column, column_names
from standoff.core.boxes import unknown_points
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import Detections, IntArray

DETECTIONS_FILE: Final = "detections.parquet"
FORMAT: Final = 1
METADATA_KEY: Final = "standoff_detections"

_DETECTED: Final[Column] = ("detected", pa.bool_(), "", "false: the detector rested in this frame")
_FRAME: Final[tuple[Column, ...]] = (
    *(column for column in FRAME_COLUMNS if column[0] in ("frame", "time_s")),
    _DETECTED,
)
_BOX: Final[tuple[Column, ...]] = (
    ("x1_px", pa.float64(), "px", "left edge of the box; null in the one row of a frame without detections"),
    ("y1_px", pa.float64(), "px", "top edge; null likewise"),
    ("x2_px", pa.float64(), "px", "right edge; null likewise"),
    ("y2_px", pa.float64(), "px", "bottom edge; null likewise"),
    ("score", pa.float64(), "", "confidence, 0 to 1; null likewise"),
    ("class", pa.dictionary(pa.int32(), pa.string()), "", "what it is; null likewise"),
)
FOOT_COLUMNS: Final[tuple[Column, ...]] = (
    (
        "foot_x_px",
        pa.float64(),
        "px",
        "ground point: where the middle of the footprint appears; null: the model has none",
    ),
    ("foot_y_px", pa.float64(), "px", "the same, down the picture; null with it"),
    ("foot_sigma_x_px", pa.float64(), "px", "standard error of foot_x_px; null with it"),
    ("foot_sigma_y_px", pa.float64(), "px", "standard error of foot_y_px; null with it"),
    ("foot_cov_px2", pa.float64(), "px^2", "covariance of foot_x_px and foot_y_px; null with them"),
)
COLUMNS: Final[tuple[Column, ...]] = (
    *FRAME_COLUMNS,
    _DETECTED,
    *_BOX,
    ("class_id", pa.int64(), "", "number of the class in this version of standoff; null likewise"),
    *FOOT_COLUMNS,
)
"""What is written. Readers ask by name and want `_FRAME` and `_BOX` only; there may be more columns in later files, and
earlier ones lack the ground points, or who tells when a picture was taken."""

_SAME_TIME_S: Final = 1e-6
"""Two readings of one timestamp differ by the rounding of a subtraction; two frames by a thousand times as much."""
_RECORD_AGAIN: Final = "repeat `standoff run` with detections among its outputs"


@dataclass(frozen=True, slots=True, eq=False)
class RecordedDetections:
    """The detections of a run, frame by frame (F).

    Attributes:
        path: The table.
        size_px: (width, height) of the pictures.
        source: The run's source, as it describes itself.
        detector: The run's detector, as it describes itself; empty when it does not.
        frame: (F,) rising indices in the source of the frames that the run read.
        time_s: (F,) their presentation timestamps.
        detected: (F,) False where the detector rested.
        first: (F + 1,) each frame's first row in `detections`, and at the end their number.
        detections: Of all frames, one frame after the other, in the order in which the detector gave them.
    """

    path: Path
    size_px: tuple[int, int]
    source: Mapping[str, Any]
    detector: Mapping[str, Any]
    frame: IntArray
    time_s: FloatArray
    detected: BoolArray
    first: IntArray
    detections: Detections

    def row_of(self, frame: int) -> int | None:
        """Return the position of a frame among those that the run read; None: it did not read it."""
        row = int(np.searchsorted(self.frame, frame))
        return row if row < len(self.frame) and self.frame[row] == frame else None

    def is_at(self, row: int, time_s: float) -> bool:
        """Tell whether the frame at a position was seen at this time of the film."""
        return bool(abs(self.time_s[row] - time_s) <= _SAME_TIME_S)

    def detections_at(self, row: int) -> Detections:
        """Return the detections of the frame at a position."""
        return self.detections[int(self.first[row]) : int(self.first[row + 1])]


def is_recording(path: Path) -> bool:
    """Tell whether a path can only mean recorded detections: a folder, or a Parquet table.

    >>> is_recording(Path("out/detections.parquet")), is_recording(Path("yolo.onnx"))
    (True, False)
    """
    return path.is_dir() or path.suffix == ".parquet"


def metadata_of(size_px: tuple[int, int], source: Mapping[str, Any], detector: Mapping[str, Any]) -> dict[str, str]:
    """Return the texts that tell in the file's metadata whose detections these are.

    Args:
        size_px: (width, height) of the pictures.
        source: The source's description, in JSON's own types.
        detector: The detector's, likewise.

    >>> metadata_of((640, 480), {"name": "site.mp4"}, {})["standoff_detections"]
    '{"format": 1, "picture_size_px": [640, 480], "source": {"name": "site.mp4"}, "detector": {}}'
    """
    about = {"format": FORMAT, "picture_size_px": list(size_px), "source": source, "detector": detector}
    return {METADATA_KEY: json.dumps(about, allow_nan=False)}


def read_detections(path: Path | str) -> RecordedDetections:
    """Read the detections of a run.

    Args:
        path: The run's folder, or the table itself.

    Raises:
        DataError: There is no such table, it is broken, or a newer standoff wrote it.
    """
    path = Path(path)
    file = path / DETECTIONS_FILE if path.is_dir() else path
    if not file.is_file():
        raise DataError(expected=f"a run's folder, or its {DETECTIONS_FILE}", found=f"no {file}", fix=_RECORD_AGAIN)
    try:
        table = pyarrow.parquet.read_table(file)
    except (OSError, pa.ArrowException) as error:
        raise DataError(expected=f"a whole Parquet table in {file}", found=str(error), fix=_RECORD_AGAIN) from error
    about = _about(table.schema, file)
    by_row = {name: _column(table, name, kind, file) for name, kind, _, _ in _FRAME}
    seen = _seen(table, file)
    frame, first_row, count = np.unique(by_row["frame"], return_index=True, return_counts=True)
    _check_frames(by_row, first_row, count, seen, file)
    rows_seen = np.concatenate([[0], np.cumsum(seen)])
    return RecordedDetections(
        path=file,
        size_px=(about["picture_size_px"][0], about["picture_size_px"][1]),
        source=about["source"],
        detector=about["detector"],
        frame=frame,
        time_s=by_row["time_s"][first_row],
        detected=by_row["detected"][first_row],
        first=rows_seen[np.append(first_row, len(seen))],
        detections=detections_of(table.filter(pa.array(seen)), file),
    )


def _about(schema: pa.Schema, file: Path) -> dict[str, Any]:
    """Return what the file says of itself, checked."""
    text = (schema.metadata or {}).get(METADATA_KEY.encode())
    if text is None:
        found = f"{file}, which does not say whose detections it holds"
        raise DataError(expected=f"{DETECTIONS_FILE} of a run", found=found, fix="give the run's folder")
    try:
        about = json.loads(text)
    except ValueError:
        about = None
    if not isinstance(about, dict) or not isinstance(about.get("format"), int):
        raise _broken("a description of the run in its metadata", file)
    if about["format"] > FORMAT:
        raise DataError(
            expected=f"recorded detections of format {FORMAT}",
            found=f"format {about['format']} in {file}",
            fix="use the version of standoff that wrote them, or a newer one",
        )
    size_px = about.get("picture_size_px")
    is_size = isinstance(size_px, list) and len(size_px) == 2 and all(isinstance(side, int) for side in size_px)
    if not is_size or not all(isinstance(about.get(name), dict) for name in ("source", "detector")):
        raise _broken("picture_size_px, source and detector in its metadata", file)
    return about


def _column(table: pa.Table, name: str, kind: pa.DataType, file: Path) -> Any:  # noqa: ANN401 - of any dtype
    """Return a column without nulls as an array."""
    if name not in column_names(table):
        found = f"{file} without {name}"
        raise DataError(expected=f"the columns of {DETECTIONS_FILE}", found=found, fix=_RECORD_AGAIN)
    column = table.column(name)
    try:
        column = column.cast(pa.string() if pa.types.is_dictionary(kind) else kind)
    except pa.ArrowException:
        raise _broken(f"{name} as {kind}, not as {column.type},", file) from None
    if column.null_count:
        raise _broken(f"{name} in every row", file)
    return column.to_numpy()


def _seen(table: pa.Table, file: Path) -> BoolArray:
    """Return which rows hold a detection; the others stand for a frame without any."""
    present = column_names(table)
    missing = [name for name, *_ in _BOX if name not in present]
    if missing:
        found = f"{file} without {', '.join(missing)}"
        raise DataError(expected=f"the columns of {DETECTIONS_FILE}", found=found, fix=_RECORD_AGAIN)
    given = np.column_stack([table.column(name).is_valid().to_numpy() for name, *_ in _BOX])
    seen: BoolArray = np.all(given, axis=1)
    if (np.any(given, axis=1) != seen).any():
        raise _broken("box, score and class of every detection", file)
    return seen


def _check_frames(by_row: Mapping[str, Any], first_row: IntArray, count: IntArray, seen: BoolArray, file: Path) -> None:
    """Raise DataError for rows that contradict each other."""
    if (np.diff(by_row["frame"]) < 0).any():
        raise _broken("frames in rising order", file)
    if not np.isfinite(by_row["time_s"]).all():
        raise _broken("a finite time_s in every row", file)
    for name in ("time_s", "detected"):
        if (by_row[name] != np.repeat(by_row[name][first_row], count)).any():
            raise _broken(f"one {name} for all rows of a frame", file)
    if (seen & ~by_row["detected"]).any():
        raise _broken("no detection in a frame on which the detector rested", file)
    if (~seen & (np.repeat(count, count) > 1)).any():
        raise _broken("a row without a box only where it is the frame's only one", file)


def detections_of(table: pa.Table, file: Path) -> Detections:
    """Return the rows of a table as detections.

    Args:
        table: With boxes, scores and classes, none of them null; ground points may be null, or not there.
        file: Where it was read, for what is said of mistakes.

    Raises:
        DataError: It is not such a table.
    """
    columns = {name: _column(table, name, kind, file) for name, kind, _, _ in _BOX}
    names, index = np.unique(columns["class"].astype(str), return_inverse=True)
    unknown = sorted(set(names.tolist()) - set(CLASS_BY_NAME))
    if unknown:
        raise DataError(
            expected=f"the classes {', '.join(CLASS_BY_NAME)}",
            found=f"{', '.join(unknown)} in {file}",
            fix="use the version of standoff that wrote them, or a newer one",
        )
    # By name: a class keeps its name in a later version, but perhaps not its number.
    id_of = np.array([CLASS_BY_NAME[name].id for name in names.tolist()], dtype=np.int64)
    xyxy_px = np.column_stack([columns[name] for name in ("x1_px", "y1_px", "x2_px", "y2_px")])
    try:
        return Detections(xyxy_px, columns["score"], id_of[index], *_feet(table, file))
    except ValueError as error:
        raise _broken(f"boxes that can be ({error})", file) from None


def _feet(table: pa.Table, file: Path) -> tuple[FloatArray, FloatArray]:
    """Return (N, 2) ground points and (N, 2, 2) covariances; NaN where there is none."""
    names = [name for name, *_ in FOOT_COLUMNS]
    if not set(names) <= column_names(table):
        return unknown_points(len(table)), np.full((len(table), 2, 2), np.nan)
    try:
        columns = [table.column(name).cast(pa.float64()).fill_null(np.nan).to_numpy() for name in names]
    except pa.ArrowException:
        raise _broken("ground points as numbers", file) from None
    x_px, y_px, sigma_x_px, sigma_y_px, covariance_px2 = columns
    rows = [sigma_x_px**2, covariance_px2, covariance_px2, sigma_y_px**2]
    return np.column_stack([x_px, y_px]), np.column_stack(rows).reshape(-1, 2, 2)


def _broken(expected: str, file: Path) -> DataError:
    return DataError(expected=f"{expected} in {file}", found="otherwise", fix=_RECORD_AGAIN)
