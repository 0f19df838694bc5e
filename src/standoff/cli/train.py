"""`standoff train`: from labelled pictures to a detector."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
import yaml

from standoff.core.errors import ConfigError

if TYPE_CHECKING:
    from standoff.training.run.train import RunPlan

_PLAN_KEYS = ("data", "arch", "weights", "train")
_ADVICE = "correct them; `standoff train --show-settings` lists every train setting of a plan that is right"


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
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="One train setting, NAME=VALUE: steps=5000, augment.mosaic=0.5.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in the folder.")] = False,
    show: Annotated[bool, typer.Option("--show-settings", help="Print the resolved settings and stop.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> None:
    """Train a YOLOv3-family detector, from scratch or from anybody's Darknet weights.

    What is given on the command line goes before the file, and the file before the defaults.
    """
    from standoff.training.required import require_packages

    require_packages("torch", "onnx", purpose="train a detector")
    from standoff.cli.console import progress_bar
    from standoff.training.run.distributed import Crew
    from standoff.training.run.train import Listener, read_run, train_detector

    if resume:
        _refuse_changes({"--config": config, "--arch": arch, "--weights": weights})
        given, origin = read_run(out), f"{out}/run.yaml and the command line"
    else:
        given = {} if config is None else read_plan(config)
        origin = str(config) if config else "the command line"
    _override(given, {"data": data, "arch": arch, "weights": weights}, settings or [])
    plan = make_plan(given, origin)
    if show:
        typer.echo(yaml.safe_dump(plan.to_dict(), sort_keys=False), nl=False)
        return
    leads = Crew.join().leads
    with progress_bar(quiet=quiet or not leads, unit="steps") as bar:
        task = bar.add_task("training", total=plan.params.steps, rate=0.0)

        def on_step(step: int, loss: float, rate: float) -> None:
            bar.update(task, completed=step, description=f"training, loss {loss:.2f}", rate=rate)

        def on_row(row: dict[str, Any]) -> None:
            line = f"step {row['step']}: loss {row['loss_total']:.2f}, mAP {100 * row['map']:.2f} %, "
            bar.console.print(line + f"average IoU {100 * row['average_iou']:.2f} %", highlight=False)

        listener = Listener(lambda line: bar.console.print(line, highlight=False, soft_wrap=True), on_step, on_row)
        progress = train_detector(plan, out, listener, resumes=resume)
    if not leads:
        return
    typer.echo(f"best mAP {100 * progress.best_map:.2f} % at step {progress.best_step}: {out}/model.onnx, best.weights")
    typer.echo(f"look at {out}/model-card.md, curves.png and predictions.jpg")


def _refuse_changes(given: dict[str, object]) -> None:
    changed = [name for name, value in given.items() if value is not None]
    if changed:
        raise ConfigError(
            expected="--resume with no other plan than that of the run",
            found=" and ".join(changed),
            fix="leave it out, or start a new run with another --out",
        )


def read_plan(path: Path) -> dict[str, Any]:
    """Read a plan; paths in it are relative to it, `$VARIABLES` and `~` are expanded.

    Raises:
        ConfigError: The file cannot be read, or holds something else.
    """
    from standoff.config import read_settings_file
    from standoff.labels.documents import resolve_path
    from standoff.stages.detect import SHIPPED_MODELS

    plan = read_settings_file(path)
    unknown = sorted(plan.keys() - set(_PLAN_KEYS))
    if unknown:
        raise ConfigError(
            expected=f"{', '.join(_PLAN_KEYS)} in {path}", found=", ".join(unknown), fix="correct the file"
        )
    for name in ("data", "weights"):
        if plan.get(name) is not None:
            shipped = name == "weights" and plan[name] in SHIPPED_MODELS
            plan[name] = plan[name] if shipped else resolve_path(str(plan[name]), path.parent)
    if str(plan.get("arch", "")).endswith(".cfg"):
        plan["arch"] = str(resolve_path(plan["arch"], path.parent))
    return plan


def _override(given: dict[str, Any], named: dict[str, Any], settings: list[str]) -> None:
    given.update({name: value for name, value in named.items() if value is not None})
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise ConfigError(
                expected="--set NAME=VALUE", found=f"'{setting}'", fix="write for example --set steps=5000"
            )
        section = given
        *outer, last = ("train", *name.split("."))
        for one in outer:
            section[one] = _section(section.get(one), one)
            section = section[one]
        try:
            section[last] = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise ConfigError(
                expected="a value as YAML has it after --set NAME=", found=f"'{setting}'", fix="check its brackets"
            ) from error


def _section(value: object, name: str) -> dict[str, Any]:
    if not isinstance(value, dict | None):
        raise ConfigError(
            expected=f"settings by name in `{name}`", found=repr(value), fix="write `name: value` lines below it"
        )
    return value or {}


def make_plan(given: dict[str, Any], origin: str) -> RunPlan:
    """Check a plan's settings.

    Args:
        given: What `read_plan` read.
        origin: Where it comes from, for messages.

    Raises:
        ConfigError: No data, a setting that does not exist, or a value out of bounds.
        ModelError: No such weights.
    """
    from standoff.config import read_params
    from standoff.stages.detect import find_model
    from standoff.training.run.params import TrainParams
    from standoff.training.run.train import RunPlan

    if given.get("data") is None:
        raise ConfigError(
            expected="labelled pictures", found="none", fix="name a data set, or a --config that names one"
        )
    weights = given.get("weights")
    return RunPlan(
        data=Path(given["data"]),
        arch=str(given.get("arch") or "yolo-fastest-xl"),
        weights=None if weights is None else find_model(str(weights)),
        params=read_params(TrainParams, _section(given.get("train"), "train"), origin, _ADVICE),
    )
