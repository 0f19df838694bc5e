"""The set-up page's server on the demo's film, whose every metre is known."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from service.demo_film import DEMO

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.stages.ground import load_camera

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")


@pytest.fixture(scope="session")
def truth() -> dict[str, Any]:
    return dict(pq.read_table(DEMO / "frames.parquet").to_pydict())


@pytest.fixture(scope="session")
def view(truth: dict[str, Any]) -> View:
    """The camera in the film's first picture."""
    place = np.array([truth[f"camera_{axis}_m"][0] for axis in "xyz"])
    return View(load_camera(DEMO / "camera.yaml"), place, np.array(truth["site_to_camera"][0]).reshape(3, 3))


@pytest.fixture(scope="session")
def corners_px(truth: dict[str, Any]) -> FloatArray:
    """(4, 2) of the footing's top in the first picture."""
    return np.column_stack([truth["reference_top_x_px"][0], truth["reference_top_y_px"][0]])


@pytest.fixture
def site_file(tmp_path: Path) -> Path:
    return tmp_path / "site.yaml"


@pytest.fixture(scope="session")
def film() -> Iterator[Any]:
    """The film; the detector is loaded by whoever wants it."""
    from standoff.config import settings_from
    from standoff.service.setup.film import Film

    yield Film(DEMO / "video.mp4", settings_from({}, "nothing"))
