from __future__ import annotations

from pathlib import Path

import pytest
from evaluation.paper import drawn_board


@pytest.fixture(scope="session")
def board_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drawn clip of a checkerboard; never changed by a test."""
    return drawn_board.write_clip(tmp_path_factory.mktemp("clips") / "board")
