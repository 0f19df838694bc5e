from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import drawn_clip
import numpy as np
import pytest
from labelled_sets import write_yolo

from standoff.core import protocols
from standoff.core.errors import ConfigError, DataError
from standoff.core.types import Detections, Frame
from standoff.evaluation.detection.detector_trial import find_all
from standoff.evaluation.detection.grouping import site_grouping
from standoff.evaluation.detection.localisation import ale_by_class_m
from standoff.evaluation.detection.material import Material, open_material
from standoff.evaluation.detection.score import score_detections
from standoff.evaluation.paper.localisation import true_scale_m_per_px

SHIFT_PX = 0.5


class ShiftedTruth(protocols.Detector):
    """Sees every true box a little to the right, and remembers which frames it was shown."""

    def __init__(self, material: Material) -> None:
        rows = zip(material.frame_index.tolist(), material.truth, strict=True)
        self._truth = dict(rows)
        self.shown: list[int] = []

    def detect(self, frame: Frame) -> Detections:
        self.shown.append(frame.index)
        truth = self._truth[frame.index]
        return Detections(
            truth.xyxy_px + np.array([SHIFT_PX, 0.0, SHIFT_PX, 0.0]), np.full(len(truth.class_id), 0.9), truth.class_id
        )


def opened(path: Path, **other: object) -> Material:
    options: dict[str, object] = {"split": "test", "video": None, "frames": None, "limit": None}
    return open_material(path, **(options | other))  # type: ignore[arg-type]


def write_people(path: Path, rows: Sequence[tuple[float, ...]]) -> Path:
    lines = ["frame,id,x,y,w,h,conf,X,Y", *(",".join(f"{value:g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_clip_has_what_can_be_seen_and_ignores_what_nobody_would_mark(seen_clip: Path) -> None:
    material = opened(seen_clip)
    assert len(material.truth) == drawn_clip.FRAMES
    for frame, truth in enumerate(material.truth):
        expected = {0, 2, 6} | ({1} if frame not in drawn_clip.UNSEEN else set())
        assert set(truth.class_id.tolist()) == expected
        assert truth.class_id[truth.ignored].tolist() == [2]
    assert [frame.index for frame in material.frames()] == list(range(drawn_clip.FRAMES))


@pytest.mark.parametrize("limit", [None, 7, 1000])
def test_ale_is_the_shift_times_the_true_scale(seen_clip: Path, limit: int | None) -> None:
    material = opened(seen_clip, limit=limit)
    assert len(material.truth) == min(limit or drawn_clip.FRAMES, drawn_clip.FRAMES)
    detector = ShiftedTruth(material)
    found, times_ms = find_all(detector, material)
    assert sorted(set(detector.shown)) == material.frame_index.tolist()
    assert len(times_ms) == len(material.truth) and (times_ms > 0.0).all()
    score = score_detections(material.truth, found, site_grouping().classes)
    assert material.clip is not None and material.clip.reference is not None
    scale = true_scale_m_per_px(material.clip.reference)[material.frame_index]
    reference_m = ale_by_class_m(score, material)["reference"]
    assert reference_m == pytest.approx(SHIFT_PX * scale.mean())
    assert set(ale_by_class_m(score, material)) == {"worker", "excavator", "reference"}


def test_people_in_a_table_are_taken_frame_by_frame(tmp_path: Path, seen_clip: Path) -> None:
    rows = [(1, 1, 10, 20, 30, 60, 1, 0, 0), (3, 1, 12, 20, 30, 60, 1, 0, 0), (3, 2, -20, 90, 40, 50, 0, 0, 0)]
    csv = write_people(tmp_path / "gt.csv", rows)
    material = opened(csv, video=seen_clip / "video.mp4")
    assert [len(one.xyxy_px) for one in material.truth] == [1, 0, 2]
    assert material.truth[0].xyxy_px.tolist() == [[10.0, 20.0, 40.0, 80.0]]
    last = material.truth[2]
    assert last.ignored.tolist() == [False, True]
    assert last.xyxy_px[1].tolist() == [-0.5, 90.0, 20.0, 140.0]
    assert [frame.index for frame in material.frames()] == [0, 1, 2]
    part = opened(csv, video=seen_clip / "video.mp4", frames=(3, 3))
    assert part.frame_index.tolist() == [2]
    later = write_people(tmp_path / "later.csv", rows[1:])
    assert opened(later, video=seen_clip / "video.mp4").frame_index.tolist() == [2]


def test_labelled_pictures_come_under_the_sites_classes(tmp_path: Path) -> None:
    names = [f"{split}/{k}" for split in ("train", "test") for k in range(3)]
    folder = write_yolo(tmp_path / "set", dict.fromkeys(names, "1 0.5 0.5 0.5 0.5\n"), names=("tree", "person"))
    material = opened(folder)
    assert len(material.truth) == 3
    assert all(one.class_id.tolist() == [0] for one in material.truth)
    assert [frame.size_px for frame in material.frames()] == [(40, 30)] * 3
    assert ale_by_class_m(score_detections(material.truth, [Detections.empty()] * 3, ("worker",)), material) == {}
    with pytest.raises(DataError, match=r"split val of .*3 in train, 3 in test.*--split"):
        opened(folder, split="val")


def test_a_video_that_is_too_short_is_one_line(tmp_path: Path, seen_clip: Path) -> None:
    beyond = drawn_clip.FRAMES + 1
    csv = write_people(tmp_path / "gt.csv", [(1, 1, 10, 20, 30, 60, 1, 0, 0), (beyond, 1, 10, 20, 30, 60, 1, 0, 0)])
    material = opened(csv, video=seen_clip / "video.mp4")
    with pytest.raises(DataError, match=f"expected {beyond} pictures .* found {drawn_clip.FRAMES}"):
        find_all(ShiftedTruth(material), material)


def test_frames_without_people_are_one_line(tmp_path: Path, seen_clip: Path) -> None:
    csv = write_people(tmp_path / "gt.csv", [(1, 1, 10, 20, 30, 60, 1, 0, 0)])
    with pytest.raises(DataError, match="frames 5-9"):
        opened(csv, video=seen_clip / "video.mp4", frames=(5, 9))


def test_a_table_needs_its_video_and_nothing_else_takes_one(tmp_path: Path, seen_clip: Path) -> None:
    with pytest.raises(ConfigError, match="--video FILE"):
        opened(write_people(tmp_path / "gt.csv", []))
    with pytest.raises(ConfigError, match="Leave --video"):
        opened(seen_clip, video=seen_clip / "video.mp4")
