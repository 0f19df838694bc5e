from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Literal

import drawn_clip
import numpy as np
import pytest
from evaluation.blind_detector import BlindDetector

from standoff.clips import Clip, load_clip
from standoff.config import Settings, load_settings
from standoff.core import protocols
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.protocols import Detector
from standoff.core.types import Detections, Frame
from standoff.evaluation.clip_run import ClipScore, ClipWitness, Encounter, score_run
from standoff.evaluation.paper.truth_detector import TrueBoxes
from standoff.evaluation.run_frames import RunFrame
from standoff.monitor import open_run

WORKER, LOADER, EXCAVATOR = drawn_clip.ENTITIES
REFERENCE = 6


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    """A drawn clip whose boxes are large enough for a tracker."""
    drawn = load_clip(drawn_clip.write_clip(tmp_path_factory.mktemp("clips") / "drawn"))
    return replace(drawn, box_px=drawn.box_px + 20.0 * np.array([-1.0, -1.0, 1.0, 1.0]))


class MovedBoxes(protocols.Detector):
    """The true boxes, those of one class so many pixels further right."""

    def __init__(self, clip: Clip, class_id: int = 0, right_px: float = 0.0) -> None:
        self._truth, self._class_id, self._right_px = TrueBoxes(clip), class_id, right_px

    def detect(self, frame: Frame) -> Detections:
        seen = self._truth.detect(frame)
        moved = (seen.class_id == self._class_id)[:, None] * np.array([1.0, 0.0, 1.0, 0.0])
        return Detections(seen.xyxy_px + self._right_px * moved, seen.score, seen.class_id)


def settings_with(clip: Clip, loader_radius_m: float, excavator_radius_m: float) -> Settings:
    radius_m = {"worker": 0.0, "wheel_loader": loader_radius_m, "excavator": excavator_radius_m}
    overrides = {
        "locate": {"radius_m": radius_m, "anchor": "box_centre"},
        "hazard": {"min_duration_s": 0.0, "rule": "distance"},
        "outputs": ("tracks", "proximity", "frames", "detections", "hazards"),
    }
    return load_settings(clip.folder / "reference.yaml", overrides)


def score_of(
    clip: Clip, settings: Settings, detector: Detector, out: Path, monkeypatch: pytest.MonkeyPatch
) -> ClipScore:
    monkeypatch.setattr("standoff.config.build.find_model", lambda model: model)
    monkeypatch.setattr("standoff.config.build.OnnxDetector", lambda path, params: detector)
    for _ in open_run(clip.video, out, settings):
        pass
    return score_run(out, clip)


def true_gap_m(other: drawn_clip.Entity, radius_m: float) -> FloatArray:
    return np.array([drawn_clip.true_distance_m(k, WORKER, other) - radius_m for k in range(drawn_clip.FRAMES)])


