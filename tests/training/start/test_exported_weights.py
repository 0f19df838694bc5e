from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import onnx
import onnx.helper
import pytest
import torch
from torch import Tensor
from training.conftest import DarknetFiles

from standoff.core.errors import ModelError
from standoff.stages.detect import find_model
from standoff.training.architectures import efficientnet_lite0_cfg, yolov3_tiny_cfg
from standoff.training.architectures.refitted import pointed_cfg
from standoff.training.architectures.yolov3 import YOLOV3_ANCHORS_PX
from standoff.training.darknet.cfg import parse_cfg, read_cfg
from standoff.training.darknet.export import export_darknet
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import load_weights, save_weights
from standoff.training.join import join_models
from standoff.training.start.exported_weights import gives_points, is_folded, read_exported
from standoff.training.start.starting_point import fill_network

MakeFiles = Callable[[str, int], DarknetFiles]
FLOAT, UINT8 = onnx.TensorProto.FLOAT, onnx.TensorProto.UINT8
_OTHER_PX = tuple(tuple((width + 3.0, height + 1.0) for width, height in head) for head in YOLOV3_ANCHORS_PX)


def _heads(network: DarknetNetwork) -> list[Tensor]:
    cfg = network.cfg
    picture = torch.rand(1, 3, cfg.height_px, cfg.width_px, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        return list(network.eval()(picture))


def _loaded(files: DarknetFiles) -> DarknetNetwork:
    network = DarknetNetwork(read_cfg(files.cfg))
    load_weights(network, files.weights)
    return network


@pytest.mark.parametrize("has_point", [False, True])
def test_an_exported_network_comes_back_with_its_anchors_classes_and_points(
    make_darknet_files: MakeFiles, tmp_path: Path, has_point: bool
) -> None:
    text = yolov3_tiny_cfg(3, 64, 64)
    files = make_darknet_files(pointed_cfg(text) if has_point else text, 0)
    card = export_darknet(*files, None, tmp_path / "a.onnx")
    target = parse_cfg(pointed_cfg(yolov3_tiny_cfg(3, 64, 64, [[(9, 9)] * 3, [(50, 60)] * 3])), "own.cfg")
    found, classes = read_exported(target, tmp_path / "a.onnx")
    expected = _loaded(files)
    assert found.cfg.heads[0].anchors_px == card.anchors_px[0] == expected.cfg.heads[0].anchors_px
    assert classes == card.classes
    assert found.cfg.heads[0].has_point is has_point is gives_points(tmp_path / "a.onnx")
    torch.testing.assert_close(_heads(found), _heads(expected), rtol=1e-4, atol=1e-4)


@pytest.mark.live
def test_of_a_joined_file_the_part_of_the_same_layers_is_taken(make_darknet_files: MakeFiles, tmp_path: Path) -> None:
    texts = yolov3_tiny_cfg(3, 64, 64), efficientnet_lite0_cfg(3, 64, 64, _OTHER_PX)
    parts = []
    for number, text in enumerate(texts):
        files = make_darknet_files(text, number)
        export_darknet(*files, None, tmp_path / f"{number}.onnx")
        parts.append(_loaded(files))
    join_models([(tmp_path / "0.onnx", {}), (tmp_path / "1.onnx", {})], tmp_path / "both.onnx")
    for expected in parts:
        found, _ = read_exported(expected.cfg, tmp_path / "both.onnx")
        assert [head.anchors_px for head in found.cfg.heads] == [head.anchors_px for head in expected.cfg.heads]
        torch.testing.assert_close(_heads(found), _heads(expected), rtol=1e-4, atol=1e-4)


def test_the_shipped_detector_is_a_start_and_its_normalisations_are_told_to_stay(tmp_path: Path) -> None:
    cfg = parse_cfg(pointed_cfg(efficientnet_lite0_cfg(2, 64, 64)), "own.cfg")
    network, transferred = fill_network(cfg, ("worker", "crane"), find_model("site"), 0)
    assert transferred.folded and transferred.fresh == ()
    assert transferred.class_sources == (("worker",), ())
    fresh, _ = fill_network(cfg, ("worker", "crane"), None, 0)
    assert not is_folded(fresh)
    save_weights(network, tmp_path / "on.weights")
    assert fill_network(cfg, ("worker", "crane"), tmp_path / "on.weights", 0)[1].folded, "in Darknet's format, too"
    assert len(transferred.resized) == 3
    assert all(torch.isfinite(head).all() for head in _heads(network))


def test_another_network_and_eight_bits_are_refused(make_darknet_files: MakeFiles, tmp_path: Path) -> None:
    files = make_darknet_files(yolov3_tiny_cfg(3, 64, 64), 0)
    export_darknet(*files, None, tmp_path / "a.onnx")
    lite = parse_cfg(efficientnet_lite0_cfg(3, 64, 64), "lite.cfg")
    with pytest.raises(ModelError, match=r"the layers of lite\.cfg"):
        read_exported(lite, tmp_path / "a.onnx")
    eight_bits = onnx.load(str(tmp_path / "a.onnx"))
    scale, zero = (onnx.helper.make_tensor(name, kind, [], [1]) for name, kind in (("s", FLOAT), ("z", UINT8)))
    eight_bits.graph.initializer.extend([scale, zero])
    eight_bits.graph.node.append(onnx.helper.make_node("QuantizeLinear", ["boxes", "s", "z"], ["in_eight_bits"]))
    onnx.save(eight_bits, str(tmp_path / "int8.onnx"))
    with pytest.raises(ModelError, match="floating point"):
        read_exported(lite, tmp_path / "int8.onnx")
