"""The clock that a camera films is read as it was shown, or not at all."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from standoff.core.types import ImageArray
from standoff.service.latency import clock_picture, read_clock

UNIX_S = 1_770_000_123.456


def filmed(
    code: ImageArray, height_px: int, frame_px: tuple[int, int] = (1280, 720), blur_px: float = 0.0, noise: float = 0.0
) -> ImageArray:
    """Return a picture of a grey room in which the code hangs somewhere."""
    width_px, room_px = frame_px
    room = np.full((room_px, width_px), 120, np.uint8)
    small = cv2.resize(code, (height_px, height_px), interpolation=cv2.INTER_AREA)
    top, left = (room_px - height_px) // 2, (width_px - height_px) // 3
    room[top : top + height_px, left : left + height_px] = small
    if blur_px:
        room = cv2.GaussianBlur(room, (0, 0), blur_px)
    shaken = room + np.random.default_rng(0).normal(0.0, noise, room.shape)
    return np.clip(shaken, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("unix_s", [UNIX_S, 1_770_000_000.0, 1_000_000_000.001, 2_500_000_000.999])
def test_a_clock_is_read_to_the_millisecond(unix_s: float) -> None:
    assert read_clock(clock_picture(unix_s)) == pytest.approx(unix_s, abs=6e-4)


@pytest.mark.parametrize("module_px", [4, 8, 16])
def test_it_is_read_at_every_size_in_which_it_is_drawn(module_px: int) -> None:
    assert read_clock(clock_picture(UNIX_S, module_px)) == UNIX_S


@pytest.mark.parametrize("height_px", [180, 400])
def test_a_camera_reads_it_from_a_quarter_of_its_picture_on(height_px: int) -> None:
    assert read_clock(filmed(clock_picture(UNIX_S), height_px)) == UNIX_S


@pytest.mark.parametrize(("blur_px", "noise"), [(1.0, 0.0), (1.5, 8.0), (0.0, 20.0)])
def test_it_is_read_through_blur_and_noise(blur_px: float, noise: float) -> None:
    assert read_clock(filmed(clock_picture(UNIX_S), 400, blur_px=blur_px, noise=noise)) == UNIX_S


def test_it_is_read_in_a_picture_of_four_times_as_many_pixels() -> None:
    assert read_clock(filmed(clock_picture(UNIX_S), 900, (3840, 2160))) == UNIX_S


def test_what_shows_no_clock_is_no_clock() -> None:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (360, 640), dtype=np.uint8)
    code = cv2.QRCodeEncoder.create().encode("https://example.org/")
    other = np.kron(np.pad(code, 4, constant_values=255), np.ones((8, 8), np.uint8))
    for picture in (np.zeros((360, 640), np.uint8), noise, other, filmed(clock_picture(UNIX_S), 400, blur_px=30.0)):
        assert read_clock(picture) is None


def test_two_moments_are_two_pictures() -> None:
    one, other = clock_picture(UNIX_S), clock_picture(UNIX_S + 0.001)
    assert one.shape == other.shape and (one != other).any()
    assert (one[:16] == 255).all() and (one[:, :16] == 255).all()


@pytest.mark.parametrize("blur_px", [2.0, 5.0])
def test_a_clock_that_is_hard_to_read_is_read_right_or_not_at_all(blur_px: float) -> None:
    for noise in (10.0, 50.0):
        assert read_clock(filmed(clock_picture(UNIX_S), 300, blur_px=blur_px, noise=noise)) in (None, UNIX_S)
