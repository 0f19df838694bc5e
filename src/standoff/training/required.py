"""Packages of the `train` extra, asked for before anything is done."""

from __future__ import annotations

import importlib.util

from standoff.core.errors import MissingDependency


def require_packages(*packages: str, purpose: str) -> None:
    """Check that packages are installed.

    Args:
        packages: Their names.
        purpose: For the error ("export a model").

    Raises:
        MissingDependency: One is not.
    """
    missing = [package for package in packages if importlib.util.find_spec(package) is None]
    if missing:
        raise MissingDependency(
            expected=f"{' and '.join(packages)} to {purpose}",
            found=f"no {' and no '.join(missing)}",
            fix="run pip install 'standoff[train]'",
        )
