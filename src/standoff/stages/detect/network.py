"""A detector's network, whoever made it: pictures in, candidates out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from standoff.core.errors import ModelError
from standoff.core.types import ImageArray
from standoff.stages.detect.candidates import (
    Candidates,
    Output,
    OutputReader,
    UnreadableOutputs,
    check_candidates,
)
from standoff.stages.detect.foreign import Foreigner
from standoff.stages.detect.graph import GraphInputs, check_own_graph, suggested_description
from standoff.stages.detect.interface import Interface
from standoff.stages.detect.letterbox import Letterbox, Preprocessing
from standoff.stages.detect.model_card import BOXES_OUTPUT, FORMAT_KEY, POINTS_OUTPUT, ModelCard
from standoff.stages.detect.outputs import read_rows
from standoff.stages.detect.params import Provider
from standoff.stages.detect.runtime import ONNX_ERRORS, open_session, told_by_runtime

_MIDDLE_LEVEL = 127


class Network:
    """A loaded model and how to talk to it.

    Args:
        path: ONNX file with metadata of standoff or Ultralytics, or with a YAML file of the same name beside it.
        provider: What computes.
        intra_op_threads: Threads on the CPU; 0: as many as cores.

    Attributes:
        interface: How it is talked to.
        boxes_are_parts: Its boxes come as parts of the input, where others of its family have pixels.
        warnings: What of it is not as it was said, or not as usual.

    Raises:
        ModelError: The file is no detector that can be read, or nothing says how.
        MissingDependency: The execution provider is not there.
    """

    def __init__(self, path: Path, provider: Provider, intra_op_threads: int) -> None:
        self._name = path.name
        self._session = open_session(path, provider, intra_op_threads)
        metadata = self._session.get_modelmeta().custom_metadata_map
        is_own = FORMAT_KEY in metadata
        if is_own:
            card = ModelCard.from_metadata(metadata, path.name)
            check_own_graph(self._session, card, path.name)
        self._inputs = GraphInputs.of(self._session, path.name)
        self.warnings: tuple[str, ...] = ()
        if is_own:
            self.interface = Interface("yolov3", card.classes, card.input_size_px, finds_workers=card.finds_workers)
            self._reader = self._own_reader()
            self._unreadable = self._own_unreadable
        else:
            suggestion = suggested_description(self._session, self._inputs)
            told_size = self._inputs.told_size is not None
            foreigner = Foreigner(path, metadata, self._inputs.size_px, told_size, suggestion)
            self.interface, self._reader, self.warnings = foreigner.settle(self._trial)
            self._unreadable = foreigner.unreadable
        self._preprocessing = _fitting_type(self.interface.preprocessing, self._inputs, path.name)

    @property
    def providers(self) -> list[str]:
        """What computes, as ONNX Runtime calls it."""
        return list(self._session.get_providers())

    def letterbox(self, source_size_px: tuple[int, int]) -> Letterbox:
        """Return where a picture of this (width, height) goes in the input."""
        return Letterbox.fit(source_size_px, self.interface.input_size_px, self._preprocessing.placement)

    @property
    def boxes_are_parts(self) -> bool:
        """Whether its boxes come as parts of the input, where others of its family have pixels."""
        return self._reader.boxes_are_parts

    def candidates(self, resized: ImageArray, letterbox: Letterbox, least: float) -> Candidates:
        """Look at a picture.

        Args:
            resized: (height, width, 3) blue first, of the letterbox's inner size.
            letterbox: Where it goes.
            least: Probability below which a candidate may be left out.

        Raises:
            ModelError: The network gives NaN, or what its family does not.
        """
        outputs = self._run(self._reader.names, resized, letterbox, self._preprocessing)
        try:
            found = self._reader.read(outputs, least)
            check_candidates(found)
        except UnreadableOutputs as error:
            raise self._unreadable(error) from error
        return found

    def _run(
        self, names: tuple[str, ...], resized: ImageArray, letterbox: Letterbox, preprocessing: Preprocessing
    ) -> list[Output]:
        picture = letterbox.network_input(resized, preprocessing)
        if self._inputs.dtype is np.uint8:
            picture = np.rint(picture)
        feed = {
            self._inputs.picture: picture.astype(self._inputs.dtype, copy=False),
            **self._inputs.constant_feed(letterbox.input_size_px),
        }
        outputs: list[Output] = self._session.run(list(names), feed)
        return outputs

    def _own_reader(self) -> OutputReader:
        has_points = POINTS_OUTPUT in {node.name for node in self._session.get_outputs()}
        return OutputReader((BOXES_OUTPUT, POINTS_OUTPUT) if has_points else (BOXES_OUTPUT,), read_rows)

    def _own_unreadable(self, error: UnreadableOutputs) -> ModelError:
        fix = "export the model again from sound weights"
        return ModelError(expected=f"{error.expected} from {self._name}", found=error.found, fix=fix)

    def _trial(self, interface: Interface) -> dict[str, Output]:
        """Show a grey picture to a foreign network."""
        width_px, height_px = interface.input_size_px
        grey = np.full((height_px, width_px, 3), _MIDDLE_LEVEL, np.uint8)
        names = tuple(node.name for node in self._session.get_outputs())
        preprocessing = _fitting_type(interface.preprocessing, self._inputs, self._name)
        letterbox = Letterbox.fit((width_px, height_px), interface.input_size_px, preprocessing.placement)
        try:
            return dict(zip(names, self._run(names, grey, letterbox, preprocessing), strict=True))
        except ONNX_ERRORS as error:
            raise ModelError(
                expected=f"{self._name} to take a picture of {width_px}x{height_px}",
                found=f"what ONNX Runtime cannot compute ({told_by_runtime(error)})",
                fix="correct input_size in its description",
            ) from error


def _fitting_type(preprocessing: Preprocessing, inputs: GraphInputs, name: str) -> Preprocessing:
    """Bytes hold levels, whatever is done with them inside the graph."""
    if inputs.dtype is not np.uint8:
        return preprocessing
    if preprocessing.normalises:
        raise ModelError(
            expected=f"no mean and no std for {name}",
            found="an input of bytes, which takes the levels themselves",
            fix="leave mean and std out of its description",
        )
    return replace(preprocessing, white=255.0)
