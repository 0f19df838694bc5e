"""Reading video and making pictures, beside OpenCV on the same file.

python -m pytest benchmarks/test_frames.py --benchmark-columns=min,median,iqr --benchmark-group-by=group
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from standoff.core.types import ImageArray
from standoff.stages.frames import AvPicture, Scaler, open_source

SIZES_PX = [(1920, 1080), (3840, 2160)]
FRAMES = 30


def texture(size_px: tuple[int, int]) -> ImageArray:
    coarse = np.random.default_rng(0).integers(60, 190, (size_px[1] // 8, size_px[0] // 8, 3), dtype=np.uint8)
    picture: ImageArray = cv2.resize(coarse, size_px, interpolation=cv2.INTER_CUBIC)
    return picture


@pytest.fixture(scope="module", params=SIZES_PX, ids=["1080p", "2160p"])
def video(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A panning texture, about as hard to decode as a drone's own recording."""
    width_px, height_px = request.param
    path = tmp_path_factory.mktemp("video") / f"{height_px}p.mp4"
    picture = texture((width_px + 4 * FRAMES, height_px))
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"preset": "ultrafast", "crf": "23"})
        stream.width, stream.height, stream.pix_fmt = width_px, height_px, "yuv420p"
        for index in range(FRAMES):
            moved = np.ascontiguousarray(picture[:, 4 * index : 4 * index + width_px])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(moved, format="bgr24")))
        container.mux(stream.encode())
    return path


def read_by_opencv(path: Path) -> int:
    capture, count = cv2.VideoCapture(str(path)), 0
    while capture.read()[0]:
        count += 1
    capture.release()
    return count


def read_ourselves(path: Path, *, convert: bool) -> int:
    with open_source(path) as source:
        return sum(frame.image is not None if convert else True for frame in source)


@pytest.mark.parametrize("reader", ["standoff, no pixels", "standoff, BGR", "cv2.VideoCapture, BGR"])
def test_decode_thirty_frames(benchmark: Callable[..., Any], video: Path, reader: str) -> None:
    benchmark.group = f"decode {FRAMES} frames, {video.stem}"  # type: ignore[attr-defined]
    read = {
        "standoff, no pixels": lambda: read_ourselves(video, convert=False),
        "standoff, BGR": lambda: read_ourselves(video, convert=True),
        "cv2.VideoCapture, BGR": lambda: read_by_opencv(video),
    }[reader]
    assert benchmark(read) == FRAMES


@pytest.mark.parametrize("maker", ["standoff", "BGR, cv2.resize area", "BGR, cv2.resize linear (aliases)"])
@pytest.mark.parametrize("size_px", SIZES_PX, ids=["1080p", "2160p"])
def test_make_the_detectors_picture(benchmark: Callable[..., Any], size_px: tuple[int, int], maker: str) -> None:
    benchmark.group = f"416 px wide, from {size_px[1]}p"  # type: ignore[attr-defined]
    frame = av.VideoFrame.from_ndarray(texture(size_px), format="bgr24").reformat(format="yuv420p")
    scaler = Scaler()
    make = {
        "standoff": lambda: AvPicture(frame, scaler=scaler).resized_bgr(416, 234),
        "BGR, cv2.resize area": lambda: cv2.resize(
            AvPicture(frame, scaler=scaler).bgr(), (416, 234), interpolation=cv2.INTER_AREA
        ),
        "BGR, cv2.resize linear (aliases)": lambda: cv2.resize(AvPicture(frame, scaler=scaler).bgr(), (416, 234)),
    }[maker]
    assert benchmark(make).shape == (234, 416, 3)


@pytest.mark.parametrize("maker", ["standoff", "BGR, cv2.cvtColor"])
@pytest.mark.parametrize("size_px", SIZES_PX, ids=["1080p", "2160p"])
def test_make_the_gray_picture(benchmark: Callable[..., Any], size_px: tuple[int, int], maker: str) -> None:
    benchmark.group = f"gray, {size_px[1]}p"  # type: ignore[attr-defined]
    frame = av.VideoFrame.from_ndarray(texture(size_px), format="bgr24").reformat(format="yuv420p")
    scaler = Scaler()
    make = {
        "standoff": lambda: AvPicture(frame, scaler=scaler).gray(),
        "BGR, cv2.cvtColor": lambda: cv2.cvtColor(AvPicture(frame, scaler=scaler).bgr(), cv2.COLOR_BGR2GRAY),
    }[maker]
    assert benchmark(make).shape == size_px[::-1]