def test_a_good_run_finds_every_encounter_and_invents_none(
    clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = settings_with(clip, loader_radius_m=8.0, excavator_radius_m=6.5)
    score = score_of(clip, settings, MovedBoxes(clip), tmp_path / "run", monkeypatch)
    near_miss, breach = score.encounters
    assert (near_miss.kind, near_miss.names) == ("near miss", ("worker", "excavator"))
    assert (breach.kind, breach.names) == ("breach", ("worker", "wheel_loader"))
    gap_m = true_gap_m(LOADER, 8.0)
    assert breach.least_gap_m == pytest.approx(gap_m.min())
    assert breach.start_s == pytest.approx(drawn_clip.time_s(int(np.argmax(gap_m < 0.0))), abs=1e-3)
    assert breach.end_s == pytest.approx(drawn_clip.time_s(drawn_clip.FRAMES - 1), abs=1e-3)
    assert near_miss.recognised and breach.recognised
    assert breach.said_s == pytest.approx(breach.start_s, abs=0.3)
    assert score.false_hazards == ()
    assert score.frames == drawn_clip.FRAMES
    assert drawn_clip.FRAMES - len(drawn_clip.HIDDEN) <= score.frames_with_map <= drawn_clip.FRAMES
    assert {one.class_name: one.detected for one in score.classes}["worker"] == drawn_clip.FRAMES
    assert all(group.scores["after the filter"].made_m < 0.5 for group in score.pairs)


def test_what_a_blind_monitor_does_not_say_is_told(clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = settings_with(clip, loader_radius_m=8.0, excavator_radius_m=6.5)
    score = score_of(clip, settings, BlindDetector(), tmp_path / "run", monkeypatch)
    assert [(one.kind, one.said, one.recognised) for one in score.encounters] == [
        ("near miss", "", False),
        ("breach", "", False),
    ]
    assert all(np.isnan(one.said_s) for one in score.encounters)
    assert (score.frames_with_map, score.false_hazards) == (0, ())


def test_a_hazard_where_nothing_is_near_is_false(clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # So that the smallest gap is just outside the buffer of 1 m.
    radius_m = float(true_gap_m(EXCAVATOR, 1.02).min())
    settings = settings_with(clip, loader_radius_m=0.1, excavator_radius_m=radius_m)
    honest = score_of(clip, settings, MovedBoxes(clip), tmp_path / "honest", monkeypatch)
    assert (honest.encounters, honest.false_hazards) == ((), ())
    # Moved by a third of its width the worker is still the same worker, and seems to be nearer.
    shifted = MovedBoxes(clip, WORKER.class_id, right_px=-15.0)
    score = score_of(clip, settings, shifted, tmp_path / "shifted", monkeypatch)
    assert score.encounters == ()
    assert score.false_hazards == ("worker - excavator: warning",)


def test_a_near_miss_called_a_breach_is_false(clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    radius_m = float(true_gap_m(EXCAVATOR, 0.02).min())
    settings = settings_with(clip, loader_radius_m=0.1, excavator_radius_m=radius_m)
    shifted = MovedBoxes(clip, WORKER.class_id, right_px=-15.0)
    score = score_of(clip, settings, shifted, tmp_path / "run", monkeypatch)
    (near_miss,) = score.encounters
    assert (near_miss.kind, near_miss.said, near_miss.recognised) == ("near miss", "danger", False)
    assert score.false_hazards == ("worker - excavator: danger",)


def test_the_score_is_plain_json_types(clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = settings_with(clip, loader_radius_m=8.0, excavator_radius_m=6.5)
    figures = score_of(clip, settings, MovedBoxes(clip), tmp_path / "run", monkeypatch).to_dict()
    assert [one["recognised"] for one in figures["encounters"]] == [True, True]
    assert {group["class_pair"] for group in figures["pairs"]} == {"worker-excavator", "worker-wheel_loader"}
    for group in figures["pairs"]:
        assert 0.0 <= group["coverage"]["inside_68"] <= group["coverage"]["inside_95"] <= 1.0
        assert group["coverage"]["sigma_m"] > 0.0


@pytest.mark.parametrize(
    ("said", "said_s", "recognised"),
    [("danger", 2.9, True), ("danger", 3.1, False), ("warning", 2.0, False), ("", np.nan, False)],
)
def test_an_encounter_is_recognised_while_it_lasts(
    said: Literal["danger", "warning", ""], said_s: float, recognised: bool
) -> None:
    assert Encounter("breach", ("worker", "excavator"), 1.0, 3.0, -0.5, said, said_s).recognised == recognised


def test_a_run_that_was_stopped_early_says_so(clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = settings_with(clip, loader_radius_m=8.0, excavator_radius_m=6.5)
    monkeypatch.setattr("standoff.config.build.find_model", lambda model: model)
    monkeypatch.setattr("standoff.config.build.OnnxDetector", lambda path, params: MovedBoxes(clip))
    results = iter(open_run(clip.video, tmp_path / "run", settings))
    for _ in range(drawn_clip.FRAMES // 2):
        next(results)
    results.close()
    with pytest.raises(DataError, match=f"all {drawn_clip.FRAMES} frames"):
        score_run(tmp_path / "run", clip)


def test_a_run_scores_the_same_from_its_folder_as_while_it_goes_on(
    clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also while something lies on the reference, and where a machine is not seen."""
    settings = settings_with(clip, loader_radius_m=8.0, excavator_radius_m=6.5)
    monkeypatch.setattr("standoff.config.build.find_model", lambda model: model)
    monkeypatch.setattr("standoff.config.build.OnnxDetector", lambda path, params: MovedBoxes(clip))
    run = open_run(clip.video, tmp_path / "run", settings)
    witness = ClipWitness(clip, settings, run.source.size_px)
    for result in run:
        witness.take(RunFrame.of_result(result))
    live, again = witness.score().to_dict(), score_run(tmp_path / "run", clip).to_dict()
    assert live["pairs"] and live["map_only"]["level"]["points"] > 0
    np.testing.assert_equal(again, live)


def test_a_run_of_another_film_is_not_scored(clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = settings_with(clip, loader_radius_m=8.0, excavator_radius_m=6.5)
    score_of(clip, settings, MovedBoxes(clip), tmp_path / "run", monkeypatch)
    other = Path(shutil.copytree(clip.folder, tmp_path / "other"))
    with (other / "video.mp4").open("ab") as video:
        video.write(b"\0\0\0\x08free")
    with pytest.raises(DataError, match="with other content"):
        score_run(tmp_path / "run", replace(clip, folder=other))


def test_settings_without_a_reference_object_are_refused(clip: Clip) -> None:
    with pytest.raises(DataError, match="with a reference object"):
        ClipWitness(clip, load_settings(), (1280, 720))
