from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from square_detector import draw_squares, write_detector

from standoff.core.errors import DataError
from standoff.core.types import Frame
from standoff.evaluation.backends import (
    TOLERANCE,
    Agreement,
    ProviderTrial,
    compare_answers,
    compare_providers,
)
from standoff.stages.detect import Candidates, Network, Provider, available_providers
from standoff.stages.frames import frame_from_array

PLACE_SHARES = np.array([[0.1, 0.2, 0.4, 0.8], [0.5, 0.5, 0.6, 0.7], [0.0, 0.0, 1.0, 1.0]])
SIZE_PX = (640, 384)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_detector(tmp_path_factory.mktemp("squares"))


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    rng = np.random.default_rng(0)
    return [frame_from_array(draw_squares(rng, 8)[0], index=index) for index in range(3)]


def altered(model: Path, out: Path, factor: float) -> Path:
    """Write the model with boxes that are so much larger and further away."""
    changed = onnx.load(model)
    for node in changed.graph.node:
        node.output[:] = ["straight" if name == "boxes" else name for name in node.output]
    one = [factor] * 4 + [1.0] * 3
    changed.graph.initializer.append(onnx.numpy_helper.from_array(np.array(one, np.float32), "factors"))
    changed.graph.node.append(onnx.helper.make_node("Mul", ["straight", "factors"], ["boxes"]))
    onnx.save(changed, out)
    return out


def by_two_backends(other: Path) -> object:
    """Open the given model on the CPU, and another one where CUDA is asked for."""

    def open_network(model: Path, provider: Provider, threads: int) -> Network:
        return Network(other, "cpu", threads) if provider == "cuda" else Network(model, provider, threads)

    return open_network


def trials(model: Path, frames: list[Frame], other: Path) -> dict[str, ProviderTrial]:
    opener = by_two_backends(other)
    return {one.provider: one for one in compare_providers(model, frames, repeats=1, open_network=opener)}  # type: ignore[arg-type]


def test_the_cpu_is_exactly_itself(model: Path, frames: list[Frame]) -> None:
    found: dict[str, ProviderTrial] = {one.provider: one for one in compare_providers(model, frames, repeats=2)}
    cpu = found["cpu"]
    assert cpu.agreement is not None and cpu.picture_ms is not None
    assert (cpu.verdict, cpu.agreement.place, cpu.agreement.score) == ("OK", 0.0, 0.0)
    assert cpu.agreement.boxes > 5
    assert cpu.picture_ms.samples == 2 * len(frames) and cpu.picture_ms.median_ms > 0
    for name in {"cuda", "tensorrt", "openvino"} - set(available_providers()):
        assert found[name].verdict == "absent" and found[name].is_good
        assert "install" in found[name].absent


@pytest.mark.parametrize(("per_mille", "verdict"), [(0.5, "OK"), (2.0, "DIFFERS")])
def test_a_backend_that_is_off_by_per_mille_is_found(
    model: Path, frames: list[Frame], tmp_path: Path, per_mille: float, verdict: str
) -> None:
    other = altered(model, tmp_path / "other.onnx", 1.0 + per_mille / 1000.0)
    cuda = trials(model, frames, other)["cuda"]
    assert cuda.agreement is not None
    assert cuda.verdict == verdict and cuda.is_good == (verdict == "OK")
    # The rightmost edge that is found moves by its own place times the factor.
    assert per_mille / 2000.0 < cuda.agreement.place < 1.1 * per_mille / 1000.0
    assert cuda.agreement.score < 1e-6


def test_a_backend_that_says_no_numbers_fails(model: Path, frames: list[Frame], tmp_path: Path) -> None:
    cuda = trials(model, frames, altered(model, tmp_path / "other.onnx", float("nan")))["cuda"]
    assert (cuda.verdict, cuda.is_good, cuda.agreement) == ("FAILS", False, None)
    assert "NaN" in cuda.failure


def test_a_provider_that_does_not_start_says_so_and_is_no_error(
    model: Path, frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    if "openvino" in available_providers():
        pytest.skip("openvino is installed here")
    installed = ["OpenVINOExecutionProvider", "CPUExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: installed)
    with pytest.warns(UserWarning, match="not in available provider names"):
        found = {one.provider: one for one in compare_providers(model, frames, repeats=1)}
    assert found["openvino"].verdict == "no start" and "does not start" in found["openvino"].absent
    assert found["openvino"].is_good


def test_where_nothing_is_seen_nothing_is_called_equal(model: Path) -> None:
    grey = frame_from_array(np.full((96, 128, 3), 90, np.uint8))
    with pytest.raises(DataError, match=r"squares\.onnx sees something"):
        list(compare_providers(model, [grey]))


def candidates(shift: float = 0.0, score: float = 0.9) -> Candidates:
    probability = np.array([[score, 0.1], [0.2, 0.8], [0.001, 0.002]])
    return Candidates((PLACE_SHARES + shift) * np.tile(SIZE_PX, 2), probability)


def test_differences_are_shares_of_the_picture_and_of_a_score() -> None:
    found = compare_answers([candidates()], [candidates(0.01, 0.88)], SIZE_PX)
    assert found.place == pytest.approx(0.01) and found.score == pytest.approx(0.02)
    assert (found.boxes, found.is_close) == (2, False)
    assert compare_answers([candidates()], [candidates(TOLERANCE / 2)], SIZE_PX).is_close
    assert not Agreement(float("nan"), 0.0, 1).is_close


def test_where_nothing_is_a_box_may_lie_anywhere() -> None:
    moved = candidates()
    boxes = moved.xyxy_px.copy()
    boxes[2] += 300.0
    assert compare_answers([candidates()], [replace(moved, xyxy_px=boxes)], SIZE_PX).place == 0.0


def test_a_ground_point_that_only_one_has_is_no_agreement() -> None:
    sigma = np.ones((3, 2))
    one = replace(candidates(), foot_px=np.full((3, 2), 50.0), foot_sigma_px=sigma)
    two = replace(one, foot_px=np.array([[50.0, 50.0], [np.nan, np.nan], [50.0, 50.0]]))
    assert compare_answers([one], [one], SIZE_PX).is_close
    assert compare_answers([one], [two], SIZE_PX).place == np.inf


def test_rows_that_a_network_sorts_itself_may_change_places() -> None:
    one, order = candidates(), [1, 0, 2]
    two = Candidates(one.xyxy_px[order], one.probability[order])
    assert compare_answers([one], [two], SIZE_PX).place > 0.1
    assert compare_answers([one], [two], SIZE_PX, is_ordered=False) == Agreement(0.0, 0.0, 2)
    moved = replace(two, xyxy_px=two.xyxy_px + 0.02 * SIZE_PX[0])
    assert compare_answers([one], [moved], SIZE_PX, is_ordered=False).place == pytest.approx(0.02 * 640 / 384)
