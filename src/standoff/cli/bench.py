"""`standoff bench`: milliseconds for each stage, beside baselines measured in the same run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from standoff.core.errors import ConfigError

if TYPE_CHECKING:
    from standoff.config import Settings
    from standoff.evaluation.timing import Spread

_FRAMES = 200


def bench(
    source: Annotated[
        Path | None,
        typer.Argument(
            help="Video file, or a folder of pictures. Without one, --providers takes the film of the demo."
        ),
    ] = None,
    config: Annotated[Path | None, typer.Option(help="Settings, YAML.")] = None,
    model: Annotated[str | None, typer.Option(help="Detector: site (ours, the default), or an ONNX file.")] = None,
    frames: Annotated[
        int | None, typer.Option(min=2, help="At most so many frames of the source: 200, or 8 with --providers.")
    ] = None,
    darknet: Annotated[
        str | None, typer.Option(help="CFG,WEIGHTS of the same network: times OpenCV on it beside ONNX Runtime.")
    ] = None,
    providers: Annotated[
        bool, typer.Option("--providers", help="Instead, compare the detector by each provider there is with the CPU.")
    ] = False,
    training: Annotated[
        Path | None, typer.Option(help="Instead, or besides, compare a training step of this plan on CPU and CUDA.")
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the result as JSON; - prints it.")
    ] = None,
) -> None:
    """Time every stage on a source, and the monitor's own work at 1080p with ten tracks.

    With --providers or --training: do other backends say what the CPU says, and how fast? Leaves with 1 where one
    differs by more than a thousandth.
    """
    from standoff.config import load_settings

    settings = load_settings(config, {"model": model} if model else {})
    if providers or training is not None:
        from standoff.cli.backends import FRAMES, compare_backends

        count = frames or FRAMES
        compare_backends(source, settings, providers=providers, training=training, frames=count, json=json_file)
        return
    if source is None:
        raise ConfigError(
            expected="a video file or a folder of pictures", found="none", fix="name one, or give --providers"
        )
    _time_stages(source, settings, frames or _FRAMES, darknet, json_file)


def _time_stages(source: Path, settings: Settings, frames: int, darknet: str | None, json_file: Path | None) -> None:
    from standoff.cli.console import print_table, write_json
    from standoff.evaluation.bench import OWN_WORK_LIMIT_MS, bench_source

    report = bench_source(source, settings, frames=frames, darknet=_two_files(darknet))
    if json_file is not None:
        write_json(report.to_dict(), json_file)
    if str(json_file) == "-":
        return
    machine = report.machine
    where = f"{machine['processor']}, {machine['cores']} cores"
    runs = {f"stages on {source.name}": report.stages}
    runs |= {f"made-up site, 1080p, ten tracks, {kind} ground": times for kind, times in report.workload.items()}
    for title, times in runs.items():
        rows = [_row(stage, spread) for stage, spread in times.by_stage().items()]
        rows += [_row("the monitor's own work", times.own_work()), _row("all", times.total())]
        print_table(f"{title} ({where}), ms a frame", ("stage", "median", "10 %", "90 %", "frames"), rows)
    whole = report.whole
    typer.echo(
        f"All of it, outputs included, side by side: {whole.frames_per_s:.1f} frames a second; "
        f"{whole.bound_frames_per_s:.1f} if no core ever waited ({whole.processor_s / whole.frames * 1e3:.0f} ms of "
        f"processor time a frame, {whole.cores} cores)."
    )
    rows = [
        (baseline.name, baseline.ours, f"{baseline.ours_ms.median_ms:.2f}", baseline.theirs,
         f"{baseline.theirs_ms.median_ms:.2f}", f"{baseline.ratio:.1f}")
        for baseline in report.baselines
    ]  # fmt: skip
    columns = ("work", "standoff", "ms", "baseline", "ms", "times faster")
    print_table(
        "Baselines in the same run, medians", columns, rows, f"Own work should stay under {OWN_WORK_LIMIT_MS:g} ms."
    )


def _row(stage: str, spread: Spread) -> tuple[str, ...]:
    return stage, f"{spread.median_ms:.3f}", f"{spread.p10_ms:.3f}", f"{spread.p90_ms:.3f}", str(spread.samples)


def _two_files(text: str | None) -> tuple[Path, Path] | None:
    if text is None:
        return None
    cfg, comma, weights = text.partition(",")
    if not (comma and cfg and weights):
        raise ConfigError(expected="--darknet CFG,WEIGHTS", found=repr(text), fix="give both files with a comma")
    return Path(cfg), Path(weights)
