"""How old a picture is follows from its sender's word as it was first given: clocks that are set change no age."""

from __future__ import annotations

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.types import ImageArray
from standoff.service.live.capture import Passage
from standoff.stages.frames import LivePicture

UNIX_S = 1_770_000_000.0
HOUR_S = 3600.0


def frame_of(gray: ImageArray, padding: int = 0) -> av.VideoFrame:
    """Return a picture whose lines are longer than the picture is wide, filled with something."""
    frame = av.VideoFrame(gray.shape[1], gray.shape[0], "gray")
    plane = frame.planes[0]
    lines = np.full((gray.shape[0], plane.line_size), padding, np.uint8)
    lines[:, : gray.shape[1]] = gray
    plane.update(lines.tobytes())
    return frame


GRAY = np.random.default_rng(0).integers(0, 256, (18, 33), dtype=np.uint8)


def picture(told_unix_s: float | None = None, frame: av.VideoFrame | None = None, stamp_s: float = 0.0) -> LivePicture:
    return LivePicture(frame_of(GRAY) if frame is None else frame, stamp_s, told_unix_s)


def test_the_delay_is_what_passed_since_the_sender_took_the_picture() -> None:
    passage = Passage(3)
    told = passage.about(picture(UNIX_S - 0.25, stamp_s=7.5), 100.0, UNIX_S)
    assert (told["connection"], told["stamp_s"], told["arrived_s"], told["arrived_unix_s"]) == (3, 7.5, 100.0, UNIX_S)
    assert told["delay_s"] == pytest.approx(0.25)
    assert (told["told_by"], told["told_unix_s"]) == ("rtcp", UNIX_S - 0.25)


def test_a_sender_that_says_nothing_has_no_delay() -> None:
    told = Passage(1).about(picture(), 100.0, UNIX_S)
    assert (told["delay_s"], told["told_unix_s"], told["told_by"]) == (None, None, "arrival")


def test_what_was_told_holds_for_the_pictures_after_it_and_not_for_ever() -> None:
    passage = Passage(1)
    passage.about(picture(UNIX_S - 0.25), 100.0, UNIX_S)
    for passed_s, delay_s in ((0.04, 0.25), (29.9, 0.25), (3600.0, None)):
        told = passage.about(picture(), 100.0 + passed_s, UNIX_S + passed_s)
        assert told["told_by"] == "arrival"
        assert told["delay_s"] == (None if delay_s is None else pytest.approx(delay_s))


@pytest.mark.parametrize("told_unix_s", [UNIX_S - 61.0, UNIX_S + 1.5, 0.0, -1e9, 1e300, 2_208_988_800.0])
def test_a_time_that_cannot_be_is_not_taken(told_unix_s: float) -> None:
    passage = Passage(1)
    told = passage.about(picture(told_unix_s), 100.0, UNIX_S)
    assert (told["delay_s"], told["told_by"], told["told_unix_s"]) == (None, "arrival", None)
    assert passage.about(picture(UNIX_S - 0.5), 100.0, UNIX_S)["delay_s"] == pytest.approx(0.5)
    later = passage.about(picture(told_unix_s + 1.0), 101.0, UNIX_S + 1.0)
    assert later["delay_s"] == pytest.approx(0.5) and later["told_by"] == "arrival"


def test_a_sender_whose_clock_is_a_little_ahead_has_no_delay_rather_than_less() -> None:
    assert Passage(1).about(picture(UNIX_S + 0.5), 100.0, UNIX_S)["delay_s"] == 0.0


@given(
    delay_s=st.floats(0.0, 50.0),
    steps=st.lists(st.tuples(st.floats(0.01, 20.0), st.sampled_from([-HOUR_S, -1.0, 0.0, 1.0, HOUR_S])), max_size=20),
)
def test_a_wall_clock_that_is_set_in_mid_connection_changes_no_delay(
    delay_s: float, steps: list[tuple[float, float]]
) -> None:
    passage, now_s, set_by_s = Passage(1), 500.0, 0.0
    for passed_s, change_s in [(0.0, 0.0), *steps]:
        now_s += passed_s
        set_by_s += change_s
        taken_unix_s = UNIX_S + now_s - 500.0 - delay_s
        told = passage.about(picture(taken_unix_s), now_s, UNIX_S + now_s - 500.0 + set_by_s)
        assert told["told_by"] == "rtcp"
        assert told["delay_s"] == pytest.approx(delay_s, abs=1e-5)


