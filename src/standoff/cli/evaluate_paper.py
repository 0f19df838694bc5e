"""`standoff evaluate paper`: the paper's tests on simulated clips, each figure beside the paper's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from standoff.core.errors import ConfigError, StandoffError

if TYPE_CHECKING:
    from standoff.evaluation.paper import BoxError, ClipResult, MonitorSetup
    from standoff_sim.clip.presets import Plan

Method = Literal["fused", "refined", "paper", "paper+tls", "oriented"]
Anchor = Literal["ground_point", "bottom_centre", "box_centre"]
Boxes = Literal["truth", "noisy"]
CameraFile = Literal["file", "unknown"]
Height = Literal["known", "unknown"]


def paper(
    clips: Annotated[
        list[Path] | None, typer.Argument(help="Folders that `standoff simulate` wrote.", show_default=False)
    ] = None,
    method: Annotated[
        Method, typer.Option(help="How the reference is found; `fused` is standoff's default, `paper` as printed.")
    ] = ("paper"),
    detector: Annotated[
        str,
        typer.Option(
            help="truth (the true boxes), noisy (the same with errors), a model (site, ONNX), or a run of the clip "
            "whose detections are replayed (its folder, or its table)."
        ),
    ] = "truth",
    anchor: Annotated[
        Anchor | None,
        typer.Option(help="Point of a box that is the entity. Left out: the centre with `paper`, else the foot."),
    ] = None,
    camera: Annotated[
        CameraFile | None,
        typer.Option(help="Whether the clip's camera file is known. Left out: unknown with `paper`, else known."),
    ] = None,
    height: Annotated[Height, typer.Option(help="Whether the reference's height is known.")] = "known",
    box_error: Annotated[
        str | None, typer.Option(help="For noisy: standard error of each edge; px, or a share of the box as 6%.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the box errors, and of clips that are rendered.")] = 0,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the result as JSON; - prints only that.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Also write one HTML page with tables and figures.")] = None,
    every_preset: Annotated[
        bool, typer.Option("--all", help="Every preset of `standoff simulate --list`; absent clips are rendered.")
    ] = False,
    clips_folder: Annotated[Path | None, typer.Option("--clips", help="For --all: where the clips are.")] = None,
    size: Annotated[str | None, typer.Option(help="For --all: render at this size, WIDTHxHEIGHT.")] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="For --all: render so many frames.")] = None,
) -> None:
    """Repeat the paper's tests on clips with exact truth: every figure beside the paper's own."""
    from standoff.cli.console import write_json
    from standoff.cli.paper_tables import print_results
    from standoff.evaluation.paper import MonitorSetup, write_report

    setup = MonitorSetup(method, _detector(detector), anchor, _box_error(detector, box_error), seed, camera, height)
    folders = list(clips or ())
    if every_preset == bool(folders):
        raise ConfigError(
            expected="clip folders, or --all with --clips FOLDER",
            found="both" if folders else "neither",
            fix="write for example `standoff evaluate paper clips/mobile`",
        )
    plans: dict[Path, Plan] = {}
    if every_preset:
        plans = _plan_presets(clips_folder, seed, size, frames)
        folders = list(plans)
    results, failures = _evaluate_all(folders, plans, setup)
    if json_file is not None:
        write_json(_as_json(results, failures), json_file)
    if results and str(json_file) != "-":
        print_results(results)
    if results and report is not None:
        write_report(results, report, failures)
    for name, error in failures.items():
        typer.echo(f"standoff: {name}: {error}", err=True)
    if failures:
        raise typer.Exit(2)


def _detector(text: str) -> Boxes | Path:
    if text == "truth":
        return "truth"
    if text == "noisy":
        return "noisy"
    from standoff.clips import is_recording
    from standoff.stages.detect import find_model

    path = find_model(text)
    if not path.is_file() and not is_recording(path):
        raise ConfigError(
            expected="--detector truth, noisy, a model file, or a run's folder",
            found=repr(text),
            fix="check the word or the path",
        )
    return path


def _box_error(detector: str, text: str | None) -> BoxError:
    from standoff.evaluation.paper import BoxError

    if (detector == "noisy") != (text is not None):
        raise ConfigError(
            expected="--detector noisy and --box-error together",
            found="one of them",
            fix="write for example --detector noisy --box-error 6%",
        )
    if text is None:
        return BoxError()
    try:
        number = float(text.removesuffix("%"))
    except ValueError:
        number = -1.0
    if not 0.0 <= number < float("inf"):
        raise ConfigError(
            expected="--box-error in px, or a share of the box with %",
            found=repr(text),
            fix="write for example 3 or 6%",
        )
    return BoxError(share=number / 100.0) if text.endswith("%") else BoxError(px=number)


def _plan_presets(folder: Path | None, seed: int, size: str | None, frames: int | None) -> dict[Path, Plan]:
    """Return a folder for each preset, with what to render where there is no clip yet."""
    from standoff.cli.numbers import size_or_none
    from standoff.cli.simulator import require_simulator

    if folder is None:
        raise ConfigError(expected="--clips FOLDER with --all", found="none", fix="say where the clips are or shall be")
    require_simulator()
    from standoff_sim.clip.presets import PRESETS, plan_clip

    width_px, height_px = size_or_none(size)
    return {
        folder / name: plan_clip(name, seed=seed, width_px=width_px, height_px=height_px, frames=frames)
        for name in PRESETS
    }


def _evaluate_all(
    folders: Sequence[Path], plans: Mapping[Path, Plan], setup: MonitorSetup
) -> tuple[list[ClipResult], dict[str, StandoffError]]:
    """Evaluate every clip that can be; render first what is planned and not there."""
    from standoff.clips import SCENE_FILE

    results, failures = [], {}
    for folder in folders:
        try:
            if folder in plans and not (folder / SCENE_FILE).is_file():
                _render(plans[folder], folder)
            results.append(_evaluate(folder, setup))
        except StandoffError as error:
            failures[folder.name or str(folder)] = error
    return results, failures


def _render(plan: Plan, folder: Path) -> None:
    from standoff.cli.console import progress
    from standoff_sim.clip.write_clip import record_clip

    with progress(f"rendering {plan.name}", plan.preset.frames) as on_frame:
        record_clip(plan, folder, on_frame=on_frame)


def _evaluate(folder: Path, setup: MonitorSetup) -> ClipResult:
    from standoff.cli.console import progress
    from standoff.clips import load_clip
    from standoff.evaluation.paper import evaluate_clip

    clip = load_clip(folder)
    with progress(f"watching {clip.name}", clip.frame_count) as on_frame:
        return evaluate_clip(clip, setup, on_frame)


def _as_json(results: Sequence[ClipResult], failures: Mapping[str, StandoffError]) -> dict[str, Any]:
    from standoff import __version__
    from standoff.evaluation.paper import pool
    from standoff.evaluation.paper.answers import FrameByFrame
    from standoff.evaluation.paper.warning_time import summarise

    pooled = pool(results)
    answers = [result.answers for result in results if result.answers is not None]
    return {
        "standoff": __version__,
        "clips": [result.to_dict() for result in results],
        "map_only": None if pooled is None else pooled.to_dict(),
        "frame_by_frame": FrameByFrame.together(answers).to_dict() if answers else None,
        "warning_times": asdict(summarise([breach for result in results for breach in result.breaches])),
        "failed": [{"clip": name, "why": str(error)} for name, error in failures.items()],
    }
