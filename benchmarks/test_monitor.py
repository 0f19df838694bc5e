"""The monitor's own arithmetic, ten tracks at 1080p: locate, proximity and hazard.

python -m pytest benchmarks/test_monitor.py --benchmark-columns=min,median,iqr
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.types import GroundMap, Tracks
from standoff.stages.hazard import HazardMonitor
from standoff.stages.locate import Locator
from standoff.stages.proximity import ProximityMeter, ProximityParams

SIZE_PX = (1920, 1080)
FRAME_S = 1.0 / 30.0
WARM_UP_FRAMES = 60
CORNERS_PX = np.array([[700.0, 500.0], [1250.0, 520.0], [1400.0, 900.0], [560.0, 880.0]])
CORNERS_M = np.array([[0.0, 12.0], [12.0, 12.0], [12.0, 0.0], [0.0, 0.0]])
MATRIX = np.array([[1500.0, 0.0, 959.5], [0.0, 1500.0, 539.5], [0.0, 0.0, 1.0]])


def ground_map(camera: Camera | None) -> GroundMap:
    matrix = homography.fit(CORNERS_PX, CORNERS_M)
    covariance = homography.fit_covariance(matrix, CORNERS_PX, np.tile(np.eye(2), (4, 1, 1)))
    polygon = np.array([[0.0, 300.0], [1920.0, 300.0], [1920.0, 1080.0], [0.0, 1080.0]])
    return GroundMap(matrix, covariance, SIZE_PX, "four corners", 0.02, valid_px=polygon, camera=camera)


def ten_tracks() -> Tracks:
    """Return six workers and four machines spread over the picture."""
    rng = np.random.default_rng(0)
    foot = np.column_stack([rng.uniform(200, 1700, 10), rng.uniform(500, 950, 10)])
    boxes = np.column_stack([foot - np.array([20.0, 80.0]), foot + np.array([20.0, 0.0])])
    class_id = np.array([0] * 6 + [1, 2, 3, 4])
    return Tracks(np.arange(1, 11), boxes, np.ones(10), class_id, np.ones(10, dtype=np.bool_), np.ones(10))


@pytest.mark.parametrize("pairs", [(("worker", "equipment"),), (("any", "any"),)], ids=["24 pairs", "45 pairs"])
@pytest.mark.parametrize("map_kind", ["fixed", "new each frame", "new each frame, lens"])
def test_one_frame_from_tracks_to_hazards(
    benchmark: Callable[..., Any], map_kind: str, pairs: tuple[tuple[str, str], ...]
) -> None:
    lens = np.array([-0.12, 0.03, 0.001, -0.0008, 0.0])
    camera = Camera(*SIZE_PX, MATRIX, lens) if map_kind.endswith("lens") else None
    grounds = [ground_map(camera) for _ in range(1 if map_kind == "fixed" else 2)]
    locator, meter, monitor = Locator(), ProximityMeter(ProximityParams(pairs=pairs)), HazardMonitor()
    tracks = ten_tracks()
    frame, followed = 0, np.zeros(1, dtype=np.bool_)

    def one_frame() -> int:
        nonlocal frame
        frame += 1
        time_s, ground = frame * FRAME_S, grounds[frame % len(grounds)]
        positions = locator.update(time_s, tracks, ground)
        proximities = meter.update(time_s, positions, ground)
        monitor.update(time_s, positions, proximities, ground, followed)
        return len(proximities)

    for _ in range(WARM_UP_FRAMES):
        one_frame()
    assert benchmark(one_frame) == (45 if pairs == (("any", "any"),) else 24)
