"""`standoff evaluate run`: a finished run against the truth of the clip that it is of."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from standoff.cli.scoring_arguments import JsonFile


def evaluate_run(
    run: Annotated[Path, typer.Argument(help="Folder of a run of the whole clip.", show_default=False)],
    clip: Annotated[Path, typer.Argument(help="Folder that `standoff simulate` wrote.", show_default=False)],
    json_file: JsonFile = None,
) -> None:
    """Score what a run wrote: the ground map, who was found, distances, and whether it warned when it had to."""
    from standoff.cli.console import write_json
    from standoff.cli.demo_tables import print_score
    from standoff.clips import load_clip
    from standoff.evaluation.clip_run import score_run

    score = score_run(run, load_clip(clip))
    if json_file is not None:
        write_json(score.to_dict(), json_file)
    if str(json_file) != "-":
        print_score(score)
