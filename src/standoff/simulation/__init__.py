"""A construction site with exact truth: drone video whose every position, box and pixel is known (extra `sim`)."""

from __future__ import annotations

from importlib.util import find_spec

from standoff.core.errors import MissingDependency

_PACKAGES = ("collada", "mapbox_earcut", "moderngl", "networkx", "shapely", "trimesh")


def require_packages() -> None:
    """Check that the extra `sim` is installed, before anything of it is imported.

    Raises:
        MissingDependency: It is not.
    """
    missing = [name for name in _PACKAGES if find_spec(name) is None]
    if missing:
        raise MissingDependency(
            expected="the simulator's packages",
            found=f"no {', '.join(missing)}",
            fix="run: pip install 'standoff[sim]'",
        )
