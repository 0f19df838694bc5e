"""What `standoff bench --providers` and `--training` run and print: backends beside the CPU."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from standoff.config import Settings
    from standoff.evaluation.backends import ProviderTrial
    from standoff.evaluation.timing import Spread
    from standoff.training.run.devices import DeviceTrial

FRAMES = 8
"""Pictures that a network is tried on, unless said otherwise."""


def compare_backends(
    source: Path | None, settings: Settings, *, providers: bool, training: Path | None, frames: int, json: Path | None
) -> None:
    """Compare what is asked for, print it, and leave with 1 where something differs from the CPU.

    Args:
        source: Video or folder of pictures; None: the film that comes with standoff.
        settings: Gives the detector.
        providers: Compare ONNX Runtime's providers.
        training: Plan of which a training step is compared; None: none.
        frames: How many pictures.
        json: File to write the result to as well; `-` prints only that.
    """
    from standoff.cli.console import write_json
    from standoff.evaluation.timing import machine

    is_quiet = str(json) == "-"
    networks = _providers(source, settings, frames, is_quiet=is_quiet) if providers else []
    devices = _devices(training, is_quiet=is_quiet) if training is not None else []
    if json is not None:
        found: dict[str, Any] = {"machine": machine(), "providers": [trial.to_dict() for trial in networks]}
        write_json(found | {"training": [trial.to_dict() for trial in devices]}, json)
    if not all([trial.is_good for trial in networks] + [trial.is_good for trial in devices]):
        raise typer.Exit(1)


def _providers(source: Path | None, settings: Settings, frames: int, *, is_quiet: bool) -> list[ProviderTrial]:
    from standoff.cli.console import print_table
    from standoff.cli.demo import find_film
    from standoff.evaluation.backends import TOLERANCE, compare_providers, read_frames
    from standoff.stages.detect import find_model

    model, source = find_model(settings.model), source or find_film()
    pictures = read_frames(source, frames)
    trials = list(compare_providers(model, pictures, intra_op_threads=settings.detect.intra_op_threads))
    if not is_quiet:
        print_table(
            f"{model.name} on {len(pictures)} pictures of {source.name}, largest differences from the CPU",
            ("provider", "", "boxes", "place", "score", "ms a picture"),
            [_provider_row(trial) for trial in trials],
            f"Place as a share of the picture; either may be {TOLERANCE:g}. Median of inference, without scaling.",
            texts=2,
        )
        for trial in trials:
            if trial.absent or trial.failure:
                typer.echo(f"{trial.provider}: {trial.absent or trial.failure}")
    return trials


def _provider_row(trial: ProviderTrial) -> tuple[str, ...]:
    agreement = trial.agreement
    if agreement is None:
        return trial.provider, trial.verdict, "", "", "", ""
    differences = f"{agreement.place:.1e}", f"{agreement.score:.1e}"
    return trial.provider, trial.verdict, str(agreement.boxes), *differences, _median(trial.picture_ms)


def _devices(plan_file: Path, *, is_quiet: bool) -> list[DeviceTrial]:
    from standoff.cli.console import print_table
    from standoff.training.required import require_packages

    require_packages("torch", "onnx", purpose="compare training steps")
    from standoff.training.run.devices import TOLERANCE, compare_devices
    from standoff.training.run.plan import make_plan, read_plan

    plan = make_plan(read_plan(plan_file), str(plan_file))
    trials = list(compare_devices(plan))
    if not is_quiet:
        print_table(
            f"a training step of {plan_file.name}, {plan.params.batch} pictures",
            ("device", "", "loss", "gradient", "difference", "ms a step"),
            [_device_row(trial) for trial in trials],
            f"In float32; relative to the CPU it may be {TOLERANCE:g}. Timed as the plan computes.",
            texts=2,
        )
    return trials


def _device_row(trial: DeviceTrial) -> tuple[str, ...]:
    if trial.gradients is None:
        return trial.device, trial.verdict, "", "", "", ""
    values = f"{trial.gradients.loss:.5g}", f"{trial.gradients.norm:.5g}", f"{trial.difference:.1e}"
    return trial.device, trial.verdict, *values, _median(trial.step_ms)


def _median(times: Spread | None) -> str:
    return "" if times is None else f"{times.median_ms:.1f}"
