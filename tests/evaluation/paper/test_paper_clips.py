from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import drawn_clip
import numpy as np
import pytest

from standoff.clips import Clip, load_clip
from standoff.config import Settings, build_stage
from standoff.config.settings import StageName
from standoff.core import protocols
from standoff.core.camera import CameraPrior
from standoff.core.errors import DataError
from standoff.core.types import Detections, Frame, NoCameraMotion, NoGroundMap
from standoff.evaluation.paper import BoxError, MonitorSetup, evaluate_clip
from standoff.evaluation.paper.corner_order import CornerOrder
from standoff.evaluation.paper.localisation import true_scale_m_per_px
from standoff.evaluation.paper.monitor_setup import settings_for
from standoff.evaluation.paper.monitored_clip import NOT_DETECTED, NOT_VISIBLE, open_clip_video
from standoff.evaluation.paper.truth_detector import REFERENCE_MARGIN_PX, TrueBoxes
from standoff.stages.frames import frame_from_array
from standoff.stages.ground import ReferenceShape

PICTURE = np.zeros((4, 4, 3), np.uint8)


def test_truth_of_another_length_than_the_video_is_refused(copy_of: Path) -> None:
    drawn_clip.write_tables(copy_of, frames=drawn_clip.FRAMES - 2)
    with pytest.raises(DataError, match=f"{drawn_clip.FRAMES - 2} frames .* found {drawn_clip.FRAMES}"):
        open_clip_video(load_clip(copy_of))


def test_a_reference_that_is_not_whole_in_the_picture_is_counted_apart(clip_folder: Path) -> None:
    clip = load_clip(clip_folder)
    reference = clip.reference
    assert reference is not None
    away = replace(reference, corners_px=reference.corners_px.copy())
    hidden = drawn_clip.HIDDEN[0]
    away.corners_px[hidden, 2, 0] = 1e4
    for known, out_of_sight in ((reference, 0), (away, 1)):
        score = evaluate_clip(replace(clip, reference=known), MonitorSetup(method="oriented")).rectification
        assert score is not None
        assert score.out_of_sight == out_of_sight
        assert score.failed == len(drawn_clip.HIDDEN) - out_of_sight


def test_which_corner_is_which_is_told(clip_folder: Path) -> None:
    clip = load_clip(clip_folder)
    assert clip.reference is not None
    settings = settings_for(clip, MonitorSetup())
    assert settings.ground.reference is not None
    first_m = settings.ground.reference.shape().corners_m[0]
    expected = drawn_clip.seen_px(0, first_m[None])[0]
    assert settings.ground.reference.first_corner_px == pytest.approx(expected.tolist())
    unseen = replace(clip, reference_box_px=np.full_like(clip.reference_box_px, np.nan))
    reference = settings_for(unseen, MonitorSetup()).ground.reference
    assert reference is not None and reference.first_corner_px is None


def test_true_boxes_are_the_truths_own(clip_folder: Path) -> None:
    clip = load_clip(clip_folder)
    boxes = TrueBoxes(clip)
    unseen = drawn_clip.UNSEEN[0]
    for index, seen in ((3, [1, 2, 3]), (unseen, [1, 2])):
        detections = boxes.detect(frame_from_array(PICTURE, index=index))
        tracks = boxes.update(0.1 * index, detections, NoCameraMotion("not estimated"), NoGroundMap("not looked for"))
        assert tracks.track_id.tolist() == seen
        rows = np.searchsorted(clip.entity_id, seen)
        assert (tracks.xyxy_px == clip.box_px[index, rows]).all()
        assert (tracks.class_id == clip.class_id[rows]).all()
        wide = np.array([-1.0, -1.0, 1.0, 1.0]) * REFERENCE_MARGIN_PX
        np.testing.assert_allclose(detections.xyxy_px[-1], clip.reference_box_px[index] + wide)


def test_box_errors_have_the_stated_size_and_depend_on_the_seed_and_the_frame_alone(clip_folder: Path) -> None:
    clip = load_clip(clip_folder)
    noisy = [TrueBoxes(clip, BoxError(share=0.06), seed) for seed in (1, 1, 2)]
    frames = [frame_from_array(PICTURE, index=index) for index in range(10)]
    exact = np.stack([TrueBoxes(clip).detect(frame).xyxy_px[-1] for frame in frames])
    one, again, other = (np.stack([boxes.detect(frame).xyxy_px[-1] for frame in frames]) for boxes in noisy)
    backwards = np.stack([noisy[0].detect(frame).xyxy_px[-1] for frame in frames[::-1]])[::-1]
    assert (one == again).all() and (one == backwards).all() and (one != other).any()
    sides = np.tile(exact[:, 2:] - exact[:, :2], 2)
    # 40 draws: the standard error of their spread is 11 %.
    assert 0.06 * 0.6 < np.std((one - exact) / sides) < 0.06 * 1.4


