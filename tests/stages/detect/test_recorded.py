from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from clips.test_detections_table import RESULT, SOURCE, result_of, some, write

from standoff.core.errors import DataError
from standoff.core.protocols import Detector
from standoff.core.types import Frame
from standoff.stages.detect import RecordedDetector
from standoff.stages.frames import frame_from_array


@pytest.fixture
def detector(tmp_path: Path) -> RecordedDetector:
    """Frames 0, 2, 4, 6: two detections, none, not asked, one."""
    return RecordedDetector(write(tmp_path, [some(2), some(0), None, some(1)]))


def frame(index: int) -> Frame:
    return result_of(index, None).frame


def test_each_frame_gets_its_own_detections(detector: RecordedDetector) -> None:
    assert [len(detector.detect(frame(index))) for index in (6, 0, 2, 0)] == [1, 2, 0, 2]
    np.testing.assert_array_equal(detector.detect(frame(0)).xyxy_px, some(2).xyxy_px)


def test_seeing_nothing_is_not_resting(detector: RecordedDetector) -> None:
    assert isinstance(detector, Detector)
    assert [detector.rests(frame(index)) for index in (0, 2, 4, 6)] == [False, False, True, False]
    with pytest.raises(DataError, match="rested"):
        detector.detect(frame(4))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (frame(3), "found frames 0 to 6, read with --every 2"),
        (frame(8), r"expected frame 8 \(0.320 s\)"),
        (replace(frame(2), time_s=0.081), "frame 2 at 0.080000 s .*site.mp4.*found it at 0.081000 s"),
        (frame_from_array(np.zeros((90, 160, 3), np.uint8)), "320x180 .*found 160x90"),
    ],
)
def test_a_frame_of_another_source_or_selection_is_refused(detector: RecordedDetector, asked: Frame, said: str) -> None:
    for ask in (detector.detect, detector.rests):
        with pytest.raises(DataError, match=said):
            ask(asked)


def test_a_run_without_frames_has_none_to_give(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no frame at all"):
        RecordedDetector(write(tmp_path, [])).detect(RESULT.frame)


def test_another_source_is_refused_before_a_frame_is_read(detector: RecordedDetector) -> None:
    detector.check_source(SOURCE)
    detector.check_source({"name": "a source without a fingerprint"})
    detector.prepare((320, 180))
    with pytest.raises(DataError, match=r"site.mp4.*other.mp4 with other content"):
        detector.check_source({**SOURCE, "name": "other.mp4", "fingerprint": "abd"})
    with pytest.raises(DataError, match="640x360"):
        detector.prepare((640, 360))


def test_the_description_names_the_recording_and_the_true_detector(detector: RecordedDetector, tmp_path: Path) -> None:
    about = detector.describe()
    assert about["kind"] == "recorded"
    assert about["file"] == str(tmp_path / "detections.parquet")
    assert about["detector"]["model"] == "yolo.onnx"
    assert about["class_map"] == {"person": "worker"}
