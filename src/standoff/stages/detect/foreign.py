"""Find out how to talk to a model that somebody else made: from what it says itself, and what is said beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

from standoff.core.errors import ModelError
from standoff.stages.detect.candidates import Output, OutputReader, UnreadableOutputs
from standoff.stages.detect.interface import Description, Interface, read_description, times, undescribed
from standoff.stages.detect.outputs import find_reader
from standoff.stages.detect.self_description import SelfDescription

Trial: TypeAlias = Callable[[Interface], Mapping[str, Output]]
"""Shows a grey picture to the network, as the interface says; gives its outputs by name."""


@dataclass(frozen=True, slots=True)
class Foreigner:
    """A model that somebody else made.

    Attributes:
        path: ONNX file.
        metadata: Its texts.
        graph_size_px: (width, height) where the graph fixes it.
        knows_size: It is told the size of its input.
        suggestion: The description that its graph seems to need.
    """

    path: Path
    metadata: Mapping[str, str]
    graph_size_px: tuple[int, int] | None
    knows_size: bool
    suggestion: str

    def settle(self, trial: Trial) -> tuple[Interface, OutputReader, tuple[str, ...]]:
        """Decide how to talk to it.

        Args:
            trial: What it gives for a grey picture.

        Returns:
            That, how to read it, and warnings.

        Raises:
            ModelError: Nothing says how, or what is said does not fit.
        """
        said = read_description(self._beside) if self._beside.is_file() else Description()
        is_said = said.family is not None and bool(said.classes)
        own = self._own(is_needed=not is_said)
        if own is None and not is_said:
            raise self._unknown(said)
        size_px = self._size_px(said, own)
        classes = said.classes or (own.classes if own is not None else ())
        try:
            if said.family is None:
                assert own is not None
                return self._by_itself(replace(own, classes=classes), said, size_px, trial)
            known = Interface(said.family, classes, size_px)
            if own is not None:
                known = replace(known, task=own.task, keypoint_values=own.keypoint_values)
            return self._as_said(said.over(known), own, said, trial)
        except UnreadableOutputs as error:
            raise self.unreadable(error) from error

    def unreadable(self, error: UnreadableOutputs) -> ModelError:
        """Return the error of outputs that are not what they are said to be."""
        beside = self._beside
        family = read_description(beside).family if beside.is_file() else None
        fix = f"correct `family: {family}` or the rest of {beside.name}, or export the model again"
        if family is None:
            fix = f"export the model again, or say in {beside.name} what it is ({self.suggestion})"
        return ModelError(expected=f"{error.expected} from {self.path.name}", found=error.found, fix=fix)

    @property
    def _beside(self) -> Path:
        return self.path.with_suffix(".yaml")

    def _own(self, *, is_needed: bool) -> SelfDescription | None:
        try:
            return SelfDescription.from_metadata(self.metadata, self.path.name)
        except ModelError:
            if is_needed:
                raise
            return None

    def _unknown(self, said: Description) -> ModelError:
        path, beside = self.path, self._beside
        if beside.is_file():
            missing = ["family"] * (said.family is None) + ["classes"] * (not said.classes)
            return undescribed(beside, f"no {' and no '.join(missing)}")
        return ModelError(
            expected=f"a model exported by standoff or by Ultralytics at {path.name}, or its description in "
            f"{beside.name} beside it",
            found="an ONNX file without their metadata, and no description",
            fix=f"write {beside.name}, such as {self.suggestion}, and labels.txt with one label a line in the order of "
            "the model's outputs",
        )

    def _size_px(self, said: Description, own: SelfDescription | None) -> tuple[int, int]:
        graph_px, said_px = self.graph_size_px, said.input_size_px
        if graph_px is not None and said_px is not None and said_px != graph_px:
            raise undescribed(self._beside, f"input_size {times(said_px)}, but the graph takes {times(graph_px)}")
        size_px = graph_px or said_px or (own.input_size_px if own is not None else None)
        if size_px is None:
            raise undescribed(self._beside, "no input_size, which the graph leaves open; such as `input_size: 640x640`")
        return size_px

    def _as_said(
        self, known: Interface, own: SelfDescription | None, said: Description, trial: Trial
    ) -> tuple[Interface, OutputReader, tuple[str, ...]]:
        """Follow the description; where the outputs are not what it says, but what the model says itself, the model."""
        try:
            reader = find_reader(known, trial(known), self.knows_size)
            return known, reader, _warnings(self.path.name, reader)
        except UnreadableOutputs:
            if own is None or len(own.classes) != len(known.classes):
                raise
            try:
                found, reader, warnings = self._by_itself(
                    replace(own, classes=known.classes), said, known.input_size_px, trial
                )
            except UnreadableOutputs:
                found = None
            if found is None:
                raise
        contradiction = (
            f"{self._beside.name} says family: {said.family}, but the outputs of {self.path.name} are those of "
            f"family: {found.family}, as its own metadata says; read as those"
        )
        return found, reader, (contradiction, *warnings)

    def _by_itself(
        self, own: SelfDescription, said: Description, size_px: tuple[int, int], trial: Trial
    ) -> tuple[Interface, OutputReader, tuple[str, ...]]:
        """Follow what the model says of itself."""
        first = Interface("yolov8", own.classes, size_px, task=own.task, keypoint_values=own.keypoint_values)
        first = said.over(first)
        outputs = trial(first)
        known = said.over(replace(first, family=own.family(first, outputs)))
        reader = find_reader(known, outputs, self.knows_size)
        return known, reader, _warnings(self.path.name, reader)


def _warnings(name: str, reader: OutputReader) -> tuple[str, ...]:
    if not reader.boxes_are_parts:
        return ()
    return (f"the boxes of {name} come as parts of its input, 0 to 1, not in pixels: read as such",)
