"""What people see of a training while it runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress

    from standoff.training.run.train import Listener


def show_run(bar: Progress, steps: int, scenario: str = "") -> Listener:
    """Show a run as the only task of a bar: its steps and loss; validations and messages above it.

    Args:
        bar: Of `standoff.cli.console.progress_bar`, counting steps.
        steps: Of the run.
        scenario: Name that is said with each line; empty where there is only one run.
    """
    from standoff.training.run.train import Listener

    what, before = (scenario, f"{scenario}: ") if scenario else ("training", "")
    for done in bar.task_ids:
        bar.remove_task(done)
    task = bar.add_task(what, total=steps, rate=0.0)

    def on_message(line: str) -> None:
        bar.console.print(f"{before}{line}", highlight=False, soft_wrap=True, markup=False)

    def on_step(step: int, loss: float, rate: float) -> None:
        bar.update(task, completed=step, description=f"{what}, loss {loss:.2f}", rate=rate)

    def on_row(row: dict[str, Any]) -> None:
        figures = f"mAP {100 * row['map']:.2f} %, average IoU {100 * row['average_iou']:.2f} %"
        on_message(f"step {row['step']}: loss {row['loss_total']:.2f}, {figures}")

    return Listener(on_message, on_step, on_row)
