from __future__ import annotations

from io import BytesIO
from pathlib import Path
from unittest.mock import patch

import av
import drawn_clip
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from stages.detect.conftest import make_model

__all__ = ["make_model"]

SIZE_PX = (1920, 1080)
"""No smaller than the drawn clip, so that no true box lies outside."""


def _black_film() -> bytes:
    """Nothing is looked at, and drawing takes its time."""
    file = BytesIO()
    width_px, height_px = SIZE_PX
    black = av.VideoFrame.from_ndarray(np.zeros((height_px, width_px, 3), np.uint8), format="bgr24")
    with av.open(file, "w", format="mp4") as container:
        stream = container.add_stream("h264", rate=25)
        stream.width, stream.height, stream.pix_fmt = width_px, height_px, "yuv420p"
        for number in range(drawn_clip.FRAMES):
            black.pts = number
            container.mux(stream.encode(black))
        container.mux(stream.encode(None))
    return file.getvalue()


@pytest.fixture(scope="session")
def seen_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drawn clip whose truth says how much of everything can be seen: of the loader too little to be marked."""
    with patch.object(drawn_clip, "_film", _black_film):
        folder = drawn_clip.write_clip(tmp_path_factory.mktemp("seen") / "drawn")
    table = pq.read_table(folder / "truth.parquet")
    loader = [class_id == 2 for class_id in table["class_id"].to_pylist()]
    unseen = [value != value for value in table["x1_px"].to_pylist()]
    shares = [0.1 if hidden else 1.0 for hidden in loader]
    pixels = [0 if gone else 60 for gone in unseen]
    # What is 60 px large is longer than the three pixels of the drawn boxes.
    for name, outwards_px in (("x1_px", -3.0), ("y1_px", -3.0), ("x2_px", 3.0), ("y2_px", 3.0)):
        edges_px = pa.array([edge + outwards_px for edge in table[name].to_pylist()])
        table = table.set_column(table.column_names.index(name), name, edges_px)
    table = table.append_column("visible_share", pa.array(shares)).append_column("visible_px", pa.array(pixels))
    pq.write_table(table, folder / "truth.parquet")
    return folder
