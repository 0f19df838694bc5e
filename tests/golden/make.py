"""Make the golden files anew: what the shipped film gives, from detections that are recorded here.

    python tests/golden/make.py [--detect]

Only after a change that is meant to change what the monitor says, and with a word in the changelog. `--detect` records
the detections anew, too, with the shipped detector.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from importlib.resources import files
from pathlib import Path

from typer.testing import CliRunner

from standoff.cli.app import app

FILM = Path(str(files("standoff"))) / "demo"
GOLDEN = Path(__file__).parent / "film"
DETECTIONS = GOLDEN / "detections.parquet"
TABLES = ("tracks", "proximity", "frames")
HAZARDS = "hazards.jsonl"
EVERY = 2
"""Of the film's frames are replayed: all that happens in it, in half the time. Recorded are all of them."""


def run_film(out: Path, *options: str) -> None:
    """Run the film into a folder, with its reference object and default settings."""
    arguments = ["run", FILM / "video.mp4", "--config", FILM / "reference.yaml", "--out", out]
    given = [str(argument) for argument in arguments]
    done = CliRunner().invoke(app, [*given, "--quiet", *options], catch_exceptions=False)
    assert done.exit_code == 0, done.output


def replay_film(out: Path, *options: str) -> None:
    """Run the film from the recorded detections."""
    outputs = ",".join((*TABLES, "hazards"))
    run_film(out, "--detections", str(DETECTIONS), "--every", str(EVERY), "--outputs", outputs, *options)


def main() -> None:
    """Write the files."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        if "--detect" in sys.argv[1:]:
            run_film(out / "seen", "--outputs", "detections")
            shutil.copyfile(out / "seen" / DETECTIONS.name, DETECTIONS)
        replay_film(out / "replayed")
        for name in (*(f"{table}.parquet" for table in TABLES), HAZARDS):
            shutil.copyfile(out / "replayed" / name, GOLDEN / name)


if __name__ == "__main__":
    main()
