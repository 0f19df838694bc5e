"""A reference on ground so plain that optical flow finds nothing to hold on to."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import tolerances

from standoff.core.errors import GroundError
from standoff.core.types import Detections, Frame, GroundMap, NoCameraMotion
from standoff.stages.frames import frame_from_array
from standoff.stages.ground import ReferenceGround, ReferenceShape, SurveyedGround
from standoff.stages.ground.reference_box import GivenPlace

STILL = NoCameraMotion("not estimated")

BOX = [100.0, 80.0, 180.0, 160.0]


def picture(index: int, shift_px: float = 0.0, *, visible: bool = True) -> Frame:
    image = np.full((240, 320, 3), 90, np.uint8)
    if visible:
        corners = np.array([[110.0, 95.0], [170.0, 92.0], [172.0, 150.0], [108.0, 152.0]]) + shift_px
        cv2.fillPoly(image, [np.round(corners * 16).astype(np.int32)], (220, 220, 220), cv2.LINE_AA, 4)
    return frame_from_array(image, index=index, time_s=index / 10)


def test_a_reference_that_stays_where_it_is_stays_known() -> None:
    ground = ReferenceGround(ReferenceShape.square(2.0), place=GivenPlace(box_xyxy_px=BOX))
    maps = [ground.update(picture(index), Detections.empty(), STILL) for index in range(10)]
    assert all(isinstance(found, GroundMap) for found in maps)
    corners = np.array([found.anchors_px for found in maps if isinstance(found, GroundMap)])
    assert np.ptp(corners, axis=0).max() < tolerances.EDGE_PX


def test_a_reference_that_was_covered_for_a_moment_is_known_again() -> None:
    ground = ReferenceGround(ReferenceShape.square(2.0), place=GivenPlace(box_xyxy_px=BOX))
    seen = [ground.update(picture(index, visible=index not in (3, 4)), Detections.empty(), STILL) for index in range(8)]
    assert [bool(found) for found in seen] == [True] * 3 + [False] * 2 + [True] * 3


def test_an_outline_somewhere_else_is_not_taken_for_the_reference() -> None:
    ground = ReferenceGround(ReferenceShape.square(2.0), place=GivenPlace(box_xyxy_px=BOX))
    assert ground.update(picture(0), Detections.empty(), STILL)
    assert not ground.update(picture(1, shift_px=18.0), Detections.empty(), STILL)


@pytest.mark.parametrize("box", [[400.0, 10.0, 500.0, 90.0], [10.0, 300.0, 90.0, 400.0]])
def test_a_box_outside_the_picture_is_told_before_the_first_frame(box: list[float]) -> None:
    with pytest.raises(GroundError, match="320x240"):
        ReferenceGround(ReferenceShape.square(2.0), place=GivenPlace(box_xyxy_px=box)).prepare((320, 240))


def test_a_survey_of_another_shape_is_told_before_the_first_frame() -> None:
    points = np.array([[10.0, 10.0], [300.0, 10.0], [300.0, 200.0], [10.0, 200.0]])
    survey = SurveyedGround(points, points / 20.0, (320, 240))
    survey.prepare((640, 480))
    with pytest.raises(GroundError, match="320x240"):
        survey.prepare((1920, 1080))