@pytest.mark.parametrize("turn", range(4))
def test_a_square_that_was_taken_for_turned_is_turned_back(turn: int) -> None:
    square_m = np.array([[4.0, 1.0], [6.0, 2.0], [5.0, 4.0], [3.0, 3.0]])
    turning = CornerOrder(ReferenceShape.from_corners(square_m), square_m)
    true_px = np.array([[10.0, 90.0], [80.0, 95.0], [70.0, 20.0], [15.0, 30.0]])
    error_px, found = turning.compare(np.roll(true_px, -turn, axis=0), true_px)
    assert error_px.tolist() == [0.0] * 4
    # Corner k was believed to be where the truth has corner k + turn.
    np.testing.assert_allclose(turning.to_site(square_m, found), np.roll(square_m, -turn, axis=0), atol=1e-12)


def test_an_uneven_shape_is_never_turned() -> None:
    uneven_m = np.array([[0.0, 0.0], [2.4, 0.0], [2.6, 2.6], [-0.3, 2.0]])
    turning = CornerOrder(ReferenceShape.from_corners(uneven_m), uneven_m[[2, 3, 0, 1]])
    true_px = 10.0 * uneven_m[[2, 3, 0, 1]]
    error_px, turn = turning.compare(10.0 * uneven_m, true_px)
    assert error_px.max() == 0.0 and turn == 0
    assert turning.compare(10.0 * np.roll(uneven_m, -1, axis=0), true_px)[0].max() > 5.0


def test_a_clip_with_a_board_alone_gets_the_lab_test_alone(board_folder: Path) -> None:
    result = evaluate_clip(load_clip(board_folder), MonitorSetup())
    assert result.board is not None
    assert result.rectification is None and result.groups == ()


@pytest.mark.parametrize(
    ("preset", "figures"),
    [
        ("stationary-15", {"stationary-15 made worker-excavator", "stationary-15 mape worker-excavator"}),
        ("virtual", {"virtual failed"}),
        ("busy", set()),
    ],
)
def test_a_preset_gets_the_papers_figures_that_are_its_own(copy_of: Path, preset: str, figures: set[str]) -> None:
    drawn_clip.change_scene(copy_of, preset=preset)
    result = evaluate_clip(load_clip(copy_of), MonitorSetup(method="oriented"))
    assert {figure.name for figure in result.figures()} == figures
    assert {group.class_pair for group in result.groups} == {"worker-wheel_loader", "worker-excavator"}
    assert all("benchmark itself" not in group.scores for group in result.groups)


class ShiftedBoxes(protocols.Detector):
    """Sees as a model does: without names, two pixels to the right, and never the loader."""

    def __init__(self, clip: Clip, sees: str) -> None:
        self._truth = TrueBoxes(clip)
        self._sees = sees

    def describe(self) -> dict[str, dict[str, str]]:
        return {"class_map": {"a": "worker", "b": self._sees}}

    def detect(self, frame: Frame) -> Detections:
        seen = self._truth.detect(frame)
        seen = seen[seen.class_id != 2]
        return Detections(seen.xyxy_px + np.array([2.0, 0.0, 2.0, 0.0]), seen.score * 0.9, seen.class_id)


def _with_model(monkeypatch: pytest.MonkeyPatch, clip: Clip, sees: str) -> MonitorSetup:
    def build(name: StageName, settings: Settings, camera: CameraPrior | None = None) -> object:
        return ShiftedBoxes(clip, sees) if name == "detect" else build_stage(name, settings, camera)

    monkeypatch.setattr("standoff.evaluation.paper.monitor_setup.build_stage", build)
    return MonitorSetup(method="oriented", detector=Path("model.onnx"))


def test_a_models_boxes_are_matched_with_the_truth_by_overlap(
    clip_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = large_boxes(load_clip(clip_folder))
    result = evaluate_clip(clip, _with_model(monkeypatch, clip, "reference"))
    scores = {score.class_name: score for score in result.localisation}
    assert scores["worker"].detected == scores["worker"].visible == drawn_clip.FRAMES
    assert scores["wheel_loader"].detected == scores["wheel_loader"].located == 0
    assert clip.reference is not None
    assert scores["worker"].ale_m == pytest.approx(2.0 * true_scale_m_per_px(clip.reference).mean())
    missing = {group.class_pair: group.missing_by_reason for group in result.groups}
    assert missing["worker-wheel_loader"][NOT_DETECTED] >= drawn_clip.FRAMES - len(drawn_clip.HIDDEN)
    assert set(missing["worker-excavator"]) >= {NOT_VISIBLE}


def large_boxes(clip: Clip) -> Clip:
    """Grow the boxes, so that two pixels are little of them."""
    return replace(clip, box_px=clip.box_px + 15.0 * np.array([-1.0, -1.0, 1.0, 1.0]))


def test_a_model_that_cannot_see_the_reference_is_refused(clip_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clip = load_clip(clip_folder)
    with pytest.raises(DataError, match="class `reference`"):
        evaluate_clip(clip, _with_model(monkeypatch, clip, "excavator"))
