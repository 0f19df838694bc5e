from __future__ import annotations

from pathlib import Path

import pytest
from cli.conftest import call as call
from cli.conftest import write_site
from cli.test_cli import make_video

FILMS = {"first": 20, "second": 24, "third": 28}
"""Names, and how many frames at ten a second."""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """Settings with a scripted detector, and hazards as the only output."""
    return write_site(tmp_path, outputs=["hazards"])


@pytest.fixture
def films(tmp_path: Path) -> Path:
    """A folder of three short films, in which a worker walks towards an excavator."""
    folder = tmp_path / "films"
    folder.mkdir()
    for name, frames in FILMS.items():
        make_video(folder / f"{name}.mp4", frames)
    return folder
