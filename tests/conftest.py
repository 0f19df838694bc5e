from __future__ import annotations

import os
from pathlib import Path

import pytest

_PROJECT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real material with its own terms, never part of the project; tests that need it skip where it is absent."""
    folder = Path(os.environ.get("STANDOFF_SHARED_DATA", _PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the shared data folder is not here ({folder}); set STANDOFF_SHARED_DATA")
    return folder
