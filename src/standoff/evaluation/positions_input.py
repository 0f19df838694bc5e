"""Read what positions are scored against: a truth file, as columns of numpy arrays."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from standoff.clips import Columns, columns_of
from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray

TRUTH_COLUMNS = ("frame", "id", "x", "y", "w", "h", "conf", "X", "Y")
TRACK_COLUMNS = ("frame", "track_id", "class", "x1_px", "y1_px", "x2_px", "y2_px", "observed", "x_m", "y_m")


def read_truth(path: Path | str) -> Columns:
    """Read a truth file, `frame,id,x,y,w,h,conf,X,Y` and whatever else, and check it.

    Returns:
        `TRUTH_COLUMNS`, float: frames from 1; boxes in pixels (left, top, width, height), NaN throughout where the
        file has none; metres on the ground.

    Raises:
        DataError: The file is missing, not such a CSV, or contradicts itself.
    """
    types = dict.fromkeys(TRUTH_COLUMNS, pa.float64())
    try:
        table = pyarrow.csv.read_csv(path, convert_options=pyarrow.csv.ConvertOptions(column_types=types))
    except (OSError, pa.ArrowException) as error:
        raise DataError(
            expected=f"a CSV file of numbers with the columns {','.join(TRUTH_COLUMNS)}",
            found=f"{path}, which cannot be read as one ({error})",
            fix="check the path and the file",
        ) from error
    truth = columns_of(table, TRUTH_COLUMNS, path, fix="check that it is the right file")
    for expected, right in _checks(truth).items():
        if not right.all():
            line = int(np.flatnonzero(~right)[0]) + 2
            raise DataError(expected=expected, found=f"otherwise in line {line} of {path}", fix="correct the truth")
    return truth


def _checks(truth: Columns) -> Mapping[str, BoolArray]:
    """Return, by what is expected of a row, which rows are so."""
    box = np.column_stack([truth[name] for name in ("x", "y", "w", "h")])
    keys = np.column_stack([truth["frame"], truth["id"]])
    finite_keys = np.isfinite(keys).all(axis=1) & np.isfinite(truth["conf"])
    finite_metres = np.isfinite(truth["X"]) & np.isfinite(truth["Y"])
    whole_box = np.isfinite(box).all(axis=1) & (box[:, 2:] > 0).all(axis=1)
    return {
        "frame, id and conf in every row, frames whole numbers from 1": (
            finite_keys & (keys[:, 0] >= 1) & (keys[:, 0] % 1 == 0)
        ),
        "X and Y in metres wherever conf is above 0": finite_metres | (truth["conf"] <= 0),
        "a box of positive width and height in every row, or a box in none": whole_box | np.isnan(box).all(),
        "every id at most once in a frame": _first_of_its_kind(keys),
    }


def _first_of_its_kind(keys: FloatArray) -> BoolArray:
    first = np.zeros(len(keys), dtype=np.bool_)
    first[np.unique(keys, axis=0, return_index=True)[1]] = True
    return first
