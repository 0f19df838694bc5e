from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from training.darknet.published_cfgs import yolov7_tiny

from standoff.core.errors import ModelError
from standoff.training.run.params import TrainParams
from standoff.training.start.starting_point import compose_cfg


def test_heads_that_cannot_be_trained_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    path = tmp_path / "yolov7-tiny.cfg"
    path.write_text(yolov7_tiny((64, 64)))
    no_data: Any = None
    with pytest.raises(ModelError, match=r"without new_coords in yolov7-tiny\.cfg, .*can be exported but not trained"):
        compose_cfg(str(path), no_data, TrainParams())
