from __future__ import annotations

import math
from pathlib import Path

import pytest
import torch
from torch import Tensor

from standoff.core.errors import ModelError
from standoff.training import yolo_fastest_xl_cfg, yolov3_cfg, yolov3_tiny_cfg
from standoff.training.architectures import Anchors
from standoff.training.architectures.refitted import pointed_cfg
from standoff.training.architectures.yolo_fastest import YOLO_FASTEST_ANCHORS_PX
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.network import DarknetNetwork, DecodedNetwork
from standoff.training.darknet.weights import save_weights
from standoff.training.start.class_rows import COCO_CLASSES
from standoff.training.start.initial_weights import initialize_layers
from standoff.training.start.transfer import Transferred, transfer_weights

SITE = ("worker", "excavator", "dump_truck", "vehicle", "reference")
_DOUBLE_PX = (((5.0, 9.0), (14.0, 20.0), (40.0, 50.0)), ((60.0, 140.0), (110.0, 80.0), (250.0, 230.0)))
_TWICE_PX = tuple(tuple((1.2 * width, 0.9 * height) for width, height in head) for head in _DOUBLE_PX)
OTHER_ANCHORS_PX = (((5.0, 9.0), (14.0, 20.0), (40.0, 50.0)), ((60.0, 140.0), (110.0, 80.0), (250.0, 230.0)))


def _network(text: str, seed: int = 0) -> DarknetNetwork:
    """A fresh network whose heads say something about every cell."""
    network = DarknetNetwork(parse_cfg(text, "own.cfg"))
    initialize_layers(network, [index for index, _ in network.convolutions()], torch.Generator().manual_seed(seed))
    generator = torch.Generator().manual_seed(seed + 100)
    for _, block in network.convolutions():
        if block.convolution.bias is not None:
            torch.nn.init.normal_(block.convolution.bias, generator=generator)
    return network


def _trained(text: str, weights: Path) -> DarknetNetwork:
    network = _network(text, seed=1)
    save_weights(network, weights)
    weights.with_suffix(".cfg").write_text(text)
    return network


def _state(network: DarknetNetwork, layer: int) -> dict[str, Tensor]:
    return dict(network.convolutions())[layer].state_dict()


def _rows(network: DarknetNetwork) -> Tensor:
    cfg = network.cfg
    picture = torch.rand(1, 3, cfg.height_px, cfg.width_px, generator=torch.Generator().manual_seed(3))
    with torch.no_grad():
        rows: Tensor = DecodedNetwork(network).eval()(picture)
    return rows[0]


def _layers(transferred: Transferred) -> list[int]:
    return sorted(transferred.copied + transferred.resized + transferred.fresh)


def test_weights_of_the_same_cfg_are_copied_whole(tmp_path: Path) -> None:
    source = _trained(yolov3_tiny_cfg(5, 64, 64), tmp_path / "a.weights")
    target = _network(yolov3_tiny_cfg(5, 64, 64))
    transferred = transfer_weights(target, tmp_path / "a.weights")
    assert (len(transferred.copied), transferred.resized, transferred.fresh) == (13, (), ())
    assert transferred.source == "all 13 convolutions, in a.weights"
    assert torch.equal(_rows(target), _rows(source))


@pytest.mark.parametrize("cut_after_layer", [0, 4, 14])
def test_weights_that_are_cut_after_a_layer_fill_what_is_before_it(tmp_path: Path, cut_after_layer: int) -> None:
    source = _network(yolov3_tiny_cfg(80, 64, 64), seed=1)
    save_weights(source, tmp_path / "a.weights", cut_after_layer=cut_after_layer)
    target = _network(yolov3_tiny_cfg(5, 64, 64))
    transferred = transfer_weights(target, tmp_path / "a.weights", classes=SITE)
    assert max(transferred.copied) == cut_after_layer
    assert min(transferred.fresh) > cut_after_layer
    assert _layers(transferred) == [index for index, _ in target.convolutions()]
    for layer in transferred.copied:
        expected = _state(source, layer)
        assert all(torch.equal(value, expected[name]) for name, value in _state(target, layer).items())


