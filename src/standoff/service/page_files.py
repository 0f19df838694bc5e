"""The page that a browser shows, where it was built."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from standoff.core.errors import MissingDependency


def page_folder() -> Path:
    """Return the folder of the built page.

    Raises:
        MissingDependency: standoff was installed where no Node was, so without it.
    """
    folder = Path(str(files("standoff"))) / "service" / "page"
    if not (folder / "index.html").is_file():
        raise MissingDependency(
            expected="the page, which is built when standoff is installed where Node is",
            found=f"none in {folder}",
            fix="run `make page` in standoff's folder, which gets what it needs, and install standoff again",
        )
    return folder
