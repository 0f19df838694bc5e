"""What is wrong with labelled pictures, told to people; and which of them can be decoded at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from standoff.core.errors import DataError
from standoff.labels.pictures import load_picture
from standoff.labels.types import UNREADABLE, LabelledPicture, Problem

_NAMED: Final = 3
"""Files named of each kind of problem."""


def problem_lines(problems: Sequence[Problem]) -> list[str]:
    """Return a line for each kind of problem: how often, and the first few files.

    >>> from pathlib import Path
    >>> problem_lines([Problem(Path("a.txt"), "class id 9, of 7 classes", "unknown class id", skipped_picture=False)])
    ['1 times unknown class id: a.txt: class id 9, of 7 classes']
    """
    kinds: dict[str, list[Problem]] = {}
    for problem in problems:
        kinds.setdefault(problem.kind, []).append(problem)
    lines = []
    for kind, own in kinds.items():
        named = "; ".join(str(problem) for problem in own[:_NAMED])
        lines.append(f"{len(own)} times {kind}: {named}" + ("; ..." if len(own) > _NAMED else ""))
    return lines


def readable_pictures(
    pictures: Sequence[LabelledPicture], on_picture: Callable[[], None]
) -> tuple[tuple[LabelledPicture, ...], list[Problem]]:
    """Decode every picture once and tell which cannot be.

    Args:
        pictures: To try.
        on_picture: Called after each.

    Returns:
        Those that can be decoded, in their order, and a problem for each of the others.
    """
    readable, problems = [], []
    for picture in pictures:
        try:
            load_picture(picture)
        except DataError as error:
            problems.append(Problem(picture.path, error.found, UNREADABLE, skipped_picture=True))
        else:
            readable.append(picture)
        on_picture()
    return tuple(readable), problems