@pytest.mark.live
def test_a_darknet53_cut_as_everybody_publishes_it_is_the_first_52_convolutions(tmp_path: Path) -> None:
    save_weights(_network(yolov3_cfg(80, 32, 32)), tmp_path / "darknet53.conv.74", cut_after_layer=74)
    # Of the published file: 162482580 bytes.
    assert (tmp_path / "darknet53.conv.74").stat().st_size == 162_482_580
    transferred = transfer_weights(_network(yolov3_cfg(5, 32, 32), seed=2), tmp_path / "darknet53.conv.74")
    assert (len(transferred.copied), len(transferred.fresh)) == (52, 23)


@pytest.mark.parametrize("has_cfg", [True, False])
def test_a_resized_head_says_the_same_boxes_and_the_same_of_the_classes_that_it_keeps(
    tmp_path: Path, has_cfg: bool
) -> None:
    source = _trained(yolo_fastest_xl_cfg(80, 96, 64), tmp_path / "coco.weights")
    target = _network(yolo_fastest_xl_cfg(5, 96, 64))
    source_cfg = tmp_path / "coco.cfg" if has_cfg else None
    transferred = transfer_weights(target, tmp_path / "coco.weights", source_cfg, classes=SITE)
    assert transferred.resized == (120, 129)
    assert transferred.fresh == ()
    assert transferred.class_sources == (("person",), ("truck",), ("truck",), ("car",), ())
    kept = [*range(5), *(5 + COCO_CLASSES.index(name) for name in ("person", "truck", "truck", "car"))]
    torch.testing.assert_close(_rows(target)[:, :9], _rows(source)[:, kept])


def test_other_anchors_start_from_the_nearest_and_say_its_boxes(tmp_path: Path) -> None:
    source = _trained(yolo_fastest_xl_cfg(80, 96, 64), tmp_path / "coco.weights")
    target = _network(yolo_fastest_xl_cfg(80, 96, 64, OTHER_ANCHORS_PX))
    transfer_weights(target, tmp_path / "coco.weights", tmp_path / "coco.cfg")
    # Coarse head first; of its anchors (115, 73), (119, 199), (242, 238) these are the nearest to 60 x 140 and so on.
    found, expected = _rows(target)[:18].reshape(6, 3, -1), _rows(source)[:18].reshape(6, 3, -1)[:, [1, 0, 2]]
    torch.testing.assert_close(found, expected)


def test_published_weights_keep_their_own_anchors_where_the_classes_are_as_many(tmp_path: Path) -> None:
    source = _trained(yolo_fastest_xl_cfg(80, 96, 64), tmp_path / "coco.weights")
    target = _network(yolo_fastest_xl_cfg(80, 96, 64, OTHER_ANCHORS_PX))
    transferred = transfer_weights(target, tmp_path / "coco.weights")
    assert transferred.resized == (120, 129)
    found, expected = _rows(target)[:18].reshape(6, 3, -1), _rows(source)[:18].reshape(6, 3, -1)[:, [1, 0, 2]]
    torch.testing.assert_close(found, expected)


def test_weights_of_a_run_keep_its_anchors_without_a_cfg_beside_them(tmp_path: Path) -> None:
    source = _trained(yolo_fastest_xl_cfg(5, 96, 64, OTHER_ANCHORS_PX), tmp_path / "run.weights")
    target = _network(yolo_fastest_xl_cfg(5, 96, 64, OTHER_ANCHORS_PX))
    assert transfer_weights(target, tmp_path / "run.weights").resized == ()
    torch.testing.assert_close(_rows(target), _rows(source))


