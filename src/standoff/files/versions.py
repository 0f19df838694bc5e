"""Which versions made a file."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

from standoff import __version__

_LIBRARIES = ("numpy", "scipy", "numba", "opencv-python-headless", "onnxruntime", "av", "pyarrow")


def library_versions() -> dict[str, str]:
    """Return the versions of standoff, Python, the libraries that results depend on, and the platform."""
    found = {"standoff": __version__, "python": platform.python_version(), "platform": platform.platform()}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
