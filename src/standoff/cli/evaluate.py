"""`standoff evaluate ...`: the paper's tests and the accuracy of a run, as tables, figures and JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from standoff.cli import evaluate_coverage, evaluate_detection, evaluate_paper, evaluate_run, evaluate_watched
from standoff.cli.calibrate import pattern_size
from standoff.cli.numbers import frame_range

app = typer.Typer(help="Measure accuracy on data with known truth.", no_args_is_help=True)
app.command("paper")(evaluate_paper.paper)
app.command("detection")(evaluate_detection.detection)
app.command("run")(evaluate_run.evaluate_run)
app.command("coverage")(evaluate_coverage.coverage)
app.command("watched")(evaluate_watched.watched)
_Json = Annotated[Path | None, typer.Option("--json", help="Also write the result as JSON; - prints only that.")]


@app.command()
def checkerboard(
    pictures: Annotated[Path, typer.Argument(help="Folder of board photographs.", show_default=False)],
    pattern: Annotated[str, typer.Option(help="Inner corners, COLUMNSxROWS.")] = "9x6",
    square_mm: Annotated[float, typer.Option(min=0.001, help="Side of one square; mm.")] = 25.0,
    camera: Annotated[Path | None, typer.Option(help="Camera file: removes lens distortion first.")] = None,
    json_file: _Json = None,
    figure: Annotated[Path | None, typer.Option(help="Also draw the paper's Fig. 8 to this PNG or SVG.")] = None,
    full: Annotated[bool, typer.Option("--full", help="Print every distance (the paper's Tables 4 and 5).")] = False,
) -> None:
    """Repeat the paper's lab test: distances on a board before and after rectification."""
    from standoff.cli.console import print_table, write_json
    from standoff.evaluation.checkerboard import FIRST_CORNER, evaluate_checkerboard
    from standoff.evaluation.checkerboard_figure import checkerboard_figure
    from standoff.stages.ground import load_camera

    lens = load_camera(camera) if camera else None
    result = evaluate_checkerboard(pictures, pattern_size(pattern), square_mm / 1000.0, lens)
    if figure is not None:
        checkerboard_figure(result, figure)
    if json_file is not None:
        write_json(result.to_dict(), json_file)
    if str(json_file) == "-":
        return
    if full:
        for title, name in (("Table 4: before rectification", "before_m"), ("Table 5: after", "after_m")):
            rows = [
                (f"{truth * 1e3:.1f}", *(f"{getattr(view, name)[row] * 1e3:.1f}" for view in result.views))
                for row, truth in enumerate(result.truth_m)
            ]
            print_table(f"{title}, mm", ("truth", *(Path(view.name).stem for view in result.views)), rows)
    with_pose = lens is not None
    summary = [
        (view.name, f"{view.before_percent:.2f}", f"{view.after_percent:.2f}")
        + ((f"{view.after_pose_percent:.2f}",) if with_pose else ())
        for view in result.views
    ]
    overall = ("overall", f"{result.before_percent:.2f}", f"{result.after_percent:.2f}")
    summary.append(overall + ((f"{result.after_pose_percent:.2f}",) if with_pose else ()))
    summary += [(name, reason) for name, reason in result.views_failed.items()]
    columns = ("view", "before %", "after %") + (("with pose %",) if with_pose else ())
    caption = f"100 % - MAPE (Eq. 7). First corner: {FIRST_CORNER}. The paper, on its own board: 93.51 and 97.43."
    print_table("Accuracy of distances on a checkerboard", columns, summary, caption)


@app.command()
def positions(
    run_folder: Annotated[Path, typer.Argument(help="Output folder of `standoff run`.", show_default=False)],
    truth: Annotated[Path, typer.Option(help="CSV: frame,id,x,y,w,h,conf,X,Y,Z; frames from 1.", show_default=False)],
    frames: Annotated[str | None, typer.Option(help="Score these truth frames only, FIRST-LAST.")] = None,
    min_overlap: Annotated[
        float | None, typer.Option(min=0, max=1, help="Match by boxes of at least this IoU instead of on the ground.")
    ] = None,
    pairs_up_to: Annotated[
        float, typer.Option(min=0, help="Score pairs that are truly this close or closer; m.")
    ] = 15.0,
    json_file: _Json = None,
) -> None:
    """Compare a run's tracks and distances with truth: recall, position error, pair distance error."""
    from standoff.cli.console import print_table, write_json
    from standoff.evaluation.positions import NOTE, evaluate_positions

    result = evaluate_positions(
        run_folder, truth, frames=frame_range(frames), pairs_up_to_m=pairs_up_to, min_overlap=min_overlap
    )
    if json_file is not None:
        write_json(result.to_dict(), json_file)
    if str(json_file) != "-":
        figures = result.to_dict()
        rows = [
            (name, _figure(figures[name]), _figure(figures.get(f"observed_{name}")))
            for name in figures
            if not name.startswith("observed_")
        ]
        print_table("Positions and distances against truth", ("figure", "all tracks", "without coasting"), rows, NOTE)


@app.command()
def rectification(
    scenes: Annotated[int, typer.Option(min=1, help="Drawn quadrilaterals of each difficulty.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Of the drawings.")] = 0,
    json_file: _Json = None,
) -> None:
    """Find drawn quadrilaterals with known corners by every method: failures, corner errors, time."""
    from standoff.cli.console import print_table, write_json
    from standoff.evaluation.rectification import evaluate_rectification

    result = evaluate_rectification(scenes, seed)
    if json_file is not None:
        write_json(result.to_dict(), json_file)
    if str(json_file) == "-":
        return
    rows = [
        (score.method, score.difficulty, f"{score.failed_percent:.1f}", f"{score.wrong_percent:.1f}",
         f"{score.corner_rmse_px:.3f}", f"{score.error_per_sigma:.2f}", f"{score.median_ms:.2f}")
        for score in result.scores
    ]  # fmt: skip
    columns = ("method", "difficulty", "failed %", "of these wrong %", "corner rmse px", "error / sigma", "median ms")
    caption = f"RANSAC: {result.speed_up:.0f} times as fast as the same algorithm as a Python loop in this run."
    print_table(f"{scenes} drawn quadrilaterals of each difficulty", columns, rows, caption, texts=2)


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
