"""The whole monitor on a drawn site: the paper's reference object, a moving camera, exact truth."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import tolerances
from laws import few

from standoff.config import load_settings
from standoff.core import homography, protocols
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, Frame
from standoff.monitor import build_monitor
from standoff.stages.frames import frame_from_array

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "drawn_site"))
import draw_site

FRAMES = 30


class TrueBoxes(protocols.Detector):
    """A detector that knows the site."""

    def detect(self, frame: Frame) -> Detections:
        boxes = [draw_site.box_px(block, frame.time_s) for block in draw_site.BLOCKS]
        classes = [block.class_id for block in draw_site.BLOCKS]
        return Detections(np.array(boxes), np.full(len(boxes), 0.95), np.array(classes))


def true_feet_m(time_s: float) -> FloatArray:
    """Return (B, 2) where the bottom centre of each block's exact box is on the ground."""
    boxes = np.array([draw_site.box_px(block, time_s) for block in draw_site.BLOCKS])
    feet_px = np.column_stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]])
    site_to_image = homography.signed(draw_site.camera(time_s)[:, [0, 1, 3]], np.array([0.0, 0.0]))
    return homography.apply(homography.invert(site_to_image), feet_px)[0]


@pytest.fixture(scope="module")
def pictures() -> list[draw_site.Picture]:
    ground = draw_site.draw_ground(seed=3)
    return [draw_site.draw_frame(ground, index / draw_site.FRAMES_PER_S) for index in range(FRAMES)]


@pytest.mark.parametrize("method", few(["oriented", "paper", "paper+tls"]))
def test_distances_through_the_reference_object_are_the_true_ones(
    pictures: list[draw_site.Picture], method: str
) -> None:
    reference = {
        "square_m": draw_site.SQUARE_M,
        "box_px": draw_site.square_box_px(),
        "params": {"method": method},
    }
    settings = load_settings(
        overrides={
            "ground": {"reference": reference},
            # The paper's maps are others in every frame, and each stands for itself.
            "locate": {"anchor": "bottom_centre", "smooth": not method.startswith("paper")},
            "replace": {"detect": {"factory": "test_drawn_site:TrueBoxes"}},
        }
    )
    monitor = build_monitor(settings)
    errors_m: list[float] = []
    normalised: list[float] = []
    for index, picture in enumerate(pictures):
        result = monitor.step(frame_from_array(picture, index=index, time_s=index / draw_site.FRAMES_PER_S))
        assert result.ground, f"frame {result.frame.index}: {result.ground}"
        feet_m = true_feet_m(result.frame.time_s)
        pairs = result.proximities
        assert len(pairs) == 4
        truth_m = np.linalg.norm(feet_m[pairs.track_a - 1] - feet_m[pairs.track_b - 1], axis=1)
        errors_m += (pairs.distance_m - truth_m).tolist()
        normalised += ((pairs.distance_m - truth_m) / pairs.sigma_m).tolist()
    assert np.sqrt(np.mean(np.square(errors_m))) < tolerances.DRAWN_SITE_M[method]
    assert np.abs(normalised).max() < 4.0
