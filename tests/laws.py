"""How hard a law is tried: with the same examples everywhere, with more seeds, or in an open search (`make fuzz`)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

TEST = "test"
FUZZ = "fuzz"
EXAMPLES = 100
"""Of a law that does not say how many it is worth."""
FUZZ_TIMES = 30
"""As many examples in the open search."""


def register_profiles() -> None:
    """Make the fixed examples the default; `--hypothesis-profile fuzz` asks for the search."""
    # How long an example takes depends on the machine and on what else it does.
    patient = settings(deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow])
    settings.register_profile(TEST, patient, derandomize=True, database=None, max_examples=EXAMPLES)
    settings.register_profile(FUZZ, patient, max_examples=EXAMPLES * FUZZ_TIMES)
    settings.load_profile(TEST)


def forget_our_constants() -> None:
    """Keep hypothesis from trying the numbers that stand in the modules loaded so far.

    An edit anywhere, or another order of the tests, would change the examples of all laws.
    """
    pytest.MonkeyPatch().setattr(providers, "is_local_module_file", lambda path: False)


def examples(count: int) -> settings:
    """Return the settings of a law that is worth another number of examples than most."""
    return settings(max_examples=count * settings().max_examples // EXAMPLES)


def few(values: Iterable[Any], *, quick: int = 1) -> list[Any]:
    """Return the parameters of what is dear to try: the first ones each time, all in `make test-live`."""
    return [
        value if index < quick else pytest.param(*_arguments(value), marks=pytest.mark.live)
        for index, value in enumerate(values)
    ]


def _arguments(value: object) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)


def seeds(count: int, *, quick: int = 2) -> list[Any]:
    """Return the parameters of a law that is tried with several seeds, as `few`."""
    return few(range(count), quick=quick)
