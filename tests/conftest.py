from __future__ import annotations

import os
import pkgutil
from collections.abc import Generator
from importlib import import_module
from pathlib import Path

import pytest
from coverage import Coverage
from hypothesis import settings
from laws import FUZZ, forget_our_constants, register_profiles

from standoff.core.errors import MissingDependency

register_profiles()

_TESTS = Path(__file__).resolve().parent
_PROJECT = _TESTS.parent
_COUNTED = {"core", "files", "stages", "test_pipeline.py"}
"""Whose tests are counted for the coverage, which is that of these packages."""
_COUNTED_PACKAGES = ("standoff.core", "standoff.files", "standoff.stages")
_LIBRARIES = (
    "av", "cv2", "jinja2", "matplotlib.figure", "numba", "onnxruntime", "pyarrow.parquet", "scipy.optimize",
    "scipy.spatial",
)  # fmt: skip
"""What takes longest to load of that which they need."""


@pytest.hookimpl(trylast=True)  # after hypothesis has read which profile is asked for
def pytest_configure() -> None:
    if settings.get_current_profile_name() != FUZZ:
        forget_our_constants()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Count the lines that run when the counted packages are loaded, not the loading of all else that tests need."""
    coverage = Coverage.current()
    if coverage is None:
        return (yield)
    coverage.stop()
    for name in _LIBRARIES:
        import_module(name)
    coverage.start()
    for package in _COUNTED_PACKAGES:
        for module in pkgutil.walk_packages(import_module(package).__path__, f"{package}."):
            import_module(module.name)
    import_module("standoff.pipeline")
    coverage.stop()
    try:
        return (yield)
    finally:
        coverage.start()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Count the lines that the tests of a package run, not those that all others come by.

    To trace makes Python half as slow again, in the libraries too.
    """
    coverage = Coverage.current()
    within = item.path.relative_to(_TESTS).parts if item.path.is_relative_to(_TESTS) else ()
    if coverage is None or not within or within[0] in _COUNTED:
        # Examples in docstrings count, too.
        return (yield)
    coverage.stop()
    try:
        return (yield)
    finally:
        coverage.start()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real material with its own terms, never part of the project; tests that need it skip where it is absent."""
    folder = Path(os.environ.get("STANDOFF_SHARED_DATA", _PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the shared data folder is not here ({folder}); set STANDOFF_SHARED_DATA")
    return folder


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skip where there is no OpenGL, except where CI says that there must be."""
    from standoff.simulation.render import Renderer

    try:
        with Renderer((64, 64)):
            pass
    except MissingDependency as error:
        if os.environ.get("STANDOFF_REQUIRE_EGL") == "1":
            raise
        pytest.skip(str(error))
