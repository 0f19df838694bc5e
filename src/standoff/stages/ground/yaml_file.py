"""Read a small YAML file that a person wrote, and say in one line what is wrong with it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.files.number_lists import number_array
from standoff.files.yaml_text import read_yaml


def read_mapping(path: Path, what: str) -> Mapping[str, Any]:
    """Return the YAML mapping in a file.

    Args:
        path: The file.
        what: What it should be, for the error ("a survey file").

    Raises:
        GroundError: It cannot be read, is not YAML, or not a mapping.
    """
    return as_mapping(read_yaml(path, what, GroundError), what, path)


def as_mapping(content: object, what: str, path: Path) -> Mapping[str, Any]:
    """Return what a file says, keys as texts.

    Raises:
        GroundError: It is not a mapping.
    """
    if not isinstance(content, dict):
        found = f"{path}: {'nothing' if content is None else 'no keys'}"
        raise GroundError(expected=f"{what}: a mapping of keys to values", found=found, fix="correct the file")
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
    found = f"{value!r}"[:80]
    try:
        array = number_array(value, len(shape))
    except ValueError as error:
        raise GroundError(expected=f"{wanted} for {where}", found=f"{found}, {error}", fix="correct the file") from None
    if not all(size in (-1, given) for size, given in zip(shape, array.shape, strict=True)):
        raise GroundError(expected=f"{wanted} for {where}", found=found, fix="correct the file")
    if not np.isfinite(array).all():
        raise GroundError(expected=f"finite numbers for {where}", found=found, fix="correct the file")
    return array
