"""A network of ground points beside a detector: any detector's boxes get points, its own are left alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from square_detector import draw_squares, write_detector

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError
from standoff.stages.detect import DetectParams, OnnxDetector, find_ground_points, find_model
from standoff.stages.detect.point_crops import POINT_CLASSES, POINT_CROP_AROUND
from standoff.stages.detect.point_network import TELLS_KEY, PointNetwork
from standoff.stages.frames import frame_from_array

torch = pytest.importorskip("torch", reason="the network that is read here is written with torch")

PLACES = np.column_stack([np.linspace(0.3, 0.7, len(POINT_CLASSES)), np.linspace(0.9, 0.5, len(POINT_CLASSES))])
STRETCH = 2.0


@pytest.fixture(scope="module")
def points_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A network that says one place of the square for each class, whatever it sees."""
    from standoff.training.ground_point import PointError, read_eyes, write_points
    from standoff.training.ground_point.network import GroundPointNetwork

    network = GroundPointNetwork(read_eyes(find_model("site"))).eval()
    for parameter in [*network.map[-1].parameters(), *network.sigma[-1].parameters()]:
        torch.nn.init.zeros_(parameter)
    network.begin_at(torch.tensor(PLACES, dtype=torch.float32))
    errors = [PointError(name, 1, 0.0, 0.0, 1.0, STRETCH) for name in POINT_CLASSES]
    path = tmp_path_factory.mktemp("points") / "points.onnx"
    write_points(network, errors, path, {"steps": 0})
    return path


def test_every_class_has_its_own_points_and_the_reference_none(points_file: Path) -> None:
    network = PointNetwork(points_file, "cpu", 1)
    image = np.random.default_rng(0).integers(0, 256, (200, 300, 3)).astype(np.uint8)
    boxes_px = np.array([[20.0, 30.0, 60.0, 110.0], [100.0, 20.0, 160.0, 60.0], [200.0, 100.0, 290.0, 190.0]])
    for name in POINT_CLASSES:
        class_id = np.array([CLASS_BY_NAME[name].id, CLASS_BY_NAME["reference"].id, CLASS_BY_NAME[name].id])
        points_px, sigma_px = network.points(image, boxes_px, class_id)
        assert np.isnan(points_px[1]).all() and np.isnan(sigma_px[1]).all()
        side_px = POINT_CROP_AROUND * (boxes_px[:, 2:] - boxes_px[:, :2]).max(axis=1)
        middle_px = (boxes_px[:, :2] + boxes_px[:, 2:]) / 2.0
        expected_px = middle_px + (PLACES[POINT_CLASSES.index(name)] - 0.5) * side_px[:, None]
        np.testing.assert_allclose(points_px[[0, 2]], expected_px[[0, 2]], atol=1.0)
        np.testing.assert_allclose(sigma_px[[0, 2]] / side_px[[0, 2], None], STRETCH * np.exp(-2.0), rtol=0.03)
    for box_px in ([-0.5, 30.0, 60.0, 110.0], [20.0, 30.0, 299.5, 110.0], [20.0, 100.0, 60.0, 199.5]):
        whole_px = np.array([[20.0, 30.0, 60.0, 110.0]])
        cut_px = np.array([box_px])
        sigmas = [network.points(image, box, np.zeros(1, dtype=np.int64))[1] for box in (whole_px, cut_px)]
        sides = [float((box[:, 2:] - box[:, :2]).max()) for box in (whole_px, cut_px)]
        # Of what goes on outside the picture less is known than the network says.
        np.testing.assert_allclose(sigmas[1] / sides[1], 2.0 * sigmas[0] / sides[0], rtol=0.03)
    none_px, _ = network.points(image, boxes_px[:0], np.zeros(0, dtype=np.int64))
    assert none_px.shape == (0, 2)


