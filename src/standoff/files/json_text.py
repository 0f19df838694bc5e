"""JSON that every reader accepts: no NaN, no infinity, no types of ours; and JSON of others, read strictly."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Set
from dataclasses import asdict, is_dataclass
from datetime import date
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.errors import DataError, OutputError, StandoffError
from standoff.files.plain_text import read_text
from standoff.files.whole import partial_file


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
    """Write an indented JSON file that is, at any moment, either the old one or the new one; or into a pipe or device.

    Raises:
        OutputError: It cannot be written.
    """
    try:
        with partial_file(path) as partial:
            partial.write_text(json_text(value), encoding="utf-8")
    except OSError as error:
        raise OutputError(
            expected=f"to write {path}",
            found=error.strerror or str(error),
            fix="make room, or choose a file in a folder that is writable",
        ) from error


class _Twice(ValueError):
    """An object has a key twice.

    Args:
        key: Which.
    """

    def __init__(self, key: str) -> None:
        self.key = key
        super().__init__(key)


def parse_json(text: str, what: str, where: str, error: type[StandoffError] = DataError) -> Any:  # noqa: ANN401
    """Return what a JSON text says.

    Args:
        text: The JSON.
        what: What it should be, for the message ("a COCO file").
        where: It stands, for the message: a path.
        error: Raised where it cannot be read.

    Raises:
        StandoffError: `error`: it is not JSON, or an object has a key twice: the last one would win in silence.
    """
    try:
        return json.loads(text, object_pairs_hook=_once_each)
    except _Twice as twice:
        places = [text.count("\n", 0, at.start()) + 1 for at in re.finditer(re.escape(json.dumps(twice.key)), text)]
        # Of a key that other objects have as well, nobody can say so which two they are.
        lines = f" (lines {places[0]} and {places[1]})" if len(places) == 2 else ""
        found = f"{where}: the key `{twice.key}` twice in one object{lines}"
        raise error(expected=what, found=found, fix="keep one of them") from None
    except (ValueError, RecursionError) as problem:
        reason = str(problem) if isinstance(problem, json.JSONDecodeError) else "nested too deeply, or a huge number"
        raise error(expected=what, found=f"{where}: not JSON ({reason})", fix="correct the file") from None


def read_json(path: Path, what: str, error: type[StandoffError] = DataError) -> Any:  # noqa: ANN401
    """Return what a JSON file says, as `parse_json`.

    Raises:
        StandoffError: `error`: it cannot be read either.
    """
    return parse_json(read_text(path, what, error), what, str(path), error)


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        names = [key for key, _ in pairs]
        raise _Twice(next(key for key in names if names.count(key) > 1))
    return content
