from __future__ import annotations

from dataclasses import replace

import numpy as np
from stages.sinks.fake_site import FakePicture, FakeSite, quiet

from standoff.core.camera import Camera
from standoff.core.types import Frame, FrameResult
from standoff.stages.sinks import DrawParams
from standoff.stages.sinks.birdseye import BirdsEye
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.sketch import Sketch

LENS = Camera(640, 360, np.array([[450.0, 0, 320], [0, 450, 180], [0, 0, 1]]), np.array([-0.2, 0.05, 0, 0, 0]))
PANEL = (300, 400)


def _sketch(result: FrameResult) -> Sketch:
    return Sketch.of(FrameMeasurements.of(quiet(result)), DrawParams())


def test_the_window_stays_until_a_track_has_been_outside_for_two_seconds() -> None:
    site = FakeSite((640, 360))
    birdseye = BirdsEye(PANEL)
    panel = np.zeros((PANEL[1], PANEL[0], 3), dtype=np.uint8)
    windows = []
    for index in range(130):
        result = site.result(index)
        if index >= 90:
            far = result.positions.xy_m.copy()
            far[0] = [0.0, 150.0]
            result = replace(result, positions=replace(result.positions, xy_m=far))
        birdseye.draw(panel, result.frame.image, _sketch(result))
        windows.append(birdseye._window)
    assert len({id(window) for window in windows[:139]}) == 1
    for index in range(130, 145):
        result = site.result(index)
        far = result.positions.xy_m.copy()
        far[0] = [0.0, 150.0]
        birdseye.draw(
            panel, result.frame.image, _sketch(replace(result, positions=replace(result.positions, xy_m=far)))
        )
    assert birdseye._window is not None
    assert birdseye._window is not windows[0]
    assert birdseye._window.covers(np.array([[0.0, 150.0]])).all()


def test_without_a_map_the_panel_says_so_instead_of_showing_the_last_one() -> None:
    site = FakeSite((640, 360))
    birdseye = BirdsEye(PANEL)
    measured, lost = (np.zeros((PANEL[1], PANEL[0], 3), dtype=np.uint8) for _ in range(2))
    birdseye.draw(measured, site.result(0).frame.image, _sketch(site.result(0)))
    result = site.result(70)
    birdseye.draw(lost, result.frame.image, _sketch(result))
    assert measured.std() > 2 * lost.std()
    away_from_text = np.vstack([lost[: PANEL[1] // 3], lost[-PANEL[1] // 3 :]])
    assert away_from_text.max() < 60


def test_a_map_that_sees_no_ground_is_drawn_too() -> None:
    site = FakeSite((640, 360), tracks=0)
    result = site.result(0)
    above_horizon = replace(site.ground(), image_to_ground=-site.ground().image_to_ground)
    panel = np.zeros((PANEL[1], PANEL[0], 3), dtype=np.uint8)
    frame = Frame("site", 0, 0.0, FakePicture(result.frame.image))
    BirdsEye(PANEL).draw(panel, frame.image, _sketch(replace(result, ground=above_horizon, frame=frame)))
    assert panel.max() > 200  # NO GROUND IN SIGHT
