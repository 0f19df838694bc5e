from __future__ import annotations

import sys
from types import ModuleType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.internal.conjecture import providers
from laws import EXAMPLES, FUZZ, examples

if settings.get_current_profile_name() == FUZZ:
    pytest.skip("the open search is random on purpose", allow_module_level=True)


def _tried(count: int) -> list[int]:
    tried: list[int] = []

    @examples(count)
    @given(st.integers(), st.lists(st.floats()))
    def law(number: int, numbers: list[float]) -> None:
        tried.append(number)

    law()
    return tried


def test_laws_are_tried_with_the_same_examples_every_time() -> None:
    first = _tried(40)
    assert first == _tried(40)
    assert len(first) == 40


def test_the_numbers_in_our_modules_do_not_change_the_examples(monkeypatch: pytest.MonkeyPatch) -> None:
    first = _tried(40)
    more = ModuleType("more")
    more.__file__ = __file__
    monkeypatch.setitem(sys.modules, "more", more)
    assert first == _tried(40)
    assert len(providers._get_local_constants()) == 0


def test_neither_the_clock_nor_an_earlier_run_decides() -> None:
    profile = settings()
    assert profile.derandomize
    assert profile.max_examples == EXAMPLES
    assert profile.deadline is None
    assert profile.database is None
