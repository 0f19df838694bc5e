"""What the tests of standoff and those of the simulator share."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import drawn_clip
import pytest
from hypothesis import settings
from laws import FUZZ, forget_our_constants, register_profiles

from standoff.core.errors import MissingDependency

register_profiles()

_PROJECT = Path(__file__).resolve().parent


@pytest.hookimpl(trylast=True)  # after hypothesis has read which profile is asked for
def pytest_configure() -> None:
    if settings.get_current_profile_name() != FUZZ:
        forget_our_constants()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real material with its own terms, never part of the project; tests that need it skip where it is absent."""
    folder = Path(os.environ.get("SHARED_DATA", _PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the shared data folder is not here ({folder}); set SHARED_DATA")
    return folder


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skip where there is no OpenGL, except where CI says that there must be."""
    from standoff_sim.render import Renderer

    try:
        with Renderer((64, 64)):
            pass
    except MissingDependency as error:
        if os.environ.get("REQUIRE_EGL") == "1":
            raise
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def clip_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drawn clip; never changed by a test."""
    return drawn_clip.write_clip(tmp_path_factory.mktemp("clips") / "drawn")


@pytest.fixture
def copy_of(clip_folder: Path, tmp_path: Path) -> Path:
    """A drawn clip of a test's own."""
    return Path(shutil.copytree(clip_folder, tmp_path / "copy"))