def test_an_anchor_may_serve_several(tmp_path: Path) -> None:
    source = _trained(yolo_fastest_xl_cfg(80, 96, 64), tmp_path / "coco.weights")
    tiny_px: Anchors = (((4.0, 6.0), (6.0, 9.0), (9.0, 14.0)), YOLO_FASTEST_ANCHORS_PX[1])
    target = _network(yolo_fastest_xl_cfg(80, 96, 64, tiny_px))
    transfer_weights(target, tmp_path / "coco.weights", tmp_path / "coco.cfg")
    found, smallest = _rows(target)[18:].reshape(24, 3, -1), _rows(source)[18:].reshape(24, 3, -1)[:, :1]
    torch.testing.assert_close(found, smallest.expand(-1, 3, -1))


@pytest.mark.parametrize(
    ("strides", "resized", "kept"), [((8, 16, 32), (120, 129), slice(0, 90)), ((8, 16), (122,), slice(18, 90))]
)
def test_heads_that_the_source_lacks_are_fresh_and_the_others_know_what_they_knew(
    tmp_path: Path, strides: tuple[int, ...], resized: tuple[int, ...], kept: slice
) -> None:
    source = _trained(yolo_fastest_xl_cfg(80, 96, 64), tmp_path / "coco.weights")
    anchors_px = (((4.0, 6.0), (6.0, 9.0), (9.0, 14.0)), *YOLO_FASTEST_ANCHORS_PX)[: len(strides)]
    target = _network(yolo_fastest_xl_cfg(5, 96, 64, anchors_px, strides))
    transferred = transfer_weights(target, tmp_path / "coco.weights", classes=SITE)
    assert transferred.resized == resized
    assert len(transferred.fresh) == 6
    assert _layers(transferred) == [index for index, _ in target.convolutions()]
    found, expected = _rows(target)[: kept.stop - kept.start], _rows(source)[kept]
    torch.testing.assert_close(found[:, :6], expected[:, :6])
    stride_8 = _rows(target)[kept.stop - kept.start :]
    assert math.isclose(stride_8[:, 4].median().item(), 0.01, abs_tol=0.01)


def test_without_names_classes_are_kept_in_their_order_if_they_are_as_many_and_else_are_fresh(tmp_path: Path) -> None:
    source = _trained(yolov3_tiny_cfg(5, 64, 64), tmp_path / "a.weights")
    same = _network(yolov3_tiny_cfg(5, 64, 64))
    transferred = transfer_weights(same, tmp_path / "a.weights", tmp_path / "a.cfg")
    assert (len(transferred.copied), transferred.class_sources) == (13, ())
    assert torch.equal(_rows(same), _rows(source))
    fewer = _network(yolov3_tiny_cfg(3, 64, 64))
    transferred = transfer_weights(fewer, tmp_path / "a.weights")
    assert transferred.class_sources == ((), (), ())
    assert transferred.source == "yolov3-tiny with 5 classes, in a.weights"
    torch.testing.assert_close(_rows(fewer)[:, :5], _rows(source)[:, :5])


def test_a_network_that_nobody_published_is_known_by_its_length_too(tmp_path: Path) -> None:
    anchors_px: Anchors = (((5.0, 9.0),), ((60.0, 140.0), (110.0, 80.0)))
    source = _trained(yolov3_tiny_cfg(4, 64, 64, anchors_px), tmp_path / "a.weights")
    target = _network(yolov3_tiny_cfg(2, 64, 64, anchors_px))
    transferred = transfer_weights(
        target,
        tmp_path / "a.weights",
        classes=("worker", "crane"),
        source_classes=("tree", "crane", "worker", "dog"),
    )
    assert transferred.class_sources == (("worker",), ("crane",))
    torch.testing.assert_close(_rows(target), _rows(source)[:, [0, 1, 2, 3, 4, 7, 6]])


