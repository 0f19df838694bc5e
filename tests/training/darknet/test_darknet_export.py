from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import tolerances
import torch
from laws import few
from training.conftest import DarknetFiles

from standoff.core.errors import MissingDependency, ModelError, OutputError
from standoff.stages.detect import ModelCard
from standoff.training import export_darknet, yolov3_tiny_cfg
from standoff.training.architectures import ARCHITECTURES
from standoff.training.architectures.refitted import pointed_cfg
from standoff.training.architectures.yolov3 import YOLOV3_ANCHORS_PX
from standoff.training.darknet.cfg import parse_cfg, read_cfg
from standoff.training.darknet.network import DarknetNetwork, DecodedNetwork
from standoff.training.darknet.weights import load_weights

# Every kind of layer, at strides 8 and 4.
ALL_LAYERS = """[net]
width=32
height=32
[convolutional]
filters=8
size=3
stride=2
pad=1
batch_normalize=1
activation=leaky
[convolutional]
filters=8
groups=4
size=3
pad=1
batch_normalize=1
activation=logistic
[dropout]
[shortcut]
from=-3
activation=leaky
[maxpool]
size=2
stride=2
[maxpool]
size=2
stride=1
[maxpool]
size=5
stride=1
[route]
layers=-1,-3
[convolutional]
filters=12
size=2
stride=2
batch_normalize=1
activation=leaky
[convolutional]
filters=14
activation=linear
[yolo]
mask=1,2
anchors=3,4, 5,9, 11,7
classes=2
num=3
scale_x_y=1.1
[route]
layers=-3
[upsample]
[route]
layers=-1,4
[convolutional]
filters=7
activation=linear
[yolo]
mask=0
anchors=3,4, 5,9, 11,7
classes=2
num=3
"""
MakeFiles = Callable[[str, int], DarknetFiles]


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("size_px", [None, (64, 48)])
def test_onnx_runtime_computes_what_torch_computes(
    make_darknet_files: MakeFiles, tmp_path: Path, size_px: tuple[int, int] | None, seed: int
) -> None:
    files = make_darknet_files(ALL_LAYERS, seed)
    card = export_darknet(*files, size_px, tmp_path / "a.onnx")
    width_px, height_px = card.input_size_px
    network = DarknetNetwork(read_cfg(files.cfg)) if size_px is None else _resized_network(files, size_px)
    load_weights(network, files.weights)
    picture = np.random.default_rng(seed).random((1, 3, height_px, width_px), dtype=np.float32)
    with torch.no_grad():
        by_torch = DecodedNetwork(network).eval()(torch.from_numpy(picture)).numpy()
    session = onnxruntime.InferenceSession(tmp_path / "a.onnx", providers=["CPUExecutionProvider"])
    (by_onnx,) = session.run(None, {"picture": picture})
    np.testing.assert_allclose(by_onnx, by_torch, rtol=tolerances.ONNX_LOGIT, atol=tolerances.ONNX_SIGMOID)


@pytest.mark.parametrize("name", few(sorted(set(ARCHITECTURES) - {"yolov3"}), quick=2))
def test_onnx_runtime_computes_what_torch_computes_in_every_small_architecture(
    make_darknet_files: MakeFiles, tmp_path: Path, name: str
) -> None:
    architecture = ARCHITECTURES[name]
    files = make_darknet_files(architecture.compose(7, 128, 96, YOLOV3_ANCHORS_PX[: len(architecture.strides)]), 0)
    export_darknet(*files, None, tmp_path / "a.onnx")
    network = DarknetNetwork(read_cfg(files.cfg))
    load_weights(network, files.weights)
    # Blotches as the weights were settled on: noise drives the heads to where only one of the two underflows.
    blotches = np.random.default_rng(0).random((1, 3, 12, 16), dtype=np.float32)
    picture = np.kron(blotches, np.ones((8, 8), dtype=np.float32))
    with torch.no_grad():
        by_torch = DecodedNetwork(network).eval()(torch.from_numpy(picture)).numpy()
    session = onnxruntime.InferenceSession(tmp_path / "a.onnx", providers=["CPUExecutionProvider"])
    (by_onnx,) = session.run(None, {"picture": picture})
    assert np.ptp(by_torch[..., 4]) > 0.01, "a dead network would agree with anything"
    np.testing.assert_allclose(by_onnx, by_torch, rtol=tolerances.ONNX_LOGIT, atol=tolerances.ONNX_SIGMOID)


