"""How true the stated errors are over many clips without pictures, each with a view, a cast and errors of its own.

python examples/pooled_errors/pool_clips.py [--seeds 30] [--first 1001] [--frames 15] [--preset NAME ...] [--json FILE]

Of every preset in which somebody works there are as many clips; `noisy_runs.py` says what is drawn and what is
measured. The tables are those of `standoff evaluate coverage`, their intervals from a bootstrap over clips.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

from noisy_runs import samples_of

from standoff.cli.console import print_tables, progress, write_json
from standoff.cli.coverage_tables import coverage_tables
from standoff.evaluation.coverage import score_samples
from standoff_sim.clip.presets import PRESETS

WITH_WORK = tuple(name for name in PRESETS if name != "board")


def main() -> None:
    """Make the clips, run them, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=30, help="of each preset")
    parser.add_argument("--first", type=int, default=1001, help="seed")
    parser.add_argument("--frames", type=int, default=15, help="of each clip, five a second")
    parser.add_argument("--preset", action="append", choices=WITH_WORK)
    parser.add_argument("--json", type=Path, help="file for all figures")
    args = parser.parse_args()
    seeds = range(args.first, args.first + args.seeds)
    clips = [(preset, seed) for seed in seeds for preset in args.preset or WITH_WORK]
    samples = []
    with progress("clips", len(clips), unit="clips") as on_clip:
        for preset, seed in clips:
            with TemporaryDirectory() as folder:
                samples.append(samples_of(preset, seed, Path(folder), frames=args.frames))
            on_clip()
    result = score_samples(samples)
    print_tables(coverage_tables(result), as_markdown=False)
    if args.json is not None:
        write_json(result.to_dict(), args.json)


if __name__ == "__main__":
    main()