def test_weights_of_another_architecture_are_refused_at_the_first_layer_that_does_not_fit(tmp_path: Path) -> None:
    _trained(yolov3_tiny_cfg(80, 64, 64), tmp_path / "tiny.weights")
    fastest = _network(yolo_fastest_xl_cfg(5, 64, 64))
    with pytest.raises(ModelError, match=r"layer \d+, \[convolutional\] .* of own\.cfg") as caught:
        transfer_weights(fastest, tmp_path / "tiny.weights")
    assert "\n" not in str(caught.value)
    with pytest.raises(ModelError, match=r"fit layer 0, .* of own\.cfg, found tiny\.cfg, \d of whose 13 convolutions"):
        transfer_weights(fastest, tmp_path / "tiny.weights", tmp_path / "tiny.cfg")


def test_weights_cut_within_a_layer_say_in_which(tmp_path: Path) -> None:
    _trained(yolov3_tiny_cfg(5, 64, 64), tmp_path / "a.weights")
    content = (tmp_path / "a.weights").read_bytes()
    (tmp_path / "a.weights").write_bytes(content[: 20 + len(content) // 8 * 4])
    with pytest.raises(ModelError, match=r"numbers in a\.weights for layer 12, \[convolutional\] .* of own\.cfg"):
        transfer_weights(_network(yolov3_tiny_cfg(5, 64, 64)), tmp_path / "a.weights")


@pytest.mark.shared
def test_the_published_weights_keep_seeing_people_after_the_transfer(shared_data: Path) -> None:
    weights = shared_data / "weights" / "yolo-fastest-1.1-xl" / "yolo-fastest-1.1-xl.weights"
    coco = _network(yolo_fastest_xl_cfg(80, 320, 320))
    transfer_weights(coco, weights)
    site = _network(yolo_fastest_xl_cfg(5, 320, 320, OTHER_ANCHORS_PX))
    transferred = transfer_weights(site, weights, classes=SITE)
    assert transferred.source == "yolo-fastest-xl with 80 classes, in yolo-fastest-1.1-xl.weights"
    assert (len(transferred.copied), len(transferred.resized), transferred.fresh) == (82, 2, ())
    # The last anchor of the coarse head is (250, 230) instead of (242, 238).
    torch.testing.assert_close(_rows(site)[2:300:3, :6], _rows(coco)[2:300:3, :6])


def _boxes_and_points(network: DarknetNetwork) -> tuple[Tensor, Tensor]:
    cfg = network.cfg
    picture = torch.rand(1, 3, cfg.height_px, cfg.width_px, generator=torch.Generator().manual_seed(3))
    with torch.no_grad():
        boxes, points = DecodedNetwork(network).decode(network.eval()(picture))
    return boxes[0], points[0]


def test_points_are_kept_in_pixels_whatever_the_new_anchors_are(tmp_path: Path) -> None:
    text, other = (pointed_cfg(yolo_fastest_xl_cfg(5, 96, 64, anchors_px)) for anchors_px in (_DOUBLE_PX, _TWICE_PX))
    source = _trained(text, tmp_path / "run.weights")
    target = _network(other)
    transfer_weights(target, tmp_path / "run.weights", tmp_path / "run.cfg")
    (_, found), (_, expected) = _boxes_and_points(target), _boxes_and_points(source)
    torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-3)
    torch.testing.assert_close(_rows(target), _rows(source))


def test_a_head_that_learns_points_anew_begins_below_the_middle_and_unsure(tmp_path: Path) -> None:
    source = _trained(yolo_fastest_xl_cfg(5, 96, 64), tmp_path / "run.weights")
    target = _network(pointed_cfg(yolo_fastest_xl_cfg(5, 96, 64)))
    assert transfer_weights(target, tmp_path / "run.weights", tmp_path / "run.cfg").resized == (120, 129)
    torch.testing.assert_close(_rows(target), _rows(source))
    boxes, points = _boxes_and_points(target)
    sides_px = boxes[:, 2:4]
    torch.testing.assert_close(
        (points[:, :2] - boxes[:, :2]) / sides_px, torch.tensor([[0.0, 0.25]]).expand(len(boxes), -1), atol=1e-4, rtol=0
    )
    assert (points[:, 2:] > 0.2 * sides_px).all()
