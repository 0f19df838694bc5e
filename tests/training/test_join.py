from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from square_detector import SIZE_PX, draw_squares, write_detector
from training.start.test_blend import write_weights

from standoff.core.errors import ConfigError, ModelError, StandoffError
from standoff.files.fingerprint import file_sha256
from standoff.stages.detect import BOXES_OUTPUT, PICTURE_INPUT, POINTS_OUTPUT, ModelCard, OnnxDetector
from standoff.stages.frames import frame_from_array
from standoff.training import export_darknet
from standoff.training.architectures.refitted import pointed_cfg
from standoff.training.darknet.cfg import read_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import save_weights
from standoff.training.join import join_models
from standoff.training.start.initial_weights import initialize_layers

CLASSES = ("worker", "vehicle")


def write_models(folder: Path, *seeds: int, size_px: tuple[int, int] | None = None) -> list[Path]:
    """Write networks of one cfg with drawn weights; each in a folder of its own, all under one name."""
    (folder / "two.names").write_text("\n".join(CLASSES))
    models = []
    for seed in seeds:
        weights, _ = write_weights(folder, f"{seed}.weights", seed)
        models.append(folder / f"run-{seed}" / "model.onnx")
        models[-1].parent.mkdir(exist_ok=True)
        export_darknet(folder / "small.cfg", weights, folder / "two.names", size_px, models[-1])
    return models


def _rows(model: Path, picture: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(str(model), providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {PICTURE_INPUT: picture})[0])


@pytest.mark.parametrize("seed", range(3))
def test_rows_are_those_of_the_parts_without_the_classes_they_do_not_answer_for(tmp_path: Path, seed: int) -> None:
    first, second, third = write_models(tmp_path, 1, 2, 3)
    out = tmp_path / "joined.onnx"
    join_models([(first, {}), (second, {"worker": 1.0}), (third, {"all": 1.0, "worker": 0.5})], out)
    onnx.checker.check_model(onnx.load(str(out)), full_check=True)
    picture = np.random.default_rng(seed).random((1, 3, 64, 96), dtype=np.float32)
    expected = [_rows(model, picture) for model in (first, second, third)]
    expected[1][..., 6] = 0
    expected[2][..., 5] *= np.float32(0.5)
    np.testing.assert_array_equal(_rows(out, picture), np.concatenate(expected, axis=1))


@pytest.mark.parametrize("listing", [0, 1])
def test_operators_that_a_part_lists_and_does_not_use_are_no_obstacle(tmp_path: Path, listing: int) -> None:
    models = write_models(tmp_path, 1, 2)
    picture = np.random.default_rng(0).random((1, 3, 64, 96), dtype=np.float32)
    expected = np.concatenate([_rows(model, picture) for model in models], axis=1)
    # As onnxruntime's quantiser leaves its files.
    proto = onnx.load(str(models[listing]))
    proto.opset_import.append(onnx.helper.make_opsetid("com.microsoft.experimental", 1))
    onnx.save(proto, str(models[listing]))
    join_models([(model, {}) for model in models], tmp_path / "joined.onnx")
    np.testing.assert_array_equal(_rows(tmp_path / "joined.onnx", picture), expected)


def test_points_stay_with_the_rows_of_the_part_that_gives_them(tmp_path: Path) -> None:
    plain, other = write_models(tmp_path, 1, 2)
    pointed = tmp_path / "pointed.cfg"
    pointed.write_text(pointed_cfg((tmp_path / "small.cfg").read_text()))
    network = DarknetNetwork(read_cfg(pointed))
    initialize_layers(network, [index for index, _ in network.convolutions()], torch.Generator().manual_seed(1))
    save_weights(network, tmp_path / "pointed.weights")
    export_darknet(pointed, tmp_path / "pointed.weights", tmp_path / "two.names", None, tmp_path / "points.onnx")
    join_models([(plain, {}), (tmp_path / "points.onnx", {})], tmp_path / "joined.onnx")
    picture = np.random.default_rng(0).random((1, 3, 64, 96), dtype=np.float32)
    sessions = (
        onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
        for path in (tmp_path / "points.onnx", tmp_path / "joined.onnx")
    )
    (own,), (joined,) = (session.run([POINTS_OUTPUT], {PICTURE_INPUT: picture}) for session in sessions)
    rows = own.shape[1]
    np.testing.assert_array_equal(joined[:, -rows:], own)
    assert np.isnan(joined[:, :-rows]).all()
    join_models([(plain, {}), (other, {})], tmp_path / "without.onnx")
    assert [output.name for output in onnx.load(str(tmp_path / "without.onnx")).graph.output] == [BOXES_OUTPUT]


def test_the_card_names_every_part(tmp_path: Path) -> None:
    models = write_models(tmp_path, 1, 2)
    card = join_models([(models[0], {}), (models[1], {"worker": 1.0})], tmp_path / "joined.onnx")
    metadata = {entry.key: entry.value for entry in onnx.load(str(tmp_path / "joined.onnx")).metadata_props}
    assert ModelCard.from_metadata(metadata, "joined.onnx") == card
    assert card.classes == CLASSES and len(card.anchors_px) == 2
    assert card.sources == {f"run-{seed}/model.onnx": file_sha256(models[seed - 1]) for seed in (1, 2)}


def test_a_detector_joined_with_itself_finds_what_it_found_alone(tmp_path: Path) -> None:
    alone = write_detector(tmp_path, half=True)
    join_models([(alone, {"worker": 1.0}), (alone, {"vehicle": 1.0})], tmp_path / "joined.onnx")
    for seed in range(3):
        frame = frame_from_array(draw_squares(np.random.default_rng(seed), 6)[0])
        expected, found = (OnnxDetector(path).detect(frame) for path in (alone, tmp_path / "joined.onnx"))
        assert len(expected.score) > 0
        np.testing.assert_array_equal(found.xyxy_px, expected.xyxy_px)
        np.testing.assert_array_equal(found.class_id, expected.class_id)


def test_parts_that_do_not_fit_are_refused_and_nothing_is_written(tmp_path: Path) -> None:
    first, second = write_models(tmp_path, 1, 2)
    (larger,) = write_models(tmp_path, 3, size_px=(192, 128))
    other = write_detector(tmp_path)
    out = tmp_path / "joined.onnx"
    wrong: list[tuple[list[tuple[Path, dict[str, float]]], type[StandoffError], str]] = [
        ([(first, {})], ConfigError, "two models or more"),
        ([(first, {}), (second, {"crane": 1.0})], ConfigError, "crane"),
        ([(first, {}), (second, {"worker": 1.5})], ConfigError, "worker:1.5"),
        ([(first, {"worker": 1.0}), (second, {"worker": 1.0})], ConfigError, "none for vehicle"),
        ([(first, {}), (larger, {})], ModelError, "input size of model.onnx, 96, 64"),
        ([(first, {}), (other, {})], ModelError, f"{SIZE_PX[0]}, {SIZE_PX[1]}"),
        ([(first, {}), (tmp_path / "two.names", {})], ModelError, "two.names"),
    ]
    for parts, error, match in wrong:
        with pytest.raises(error, match=match):
            join_models(parts, out)
    assert not out.exists()
