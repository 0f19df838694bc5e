"""Read a small YAML file that a person wrote, and say in one line what is wrong with it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray


def read_text(path: Path, what: str) -> str:
    """Return a file's text.

    Args:
        path: The file.
        what: What it should be, for the error ("a camera file").

    Raises:
        GroundError: It does not exist, cannot be read, or is not text.
    """
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise GroundError(expected=f"{what} at {path}", found="no such file", fix="check the path") from None
    except UnicodeDecodeError:
        raise GroundError(expected=f"{what} at {path}", found="a binary file", fix="give a text file") from None
    except OSError as error:
        found = error.strerror or type(error).__name__
        raise GroundError(expected=f"{what} at {path}", found=found, fix="check the path and its permissions") from None


def parse_mapping(text: str, path: Path, what: str) -> Mapping[str, Any]:
    """Return the YAML mapping in a text.

    Raises:
        GroundError: The text is not YAML, or not a mapping.
    """
    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark is not None else ""
        raise GroundError(expected=f"{what}", found=f"{path}{where}: not YAML", fix="correct the file") from None
    if not isinstance(content, dict):
        found = f"{path}: {'nothing' if content is None else 'no keys'}"
        raise GroundError(expected=f"{what}: a YAML mapping of keys to values", found=found, fix="correct the file")
    return {str(key): value for key, value in content.items()}


def check_keys(content: Mapping[str, Any], allowed: Collection[str], where: str) -> None:
    """Refuse keys that nobody reads: a misspelt one would silently change every distance.

    Raises:
        GroundError: There is a key that is not allowed.
    """
    strangers = sorted(set(content) - set(allowed))
    if strangers:
        keys = ", ".join(sorted(allowed))
        found = f"{', '.join(map(repr, strangers))} in {where}"
        raise GroundError(expected=f"only the keys {keys}", found=found, fix="correct or remove it")


def numbers(value: object, shape: tuple[int, ...], where: str) -> FloatArray:
    """Return finite numbers of a given shape; -1 stands for any length, () for a single number.

    Raises:
        GroundError: The value is missing, not made of numbers, not finite, or of another shape.

    >>> numbers([[1, 2], [3, 4.5]], (-1, 2), "here")
    array([[1. , 2. ],
           [3. , 4.5]])
    """
    wanted = "a number" if shape == () else "x".join("N" if size == -1 else str(size) for size in shape) + " numbers"
    found, array = f"{value!r}"[:80], np.full(0, np.nan)
    try:
        raw = np.array(value)
        if raw.dtype.kind in "iuf":
            array = raw.astype(np.float64)
    except ValueError:
        found = "rows of different lengths"
    fits = array.ndim == len(shape) and all(s in (-1, n) for s, n in zip(shape, array.shape, strict=True))
    if not fits:
        raise GroundError(expected=f"{wanted} for {where}", found=found, fix="correct the file")
    if not np.isfinite(array).all():
        raise GroundError(expected=f"finite numbers for {where}", found=found, fix="correct the file")
    return array
