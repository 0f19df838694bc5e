"""A detector's network, whoever made it: pictures in, candidates out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime

from standoff.core.errors import ModelError
from standoff.core.types import ImageArray
from standoff.stages.detect.graph import GraphInputs, check_own_graph, suggested_description
from standoff.stages.detect.interface import Interface, read_interface
from standoff.stages.detect.letterbox import Letterbox, Preprocessing
from standoff.stages.detect.model_card import FORMAT_KEY, OUTPUT_NAME, POINTS_NAME, ModelCard
from standoff.stages.detect.outputs import (
    Candidates,
    Output,
    OutputReader,
    UnreadableOutputs,
    check_candidates,
    find_reader,
    read_rows,
)
from standoff.stages.detect.params import Provider
from standoff.stages.detect.runtime import ONNX_ERRORS, open_session

_MIDDLE_LEVEL = 127


class Network:
    """A loaded model and how to talk to it.

    Args:
        path: ONNX file with standoff's metadata, or with a YAML file of the same name beside it.
        provider: What computes.
        intra_op_threads: Threads on the CPU; 0: as many as cores.

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
        if is_own:
            self.interface = Interface("yolov3", card.classes, card.input_size_px)
            self._fix = "export the model again from sound weights"
        else:
            self.interface = _described(self._session, self._inputs, path)
            family, description = self.interface.family, path.with_suffix(".yaml").name
            self._fix = f"correct `family: {family}` or the rest of {description}, or export the model again"
        self._preprocessing = _fitting_type(self.interface.preprocessing, self._inputs, path.name)
        self._constant = self._inputs.constant_feed(self.interface.input_size_px)
        self._reader = self._own_reader() if is_own else self._reader_from_trial()

    @property
    def providers(self) -> list[str]:
        """What computes, as ONNX Runtime calls it."""
        return list(self._session.get_providers())

    def letterbox(self, source_size_px: tuple[int, int]) -> Letterbox:
        """Return where a picture of this (width, height) goes in the input."""
        return Letterbox.fit(source_size_px, self.interface.input_size_px, self._preprocessing.placement)

    def candidates(self, resized: ImageArray, letterbox: Letterbox, least: float) -> Candidates:
        """Look at a picture.

        Args:
            resized: (height, width, 3) blue first, of the letterbox's inner size.
            letterbox: Where it goes.
            least: Probability below which a candidate may be left out.

        Raises:
            ModelError: The network gives NaN, or what its family does not.
        """
        outputs = self._run(self._reader.names, resized, letterbox)
        try:
            found = self._reader.read(outputs, least)
            check_candidates(found)
        except UnreadableOutputs as error:
            raise self._unreadable(error) from error
        return found

    def _run(self, names: tuple[str, ...], resized: ImageArray, letterbox: Letterbox) -> list[Output]:
        picture = letterbox.network_input(resized, self._preprocessing)
        if self._inputs.dtype is np.uint8:
            picture = np.rint(picture)
        feed = {self._inputs.picture: picture.astype(self._inputs.dtype, copy=False), **self._constant}
        outputs: list[Output] = self._session.run(list(names), feed)
        return outputs

    def _own_reader(self) -> OutputReader:
        has_points = POINTS_NAME in {node.name for node in self._session.get_outputs()}
        return OutputReader((OUTPUT_NAME, POINTS_NAME) if has_points else (OUTPUT_NAME,), read_rows)

    def _reader_from_trial(self) -> OutputReader:
        """Find out how to read a foreign network, by showing it a grey picture."""
        width_px, height_px = self.interface.input_size_px
        grey = np.full((height_px, width_px, 3), _MIDDLE_LEVEL, np.uint8)
        names = tuple(node.name for node in self._session.get_outputs())
        try:
            outputs = self._run(names, grey, self.letterbox((width_px, height_px)))
            trial = dict(zip(names, outputs, strict=True))
            return find_reader(self.interface, trial, self._inputs.told_size is not None)
        except UnreadableOutputs as error:
            raise self._unreadable(error) from error
        except ONNX_ERRORS as error:
            raise ModelError(
                expected=f"{self._name} to take a picture of {width_px}x{height_px}",
                found=f"what ONNX Runtime cannot compute ({str(error)[:120]})",
                fix="correct input_size in its description",
            ) from error

    def _unreadable(self, error: UnreadableOutputs) -> ModelError:
        return ModelError(expected=f"{error.expected} from {self._name}", found=error.found, fix=self._fix)


def _described(session: onnxruntime.InferenceSession, inputs: GraphInputs, path: Path) -> Interface:
    description = path.with_suffix(".yaml")
    if not description.is_file():
        raise ModelError(
            expected=f"a model exported by standoff at {path.name}, or its description in {description.name} beside it",
            found="an ONNX file without its metadata, and no description",
            fix=f"write {description.name}, such as {suggested_description(session, inputs)}, "
            "and labels.txt with one label a line in the order of the model's outputs",
        )
    return read_interface(description, inputs.size_px)


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
