"""Run the program in the test's own process."""

from __future__ import annotations

from collections.abc import Callable

Call = Callable[..., tuple[int, str, str]]
"""Words in; exit code, standard output and standard error out."""
