"""JSON that every reader accepts: no NaN, no infinity, no types of ours."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Set
from contextlib import suppress
from dataclasses import asdict, is_dataclass
from datetime import date
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.errors import OutputError
from standoff.files.whole import partial_path


def plain(value: Any) -> Any:  # noqa: ANN401
    """Return the value in JSON's own types; numbers that are not finite become None.

    >>> plain({"distance_m": float("nan"), "size_px": np.array([4, 3]), "path": Path("a.mp4")})
    {'distance_m': None, 'size_px': [4, 3], 'path': 'a.mp4'}
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | Set):
        return [plain(item) for item in value]
    return _plain_scalar(value)


def _plain_scalar(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return value.isoformat() if isinstance(value, date) else str(value)


def json_line(value: Any) -> str:  # noqa: ANN401
    r"""Return the value as one line of JSON with its line end.

    >>> json_line({"gap_m": float("inf")})
    '{"gap_m": null}\n'
    """
    return json.dumps(plain(value), allow_nan=False, ensure_ascii=False) + "\n"


def json_text(value: Any) -> str:  # noqa: ANN401
    """Return the value as indented JSON with a line end."""
    return json.dumps(plain(value), allow_nan=False, ensure_ascii=False, indent=2) + "\n"


def write_json(path: Path, value: Any) -> None:  # noqa: ANN401
    """Write an indented JSON file that is, at any moment, either the old one or the new one.

    Raises:
        OutputError: It cannot be written.
    """
    partial = partial_path(path)
    try:
        with partial.open("w", encoding="utf-8") as file:
            file.write(json_text(value))
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise OutputError(
            expected=f"to write {path}",
            found=error.strerror or str(error),
            fix="make room, or choose a file in a folder that is writable",
        ) from error
