"""YAML and JSON files of settings and labels, read with errors that name the file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from standoff.core.errors import DataError
from standoff.files import json_text, yaml_text


def read_yaml(path: Path) -> dict[str, Any]:
    """Read names and values from a YAML file.

    Raises:
        DataError: It cannot be read, is not YAML, or holds something else.
    """
    return _checked(yaml_text.read_yaml(path, "names and values as YAML"), path, "YAML")


def read_json(path: Path) -> dict[str, Any]:
    """Read names and values from a JSON file.

    Raises:
        DataError: It cannot be read, is not JSON, or holds something else.
    """
    return _checked(json_text.read_json(path, "names and values as JSON"), path, "JSON")


def check_types(entry: Mapping[str, Any], types: Mapping[str, tuple[type, ...]], where: str) -> None:
    """Check that all keys are known and their values of a kind that is meant.

    Args:
        entry: Names and values.
        types: What a value may be, by name; True and False are no numbers.
        where: The entry, for messages.

    Raises:
        DataError: A key that is not known, or a value of another type.
    """
    for key, value in entry.items():
        if key not in types:
            raise DataError(expected=f"{', '.join(types)} in {where}", found=f"`{key}`", fix="remove or correct it")
        if not isinstance(value, types[key]) or (isinstance(value, bool) and bool not in types[key]):
            kinds = " or ".join(kind.__name__ for kind in types[key])
            raise DataError(expected=f"`{key}` as {kinds} in {where}", found=repr(value), fix="correct it")


def resolve_path(text: str, folder: Path) -> Path:
    """Return a path relative to a folder, with `~` and $VARIABLES filled in."""
    return folder / Path(os.path.expandvars(text)).expanduser()


def _checked(content: object, path: Path, language: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise DataError(
            expected=f"names and values as {language} in {path}",
            found=type(content).__name__,
            fix="give a mixture file, a data.yaml or a COCO file",
        )
    return content
