"""Write YAML."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from standoff.files.whole import whole_file


def write_yaml(path: Path, content: Mapping[str, Any]) -> None:
    """Write a YAML file, whole or not at all, its keys in their own order.

    Args:
        path: Of the file.
        content: Plain values.

    Raises:
        OutputError: It cannot be written.
    """
    with whole_file(path) as partial:
        partial.write_text(yaml.safe_dump(dict(content), sort_keys=False), encoding="utf-8")
