"""`standoff evaluate paper`: the paper's tests on simulated clips, each figure beside the paper's own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from standoff.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.progress import Progress

    from standoff.evaluation.paper import BoxError, ClipResult, Trial

Method = Literal["paper", "paper+tls", "oriented"]
Anchor = Literal["bottom_centre", "box_centre"]
Boxes = Literal["truth", "noisy"]


def paper(
    clips: Annotated[
        list[Path] | None, typer.Argument(help="Folders that `standoff simulate` wrote.", show_default=False)
    ] = None,
    method: Annotated[Method, typer.Option(help="How the reference's corners are found; `paper` is as printed.")] = (
        "paper"
    ),
    detector: Annotated[
        str, typer.Option(help="truth (the true boxes), noisy (the same with errors), or a model, ONNX.")
    ] = "truth",
    anchor: Annotated[
        Anchor | None,
        typer.Option(help="Point of a box that is the entity. Left out: the centre with `paper`, else the foot."),
    ] = None,
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
    from standoff.evaluation.paper import Trial, write_report

    trial = Trial(method, _detector(detector), anchor, _box_error(detector, box_error), seed)
    folders = list(clips or ())
    if every_preset == bool(folders):
        raise ConfigError(
            expected="clip folders, or --all with --clips FOLDER",
            found="both" if folders else "neither",
            fix="write for example `standoff evaluate paper clips/mobile`",
        )
    if every_preset:
        folders = _every_preset(clips_folder, seed, size, frames)
    results = _evaluate(folders, trial)
    if report is not None:
        write_report(results, report)
    _tell(results, json_file)


def _detector(text: str) -> Boxes | Path:
    if text == "truth":
        return "truth"
    if text == "noisy":
        return "noisy"
    if not Path(text).is_file():
        raise ConfigError(
            expected="--detector truth, noisy, or a model file", found=repr(text), fix="check the word or the path"
        )
    return Path(text)


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


def _every_preset(folder: Path | None, seed: int, size: str | None, frames: int | None) -> list[Path]:
    """Return a folder for each preset; render what is not there yet."""
    from standoff.cli.simulate import parse_size
    from standoff.simulation.presets import PRESETS, plan_clip
    from standoff.simulation.record import record_clip

    if folder is None:
        raise ConfigError(expected="--clips FOLDER with --all", found="none", fix="say where the clips are or shall be")
    width_px, height_px = parse_size(size)
    plans = {
        folder / name: plan_clip(name, seed=seed, width_px=width_px, height_px=height_px, frames=frames)
        for name in PRESETS
        if not (folder / name / "scene.json").is_file()
    }
    for path, plan in plans.items():
        with _progress(f"rendering {plan.name}", plan.preset.frames) as on_frame:
            record_clip(plan, path, on_frame=on_frame)
    return [folder / name for name in PRESETS]


def _evaluate(folders: Sequence[Path], trial: Trial) -> list[ClipResult]:
    from standoff.evaluation.paper import evaluate_clip, load_clip

    loaded = [load_clip(folder) for folder in folders]
    results = []
    for clip in loaded:
        passes = (clip.reference is not None) + (clip.board is not None)
        with _progress(f"watching {clip.name}", passes * clip.frame_count) as on_frame:
            results.append(evaluate_clip(clip, trial, on_frame))
    return results


@contextmanager
def _progress(title: str, total: int) -> Iterator[Callable[[], None]]:
    """Show a progress bar; give what is to be called after each frame."""
    from standoff.cli.console import progress_bar

    with progress_bar(quiet=False) as bar:
        task = bar.add_task(title, total=total, rate=0.0)
        started = monotonic()
        yield lambda: _advance(bar, started)
        bar.remove_task(task)


def _advance(bar: Progress, started: float) -> None:
    (task,) = bar.tasks
    bar.update(task.id, advance=1, rate=(task.completed + 1) / (monotonic() - started))


def _tell(results: Sequence[ClipResult], json_file: Path | None) -> None:
    from standoff import __version__
    from standoff.cli.console import print_table, write_json

    if json_file is not None:
        write_json({"standoff": __version__, "clips": [result.to_dict() for result in results]}, json_file)
    if str(json_file) == "-":
        return
    for result in results:
        _tell_clip(result)
    mapped = [(result, result.rectification) for result in results if result.rectification is not None]
    if mapped:
        headings = ("clip", "frames", "reference unseen", "failed", "wrong", "corner rmse px", "within 5 px %")
        lines = [
            (result.clip.name, f"{score.frames}", f"{score.not_visible}", f"{score.failed}", f"{score.wrong}",
             f"{score.corner_rmse_px:.3f}", f"{100 * score.within_share:.1f}")
            for result, score in mapped
        ]  # fmt: skip
        caption = "Failed: no map although the reference can be seen, or a wrong one: a corner more than 5 px off."
        print_table("Rectification", headings, lines, caption)
    facts = "; ".join(f"{name}: {value}" for name, value in results[0].trial.describe().items())
    print_table("", ("", ""), [("tried", facts)], texts=2)


def _tell_clip(result: ClipResult) -> None:
    from standoff.cli.console import print_table
    from standoff.evaluation.paper.report import number_text

    figures = [
        (figure.label, number_text(figure.paper, figure.unit), number_text(figure.measured, figure.unit),
         number_text(figure.exact_before, figure.unit, none=""), number_text(figure.exact_after, figure.unit, none=""),
         f"{figure.count} of {figure.of}")
        for figure in result.figures()
    ]  # fmt: skip
    if figures:
        columns = ("figure", "paper", "measured", "before", "after", "frames")
        caption = "Measured: as the paper did. Before and after the outlier filter: against exact truth."
        if result.trial.detector == "truth" and any(figure.name.startswith("ale") for figure in result.figures()):
            caption += " With true boxes ALE is 0 by construction."
        print_table(f"{result.clip.name}: beside the paper", columns, figures, caption)
    distances = [
        (group.class_pair.replace("_", " "), name, f"{score.measured} of {score.frames}",
         number_text(score.made_m, "m"), number_text(score.mape_percent, "%"), number_text(score.median_m, "m"))
        for group in result.groups
        for name, score in group.scores.items()
    ]  # fmt: skip
    if distances:
        columns = ("pair", "compared", "measured", "MADE", "MAPE", "median")
        print_table(f"{result.clip.name}: distances", columns, distances, texts=2)
