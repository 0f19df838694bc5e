"""Pictures over RTSP are whole, however the encoder cuts them into parts."""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from service.live.feed import Camera
from service.live.servers import rtsp_server

from standoff.core.types import ImageArray
from standoff.stages.frames import LiveAddress, LiveStream

pytestmark = pytest.mark.live
SIZE_PX = (640, 360)
BITS, SIDE_PX = 10, 40
ROWS_PX = (0, 170, 340)


class Numbered:
    """Draws rough ground that moves, with the number of the picture at its top, in its middle and at its bottom."""

    def __init__(self) -> None:
        self.number = 0
        self._ground = np.random.default_rng(0).integers(60, 190, (SIZE_PX[1], SIZE_PX[0], 3), dtype=np.uint8)

    def draw(self, _time_s: float) -> ImageArray:
        self.number += 1
        picture = np.roll(self._ground, 3 * self.number, axis=1)
        for row in ROWS_PX:
            for bit in range(BITS):
                picture[row : row + 20, bit * SIDE_PX : (bit + 1) * SIDE_PX] = 255 * (self.number >> bit & 1)
        return picture


def numbers_in(gray: ImageArray) -> set[int]:
    cells = [
        [gray[row + 6 : row + 14, bit * SIDE_PX + 10 : bit * SIDE_PX + 30] for bit in range(BITS)] for row in ROWS_PX
    ]
    return {sum(1 << bit for bit, cell in enumerate(row) if cell.mean() > 128) for row in cells}


@pytest.mark.parametrize("slices", [1, 2, 4])
def test_all_parts_of_a_picture_are_of_the_same_moment_and_none_comes_twice(slices: int, tmp_path: Path) -> None:
    drawn, seen = Numbered(), list[int]()
    with (
        rtsp_server(tmp_path) as sender,
        Camera(drawn.draw, sender.write, size_px=SIZE_PX, slices=slices),
        LiveStream(LiveAddress.read(sender.address)) as stream,
    ):
        until_s = time.monotonic() + 20.0
        for picture in stream:
            numbers = numbers_in(picture.frame.to_ndarray(format="gray"))
            assert len(numbers) == 1, f"picture {len(seen)} shows {numbers}"
            seen += numbers
            if len(seen) >= 80 or time.monotonic() > until_s:
                break
    assert len(seen) >= 80
    assert all(later > earlier for earlier, later in pairwise(seen))