def _resized_network(files: DarknetFiles, size_px: tuple[int, int]) -> DarknetNetwork:
    text = files.cfg.read_text().replace("width=32", f"width={size_px[0]}").replace("height=32", f"height={size_px[1]}")
    (files.cfg.parent / "resized.cfg").write_text(text)
    return DarknetNetwork(read_cfg(files.cfg.parent / "resized.cfg"))


def test_a_raw_head_of_zeros_decodes_to_cell_centres_and_anchors(make_darknet_files: MakeFiles) -> None:
    network = DarknetNetwork(read_cfg(make_darknet_files(ALL_LAYERS, 0).cfg))
    for _, block in network.convolutions():
        for parameter in block.parameters():
            torch.nn.init.zeros_(parameter)
    with torch.no_grad():
        rows = DecodedNetwork(network).eval()(torch.rand(1, 3, 32, 32))[0]
    assert rows.shape == (4 * 4 * 2 + 8 * 8, 7)
    # Coarse head first: rows over cell rows, cell columns, anchors.
    np.testing.assert_allclose(rows[0], [4, 4, 5, 9, 0.5, 0.5, 0.5], rtol=1e-6)
    np.testing.assert_allclose(rows[3], [12, 4, 11, 7, 0.5, 0.5, 0.5], rtol=1e-6)
    np.testing.assert_allclose(rows[8], [4, 12, 5, 9, 0.5, 0.5, 0.5], rtol=1e-6)
    np.testing.assert_allclose(rows[-1], [30, 30, 3, 4, 0.5, 0.5, 0.5], rtol=1e-6)


def test_the_file_describes_itself(make_darknet_files: MakeFiles, tmp_path: Path) -> None:
    files = make_darknet_files(ALL_LAYERS, 0)
    card = export_darknet(*files, (64, 32), tmp_path / "a.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "a.onnx", providers=["CPUExecutionProvider"])
    assert ModelCard.from_metadata(session.get_modelmeta().custom_metadata_map, "a.onnx") == card
    assert card.classes == ("class 0", "class 1")
    assert card.anchors_px == (((5.0, 9.0), (11.0, 7.0)), ((3.0, 4.0),))
    assert card.input_size_px == (64, 32)
    assert set(card.sources) == {"net.cfg", "net.weights", "net.names"}
    assert all(len(digest) == 64 for digest in card.sources.values())


@pytest.mark.parametrize(
    ("size_px", "names", "message"),
    [
        ((416, 400), 2, r"multiples of 32 px, found 416x400\. Take 416x384"),
        ((0, 32), 2, r"multiples of 32 px, found 0x32\. Take 32x32"),
        (None, 3, r"2 names, as many as classes in net\.cfg, found 3 in net\.names"),
    ],
)
def test_a_size_or_names_that_do_not_fit_are_refused(
    make_darknet_files: MakeFiles, tmp_path: Path, size_px: tuple[int, int] | None, names: int, message: str
) -> None:
    files = make_darknet_files(yolov3_tiny_cfg(2, 64, 64), 0)
    files.names.write_text(names * "x\n")
    with pytest.raises(ModelError, match=message):
        export_darknet(*files, size_px, tmp_path / "a.onnx")


def test_names_in_another_encoding_are_refused_and_the_encoding_is_named(
    make_darknet_files: MakeFiles, tmp_path: Path
) -> None:
    files = make_darknet_files(ALL_LAYERS, 0)
    files.names.write_bytes("worker\nträger\n".encode("cp1252"))
    with pytest.raises(ModelError, match="Windows-1252"):
        export_darknet(*files, None, tmp_path / "a.onnx")
    files.names.write_text("worker\nträger\n", encoding="utf-8-sig")
    assert export_darknet(*files, None, tmp_path / "a.onnx").classes == ("worker", "träger")


def test_a_route_takes_its_part_of_each_of_its_layers() -> None:
    # As Darknet's forward_route_layer copies them; OpenCV reads groups of one layer only.
    text = "[net]\nwidth=8\nheight=8\n"
    text += "".join(f"[convolutional]\nfilters={filters}\nactivation=linear\n" for filters in (4, 8))
    text += "[route]\nlayers=-1,-2\ngroups=2\ngroup_id=1\n[yolo]\nanchors=1,1\nclasses=1\n"
    network = DarknetNetwork(parse_cfg(text))
    picture = torch.rand(1, 3, 8, 8)
    with torch.no_grad():
        (head,) = network(picture)
        first = network.blocks[0](picture)
        second = network.blocks[1](first)
    torch.testing.assert_close(head, torch.cat([second[:, 4:], first[:, 2:]], dim=1))
    with pytest.raises(ModelError, match=r"channels that 3 groups divide in layer 2, \[route\] .*found 8 and 4"):
        DarknetNetwork(parse_cfg(text.replace("groups=2", "groups=3")))


def test_an_input_that_no_memory_holds_is_refused(make_darknet_files: MakeFiles, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="at most 8192 px a side, found 1000000x32"):
        export_darknet(*make_darknet_files(ALL_LAYERS, 0), (1000000, 32), tmp_path / "a.onnx")


def test_other_than_three_channels_are_refused(make_darknet_files: MakeFiles, tmp_path: Path) -> None:
    files = make_darknet_files(ALL_LAYERS, 0)
    files.cfg.write_text(ALL_LAYERS.replace("height=32", "height=32\nchannels=1"))
    with pytest.raises(ModelError, match="3 input channels"):
        export_darknet(*files, None, tmp_path / "a.onnx")


def test_a_failed_export_leaves_the_older_file_and_nothing_else(make_darknet_files: MakeFiles, tmp_path: Path) -> None:
    files = make_darknet_files(ALL_LAYERS, 0)
    files.weights.write_bytes(files.weights.read_bytes()[:-400])
    out = tmp_path / "out" / "a.onnx"
    out.parent.mkdir()
    out.write_text("older")
    with pytest.raises(ModelError, match="layer 14"):
        export_darknet(*files, None, out)
    assert out.read_text() == "older"
    assert list(out.parent.iterdir()) == [out]


def test_missing_names_and_a_missing_folder_are_refused(make_darknet_files: MakeFiles, tmp_path: Path) -> None:
    files = make_darknet_files(ALL_LAYERS, 0)
    with pytest.raises(OutputError, match="No such file"):
        export_darknet(*files, None, tmp_path / "nowhere" / "a.onnx")
    files.names.unlink()
    with pytest.raises(ModelError, match="a names file"):
        export_darknet(*files, None, tmp_path / "a.onnx")


def test_without_torch_the_export_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingDependency, match=r"found no torch and no onnx\. Run pip install 'standoff\[train\]'"):
        export_darknet(tmp_path / "a.cfg", tmp_path / "a.weights", tmp_path / "a.names", None, tmp_path / "a.onnx")


