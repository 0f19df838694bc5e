"""`standoff quantize`: a float detector in, an int8 one out, unless it finds less."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from standoff.training.quantization.quantize import QuantizationReport


def quantize(
    model: Annotated[Path, typer.Argument(help="Float detector, ONNX.", show_default=False)],
    data: Annotated[Path, typer.Option(help="Labelled pictures: folder, COCO file or mixture.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="ONNX file to write.", show_default=False)],
    split: Annotated[Literal["train", "val", "test"], typer.Option(help="Pictures that decide.")] = "val",
    calibration: Annotated[int, typer.Option(min=1, help="Pictures that the ranges of numbers are taken from.")] = 200,
    method: Annotated[
        Literal["minmax", "entropy", "percentile"], typer.Option(help="How ranges are taken, at first.")
    ] = "minmax",
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")] = False,
) -> None:
    """Quantise a detector to int8; refused when mAP falls by more than 1 point or AP of a class by more than 2."""
    from functools import partial

    from standoff.cli.console import progress
    from standoff.labels import read_data
    from standoff.labels.problems import problem_lines
    from standoff.labels.site_classes import to_site_classes
    from standoff.training.required import require_packages

    require_packages("onnx", purpose="quantise a model")
    from standoff.training.quantization.quantize import QuantizationPlan, QuantizationRefused, quantize_model

    plan = QuantizationPlan(split=split, calibration_pictures=calibration, method=method)
    show = partial(progress, quiet=quiet or as_json, unit="steps")
    try:
        labelled = to_site_classes(read_data(data))
        for line in problem_lines(labelled.problems):
            typer.echo(line, err=True)
        report = quantize_model(model, labelled, out, plan, show)
    except QuantizationRefused as refused:
        if refused.report is not None:
            _tell(refused.report, as_json=as_json, quiet=quiet)
        raise
    _tell(report, as_json=as_json, quiet=quiet)
    if not as_json:
        typer.echo(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB): {report.best.recipe.summary}")


def _tell(report: QuantizationReport, *, as_json: bool, quiet: bool) -> None:
    from standoff.cli.console import print_table, write_json

    if as_json:
        write_json(report.to_dict(), Path("-"))
        return
    if quiet:
        return
    loss, sizes_mb, times_ms = report.best.loss, [size / 1e6 for size in report.size_bytes], report.median_ms
    rows = [("mAP", "", *_points(loss.before, loss.after), "")]
    rows += [
        (
            f"AP {one.name}" + ("" if one.counted else " (few: more is allowed)"),
            f"{one.truths}",
            *_points(one.before, one.after),
            " to ".join(_points(one.recall_before, one.recall_after)[:2]),
        )
        for one in loss.classes
    ]
    rows += [
        (
            f"ground points of {one.name}, box heights",
            "",
            f"{one.point_before:.3f}",
            f"{one.point_after:.3f}",
            f"{one.point_after - one.point_before:+.3f}",
            "",
        )
        for one in loss.classes
        if isfinite(one.point_before)
    ]
    rows += [("file, MB", "", *_parts(*sizes_mb), ""), ("median ms a picture", "", *_parts(*times_ms), "")]
    print_table(
        f"{report.model}: float and int8",
        ("", "truths", "float", "int8", "change", "recall*"),
        rows,
        f"{report.deciding_pictures} pictures compared, {report.calibration_pictures} calibrated.\n"
        "* at the score that suits the float model best, float to int8",
    )
    for path in report.unreadable:
        typer.echo(f"{path} cannot be decoded and was left out", err=True)
    for attempt in report.attempts:
        typer.echo(f"{attempt.recipe.summary}: {', '.join(attempt.loss.complaints) or 'accepted'}")


def _points(before: float, after: float) -> tuple[str, str, str]:
    return f"{100 * before:.1f}", f"{100 * after:.1f}", f"{100 * (after - before):+.1f}"


def _parts(before: float, after: float) -> tuple[str, str, str]:
    return f"{before:.2f}", f"{after:.2f}", f"{after / before - 1:+.0%}"
