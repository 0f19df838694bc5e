from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
import yaml
from tolerances import FLOAT32_BOX_PX
from training.small_runs import CFG, CLASSES, QUIET, small_params, write_data

from standoff.core.errors import ConfigError, DataError, ModelError, OutputError
from standoff.core.types import Frame
from standoff.labels import LabelledData, Problem, read_data
from standoff.labels.read import CUT_GROUP
from standoff.labels.splits import spread
from standoff.stages.detect import DetectParams, OnnxDetector
from standoff.stages.frames import ArrayPicture
from standoff.training.darknet.cfg import parse_cfg, read_cfg
from standoff.training.darknet.layers import Yolo
from standoff.training.darknet.network import DarknetNetwork, DecodedNetwork
from standoff.training.darknet.weights import load_weights
from standoff.training.run.card import card_text
from standoff.training.run.loop import Progress
from standoff.training.run.train import Listener, RunPlan, read_run, train_detector
from standoff.training.run.training_folder import TrainingFolder
from standoff.training.run.validation import detect_pictures, validate
from standoff.training.start.starting_point import backbone_of, fill_network


class _Heard:
    def __init__(self) -> None:
        self.messages: list[str] = []
        self.rows: list[dict[str, Any]] = []

    def listener(self) -> Listener:
        return Listener(self.messages.append, lambda *_: None, self.rows.append)


def _plan(folder: Path, *, points: bool = False, **changes: object) -> RunPlan:
    (folder / "small.cfg").write_text(CFG)
    data = folder / "blocks"
    return RunPlan(write_data(data, points=points), str(folder / "small.cfg"), None, small_params(**changes))