def test_importing_training_does_not_import_torch() -> None:
    code = "import sys, standoff.training; sys.exit(int(bool({'torch', 'onnx'} & set(sys.modules))))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("seed", range(2))
def test_points_are_exported_beside_the_boxes_and_leave_them_as_they_were(
    make_darknet_files: MakeFiles, tmp_path: Path, seed: int
) -> None:
    files = make_darknet_files(pointed_cfg(ALL_LAYERS), seed)
    card = export_darknet(*files, None, tmp_path / "a.onnx")
    network = DarknetNetwork(read_cfg(files.cfg))
    load_weights(network, files.weights)
    width_px, height_px = card.input_size_px
    picture = np.random.default_rng(seed).random((1, 3, height_px, width_px), dtype=np.float32)
    with torch.no_grad():
        boxes, points = DecodedNetwork(network).eval().decode(network.eval()(torch.from_numpy(picture)))
    session = onnxruntime.InferenceSession(tmp_path / "a.onnx", providers=["CPUExecutionProvider"])
    found = dict(zip(("boxes", "points"), session.run(["boxes", "points"], {"picture": picture}), strict=True))
    assert found["points"].shape == (*found["boxes"].shape[:2], 4)
    assert (found["points"][..., 2:] > 0).all(), "errors are positive"
    for name, expected in (("boxes", boxes), ("points", points)):
        np.testing.assert_allclose(
            found[name], expected.numpy(), rtol=tolerances.ONNX_LOGIT, atol=tolerances.ONNX_SIGMOID
        )


@pytest.mark.parametrize("seed", range(2))
def test_a_point_of_zeros_lies_in_the_middle_of_its_box_and_is_unsure_by_its_sides(
    make_darknet_files: MakeFiles, seed: int
) -> None:
    files = make_darknet_files(pointed_cfg(ALL_LAYERS), seed)
    network = DarknetNetwork(read_cfg(files.cfg)).eval()
    load_weights(network, files.weights)
    with torch.no_grad():
        heads = []
        for raw, head in zip(network(torch.rand(1, 3, 32, 32)), network.cfg.heads, strict=True):
            by_anchor = raw.reshape(1, len(head.anchors_px), head.values, *raw.shape[2:]).clone()
            by_anchor[:, :, -4:] = 0.0
            heads.append(by_anchor.reshape(raw.shape))
        boxes, points = DecodedNetwork(network).decode(tuple(heads))
    torch.testing.assert_close(points, boxes[..., :4])
