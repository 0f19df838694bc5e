from __future__ import annotations

import csv
import json
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import supervision
from hypothesis import given
from hypothesis import strategies as st
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO

from standoff.core import protocols
from standoff.core.errors import SourceError
from standoff.core.types import Detections, Frame, ImageArray
from standoff.stages.frames import ArrayPicture
from standoff.training.frame_selection import LabelPlan, LabelReport, SelectionParams, choose, label_frames
from standoff.training.frame_selection.appearance import blurred, describe, sharpness
from standoff.training.frame_selection.candidates import look_through
from standoff.training.frame_selection.doubt import doubt, flickering
from standoff.training.frame_selection.selection import CandidateFrame

WIDTH_PX, HEIGHT_PX, FPS = 160, 96, 10
_NOTHING = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64))


@contextmanager
def _quiet(what: str, total: int | None) -> Generator[Callable[[], None], None, None]:
    yield lambda: None


def _boxes(*rows: tuple[float, float, float, float, float]) -> Detections:
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return Detections(table[:, :4], table[:, 4], np.zeros(len(table), np.int64))


def _picture(frame: int) -> ImageArray:
    """Draw a scene that changes every second, with a bright square that moves a pixel a frame."""
    rng = np.random.default_rng(frame // FPS)
    coarse = rng.integers(30, 160, (6, 10, 3), dtype=np.uint8)
    image = cv2.resize(coarse, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_NEAREST)
    image[40:56, frame % 140 : frame % 140 + 16] = 255
    return np.asarray(image)


class BrightSquare(protocols.Detector):
    """Find the bright square; as unsure of it as the frame's number says."""

    def __init__(self, score_of: Callable[[int], float]) -> None:
        self._score_of = score_of

    def detect(self, frame: Frame) -> Detections:
        left = float(frame.index % 140) - 0.5
        score = self._score_of(frame.index)
        return _boxes((left, 39.5, left + 16.0, 55.5, score)) if score else _NOTHING


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "drawn.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = WIDTH_PX, HEIGHT_PX, "yuv420p"
        stream.bit_rate = 4_000_000
        for number in range(60):
            for packet in stream.encode(av.VideoFrame.from_ndarray(_picture(number), format="bgr24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def _label(
    source: Path, folder: Path, detector: BrightSquare, frames: int, every_s: float | None = None
) -> LabelReport:
    folder.mkdir()
    plan = LabelPlan(source, SelectionParams(frames=frames), every_s=every_s, fps=1.0 if source.is_dir() else None)
    return label_frames(plan, detector, folder, _quiet)


@given(st.floats(0, 1), st.floats(0.01, 0.99))
def test_doubt_is_largest_at_the_threshold_and_none_where_all_is_clear(score: float, threshold: float) -> None:
    at, ends = doubt(np.array([threshold]), threshold), doubt(np.array([0.0, 1.0]), threshold)
    here = doubt(np.array([score]), threshold)[0]
    assert at[0] == pytest.approx(1.0) and ends.tolist() == [0.0, 0.0]
    assert 0.0 <= here <= 1.0
    nearer = doubt(np.array([0.5 * (score + threshold)]), threshold)[0]
    assert nearer >= here - 1e-12


def test_a_box_flickers_if_the_next_frame_has_nothing_there() -> None:
    now = _boxes((0, 0, 20, 40, 0.9), (50, 0, 70, 40, 0.9), (90, 0, 99, 9, 0.1))
    following = _boxes((2, 1, 22, 41, 0.06), (66, 30, 90, 70, 0.9))
    assert flickering(now, following, 0.3).tolist() == [False, True, False]
    assert flickering(now, _NOTHING, 0.3).tolist() == [True, True, False]
    assert flickering(_NOTHING, now, 0.3).tolist() == []


def test_boxes_of_another_class_are_no_counterpart() -> None:
    now = _boxes((0, 0, 20, 40, 0.9))
    other = Detections(now.xyxy_px, now.score, now.class_id + 5)
    assert flickering(now, now, 0.3).tolist() == [False]
    assert flickering(now, other, 0.3).tolist() == [True]


@pytest.mark.parametrize("seed", range(3))
def test_flicker_agrees_with_cocos_overlap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0, 60, (2, 25, 2))
    boxes = np.concatenate([corners, corners + rng.uniform(5, 40, (2, 25, 2))], axis=2)
    now, following = (Detections(xyxy, np.full(25, 0.9), np.zeros(25, np.int64)) for xyxy in boxes)
    xywh = np.concatenate([boxes[..., :2], boxes[..., 2:] - boxes[..., :2]], axis=2)
    overlap = coco_mask.iou(xywh[0], xywh[1], [0] * 25)
    assert flickering(now, following, 0.3).tolist() == (overlap < 0.3).all(axis=1).tolist()


@pytest.mark.parametrize("seed", range(3))
def test_a_frame_blurred_by_a_turn_is_told_from_its_neighbours(seed: int) -> None:
    rng = np.random.default_rng(seed)
    images = [cv2.GaussianBlur(rng.integers(0, 256, (120, 200, 3), dtype=np.uint8), (0, 0), 1.0) for _ in range(12)]
    images[5] = cv2.blur(images[5], (9, 1))
    sharp = np.array([sharpness(ArrayPicture(image)) for image in images])
    assert np.flatnonzero(blurred(sharp)).tolist() == [5]


def test_a_description_changes_with_colour_edges_and_what_is_found() -> None:
    plain = np.full((96, 160, 3), 90, np.uint8)
    red, striped = plain.copy(), plain.copy()
    red[:48, :80, 2] = 200
    striped[:, ::8] = 160
    base = describe(ArrayPicture(plain), _NOTHING)
    others = [
        describe(ArrayPicture(red), _NOTHING),
        describe(ArrayPicture(striped), _NOTHING),
        describe(ArrayPicture(plain), _boxes((0, 0, 20, 20, 0.9))),
    ]
    assert all(np.abs(other - base).max() > 0.01 for other in others)
    assert np.isfinite(others).all() and base.shape == (192,)


def _candidates(rng: np.random.Generator, count: int) -> list[CandidateFrame]:
    return [
        CandidateFrame(
            index=5 * number,
            time_s=0.2 * number,
            detections=_NOTHING,
            doubt=float(rng.uniform(0, 3)),
            flicker=int(rng.integers(2)),
            sharpness=float(rng.choice([10.0, 10.5, 1.0], p=[0.45, 0.45, 0.1])),
            look=rng.normal(size=6),
        )
        for number in range(count)
    ]


@given(st.integers(0, 10_000), st.integers(0, 60), st.integers(1, 40), st.sampled_from([0.0, 0.5, 1.0]))
def test_chosen_frames_are_sharp_apart_in_time_and_no_more_than_wanted(
    seed: int, count: int, wanted: int, gap_s: float
) -> None:
    candidates = _candidates(np.random.default_rng(seed), count)
    params = SelectionParams(frames=wanted, least_gap_s=gap_s)
    chosen = [choice.candidate for choice in choose(candidates, params)]
    assert len(chosen) <= wanted and bool(chosen) == bool(candidates)
    times = np.array([one.time_s for one in chosen])
    assert (np.diff(times) >= max(gap_s, 0.19) - 1e-9).all()
    is_blurred = blurred(np.array([one.sharpness for one in candidates]))
    allowed = {one.index for one, bad in zip(candidates, is_blurred, strict=True) if not bad}
    assert {one.index for one in chosen} <= allowed
    assert [one.index for one in chosen] == [
        choice.candidate.index for choice in choose(_candidates(np.random.default_rng(seed), count), params)
    ]


@given(st.integers(0, 10_000), st.integers(1, 20))
def test_wanting_more_frames_keeps_those_already_chosen(seed: int, wanted: int) -> None:
    candidates = _candidates(np.random.default_rng(seed), 40)
    few, many = (
        {choice.candidate.index for choice in choose(candidates, SelectionParams(frames=count))}
        for count in (wanted, wanted + 5)
    )
    assert few <= many


@pytest.mark.parametrize("seed", range(3))
def test_one_frame_of_each_scene_comes_before_a_second_of_any(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scenes = rng.normal(size=(6, 8)) * 20
    candidates = [
        CandidateFrame(n, float(n), _NOTHING, 1.0, 0, 10.0, scenes[n // 10] + rng.normal(size=8) * 0.01)
        for n in range(60)
    ]
    chosen = choose(candidates, SelectionParams(frames=6))
    assert sorted(choice.candidate.index // 10 for choice in chosen) == list(range(6))


@pytest.mark.parametrize("seed", range(3))
def test_of_frames_that_look_alike_the_unsure_ones_are_chosen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    doubts = rng.permutation(np.repeat([0.0, 5.0], 50))
    candidates = [CandidateFrame(n, float(n), _NOTHING, doubts[n], 0, 10.0, rng.normal(size=12)) for n in range(100)]
    chosen = choose(candidates, SelectionParams(frames=20))
    assert np.mean([choice.candidate.doubt for choice in chosen]) > 4.5
    assert choose(candidates, SelectionParams(frames=1))[0].candidate.doubt == 5.0


def test_the_same_picture_again_is_not_worth_labelling() -> None:
    look = np.arange(5.0)
    candidates = [CandidateFrame(n, float(n), _NOTHING, 1.0, 0, 10.0, look * (n < 20)) for n in range(40)]
    assert [choice.candidate.index for choice in choose(candidates, SelectionParams(frames=10))] == [0, 20]


def test_every_frame_is_detected_once() -> None:
    asked: list[int] = []

    class Listening(BrightSquare):
        def detect(self, frame: Frame) -> Detections:
            asked.append(frame.index)
            return super().detect(frame)

    frames = [Frame("drawn", n, n / FPS, ArrayPicture(_picture(n))) for n in range(30)]
    every = list(look_through(frames, Listening(lambda _: 0.5), 0.0, 0.3))
    assert asked == list(range(30)) and len(every) == 30
    asked.clear()
    some = list(look_through(frames, Listening(lambda _: 0.5), 1.0, 0.3))
    assert asked == [0, 1, 10, 11, 20, 21]
    assert [one.index for one in some] == [0, 10, 20]


def test_a_track_that_flickers_is_noticed_only_between_neighbours() -> None:
    detector = BrightSquare(lambda index: 0.0 if index % 2 else 0.9)
    near, far = ([Frame("drawn", n, n * step_s, ArrayPicture(_picture(n))) for n in range(6)] for step_s in (0.1, 1.0))
    assert [one.flicker for one in look_through(near, detector, 0.0, 0.3)] == [1, 0, 1, 0, 1, 0]
    assert [one.flicker for one in look_through(far, detector, 0.0, 0.3)] == [0] * 6


def test_what_is_written_can_be_read_by_others(video: Path, tmp_path: Path) -> None:
    report = _label(video, tmp_path / "out", BrightSquare(lambda index: 0.3 + 0.01 * (index % 30)), 5)
    folder = tmp_path / "out"
    indices = [choice.candidate.index for choice in report.choices]
    assert len(indices) == 5 and report.boxes == 5 and report.anything_seen
    names = [f"drawn_{index:06d}.jpg" for index in indices]
    assert sorted(path.name for path in (folder / "images").iterdir()) == names
    for index, name in zip(indices, names, strict=True):
        image = np.asarray(cv2.imread(str(folder / "images" / name)))
        assert np.abs(image.astype(float) - _picture(index)).mean() < 12
    coco = COCO(str(folder / "coco.json"))
    assert [image["file_name"] for image in coco.dataset["images"]] == names
    assert [annotation["bbox"] for annotation in coco.dataset["annotations"]] == [
        [index % 140, 40.0, 16.0, 16.0] for index in indices
    ]
    dataset = supervision.DetectionDataset.from_coco(str(folder / "images"), str(folder / "coco.json"))
    read = {Path(path).name: (found.xyxy[0].tolist(), dataset.classes[found.class_id[0]]) for path, _, found in dataset}
    for index, name in zip(indices, names, strict=True):
        assert read[name] == ([index % 140, 40.0, index % 140 + 16, 56.0], "worker")
    tasks = json.loads((folder / "label_studio.json").read_text())
    assert [task["data"]["image"] for task in tasks] == [f"/data/local-files/?d=images/{name}" for name in names]
    for index, task in zip(indices, tasks, strict=True):
        (box,) = task["predictions"][0]["result"]
        assert {"id", "type", "from_name", "to_name", "original_width", "original_height", "value"} <= box.keys()
        assert box["type"] == "rectanglelabels"
        value = box["value"]
        assert value["rectanglelabels"] == ["worker"]
        left_px, top_px = value["x"] * WIDTH_PX / 100, value["y"] * HEIGHT_PX / 100
        assert (left_px, top_px) == pytest.approx((index % 140, 40))
    sheet = np.asarray(cv2.imread(str(folder / "contact_sheet.png")))
    assert sheet.shape[1] > 2 * 384 and sheet.std() > 20


def test_every_second_of_a_changing_scene_is_chosen(video: Path, tmp_path: Path) -> None:
    report = _label(video, tmp_path / "out", BrightSquare(lambda _: 0.9), 6, every_s=0.1)
    assert sorted(choice.candidate.index // FPS for choice in report.choices) == list(range(6))


def test_a_detector_that_sees_nothing_still_gives_frames(video: Path, tmp_path: Path) -> None:
    report = _label(video, tmp_path / "out", BrightSquare(lambda _: 0.0), 4)
    assert not report.anything_seen and report.boxes == 0 and len(report.choices) == 4
    assert json.loads((tmp_path / "out" / "coco.json").read_text())["annotations"] == []
    assert {choice.reason for choice in report.choices} == {"unlike the others"}


def test_unsure_boxes_are_not_proposed(video: Path, tmp_path: Path) -> None:
    assert _label(video, tmp_path / "out", BrightSquare(lambda _: 0.2), 4).boxes == 0


def test_a_folder_of_pictures_will_do(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    for number in range(0, 40, 5):
        cv2.imwrite(str(tmp_path / "pictures" / f"{number}.png"), _picture(number))
    report = _label(tmp_path / "pictures", tmp_path / "out", BrightSquare(lambda _: 0.9), 3)
    assert len(report.choices) == 3


def test_what_is_no_video_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no.mp4").write_bytes(b"nothing" * 100)
    with pytest.raises(SourceError):
        _label(tmp_path / "no.mp4", tmp_path / "out", BrightSquare(lambda _: 0.9), 3)


@pytest.mark.shared
def test_frames_of_real_video_come_from_all_parts_with_people(shared_data: Path, tmp_path: Path) -> None:
    people: dict[int, list[tuple[float, float, float, float, float]]] = {}
    with (shared_data / "pets2009" / "gt.csv").open() as file:
        for row in csv.DictReader(file):
            x, y, w, h = (float(row[key]) for key in "xywh")
            people.setdefault(int(row["frame"]) - 1, []).append((x, y, x + w, y + h, 0.9))

    class Truth(protocols.Detector):
        def detect(self, frame: Frame) -> Detections:
            return _boxes(*people.get(frame.index, []))

    (tmp_path / "out").mkdir()
    plan = LabelPlan(shared_data / "pets2009" / "vtest.avi", SelectionParams(frames=12))
    report = label_frames(plan, Truth(), tmp_path / "out", _quiet)
    times_s = np.array([choice.candidate.time_s for choice in report.choices])
    assert len(times_s) == 12
    # Only two parts of the video are labelled; nobody is seen in between.
    assert (times_s < 22).sum() >= 3 and ((times_s > 38) & (times_s < 56)).sum() >= 3
