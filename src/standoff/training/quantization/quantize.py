"""Quantise a detector, and refuse when it finds less than before."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import onnx
from annotated_types import Ge
from onnxruntime.quantization.calibrate import TensorsData
from typing_extensions import Doc

from standoff.core.errors import DataError, ModelError
from standoff.files.whole import whole_file
from standoff.labels import LabelledData, LabelledPicture, Split, load_picture
from standoff.labels.problems import readable_pictures
from standoff.labels.splits import spread
from standoff.stages.detect import Letterbox
from standoff.stages.frames import frame_from_array
from standoff.training.quantization.gate import Gate, Loss
from standoff.training.quantization.int8 import Int8Network, Method, NetworkInput, Recipe
from standoff.training.quantization.onnx_file import describe_as_made_from, is_quantized, read_own_model

Step = Callable[[], None]
Progress = Callable[[str, int], AbstractContextManager[Step]]
"""Of a task, its name and number of steps; gives what is to be called after each step."""

_OUTLIERS_LEFT_OUT: Final = "percentile"
_LENT_GROUPS = 4
"""Every so many-th scene calibrates where there is no training split."""
_HARM_PICTURES = 3
_FLOAT_SHARES = (0.1, 0.25)


@dataclass(frozen=True, slots=True)
class QuantizationPlan:
    """How to quantise.

    Attributes:
        split: Pictures that decide.
        calibration_pictures: Pictures that the ranges are taken from; never among those that decide.
        method: How ranges are taken at first.
    """

    split: Split = "val"
    calibration_pictures: Annotated[int, Ge(1), Doc("More than a few hundred change nothing.")] = 200
    method: Method = "minmax"


@dataclass(frozen=True, slots=True)
class Attempt:
    """One recipe and what it costs."""

    recipe: Recipe
    loss: Loss


@dataclass(frozen=True, slots=True)
class QuantizationReport:
    """What was tried and what came of it.

    Attributes:
        model: The float model's file name.
        attempts: In the order tried.
        best: The one that was accepted, or the least harmful when all were refused.
        layers: Convolutions of the network.
        calibration_pictures: That the ranges were taken from.
        deciding_pictures: That the models were compared on.
        unreadable: Pictures that could not be decoded.
        size_bytes: Of the float file and of the best int8 one.
        median_ms: Of a picture with the float and with the best int8 model, on this machine.
    """

    model: str
    attempts: tuple[Attempt, ...]
    best: Attempt
    layers: int
    calibration_pictures: int
    deciding_pictures: int
    unreadable: tuple[Path, ...]
    size_bytes: tuple[int, int]
    median_ms: tuple[float, float]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        best = self.best
        return {
            "model": self.model,
            "accepted": not best.loss.complaints,
            "recipe": best.recipe.summary,
            "float_layers": list(best.recipe.float_layers),
            "layers": self.layers,
            "complaints": list(best.loss.complaints),
            "mean_ap11": {"float": best.loss.before, "int8": best.loss.after},
            "classes": [asdict(one) for one in best.loss.classes],
            "attempts": [
                {"recipe": one.recipe.summary, "mean_ap11": one.loss.after, "complaints": list(one.loss.complaints)}
                for one in self.attempts
            ],
            "calibration_pictures": self.calibration_pictures,
            "deciding_pictures": self.deciding_pictures,
            "unreadable": [str(path) for path in self.unreadable],
            "size_bytes": dict(zip(("float", "int8"), self.size_bytes, strict=True)),
            "median_ms": dict(zip(("float", "int8"), self.median_ms, strict=True)),
        }


class QuantizationRefused(ModelError):
    """Every way to quantise the model finds less than is allowed.

    Attributes:
        report: What was tried; None after a journey between processes.
    """

    report: QuantizationReport | None = None


def quantize_model(
    model: Path, data: LabelledData, out: Path, plan: QuantizationPlan, progress: Progress
) -> QuantizationReport:
    """Write an int8 version of a detector, unless it finds less.

    Remedies are tried one after another until one is good enough: ranges without outliers, the last convolutions
    in float, then in float also the layers whose quantisation moves boxes and scores most.

    Args:
        model: Made by `standoff export` or `standoff train`.
        data: Labelled with the classes of the site.
        out: The int8 model.
        plan: How.
        progress: Shows what takes long.

    Raises:
        QuantizationRefused: None is good enough; nothing is written.
        ModelError: The model is not ours, or is quantised already.
        DataError: There are too few pictures, or too few things in them to decide.
        OutputError: The file cannot be written.
    """
    proto, card = read_own_model(model)
    if is_quantized(proto):
        raise ModelError(expected=f"a float model in {model.name}", found="an int8 model", fix="give the float model")
    chosen, deciding = divide_pictures(data, plan)
    with progress("pictures to calibrate with", len(chosen)) as step:
        calibrating, lost = readable_pictures(chosen, step)
    if not calibrating:
        raise DataError(
            expected="pictures to calibrate with that can be decoded",
            found=f"none of {len(chosen)}",
            fix="check the files",
        )
    with whole_file(out) as path:
        with progress("float model", len(deciding)) as step:
            gate = Gate(model, deciding, step)
        search = _Search(model, path, gate, progress)
        best = search.run(plan.method, calibrating, card.input_size_px)
        report = QuantizationReport(
            model=model.name,
            attempts=tuple(search.attempts),
            best=best,
            layers=len(search.network.layers),
            calibration_pictures=len(calibrating),
            deciding_pictures=len(gate),
            unreadable=(*(problem.path for problem in lost), *gate.unreadable),
            size_bytes=(model.stat().st_size, path.stat().st_size),
            median_ms=gate.median_ms(path),
        )
        if best.loss.complaints:
            raise _refused(report)
    return report


def _refused(report: QuantizationReport) -> QuantizationRefused:
    error = QuantizationRefused(
        expected="mAP to fall by at most 1 point, AP of every class by at most 2 (under 50 truths: more), and ground "
        "points as good to a tenth",
        found=f"that {', '.join(report.best.loss.complaints)} at best ({report.best.recipe.summary})",
        fix="keep the float model; `standoff export --half` halves its file as well",
    )
    error.report = report
    return error


def divide_pictures(
    data: LabelledData, plan: QuantizationPlan
) -> tuple[tuple[LabelledPicture, ...], tuple[LabelledPicture, ...]]:
    """Return pictures to calibrate with and pictures that decide; none is in both.

    Calibration takes the training split, or where that is empty (or decides) a share of the scenes of the
    deciding split, at most half of them.

    Raises:
        DataError: There are too few.
    """
    deciding = data.splits[plan.split]
    calibrating = () if plan.split == "train" else data.splits["train"]
    if not calibrating:
        groups = sorted({picture.group for picture in deciding})
        lent = set(groups[::_LENT_GROUPS]) if len(groups) > 1 else set()
        calibrating = tuple(picture for picture in deciding if picture.group in lent)
        deciding = tuple(picture for picture in deciding if picture.group not in lent)
    decided_on = {picture.path for picture in deciding}
    calibrating = tuple(picture for picture in calibrating if picture.path not in decided_on)
    if not calibrating or not deciding:
        counts = ", ".join(f"{len(pictures)} in {split}" for split, pictures in data.splits.items())
        raise DataError(
            expected=f"pictures in {plan.split} to compare the models on, and others, in train or of another scene, to "
            "calibrate with",
            found=counts,
            fix="choose another --split, or add pictures",
        )
    return spread(calibrating, plan.calibration_pictures), deciding


class _Search:
    """Try recipe after recipe; the file at `path` is the best so far."""

    def __init__(self, model: Path, path: Path, gate: Gate, progress: Progress) -> None:
        self.network = Int8Network(model, path.parent)
        self.attempts: list[Attempt] = []
        self._model, self._path, self._gate, self._progress = model, path, gate, progress
        self._ranges: dict[Method, TensorsData] = {}

    def run(self, method: Method, pictures: Sequence[LabelledPicture], input_size_px: tuple[int, int]) -> Attempt:
        """Return the first attempt that is good enough, or else the best."""
        for recipe in self._recipes(method, pictures, input_size_px):
            if recipe.method not in self._ranges:
                with self._progress(f"calibration, {recipe.method}", len(pictures)) as step:
                    inputs = _inputs(pictures, input_size_px, step)
                    self._ranges[recipe.method] = self.network.calibrate(recipe.method, inputs)
            attempt = self._try(recipe)
            if not attempt.loss.complaints:
                return attempt
        return self._best()

    def _recipes(
        self, method: Method, pictures: Sequence[LabelledPicture], input_size_px: tuple[int, int]
    ) -> Iterator[Recipe]:
        yield Recipe(method, (), f"{method} calibration")
        if method != _OUTLIERS_LEFT_OUT:
            yield Recipe(_OUTLIERS_LEFT_OUT, (), f"{_OUTLIERS_LEFT_OUT} calibration")
        best, heads = self._best().recipe.method, self.network.heads
        yield Recipe(best, heads, f"{best} calibration, last convolutions in float")
        with self._progress("harm of each layer", len(self.network.layers)) as step:
            few = list(_inputs(spread(pictures, _HARM_PICTURES), input_size_px, _no_step))
            order = self.network.by_harm(self._ranges[best], few, step)
        for share in _FLOAT_SHARES:
            harmful = order[: math.ceil(share * len(order))]
            layers = tuple(dict.fromkeys([*heads, *harmful]))
            yield Recipe(best, layers, f"{best} calibration, {len(layers)} of {len(order)} convolutions in float")

    def _best(self) -> Attempt:
        return min(self.attempts, key=lambda attempt: attempt.loss.excess)

    def _try(self, recipe: Recipe) -> Attempt:
        tried = self._path.with_name("tried.onnx")
        self.network.write(self._ranges[recipe.method], tried, float_layers=recipe.float_layers)
        quantized = onnx.load(str(tried))
        describe_as_made_from(quantized, self._model, quantization=recipe.summary)
        onnx.save(quantized, str(tried))
        with self._progress(recipe.summary, len(self._gate)) as step:
            attempt = Attempt(recipe, self._gate.compare(tried, step))
        self.attempts.append(attempt)
        if attempt is self._best():
            tried.replace(self._path)
        return attempt


def _inputs(pictures: Sequence[LabelledPicture], input_size_px: tuple[int, int], step: Step) -> Iterator[NetworkInput]:
    """Lay pictures into network inputs as the detector does."""
    for picture in pictures:
        step()
        image = load_picture(picture)
        letterbox = Letterbox.fit(picture.size_px, input_size_px)
        resized = frame_from_array(image).picture.resized_bgr(*letterbox.inner_size_px)
        yield letterbox.network_input(resized)


def _no_step() -> None:
    """Show nothing."""
