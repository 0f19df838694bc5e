from __future__ import annotations

import inspect
import re

import pytest

from standoff.core import errors
from standoff.core.errors import StandoffError

_ALL = [kind for _, kind in inspect.getmembers(errors, inspect.isclass) if kind.__module__ == errors.__name__]


@pytest.mark.parametrize("kind", _ALL)
def test_every_error_is_one_line_with_what_was_expected_found_and_to_do(kind: type[StandoffError]) -> None:
    error = kind(expected="a video\n  file", found="a folder", fix="give a file")
    assert str(error) == "expected a video file, found a folder. Give a file."
    assert (error.found, error.fix) == ("a folder", "give a file")
    assert isinstance(error, StandoffError)


def test_the_tree_at_the_head_of_the_file_is_the_tree_in_the_file() -> None:
    lines = (errors.__doc__ or "").splitlines()
    drawn = {match[2]: len(match[1]) for line in lines if (match := re.match(r"([ │├└─]+)([A-Z]\w+)  ", line))}
    assert set(drawn) == {kind.__name__ for kind in _ALL}
    for kind in _ALL:
        depth = len(kind.__mro__) - len(StandoffError.__mro__)
        assert drawn[kind.__name__] == 4 * (depth + 1)
