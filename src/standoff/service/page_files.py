"""The pages that a browser shows, where they were built."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from standoff.core.errors import MissingDependency


def page_folder() -> Path:
    """Return the folder of the built pages.

    Raises:
        MissingDependency: standoff was installed where no Node was, so without them.
    """
    folder = Path(str(files("standoff"))) / "service" / "page"
    if not (folder / "assets").is_dir():
        raise MissingDependency(
            expected="the pages, which are built when standoff is installed where Node is",
            found=f"none in {folder}",
            fix="run `make page` in standoff's folder, which gets what it needs, and install standoff again",
        )
    return folder