@pytest.mark.parametrize("scale", [1, 2, 3])
def test_boxes_of_a_detector_without_points_get_some_in_the_pixels_of_the_picture(
    points_file: Path, tmp_path: Path, scale: int
) -> None:
    model = write_detector(tmp_path)
    image, _ = draw_squares(np.random.default_rng(0), 12)
    frame = frame_from_array(np.repeat(np.repeat(image, scale, axis=0), scale, axis=1))
    bare = OnnxDetector(model, DetectParams(ground_points="none")).detect(frame)
    found = OnnxDetector(model, DetectParams(ground_points=str(points_file))).detect(frame)
    assert np.isnan(bare.foot_px).all() and len(found) > 0
    np.testing.assert_array_equal(found.xyxy_px, bare.xyxy_px)
    known = np.isin(found.class_id, [CLASS_BY_NAME[name].id for name in POINT_CLASSES])
    assert known.any()
    by_class = {CLASS_BY_NAME[name].id: PLACES[k] for k, name in enumerate(POINT_CLASSES)}
    side_px = POINT_CROP_AROUND * (found.xyxy_px[:, 2:] - found.xyxy_px[:, :2]).max(axis=1)
    middle_px = (found.xyxy_px[:, :2] + found.xyxy_px[:, 2:]) / 2.0
    for row in np.flatnonzero(known):
        expected_px = middle_px[row] + (by_class[int(found.class_id[row])] - 0.5) * side_px[row]
        np.testing.assert_allclose(found.foot_px[row], expected_px, atol=1.5 * scale)
        # Squares at the edge of the picture go on outside, as far as anybody can tell.
        sigmas = np.sqrt(np.diag(found.foot_covariance_px2[row])) / (STRETCH * np.exp(-2.0) * side_px[row])
        assert np.abs(sigmas - 1.0).max() < 0.15 or np.abs(sigmas - 2.0).max() < 0.3


def test_a_file_is_asked_of_the_classes_that_it_names(points_file: Path, tmp_path: Path) -> None:
    model = onnx.load(str(points_file))
    texts = {entry.key: entry.value for entry in model.metadata_props} | {TELLS_KEY: json.dumps(["excavator"])}
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, texts)
    onnx.save(model, str(tmp_path / "some.onnx"))
    network = PointNetwork(tmp_path / "some.onnx", "cpu", 1)
    boxes_px = np.array([[20.0, 30.0, 60.0, 110.0]] * 2)
    class_id = np.array([CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["excavator"].id])
    points_px, _ = network.points(np.zeros((200, 300, 3), np.uint8), boxes_px, class_id)
    assert np.isnan(points_px).all(axis=1).tolist() == [True, False]


def test_each_class_is_told_by_one_of_the_networks_that_come_with_standoff() -> None:
    image = np.random.default_rng(0).integers(0, 256, (200, 300, 3)).astype(np.uint8)
    class_id = np.array([CLASS_BY_NAME[name].id for name in POINT_CLASSES])
    boxes_px = np.tile([20.0, 30.0, 60.0, 110.0], (len(class_id), 1))
    told = [PointNetwork(file, "cpu", 1).points(image, boxes_px, class_id)[0] for file in find_ground_points("site")]
    np.testing.assert_array_equal(np.isfinite(told).all(axis=2).sum(axis=0), 1)


def test_a_detector_takes_the_points_of_all_networks(tmp_path: Path) -> None:
    image, _ = draw_squares(np.random.default_rng(0), 12)
    found = OnnxDetector(write_detector(tmp_path), DetectParams()).detect(frame_from_array(image))
    known = np.isin(found.class_id, [CLASS_BY_NAME[name].id for name in POINT_CLASSES])
    np.testing.assert_array_equal(np.isfinite(found.foot_px).all(axis=1), known)
    assert len(set(found.class_id[known].tolist()) - {CLASS_BY_NAME["worker"].id, CLASS_BY_NAME["excavator"].id}) > 0


def test_another_network_in_its_place_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="a network of ground points"):
        PointNetwork(write_detector(tmp_path), "cpu", 1)
    with pytest.raises(ModelError, match="no such file"):
        OnnxDetector(write_detector(tmp_path), DetectParams(ground_points="missing.onnx"))


def test_the_detectors_description_names_the_network(points_file: Path, tmp_path: Path) -> None:
    model = write_detector(tmp_path)
    for name, expected in ((str(points_file), [points_file.name]), ("none", [])):
        assert OnnxDetector(model, DetectParams(ground_points=name)).describe()["ground_points"] == expected
