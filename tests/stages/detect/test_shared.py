from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from time import sleep

import numpy as np
import pytest

from standoff.core import protocols
from standoff.core.types import Detections, Frame
from standoff.stages.detect import OnnxDetector, SharedDetector, find_model
from standoff.stages.frames import frame_from_array


class Alone(protocols.Detector):
    """Fails where two ask at once, and writes down in which order they came."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self._busy = threading.Lock()

    def detect(self, frame: Frame) -> Detections:
        assert self._busy.acquire(blocking=False), "two at once"
        self.asked.append(frame.stream_id)
        sleep(0.002)
        self._busy.release()
        if frame.index == 3:
            raise ValueError("no such frame")
        return Detections.empty()


def test_streams_take_turns_and_a_failure_of_one_is_not_the_others() -> None:
    alone = Alone()
    shared = SharedDetector(alone)
    barrier = threading.Barrier(3)

    def watch(stream_id: str) -> int:
        barrier.wait(5.0)
        failed = 0
        for index in range(8):
            try:
                shared.detect(frame_from_array(np.zeros((4, 4, 3), np.uint8), index=index, stream_id=stream_id))
            except ValueError:
                failed += 1
        return failed

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(watch, "abc")) == [1, 1, 1]
    assert len(alone.asked) == 24
    for start in range(3, 21):
        # Nobody waits for more than the turns of the two others and one that had begun.
        assert set(alone.asked[start : start + 4]) == {"a", "b", "c"} or start > 18


@pytest.mark.live
def test_two_streams_see_with_one_network_what_each_would_alone() -> None:
    detector = OnnxDetector(find_model("site"))
    shared = SharedDetector(detector)
    frames = [
        frame_from_array(np.random.default_rng(seed).integers(0, 255, (360, 640, 3), np.uint8)) for seed in range(4)
    ]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(shared.detect, frames))
    for one, other in zip(together, map(detector.detect, frames), strict=True):
        np.testing.assert_array_equal(one.xyxy_px, other.xyxy_px)
