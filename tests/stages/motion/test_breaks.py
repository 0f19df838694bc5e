from __future__ import annotations

import numpy as np
import pytest
from drawn_ground import SIZE_PX
from flown_ground import FPS, GROUND, NOTHING, OTHER_GROUND, flight, frame, seen

from standoff.core.homography import FloatArray
from standoff.core.types import Frame, ImageArray
from standoff.stages.motion import MotionEstimator

HOME = flight(0.0)


def told(frames: list[Frame]) -> list[str]:
    """Return what the estimator says of a film."""
    estimator = MotionEstimator()
    for one in frames:
        estimator.update(one, NOTHING)
    warnings: list[str] = estimator.describe()["warnings"]
    return warnings


def film(pictures: list[ImageArray]) -> list[Frame]:
    return [frame(picture, index) for index, picture in enumerate(pictures)]


def later(one: Frame, seconds: float) -> Frame:
    return Frame(one.stream_id, one.index, one.time_s + seconds, one.picture)


def zoomed(factor: float) -> FloatArray:
    half = np.array([[1.0, 0.0, SIZE_PX[0] / 2], [0.0, 1.0, SIZE_PX[1] / 2], [0.0, 0.0, 1.0]])
    return half @ np.diag([factor, factor, 1.0]) @ np.linalg.inv(half) @ HOME


def test_a_whole_film_has_nothing_to_tell() -> None:
    assert told(film([seen(flight(0.02 * k), seed=k) for k in range(12)])) == []


@pytest.mark.parametrize("at", [4, 7])
def test_a_cut_is_told_with_its_frame(at: int) -> None:
    pictures = [seen(HOME, seed=k, ground=OTHER_GROUND if k >= at else GROUND) for k in range(10)]
    (warning,) = told(film(pictures))
    assert warning.startswith(f"the picture was cut at frame {at} (")


def test_a_zoom_is_told_once_however_many_frames_it_takes() -> None:
    factors = [1.0] * 4 + [1.05**k for k in range(1, 12)] + [1.05**11] * 4
    warnings = [text for text in told(film([seen(zoomed(f), seed=k) for k, f in enumerate(factors)])) if "zoom" in text]
    assert len(warnings) == 1 and "frames" in warnings[0]


def test_a_picture_that_stands_still_is_told_and_one_that_is_shown_twice_is_not() -> None:
    pictures = [seen(flight(0.02 * k), seed=k) for k in range(4)]
    frozen = film(
        [*pictures, *[pictures[-1]] * round(2.5 * FPS), *[seen(flight(0.02 * k), seed=k) for k in range(4, 8)]]
    )
    (warning,) = told(frozen)
    assert warning.startswith(f"the picture stood still in frames 3 to {3 + round(2.5 * FPS)} (")
    assert told(film([picture for picture in pictures for _ in range(2)])) == []


def test_a_clock_that_jumps_is_told_with_how_far() -> None:
    frames = film([seen(flight(0.02 * k), seed=k) for k in range(10)])
    ahead = [one if one.index < 6 else later(one, 30.0) for one in frames]
    assert any(text.startswith("the clock jumped ahead in frames 5 to 6 (") for text in told(ahead))
    back = [one if one.index < 6 else later(one, -0.15) for one in frames]
    assert any(text.startswith("the clock went backwards at frame 6 (") for text in told(back))


def test_a_frame_every_few_seconds_is_no_jump() -> None:
    frames = [later(one, 4.0 * one.index) for one in film([seen(flight(0.02 * k), seed=k) for k in range(8)])]
    assert not any("clock" in text for text in told(frames))


def test_what_happens_all_the_time_is_told_in_one_line() -> None:
    frames = [later(one, 40.0 * (one.index // 6)) for one in film([seen(HOME, seed=k) for k in range(60)])]
    (warning,) = [text for text in told(frames) if "clock" in text]
    assert warning.count("frames") == 5 and warning.endswith("and 4 times more")
