"""Turn a detector's convolutions into eight-bit arithmetic for ONNX Runtime.

Weights are signed and have a scale for each output channel (a network of depthwise convolutions loses too much with
one for the whole tensor); activations are unsigned, because ONNX Runtime multiplies signed by signed so slowly on x86
that int8 loses to float: YOLO-Fastest-XL at 640x480, one thread with VNNI, takes 26.6 ms in float, 25.1 ms with
unsigned and 34.8 ms with signed activations. What lies behind the last convolutions (sigmoid, exp, boxes) stays in
float. Processors with VNNI, and ARM's, need no spare bit in the weights; on x86 without VNNI sums of two products can
saturate, and the comparison with the float model must be made there.

Source:
    Jacob et al., Quantization and Training of Neural Networks for Efficient Integer-Arithmetic-Only Inference (2018),
    section 2; Krishnamoorthi, Quantizing deep convolutional networks for efficient inference (2018), section 3.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
import onnx
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantType
from onnxruntime.quantization.calibrate import TensorsData, create_calibrator
from onnxruntime.quantization.qdq_quantizer import QDQQuantizer
from onnxruntime.quantization.shape_inference import quant_pre_process

from standoff.core.homography import FloatArray
from standoff.stages.detect import BOXES_OUTPUT, PICTURE_INPUT, open_session

Method = Literal["minmax", "entropy", "percentile"]
NetworkInput = npt.NDArray[np.float32]

_METHODS: Final[dict[Method, tuple[CalibrationMethod, dict[str, Any]]]] = {
    "minmax": (CalibrationMethod.MinMax, {}),
    # With as many bins as levels, which is ONNX Runtime's default, there is nothing to choose from.
    "entropy": (CalibrationMethod.Entropy, {"num_bins": 512, "num_quantized_bins": 128}),
    "percentile": (CalibrationMethod.Percentile, {"percentile": 99.99, "symmetric": False}),
}
_ACTIVATIONS: Final = frozenset({"LeakyRelu", "Relu", "Clip", "Sigmoid", "Mul", "HardSwish"})
_QUANTIZABLE: Final = ("Conv", "LeakyRelu", "Relu", "Clip", "Add", "Concat", "MaxPool", "Resize")
_VISIBLE_OBJECTNESS: Final = 0.1


@dataclass(frozen=True, slots=True)
class Recipe:
    """How a network is quantised.

    Attributes:
        method: How ranges of activations are found from the calibration pictures.
        float_layers: Names of convolutions that stay in float, with their activations.
        summary: For people.
    """

    method: Method
    float_layers: tuple[str, ...]
    summary: str


class Int8Network:
    """A detector about to be quantised.

    Args:
        model: ONNX file.
        folder: For intermediate files.

    Attributes:
        layers: Names of all convolutions, in the order of computation.
        heads: Those behind which there is no other.
    """

    def __init__(self, model: Path, folder: Path) -> None:
        self._model, self._folder = model, folder
        self._prepared = folder / "prepared.onnx"
        quant_pre_process(str(model), str(self._prepared), skip_symbolic_shape=True)
        graph = onnx.load(str(self._prepared)).graph
        self._nodes = {node.name: node for node in graph.node}
        self._users: dict[str, list[onnx.NodeProto]] = {}
        for node in graph.node:
            for name in node.input:
                self._users.setdefault(name, []).append(node)
        self.layers = tuple(node.name for node in graph.node if node.op_type == "Conv")
        self._decoding = frozenset(self._nodes) - self._before(graph, self.layers)
        self.heads = tuple(name for name in self.layers if self._ends_in_decoding(name))

    @staticmethod
    def _before(graph: onnx.GraphProto, layers: Iterable[str]) -> frozenset[str]:
        """Return the layers and all nodes that they depend on."""
        makers = {name: node for node in graph.node for name in node.output}
        waiting = [node for node in graph.node if node.name in set(layers)]
        found: set[str] = set()
        while waiting:
            node = waiting.pop()
            if node.name not in found:
                found.add(node.name)
                waiting += [makers[name] for name in node.input if name in makers]
        return frozenset(found)

    def _ends_in_decoding(self, layer: str) -> bool:
        return all(user.name in self._decoding for user in self._users.get(self._nodes[layer].output[0], []))

    def _with_activations(self, layers: Iterable[str]) -> list[str]:
        """Return layers and the activations that they feed: each would be quantised by itself otherwise."""
        names: list[str] = []
        for layer in layers:
            users = self._users.get(self._nodes[layer].output[0], [])
            names += [layer, *(user.name for user in users if user.op_type in _ACTIVATIONS)]
        return names

    def calibrate(self, method: Method, inputs: Iterable[NetworkInput]) -> TensorsData:
        """Find the range of every activation.

        Args:
            method: `minmax`: all that was seen; `percentile`: all but a ten-thousandth; `entropy`: what loses least
                information.
            inputs: (1, 3, height, width) each.
        """
        kind, options = _METHODS[method]
        # ONNX Runtime's calibrators talk on standard output, and keep whatever they are given in one go.
        with redirect_stdout(io.StringIO()):
            calibrator = create_calibrator(
                self._prepared,
                list(_QUANTIZABLE),
                augmented_model_path=str(self._folder / "calibrated.onnx"),
                calibrate_method=kind,
                extra_options=options,
            )
            for picture in inputs:
                calibrator.collect_data(_OnePicture(picture))
            return calibrator.compute_data()

    def write(
        self, ranges: TensorsData, out: Path, *, float_layers: Iterable[str] = (), only: Iterable[str] = ()
    ) -> None:
        """Write the quantised network, without metadata.

        Args:
            ranges: From `calibrate`.
            out: ONNX file.
            float_layers: Stay in float.
            only: Layers to quantise; none: all.
        """
        quantizer = QDQQuantizer(
            onnx.load(str(self._prepared)),
            per_channel=True,
            reduce_range=False,
            weight_qType=QuantType.QInt8,
            activation_qType=QuantType.QUInt8,
            tensors_range=ranges,
            nodes_to_quantize=self._with_activations(only),
            nodes_to_exclude=[*self._decoding, *self._with_activations(float_layers)],
            op_types_to_quantize=list(_QUANTIZABLE),
            extra_options={},
        )
        quantizer.quantize_model()
        quantizer.model.save_model_to_file(str(out), False)

    def by_harm(self, ranges: TensorsData, inputs: Sequence[NetworkInput], step: Callable[[], None]) -> tuple[str, ...]:
        """Sort the layers by what quantising each alone does to the boxes, the most harmful first.

        Args:
            ranges: From `calibrate`.
            inputs: A few.
            step: Called after each layer.
        """
        expected = self._outputs(self._model, inputs)
        harm = {}
        for layer in self.layers:
            path = self._folder / "one_layer.onnx"
            self.write(ranges, path, only=[layer])
            harm[layer] = _harm(expected, self._outputs(path, inputs))
            step()
        return tuple(sorted(self.layers, key=lambda layer: -harm[layer]))

    @staticmethod
    def _outputs(path: Path, inputs: Sequence[NetworkInput]) -> FloatArray:
        session = open_session(path, "cpu", 0)
        rows = [session.run([BOXES_OUTPUT], {PICTURE_INPUT: picture})[0][0] for picture in inputs]
        return np.concatenate(rows).astype(np.float64)


def _harm(expected: FloatArray, found: FloatArray) -> float:
    """Return the mean change of scores and, in parts of their size, of boxes, where there seems to be something."""
    visible = expected[:, 4] >= min(_VISIBLE_OBJECTNESS, expected[:, 4].max())
    expected, found = expected[visible], found[visible]
    boxes = np.abs(found[:, :4] - expected[:, :4]) / np.tile(expected[:, 2:4], 2)
    scores = np.abs(found[:, 4:5] * found[:, 5:] - expected[:, 4:5] * expected[:, 5:]).max(axis=1)
    return float(boxes.mean() + scores.mean())


class _OnePicture(CalibrationDataReader):  # type: ignore[misc] # onnxruntime has no types
    def __init__(self, picture: NetworkInput) -> None:
        self._feeds = iter([{PICTURE_INPUT: picture}])

    def get_next(self) -> dict[str, NetworkInput] | None:
        return next(self._feeds, None)
