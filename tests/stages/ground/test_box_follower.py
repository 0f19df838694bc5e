from __future__ import annotations

import cv2
import numpy as np
import pytest

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray
from standoff.stages.ground.box_follower import BoxFollower, moved_box

ROUGH = (
    cv2.GaussianBlur(np.random.default_rng(2).normal(120.0, 300.0, (400, 500)), (0, 0), 3.0)
    .clip(0, 255)
    .astype(np.uint8)
)
BOX = np.array([200.0, 150.0, 280.0, 230.0])


def moved(angle_deg: float, zoom: float, shift: tuple[float, float]) -> tuple[ImageArray, FloatArray]:
    motion = cv2.getRotationMatrix2D((240.0, 190.0), angle_deg, zoom)
    motion[:, 2] += shift
    return cv2.warpAffine(ROUGH, motion, (500, 400), borderMode=cv2.BORDER_REFLECT), motion


@pytest.mark.parametrize(
    ("angle_deg", "zoom", "shift"), [(0.0, 1.0, (0.0, 0.0)), (3.0, 1.03, (12.0, -7.0)), (-6.0, 0.95, (-25.0, 10.0))]
)
def test_the_box_goes_where_the_picture_goes(angle_deg: float, zoom: float, shift: tuple[float, float]) -> None:
    now, true_motion = moved(angle_deg, zoom, shift)
    follower = BoxFollower()
    follower.start(ROUGH, BOX)
    motion = follower.follow(now)
    assert motion is not None
    centre = np.array([240.0, 190.0, 1.0])
    np.testing.assert_allclose(motion @ centre, true_motion @ centre, atol=0.3)
    size = moved_box(motion, BOX)[2:] - moved_box(motion, BOX)[:2]
    np.testing.assert_allclose(size, zoom * 80.0, atol=1.0)


def test_a_reference_that_is_gone_is_lost_and_found_again_when_it_is_back() -> None:
    follower = BoxFollower()
    follower.start(ROUGH, BOX)
    assert follower.follow(np.full_like(ROUGH, 100)) is None
    assert follower.follow(np.random.default_rng(0).integers(0, 255, ROUGH.shape).astype(np.uint8)) is None
    assert follower.follow(ROUGH) is not None


def test_nothing_is_followed_before_the_start_or_into_another_size() -> None:
    follower = BoxFollower()
    assert follower.follow(ROUGH) is None
    follower.start(ROUGH, BOX)
    assert follower.follow(ROUGH[:300]) is None
    follower.start(ROUGH, BOX + 2000.0)
    assert follower.follow(ROUGH) is None