def test_each_connection_asks_for_the_wall_clock_anew() -> None:
    Passage(1).about(picture(UNIX_S - 0.5), 100.0, UNIX_S)
    after = Passage(2).about(picture(UNIX_S + HOUR_S - 0.5), 101.0, UNIX_S + HOUR_S)
    assert after["delay_s"] == pytest.approx(0.5)


SIZES = [(65, 36), (640, 360), (1280, 720), (101, 51)]


def scene(size_px: tuple[int, int], seed: int = 0) -> ImageArray:
    rng = np.random.default_rng(seed)
    gray: ImageArray = rng.integers(60, 180, size_px[::-1], dtype=np.uint8)
    return gray


def moved(gray: ImageArray) -> ImageArray:
    """Return a picture in which a twentieth of the ground is covered by something bright."""
    other = gray.copy()
    height_px, width_px = gray.shape
    other[height_px // 2 : height_px * 3 // 4, width_px // 2 : width_px * 7 // 10] = 250
    return other


def changes(frames: list[av.VideoFrame]) -> list[float]:
    passage = Passage(1)
    told = [passage.about(picture(frame=frame), float(now_s), UNIX_S) for now_s, frame in enumerate(frames)]
    return [float(one["changed_s"] or 0.0) for one in told]


@pytest.mark.parametrize("size_px", SIZES)
def test_a_picture_that_comes_again_is_known_since_when(size_px: tuple[int, int]) -> None:
    gray = scene(size_px)
    frames = [frame_of(one) for one in (gray, gray, gray, moved(gray), moved(gray), gray)]
    assert changes(frames) == [0, 0, 0, 3, 3, 5]


@pytest.mark.parametrize("size_px", SIZES)
def test_what_coding_anew_does_to_a_picture_is_no_change_of_it(size_px: tuple[int, int]) -> None:
    rng, gray = np.random.default_rng(5), scene(size_px)
    noisy = [(gray + rng.integers(-2, 3, gray.shape)).astype(np.uint8) for _ in range(5)]
    assert changes([frame_of(one) for one in noisy]) == [0] * 5


def test_a_picture_of_another_size_is_another_picture() -> None:
    assert changes([frame_of(scene(size_px)) for size_px in SIZES]) == [0, 1, 2, 3]


@pytest.mark.parametrize("every", [1, 2, 5])
def test_key_frames_are_pictures_like_others(every: int) -> None:
    """Some cameras send nothing else: what moves in them moves."""
    gray = scene((640, 360))
    frames = [frame_of(moved(gray) if number // every % 2 else gray) for number in range(8)]
    still = [frame_of(gray) for _ in range(8)]
    for frame in (*frames, *still):
        frame.key_frame = True
    assert changes(frames) == [float(number // every * every) for number in range(8)]
    assert changes(still) == [0] * 8


def test_the_key_frame_that_codes_a_still_scene_anew_is_no_change_of_it() -> None:
    gray = scene((640, 360))
    frames = [frame_of(np.clip(gray + (30 if number % 4 == 3 else 0), 0, 255).astype(np.uint8)) for number in range(8)]
    for number, frame in enumerate(frames):
        frame.key_frame = number % 4 == 3
    # What comes after it corrects it, and that counts: once in each group, and no longer than the group lasts.
    assert all(changed_s % 4 == 0 for changed_s in changes(frames))


def test_what_lies_behind_the_end_of_a_line_is_no_part_of_the_picture() -> None:
    gray = scene((65, 36))
    frames = [frame_of(gray, padding) for padding in (0, 7, 255)]
    assert frames[0].planes[0].line_size > gray.shape[1]
    assert changes(frames) == [0, 0, 0]


@pytest.mark.parametrize("size_px", [(2, 2), (34, 18), (64, 6), (1280, 720)])
def test_coded_pictures_of_all_sizes_are_looked_at(size_px: tuple[int, int]) -> None:
    width_px, height_px = size_px
    planes = np.random.default_rng(1).integers(0, 128, (height_px * 3 // 2, width_px), dtype=np.uint8)
    frames = [av.VideoFrame.from_ndarray(one, format="yuv420p") for one in (planes, planes, planes + np.uint8(100))]
    found = changes(frames)
    assert found[:2] == [0, 0]
    if width_px * height_px >= 64 * 16:
        assert found[2] == 2
