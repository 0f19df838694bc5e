"""How true the stated errors are over many clips without pictures, each with a view, a cast and errors of its own.

python examples/pooled_errors/pool_clips.py [--seeds 30] [--first 1001] [--frames 15] [--preset NAME ...]
    [--processes 2] [--json FILE]

Of every preset in which somebody works there are as many clips; `noisy_runs.py` says what is drawn and what is
measured. The tables are those of `standoff evaluate coverage`, their intervals from a bootstrap over clips, and what
`standoff evaluate paper` says of danger, warning, clear and unknown.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from noisy_runs import NoisyRun, run_noisily

from standoff.cli.answer_tables import print_answers
from standoff.cli.console import print_tables, progress, write_json
from standoff.cli.coverage_tables import coverage_tables
from standoff.evaluation.coverage import score_samples
from standoff.evaluation.paper.answers import FrameByFrame
from standoff_sim.clip.presets import PRESETS

WITH_WORK = tuple(name for name in PRESETS if name != "board")


def _run(clip: tuple[str, int], *, frames: int) -> NoisyRun:
    preset, seed = clip
    with TemporaryDirectory() as folder:
        return run_noisily(preset, seed, Path(folder), frames=frames)


def main() -> None:
    """Make the clips, run them, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=30, help="of each preset")
    parser.add_argument("--first", type=int, default=1001, help="seed")
    parser.add_argument("--frames", type=int, default=15, help="of each clip, five a second")
    parser.add_argument("--preset", action="append", choices=WITH_WORK)
    parser.add_argument("--processes", type=int, default=2, help="side by side")
    parser.add_argument("--json", type=Path, help="file for all figures")
    args = parser.parse_args()
    seeds = range(args.first, args.first + args.seeds)
    clips = [(preset, seed) for seed in seeds for preset in args.preset or WITH_WORK]
    runs: list[NoisyRun] = []
    with (
        ProcessPoolExecutor(args.processes, get_context("spawn")) as workers,
        progress("clips", len(clips), unit="clips") as on_clip,
    ):
        for run in workers.map(partial(_run, frames=args.frames), clips):
            runs.append(run)
            on_clip()
    result = score_samples([run.samples for run in runs])
    print_tables(coverage_tables(result), as_markdown=False)
    by_preset = [
        (name, FrameByFrame.together([run.answers for (one, _), run in zip(clips, runs, strict=True) if one == name]))
        for name in dict.fromkeys(preset for preset, _ in clips)
    ]
    print_answers(by_preset)
    if args.json is not None:
        answers = {name: one.to_dict() for name, one in by_preset}
        write_json(result.to_dict() | {"frame_by_frame": answers}, args.json)


if __name__ == "__main__":
    main()
