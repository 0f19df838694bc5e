"""The exported network against OpenCV's Darknet importer, which nobody here wrote."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import onnxruntime
import pytest
import tolerances
from laws import few
from training.conftest import DarknetFiles
from training.darknet.published_cfgs import PUBLISHED

from standoff.training import export_darknet, yolov3_cfg, yolov3_tiny_cfg
from standoff.training.architectures import ARCHITECTURES
from standoff.training.architectures.yolov3 import YOLOV3_ANCHORS_PX
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.layers import Yolo

Picture = npt.NDArray[np.uint8]
Rows = npt.NDArray[np.float32]


def _ours(files: DarknetFiles, network_input: Rows, folder: Path) -> Rows:
    size_px = network_input.shape[3], network_input.shape[2]
    export_darknet(files.cfg, files.weights, files.names, size_px, folder / "model.onnx")
    session = onnxruntime.InferenceSession(folder / "model.onnx", providers=["CPUExecutionProvider"])
    rows: Rows = session.run(None, {"picture": network_input})[0][0]
    return rows


def _opencv(files: DarknetFiles, network_input: Rows, folder: Path) -> Rows:
    # By default OpenCV sets class probabilities below 0.2 to 0; without a threshold all can be compared.
    (folder / "opencv.cfg").write_text(files.cfg.read_text().replace("[yolo]", "[yolo]\nthresh=0"))
    network = cv2.dnn.readNetFromDarknet(str(folder / "opencv.cfg"), str(files.weights))
    network.enableWinograd(False)  # it is the less exact side: 1.6e-3 from float64 in YOLOv3-416, without it 1.4e-3
    network.setInput(network_input)
    return np.concatenate(network.forward(network.getUnconnectedOutLayersNames()))


def _worst_differences(files: DarknetFiles, picture: Picture, size_px: tuple[int, int], folder: Path) -> Rows:
    """Largest difference in each column, in OpenCV's units: fractions of the input, and probabilities."""
    network_input = np.asarray(cv2.dnn.blobFromImage(picture, 1 / 255, size_px, swapRB=True))
    ours, theirs = _ours(files, network_input, folder), _opencv(files, network_input, folder)
    assert ours.shape == theirs.shape
    assert np.ptp(theirs[:, 4]) > 0.01, "a dead network would agree with anything"
    ours[:, 0:4] /= np.array([*size_px, *size_px])
    ours[:, 5:] *= ours[:, 4:5]
    worst: Rows = np.abs(ours - theirs).max(axis=0)
    return worst


def _noise(size_px: tuple[int, int], seed: int) -> Picture:
    small = np.random.default_rng(seed).integers(0, 256, (12, 16, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(small, size_px, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


@pytest.mark.shared
@pytest.mark.parametrize("size_px", [(320, 320), pytest.param((768, 576), marks=pytest.mark.live)])
def test_yolo_fastest_with_its_real_weights_decodes_as_in_opencv(
    shared_data: Path, tmp_path: Path, size_px: tuple[int, int]
) -> None:
    stem = shared_data / "weights" / "yolo-fastest-1.1-xl" / "yolo-fastest-1.1-xl"
    files = DarknetFiles(Path(f"{stem}.cfg"), Path(f"{stem}.weights"), stem.with_name("coco.names"))
    video = cv2.VideoCapture(str(shared_data / "pets2009" / "vtest.avi"))
    has_frame, picture = video.read()
    video.release()
    assert has_frame
    worst = _worst_differences(files, np.asarray(picture, np.uint8), size_px, tmp_path)
    assert worst.max() <= tolerances.DARKNET_DECODED


@pytest.mark.parametrize(("size_px", "seed"), few([((224, 160), 1), ((160, 160), 0), ((160, 224), 2)]))
def test_yolov3_tiny_decodes_as_in_opencv(
    make_darknet_files: Callable[[str, int], DarknetFiles], tmp_path: Path, size_px: tuple[int, int], seed: int
) -> None:
    files = make_darknet_files(yolov3_tiny_cfg(9, *size_px), seed)
    worst = _worst_differences(files, _noise(size_px, seed), size_px, tmp_path)
    assert worst.max() <= tolerances.DARKNET_DECODED


@pytest.mark.parametrize(("name", "seed"), few([("yolo-fastest-xl-8-16-32", 1), ("yolo-fastest-xl-8-16", 0)]))
def test_yolo_fastest_with_a_stride_8_head_decodes_as_in_opencv(
    make_darknet_files: Callable[[str, int], DarknetFiles], tmp_path: Path, name: str, seed: int
) -> None:
    size_px = (224, 160)
    architecture = ARCHITECTURES[name]
    anchors_px = YOLOV3_ANCHORS_PX[: len(architecture.strides)]
    files = make_darknet_files(architecture.compose(7, *size_px, anchors_px), seed)
    worst = _worst_differences(files, _noise(size_px, seed), size_px, tmp_path)
    assert worst.max() <= tolerances.DARKNET_DECODED


@pytest.mark.parametrize("name", PUBLISHED)
def test_networks_since_yolov4_decode_as_in_opencv(
    make_darknet_files: Callable[[str, int], DarknetFiles], tmp_path: Path, name: str
) -> None:
    compose, heads = PUBLISHED[name]
    size_px = (128, 96)
    text = compose(size_px)
    layers = parse_cfg(text).layers
    assert [index for index, layer in enumerate(layers) if isinstance(layer, Yolo)] == [*heads]
    assert len(layers) == heads[-1] + 1
    worst = _worst_differences(make_darknet_files(text, 0), _noise(size_px, 0), size_px, tmp_path)
    assert worst.max() <= tolerances.DARKNET_DECODED


@pytest.mark.live  # 62 million weights; every kind of layer in it is in the small ones
def test_full_yolov3_exports_runs_and_decodes_as_in_opencv(
    make_darknet_files: Callable[[str, int], DarknetFiles], tmp_path: Path
) -> None:
    files = make_darknet_files(yolov3_cfg(9, 160, 160), 0)
    worst = _worst_differences(files, _noise((160, 160), 0), (160, 160), tmp_path)
    assert worst.max() <= tolerances.DARKNET_DECODED
