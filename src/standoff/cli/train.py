"""`standoff train`: from labelled pictures to a detector."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from standoff.core.errors import ConfigError

if TYPE_CHECKING:
    from standoff.training.run.plan import Overrides, RunPlan

Preset = Literal["my-site"]


def train(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the run.", show_default=False)],
    data: Annotated[
        Path | None, typer.Argument(help="Labelled pictures: a YOLO, COCO or VOC data set, or a mixture file.")
    ] = None,
    arch: Annotated[
        str | None,
        typer.Option(
            help="yolov3, yolov3-tiny, yolo-fastest-xl, yolo-fastest-xl-8-16, yolo-fastest-xl-8-16-32, "
            "efficientnet-lite0, or a Darknet .cfg."
        ),
    ] = None,
    weights: Annotated[
        Path | None,
        typer.Option(
            help="Darknet weights to start from, whole or cut at a layer; or an exported detector, such as site, the "
            "one that comes with standoff. Absent: from scratch."
        ),
    ] = None,
    config: Annotated[
        Path | None, typer.Option(help="YAML with data, arch, weights and train settings, as a run writes run.yaml.")
    ] = None,
    preset: Annotated[
        Preset | None,
        typer.Option(
            help="my-site: go on from the detector that comes with standoff, with 25 to 200 labelled frames of one "
            "site, in under half an hour on two cores."
        ),
    ] = None,
    sweep: Annotated[
        Path | None,
        typer.Option(
            help="YAML as of --config, and scenarios that differ from it by name: train each in its own folder, and "
            "compare them in one table."
        ),
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="One train setting, NAME=VALUE: steps=5000, augment.mosaic=0.5.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run, or the sweep, in the folder.")] = False,
    show: Annotated[bool, typer.Option("--show-settings", help="Print the resolved settings and stop.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> None:
    """Train a YOLOv3-family detector, from scratch or from anybody's Darknet weights.

    What is given on the command line goes before the file, and the file before the defaults.
    """
    from standoff.training.required import require_packages

    require_packages("torch", "onnx", purpose="train a detector")
    from standoff.cli.train_sweep import train_sweep
    from standoff.files.yaml_text import dump_yaml
    from standoff.training.my_site import prepare_plan
    from standoff.training.run.plan import Overrides
    from standoff.training.sweep.scenarios import read_sweep

    overrides = Overrides(data, arch, weights, settings or ())
    _refuse_two({"--config": config, "--preset": preset, "--sweep": sweep})
    if sweep is not None:
        scenarios = read_sweep(sweep, overrides)
        if show:
            typer.echo(dump_yaml(scenarios.to_dict()), nl=False)
        else:
            train_sweep(scenarios, out, resumes=resume, quiet=quiet)
        return
    if resume:
        _refuse_changes({"--config": config, "--preset": preset, "--arch": arch, "--weights": weights})
    plan = _plan(config, preset, overrides, out if resume else None)
    if show:
        typer.echo(dump_yaml(plan.to_dict()), nl=False)
        return
    if preset is not None:
        plan = prepare_plan(plan, out, typer.echo)
    _train_one(plan, out, resumes=resume, quiet=quiet)


def _train_one(plan: RunPlan, out: Path, *, resumes: bool, quiet: bool) -> None:
    from standoff.cli.console import progress_bar
    from standoff.cli.train_progress import show_run
    from standoff.training.run.distributed import Crew
    from standoff.training.run.train import train_detector

    leads = Crew.join().leads
    with progress_bar(quiet=quiet or not leads, unit="steps") as bar:
        progress = train_detector(plan, out, show_run(bar, plan.params.steps), resumes=resumes)
    if not leads:
        return
    typer.echo(f"best mAP {100 * progress.best_map:.2f} % at step {progress.best_step}: {out}/model.onnx, best.weights")
    typer.echo(f"look at {out}/model-card.md, curves.png and predictions.jpg")


def _plan(config: Path | None, preset: Preset | None, overrides: Overrides, resumed: Path | None) -> RunPlan:
    """Make the plan of the file, of the preset or of the run that is resumed, and of what goes before it."""
    from standoff.training.my_site import read_preset
    from standoff.training.run.plan import make_plan, read_plan
    from standoff.training.run.training_folder import read_run

    if resumed is not None:
        given, origin = read_run(resumed), f"{resumed}/run.yaml and the command line"
    elif preset is not None:
        given, origin = read_preset(), f"the preset {preset} and the command line"
    else:
        given = {} if config is None else read_plan(config)
        origin = str(config) if config else "the command line"
    overrides.apply(given)
    return make_plan(given, origin)


def _refuse_two(given: dict[str, object]) -> None:
    said = [name for name, value in given.items() if value is not None]
    if len(said) > 1:
        raise ConfigError(
            expected="a plan, a preset or a sweep",
            found=" and ".join(said),
            fix="write what the plan says into the sweep, above `scenarios`, or copy the preset (--show-settings)",
        )


def _refuse_changes(given: dict[str, object]) -> None:
    changed = [name for name, value in given.items() if value is not None]
    if changed:
        raise ConfigError(
            expected="--resume with no other plan than that of the run",
            found=" and ".join(changed),
            fix="leave it out, or start a new run with another --out",
        )
