from __future__ import annotations

import os

import pytest

from standoff.core.errors import MissingDependency
from standoff.simulation.render import Renderer


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skip where there is no OpenGL, except where CI says that there must be."""
    try:
        with Renderer((64, 64)):
            pass
    except MissingDependency as error:
        if os.environ.get("STANDOFF_REQUIRE_EGL") == "1":
            raise
        pytest.skip(str(error))
