"""The tables of truth in a clip folder, as columns of numpy arrays."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet

from standoff.clips.columns import column_names
from standoff.core.errors import DataError
from standoff.evaluation.positions_input import Columns

TRUTH = ("frame", "entity_id", "class_id", "x_m", "y_m", "x1_px", "y1_px", "x2_px", "y2_px", "foot_x_px", "foot_y_px")
PAIRS = ("frame", "entity_a", "entity_b", "centre_m")
REFERENCE_PX = ("reference_top_x_px", "reference_top_y_px")
CAMERA = ("camera_x_m", "camera_y_m", "camera_z_m", "site_to_camera")
FRAMES = ("frame", "reference_covered", "reference_visible_share", *REFERENCE_PX, "board_x_px", "board_y_px", *CAMERA)


def read_table(path: Path, names: tuple[str, ...]) -> Columns:
    """Read columns of a Parquet table; lists become arrays of objects.

    Raises:
        DataError: The table is missing, unreadable, or lacks a column.
    """
    fix = "render the clip again with `standoff simulate`"
    if not path.is_file():
        raise DataError(expected=f"{path.name} in the clip", found=f"no {path}", fix=fix)
    try:
        table = pyarrow.parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise DataError(expected=f"a whole Parquet table in {path}", found=str(error), fix=fix) from error
    present = column_names(table)
    missing = [name for name in names if name not in present]
    if missing:
        raise DataError(expected=f"the columns {','.join(names)}", found=f"{path} without {','.join(missing)}", fix=fix)
    return {name: table.column(name).to_numpy() for name in names}
