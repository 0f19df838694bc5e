"""Checkpoints from which a run goes on as if nothing had happened."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path
from typing import Any

import torch

from standoff.core.errors import DataError, OutputError
from standoff.files.whole import partial_file

_KEPT = 2
"""The last good one must still be there when the newest was cut short."""
_DAMAGE = (OSError, EOFError, RuntimeError, ValueError, KeyError, pickle.UnpicklingError, zipfile.BadZipFile)


def save_checkpoint(folder: Path, step: int, state: dict[str, Any]) -> None:
    """Write `step-NNNNNNN.pt`, whole or not at all, and drop all but the newest two.

    Args:
        folder: Made if need be.
        step: Steps done.
        state: Tensors, numbers, texts, and lists and mappings of them.

    Raises:
        OutputError: It cannot be written; the older ones are still there.
    """
    path = folder / f"step-{step:07d}.pt"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with partial_file(path) as partial:
            torch.save(state, partial)
    # torch's own writer raises RuntimeError where the disk is full.
    except (OSError, RuntimeError) as error:
        raise OutputError(
            expected=f"to write the checkpoint {path}",
            found=str(error).splitlines()[0],
            fix="make room or give write permission, and go on with --resume",
        ) from error
    for older in sorted(folder.glob("step-*.pt"))[:-_KEPT]:
        older.unlink()


def load_checkpoint(folder: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Read the newest checkpoint that is whole.

    Args:
        folder: Of checkpoints.

    Returns:
        The state, and the names of newer files that could not be read.

    Raises:
        DataError: There is none.
    """
    damaged: list[str] = []
    for path in sorted(folder.glob("step-*.pt"), reverse=True):
        try:
            state = torch.load(path, map_location="cpu", weights_only=True)
        except _DAMAGE:
            damaged.append(path.name)
            continue
        return state, tuple(damaged)
    found = f"only damaged ones ({', '.join(damaged)})" if damaged else "none"
    fix = "delete the folder of the run, or choose another --out"
    raise DataError(expected=f"a checkpoint in {folder}", found=found, fix=fix)


def has_checkpoint(folder: Path) -> bool:
    """Tell whether there is anything to go on from, whole or damaged."""
    return any(folder.glob("step-*.pt"))
