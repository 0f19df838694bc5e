"""The simulator, a distribution of its own, which may not be installed."""

from __future__ import annotations

from importlib.util import find_spec

import typer

from standoff.core.errors import MissingDependency

INSTALL = "pip install ./simulator (in standoff's repository)"


def require_simulator() -> None:
    """Check that the simulator is there, before anything of it is imported.

    Raises:
        MissingDependency: It is not.
    """
    if find_spec("standoff_sim") is None:
        raise MissingDependency(expected="standoff's simulator", found="no package standoff-sim", fix=f"run: {INSTALL}")


def absent(context: typer.Context) -> None:
    """Render a construction site whose every position, box and pixel is known. Not installed."""
    require_simulator()
    raise MissingDependency(
        expected="the verb that standoff's simulator brings",
        found="a simulator without it",
        fix=f"install it again: {INSTALL}",
    )
