"""What the same work costs in OpenCV, the library that everybody would use, on the same source in the same run."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2

from standoff.core.errors import ModelError, SourceError
from standoff.core.protocols import Detector
from standoff.core.types import Frame
from standoff.evaluation.drawn_quadrilaterals import draw_quadrilateral
from standoff.evaluation.rectification import time_ransac
from standoff.evaluation.timing import Baseline, Spread
from standoff.stages.frames import open_source

_ROUNDS = 3


def _ms(work: Callable[[], object]) -> float:
    start_s = perf_counter()
    work()
    return (perf_counter() - start_s) * 1e3


def ransac_baseline(scenes: int = 5) -> Baseline:
    """Fit the paper's four lines to drawn quadrilaterals, compiled and as a literal Python loop."""
    drawn = [draw_quadrilateral("clean", seed=0, index=index) for index in range(scenes)]
    time_ransac(drawn[:1])  # compiles
    ours_ms, theirs_ms, _ = time_ransac(drawn)
    return Baseline(
        name="four lines, 4 x 2000 hypotheses",
        ours="compiled by numba",
        theirs="the same algorithm, Python loop",
        ours_ms=Spread.of(ours_ms),
        theirs_ms=Spread.of(theirs_ms),
    )


def decoding_baseline(path: Path, frames: int = 100) -> Baseline:
    """Decode a video file to full-size BGR, by standoff and by OpenCV in turns.

    Raises:
        SourceError: Either of the two cannot read it.
    """
    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(_ROUNDS):
        _decode_ourselves(path, frames, ours)
        _decode_by_opencv(path, frames, theirs)
    return Baseline(
        name="decode a frame to BGR",
        ours="PyAV, threads for frames and slices",
        theirs="cv2.VideoCapture.read",
        ours_ms=Spread.of(ours),
        theirs_ms=Spread.of(theirs),
    )


def _decode_ourselves(path: Path, frames: int, times_ms: list[float]) -> None:
    with open_source(path) as source:
        iterator = iter(source)
        for _ in range(frames):
            start_s = perf_counter()
            frame = next(iterator, None)
            if frame is None:
                return
            frame.picture.bgr()
            times_ms.append((perf_counter() - start_s) * 1e3)


def _decode_by_opencv(path: Path, frames: int, times_ms: list[float]) -> None:
    capture = cv2.VideoCapture(str(path))
    try:
        if not capture.isOpened():
            raise SourceError(
                expected="a video that OpenCV can read, to compare with", found=path.name, fix="leave this baseline out"
            )
        for _ in range(frames):
            start_s = perf_counter()
            if not capture.read()[0]:
                return
            times_ms.append((perf_counter() - start_s) * 1e3)
    finally:
        capture.release()


def picture_baselines(
    path: Path, *, fps: float | None = None, frames: int = 100, width_px: int = 416
) -> tuple[Baseline, ...]:
    """Make a small BGR picture and a gray one from each decoded frame, by standoff and from full-size BGR by OpenCV.

    Args:
        path: Video file or image folder.
        fps: Images a second of a folder.
        frames: How many frames.
        width_px: Width of the small picture; its height follows.
    """
    small: tuple[list[float], list[float]] = ([], [])
    gray: tuple[list[float], list[float]] = ([], [])
    with open_source(path, fps=fps) as source:
        height_px = max(1, round(width_px * source.size_px[1] / source.size_px[0]))
        for frame in islice(source, frames):
            picture = frame.picture
            gray[0].append(_ms(picture.gray))
            small[0].append(_ms(partial(picture.resized_bgr, width_px, height_px)))
            convert_ms = _ms(picture.bgr)
            shrink = partial(cv2.resize, picture.bgr(), (width_px, height_px), interpolation=cv2.INTER_AREA)
            small[1].append(convert_ms + _ms(shrink))
            gray[1].append(convert_ms + _ms(partial(cv2.cvtColor, picture.bgr(), cv2.COLOR_BGR2GRAY)))
    return (
        Baseline(
            name=f"make the detector's picture, {width_px}x{height_px}",
            ours="scaled inside swscale, then BGR",
            theirs="full-size BGR, then cv2.resize INTER_AREA",
            ours_ms=Spread.of(small[0]),
            theirs_ms=Spread.of(small[1]),
        ),
        Baseline(
            name="make the gray picture",
            ours="the coded luma plane",
            theirs="full-size BGR, then cv2.cvtColor",
            ours_ms=Spread.of(gray[0]),
            theirs_ms=Spread.of(gray[1]),
        ),
    )


def detection_baseline(
    detector: Detector, frames: list[Frame], cfg: Path, weights: Path, size_px: tuple[int, int]
) -> Baseline:
    """Run the model on frames, by standoff and, from its Darknet files, by OpenCV's dnn without suppression.

    Args:
        detector: Ours.
        frames: On which.
        cfg: The network as Darknet describes it.
        weights: Its weights.
        size_px: (width, height) of the input of both.

    Raises:
        ModelError: OpenCV cannot read the Darknet files.
    """
    try:
        network: Any = cv2.dnn.readNetFromDarknet(str(cfg), str(weights))
    except cv2.error as error:
        raise ModelError(
            expected="Darknet files that OpenCV reads",
            found=f"{cfg.name} and {weights.name}: {error}",
            fix="leave this baseline out",
        ) from error
    outputs = network.getUnconnectedOutLayersNames()
    ours: list[float] = []
    theirs: list[float] = []

    def detect_by_opencv(frame: Frame) -> None:
        network.setInput(cv2.dnn.blobFromImage(frame.image, 1 / 255, size_px, swapRB=True))
        network.forward(outputs)

    detector.detect(frames[0])
    detect_by_opencv(frames[0])
    for frame in frames:
        ours.append(_ms(partial(detector.detect, frame)))
        theirs.append(_ms(partial(detect_by_opencv, frame)))
    return Baseline(
        name=f"detect, {size_px[0]}x{size_px[1]}",
        ours="ONNX Runtime, with suppression",
        theirs="OpenCV dnn, network only",
        ours_ms=Spread.of(ours),
        theirs_ms=Spread.of(theirs),
    )