@pytest.fixture(autouse=True)
def plain_curves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no curves, which takes half of a short run, except in the finished one, which is made before this."""
    monkeypatch.setattr("standoff.training.run.training_folder.draw_curves", lambda rows, classes, path: path.touch())


@pytest.fixture(scope="session")  # of one worker, wherever its turn to run the tests of this file comes
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunPlan, Path, _Heard]:
    folder = tmp_path_factory.mktemp("finished")
    plan, heard = _plan(folder, points=True, steps=90, validate_every=30, checkpoint_every=30, ema=0.9), _Heard()
    train_detector(plan, folder / "run", heard.listener())
    return plan, folder / "run", heard


def test_a_run_leaves_all_that_it_takes_to_judge_and_to_use_it(finished: tuple[RunPlan, Path, _Heard]) -> None:
    _, out, heard = finished
    names = {path.name for path in out.iterdir()}
    assert names == {
        "network.cfg", "classes.names", "run.yaml", "start.json", "checkpoints", "history.json", "table.md",
        "curves.png", "predictions.jpg", "best.json", "start.weights", "best.weights", "last.weights", "model.onnx",
        "model-half.onnx", "model-card.md",
    }  # fmt: skip
    assert [row["step"] for row in heard.rows] == [30, 60, 90]
    assert json.loads((out / "history.json").read_text()) == heard.rows
    assert len((out / "table.md").read_text().splitlines()) == 2 + 3
    for name in ("curves.png", "predictions.jpg"):
        picture = cv2.imread(str(out / name))
        assert picture is not None and picture.std() > 10


def test_the_exported_model_sees_what_the_network_sees(finished: tuple[RunPlan, Path, _Heard]) -> None:
    plan, out, _ = finished
    network = DarknetNetwork(read_cfg(out / "network.cfg"))
    load_weights(network, out / "best.weights")
    pictures = read_data(plan.data).splits["val"]
    _, found = detect_pictures(network, pictures, bf16=False)
    detector = OnnxDetector(out / "model.onnx", DetectParams(score_threshold=0.01))
    site_class = np.array([0, 5])
    for picture, own in zip(pictures, found, strict=True):
        image = cv2.imread(str(picture.path))
        seen = detector.detect(Frame("test", 0, 0.0, ArrayPicture(np.asarray(image, dtype=np.uint8))))
        assert len(seen) == len(own) > 0
        np.testing.assert_allclose(seen.xyxy_px, own.xyxy_px, atol=FLOAT32_BOX_PX)
        np.testing.assert_array_equal(seen.class_id, site_class[own.class_id])
        np.testing.assert_allclose(seen.foot_px, own.foot_px, atol=FLOAT32_BOX_PX)
        np.testing.assert_allclose(seen.foot_covariance_px2, own.foot_covariance_px2, rtol=1e-3, atol=1e-3)


def test_labels_with_ground_points_give_heads_that_learn_them(finished: tuple[RunPlan, Path, _Heard]) -> None:
    _, out, heard = finished
    assert "ground_point=1" in (out / "network.cfg").read_text()
    losses = [row["loss_points"] for row in heard.rows]
    assert 0.0 < losses[-1] < losses[0]


@pytest.mark.live
def test_the_run_can_be_repeated_from_its_own_record(finished: tuple[RunPlan, Path, _Heard], tmp_path: Path) -> None:
    plan, out, heard = finished
    recorded = read_run(out)
    assert recorded == plan.to_dict()
    again = _Heard()
    train_detector(plan, tmp_path / "again", again.listener())
    for first, second in zip(heard.rows, again.rows, strict=True):
        assert {**first, "validation_s": 0} == {**second, "validation_s": 0}
    assert (tmp_path / "again" / "best.weights").read_bytes() == (out / "best.weights").read_bytes()


def test_a_run_goes_on_in_its_folder(tmp_path: Path) -> None:
    plan = _plan(tmp_path, steps=8, validate_every=4, checkpoint_every=4)
    whole = _Heard()
    train_detector(plan, tmp_path / "whole", whole.listener())
    shutil.copytree(tmp_path / "whole", tmp_path / "parts")
    newest = tmp_path / "parts" / "checkpoints" / "step-0000008.pt"
    newest.write_bytes(newest.read_bytes()[:500])
    resumed = _Heard()
    train_detector(plan, tmp_path / "parts", resumed.listener(), resumes=True)
    assert [row["step"] for row in resumed.rows] == [8]
    assert {**resumed.rows[0], "validation_s": 0} == {**whole.rows[1], "validation_s": 0}
    assert any("step-0000008.pt is damaged" in message for message in resumed.messages)


def test_a_folder_in_use_is_not_written_to(tmp_path: Path) -> None:
    plan = _plan(tmp_path)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "mine.txt").write_text("keep")
    with pytest.raises(OutputError, match="pass --resume"):
        train_detector(plan, tmp_path / "run", _Heard().listener())
    with pytest.raises(ConfigError, match=r"no run\.yaml"):
        read_run(tmp_path / "run")


def test_weights_of_another_architecture_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    plan = _plan(tmp_path)
    stranger = tmp_path / "stranger.weights"
    stranger.write_bytes(np.concatenate([np.zeros(5, np.float32), np.full(40_000, 1e-3, np.float32)]).tobytes())
    with pytest.raises(ModelError):
        train_detector(RunPlan(plan.data, plan.arch, stranger, plan.params), tmp_path / "run", _Heard().listener())
    assert not (tmp_path / "run").exists()


def test_labels_without_a_box_cannot_give_anchors(tmp_path: Path) -> None:
    plan = _plan(tmp_path)
    for path in (plan.data / "labels" / "train").iterdir():
        path.write_text("")
    with pytest.raises(DataError, match="labelled boxes with positive sides, to find anchors, found none"):
        train_detector(plan, tmp_path / "run", _Heard().listener())


@pytest.mark.parametrize(
    ("emptied", "told"),
    [
        ("images/val", r"found none in val\."),
        ("images/train", r"found none in train\."),
        ("labels/val", "boxes to validate with, found none in the 8 pictures"),
    ],
)
def test_data_that_nothing_can_be_validated_with_is_refused_before_anything_is_made_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, emptied: str, told: str
) -> None:
    monkeypatch.delattr("standoff.training.run.data_checks.near_duplicates")
    plan = _plan(tmp_path)
    kind, split = emptied.split("/")
    if kind == "labels":
        for path in (plan.data / emptied).iterdir():
            path.write_text("")
    else:
        other = {"val": "train", "train": "val"}[split]
        content = {other: f"images/{other}", "names": list(CLASSES)}
        (plan.data / "data.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(DataError, match=told):
        train_detector(plan, tmp_path / "run", _Heard().listener())
    assert not (tmp_path / "run").exists()


def test_a_run_that_was_killed_before_its_first_checkpoint_says_what_to_do(tmp_path: Path) -> None:
    plan = _plan(tmp_path, steps=4, warmup_steps=1)
    train_detector(plan, tmp_path / "run", _Heard().listener())
    for path in (tmp_path / "run" / "checkpoints").iterdir():
        path.unlink()
    with pytest.raises(DataError, match="Delete the folder of the run, or choose another --out"):
        train_detector(plan, tmp_path / "run", _Heard().listener(), resumes=True)


def test_a_run_goes_on_only_with_its_classes_and_its_size(tmp_path: Path) -> None:
    plan = _plan(tmp_path, steps=4, warmup_steps=1)
    train_detector(plan, tmp_path / "run", _Heard().listener())
    larger = RunPlan(plan.data, plan.arch, None, small_params(steps=4, warmup_steps=1, size_px=(128, 96)))
    with pytest.raises(ConfigError, match=r"size_px \[96, 64\], .* found \[128, 96\]"):
        train_detector(larger, tmp_path / "run", _Heard().listener(), resumes=True)
    names = plan.data / "data.yaml"
    names.write_text(yaml.safe_dump({**yaml.safe_load(names.read_text()), "names": ["vehicle", "worker"]}))
    with pytest.raises(ConfigError, match="worker, vehicle, found vehicle, worker in the data"):
        train_detector(plan, tmp_path / "run", _Heard().listener(), resumes=True)


@pytest.mark.parametrize(
    ("change", "telling"),
    [
        ({"optimizer": "sgd"}, "optimizer adamw"),
        ({"weight_decay": 0.1}, "weight_decay"),
        ({"validate_pictures": 1}, "validate_pictures"),
        ({"backbone_layers": 3}, "backbone_layers 0"),
        ({"augment": replace(QUIET, mosaic=0.5)}, r"augment\.mosaic"),
    ],
)
def test_a_run_goes_on_only_with_what_its_checkpoint_holds(
    finished: tuple[RunPlan, Path, _Heard], change: dict[str, Any], telling: str
) -> None:
    plan, out, _ = finished
    assert plan.params.optimizer == "adamw"
    other = replace(plan, params=replace(plan.params, **change))
    with pytest.raises(ConfigError, match=telling):
        train_detector(other, out, _Heard().listener(), resumes=True)


def test_a_run_that_goes_on_for_longer_says_so_in_its_record(tmp_path: Path) -> None:
    plan = _plan(tmp_path, steps=4, warmup_steps=1)
    train_detector(plan, tmp_path / "run", _Heard().listener())
    longer = replace(plan, params=replace(plan.params, steps=6))
    assert train_detector(longer, tmp_path / "run", _Heard().listener(), resumes=True).step == 6
    assert read_run(tmp_path / "run") == longer.to_dict()
    before = yaml.safe_load((tmp_path / "run" / "run-until-4.yaml").read_text())
    assert before == plan.to_dict()
    header = load_weights(DarknetNetwork(read_cfg(tmp_path / "run" / "network.cfg")), tmp_path / "run" / "last.weights")
    assert header.seen == 6 * plan.params.batch * plan.params.accumulate


def test_only_a_data_set_that_is_there_can_be_turned_freely(tmp_path: Path) -> None:
    plan = _plan(tmp_path, augment=replace(QUIET, any_rotation_sources=("flights",)))
    with pytest.raises(ConfigError, match=r"names of data sets \(blocks\) in any_rotation_sources, found flights"):
        train_detector(plan, tmp_path / "run", _Heard().listener())


def test_a_run_trains_on_from_another_whose_anchors_and_order_of_classes_differ(
    finished: tuple[RunPlan, Path, _Heard],
) -> None:
    _, out, _ = finished
    cfg = read_cfg(out / "network.cfg")
    (anchors_px,) = (head.anchors_px for head in cfg.heads)
    turned = parse_cfg((out / "network.cfg").read_text(), "turned.cfg")
    turned = replace(
        turned,
        layers=tuple(
            replace(layer, anchors_px=anchors_px[::-1]) if isinstance(layer, Yolo) else layer for layer in turned.layers
        ),
    )
    source, _ = fill_network(cfg, CLASSES, out / "best.weights", seed=0)
    network, transferred = fill_network(turned, CLASSES[::-1], out / "best.weights", seed=0)
    assert (transferred.copied, transferred.resized) == ((0, 1, 2), (4,))
    assert transferred.class_sources == (("vehicle",), ("worker",))
    picture = torch.rand(1, 3, 64, 96, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        expected, found = (DecodedNetwork(one).eval()(picture)[0].reshape(-1, 3, 7) for one in (source, network))
    torch.testing.assert_close(found, expected.flip(1)[..., [0, 1, 2, 3, 4, 6, 5]])


def test_the_first_steps_of_a_run_that_trains_on_may_freeze_its_backbone(
    finished: tuple[RunPlan, Path, _Heard], tmp_path: Path
) -> None:
    plan, out, _ = finished
    params = small_params(steps=4, warmup_steps=1, freeze_steps=2)
    again = RunPlan(plan.data, str(out / "network.cfg"), out / "best.weights", params)
    train_detector(again, tmp_path / "again", _Heard().listener())
    assert json.loads((tmp_path / "again" / "start.json").read_text())["backbone_layers"] == 4


def test_what_repeats_a_run_does_so_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    written = RunPlan(Path("data"), "nets/a.cfg", Path("a.weights"), small_params()).to_dict()
    assert [written[name] for name in ("data", "arch", "weights")] == [
        str(tmp_path / name) for name in ("data", "nets/a.cfg", "a.weights")
    ]
    assert RunPlan(Path("data"), "yolov3", None, small_params()).to_dict()["arch"] == "yolov3"


def test_a_validation_of_which_nothing_can_be_shown_is_still_written(
    finished: tuple[RunPlan, Path, _Heard], tmp_path: Path
) -> None:
    plan, out, heard = finished
    network, _ = fill_network(read_cfg(out / "network.cfg"), CLASSES, None, seed=0)
    pictures = read_data(plan.data).splits["val"]
    score = validate(network, pictures, CLASSES, bf16=False)
    lost = tuple(replace(picture, path=tmp_path / "gone.png") for picture in pictures)
    progress = Progress(step=20, best_step=20, rows=heard.rows[:1])
    TrainingFolder(tmp_path, CLASSES).write_validation(progress, score, network, lost)
    assert (tmp_path / "best.weights").is_file() and not (tmp_path / "predictions.jpg").exists()


def test_problems_of_the_data_are_counted_and_named_once_a_kind(tmp_path: Path) -> None:
    plan = _plan(tmp_path, steps=4, warmup_steps=1, validate_every=4)
    labels = sorted((plan.data / "labels" / "train").iterdir())
    for path in labels[:3]:
        path.write_text(path.read_text() + "9 0.5 0.5 0.1 0.1\n")
    heard = _Heard()
    train_detector(plan, tmp_path / "run", heard.listener())
    assert sum(message.startswith("3 times ") and labels[0].stem in message for message in heard.messages) == 1


def test_a_held_out_picture_that_is_also_trained_on_is_reported(tmp_path: Path) -> None:
    plan = _plan(tmp_path, steps=4, warmup_steps=1, validate_every=4)
    rng = np.random.default_rng(3)
    blotches = cv2.resize(rng.integers(0, 255, (6, 8, 3)).astype(np.uint8), (128, 96), interpolation=cv2.INTER_CUBIC)
    for split, name in (("train", "twice_1"), ("val", "copy_1")):
        cv2.imwrite(str(plan.data / "images" / split / f"{name}.png"), blotches)
        (plan.data / "labels" / split / f"{name}.txt").write_text("")
    heard = _Heard()
    train_detector(plan, tmp_path / "run", heard.listener())
    assert sum("copy_1.png (val) like twice_1.png" in message for message in heard.messages) == 1


def test_an_unknown_architecture_is_answered_with_the_known_ones(tmp_path: Path) -> None:
    plan = _plan(tmp_path)
    with pytest.raises(ConfigError, match="yolov3-tiny"):
        train_detector(RunPlan(plan.data, "yolov9", None, plan.params), tmp_path / "run", _Heard().listener())


def test_the_backbone_is_what_the_weights_filled(finished: tuple[RunPlan, Path, _Heard]) -> None:
    _, out, _ = finished
    cfg = read_cfg(out / "network.cfg")
    network, transferred = fill_network(cfg, CLASSES, out / "best.weights", seed=0)
    assert transferred.copied == (0, 1, 2, 4)
    assert backbone_of(network, transferred) == 4  # the head is not part of it: something must be left to train
    network, transferred = fill_network(cfg, CLASSES, None, seed=0)
    assert backbone_of(network, transferred) == 0


def test_pictures_to_validate_with_are_spread_over_all(finished: tuple[RunPlan, Path, _Heard]) -> None:
    pictures = read_data(finished[0].data).splits["train"]
    few = spread(pictures, 4)
    assert [few[0], few[-1]] == [pictures[0], pictures[-1]] and len(few) == 4
    assert spread(pictures, 1000) == pictures


def test_the_card_says_how_to_repeat_the_run(finished: tuple[RunPlan, Path, _Heard]) -> None:
    plan, out, _ = finished
    card = (out / "model-card.md").read_text()
    repeated = yaml.safe_load(card.split("```yaml\n")[1].split("```")[0])
    assert repeated == plan.to_dict()


def test_the_card_says_so_where_scenes_are_in_two_splits(finished: tuple[RunPlan, Path, _Heard]) -> None:
    plan, _, heard = finished
    data, progress = read_data(plan.data), Progress(rows=heard.rows)
    assert "never in two splits" in card_text(plan.to_dict(), data, progress)
    cut = Problem(plan.data, "'scene3' is in train and val", CUT_GROUP, skipped_picture=False)
    card = card_text(plan.to_dict(), LabelledData(data.classes, data.splits, [cut]), progress)
    assert "in two splits: 1, first 'scene3' is in train and val" in card and "never" not in card


def test_a_half_model_that_is_refused_does_not_end_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(model_in: Path, model_out: Path) -> None:
        raise ModelError(
            expected=f"small shifts from {model_in.name}", found="large ones", fix=f"drop {model_out.name}"
        )

    monkeypatch.setattr("standoff.training.run.training_folder.store_half", refuse)
    plan, heard = _plan(tmp_path, steps=4, warmup_steps=1, validate_every=4), _Heard()
    train_detector(plan, tmp_path / "run", heard.listener())
    assert {"model.onnx", "model-card.md"} <= {path.name for path in (tmp_path / "run").iterdir()}
    assert sum("no model-half.onnx" in message and "large ones" in message for message in heard.messages) == 1


def test_a_run_that_goes_on_from_weights_says_what_it_gained_and_lost(
    finished: tuple[RunPlan, Path, _Heard], tmp_path: Path
) -> None:
    plan, first, _ = finished
    params = replace(plan.params, steps=3, validate_every=3, checkpoint_every=3, export_size_px=(128, 96))
    again, heard, out = replace(plan, weights=first / "best.weights", params=params), _Heard(), tmp_path / "again"
    train_detector(again, out, heard.listener())
    (compared,) = json.loads((out / "before-after.json").read_text())
    assert (compared["source"], compared["split"]) == ("blocks", "val")
    network = DarknetNetwork(replace(read_cfg(out / "network.cfg"), width_px=128, height_px=96))
    pictures = spread(read_data(plan.data).splits["val"], params.validate_pictures)
    for when, weights in (("before", "start.weights"), ("after", "best.weights")):
        load_weights(network, out / weights)
        assert compared[when]["mean_ap11"] == validate(network, pictures, CLASSES, bf16=False).mean_ap11
    assert "blocks (val)" in (out / "model-card.md").read_text()
    assert any("before" in line and "after" in line for line in heard.messages)
    assert OnnxDetector(out / "model.onnx").describe()["input_size_px"] == [128, 96]


def test_a_run_from_nothing_has_no_before(finished: tuple[RunPlan, Path, _Heard]) -> None:
    assert "Before and after" not in (finished[1] / "model-card.md").read_text()


def test_an_export_size_that_does_not_fit_the_network_is_refused_before_the_first_step(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="100x"):
        train_detector(_plan(tmp_path, export_size_px=(100, 64)), tmp_path / "run", _Heard().listener())
    assert not (tmp_path / "run").exists()
